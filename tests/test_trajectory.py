import casadi as ca
import numpy as np
import pytest
from scipy.interpolate import BPoly, PPoly

from gbt_ocp.ocp.trajectory import FlatTrajectory, propagate

PERIOD = 0.3


def trajectory(degree, pieces=4, outputs=3, seed=0):
    rng = np.random.default_rng(seed)
    return FlatTrajectory(PERIOD, rng.standard_normal((degree, outputs)), rng.standard_normal((pieces, outputs)))


def as_scipy(plan):
    """The same trajectory built by scipy from nothing but the knots' coefficients."""
    coefficients = np.swapaxes(plan.coefficients, 0, 1)[::-1]
    return PPoly(coefficients, PERIOD * np.arange(plan.pieces + 1))


every_degree = pytest.mark.parametrize("degree", [2, 3, 4])


@every_degree
def test_value_and_derivatives_are_those_of_scipys_piecewise_polynomial(degree):
    plan, times = trajectory(degree), np.random.default_rng(1).uniform(0.0, 1.2, 50)
    for order in range(degree + 1):
        np.testing.assert_allclose(plan(times, order), as_scipy(plan)(times, nu=order), atol=1e-9)
    for time in (-0.1, *times[:5], 1.3):
        exact = [as_scipy(plan)(time, nu=order) for order in range(3)]
        np.testing.assert_allclose(plan.point(time), exact, atol=1e-9)
    assert plan(times).shape == (50, 3)
    assert plan(0.4).shape == (3,)
    assert (plan.degree, plan.pieces, plan.duration) == (degree, 4, pytest.approx(1.2))


@every_degree
def test_starts_where_it_should(degree):
    plan = trajectory(degree)
    for order in range(degree):
        np.testing.assert_allclose(plan(0.0, order), plan.start[order], atol=1e-14)


@every_degree
def test_continuous_to_one_order_below_its_degree_and_no_further(degree):
    plan = trajectory(degree)
    step = 1e-4
    for boundary in PERIOD * np.arange(1, plan.pieces):
        for order in range(degree):
            # Either side of the boundary, each extrapolated to it: what is left is of second order in the step.
            before, after = (plan(boundary + h, order) - h * plan(boundary + h, order + 1) for h in (-step, step))
            np.testing.assert_allclose(before, after, atol=1e3 * step**2)
        jump = plan(boundary + step, degree) - plan(boundary - step, degree)
        assert np.abs(jump).min() > 1e-3


@every_degree
def test_endpoints_and_top_derivatives_are_the_same_unknowns(degree):
    plan = trajectory(degree)
    again = FlatTrajectory.from_endpoints(PERIOD, plan.start, plan.endpoints)
    np.testing.assert_allclose(again.top, plan.top, atol=1e-8)
    np.testing.assert_allclose(plan.endpoints, plan(PERIOD * np.arange(1, 5)), atol=1e-12)


def test_degree_2_is_scipys_piece_through_value_and_slope_and_end():
    plan, s = trajectory(2), np.linspace(0.0, PERIOD, 7)[:-1]
    for i in range(plan.pieces):
        piece = BPoly.from_derivatives([0.0, PERIOD], [plan.knots[i], plan.endpoints[i][None]])
        np.testing.assert_allclose(plan(i * PERIOD + s), piece(s), atol=1e-10)


@every_degree
def test_samples_are_the_trajectory_with_both_sides_of_each_boundary(degree):
    plan = trajectory(degree)
    point = plan.sample(5)
    s = np.linspace(0.0, PERIOD, 5)
    for i in range(plan.pieces):
        for order, values in enumerate(point):
            assert values.shape == (4, 5, 3)
            np.testing.assert_allclose(values[i, :-1], plan(i * PERIOD + s[:-1], order), atol=1e-10)
    if degree == 2:
        np.testing.assert_allclose(point.ddz[:, -1], plan.top)
        np.testing.assert_allclose(point.ddz[:, 0], plan.top)


@every_degree
def test_shifted_is_the_rest(degree):
    plan = trajectory(degree)
    rest, times = plan.shifted(), np.linspace(0.0, 3 * PERIOD - 1e-6, 40)
    assert rest.pieces == plan.pieces
    for order in range(degree + 1):
        np.testing.assert_allclose(rest(times, order), plan(times + PERIOD, order), atol=1e-9)
    np.testing.assert_array_equal(rest.top[-1], 0.0)


def test_the_later_piece_counts_at_a_boundary_however_it_was_rounded():
    plan = FlatTrajectory(0.1, np.zeros((2, 1)), np.arange(1.0, 31.0)[:, None])
    times = 0.1 * np.arange(30)
    np.testing.assert_array_equal(plan(times, 2)[:, 0], np.arange(1.0, 31.0))
    np.testing.assert_array_equal(plan(np.cumsum(np.full(29, 0.1)), 2)[:, 0], np.arange(2.0, 31.0))
    assert plan(3.0, 2)[0] == 30.0


@every_degree
def test_a_step_is_what_lies_between_two_times(degree):
    plan = trajectory(degree)
    for since, until in (
        (0.0, 0.02),
        (1.3 * PERIOD, 1.9 * PERIOD),
        (0.7 * PERIOD, 2.4 * PERIOD),
        (3.5 * PERIOD, 4.2 * PERIOD),
    ):
        gone = plan.step(since, until)
        for order in range(2):
            np.testing.assert_allclose(gone[order], plan(until, order) - plan(since, order), atol=1e-11)


def test_beyond_its_ends_the_outer_pieces_are_continued():
    plan = trajectory(3)
    for time, piece in ((-0.2, 0), (1.5, 3)):
        s = time - piece * PERIOD
        expected = sum(plan.coefficients[piece, k] * s**k for k in range(4))
        np.testing.assert_allclose(plan(time), expected, atol=1e-12)


def test_propagation_is_the_same_for_symbols_and_numbers():
    rng = np.random.default_rng(2)
    derivatives, top = list(rng.standard_normal((3, 2))), rng.standard_normal(2)
    symbols = [ca.SX.sym(f"d{i}", 2) for i in range(4)]
    function = ca.Function("step", symbols, propagate(symbols[:3], symbols[3:], 0.7))
    numbers = propagate(derivatives, [top], 0.7)
    for symbolic, number in zip(function(*derivatives, top), numbers, strict=True):
        np.testing.assert_allclose(np.asarray(symbolic).ravel(), number, atol=1e-13)
    np.testing.assert_array_equal(numbers[-1], top)
