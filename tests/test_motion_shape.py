"""The motion-shape process against finite differences, direct integration, samples, and brute force."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import multivariate_t

from gbt_ocp.models.bearings import rotate_bearing, tangent_basis, unit_bearing
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.tracking.shape.fit import LaplaceFit, Sightings, fit
from gbt_ocp.tracking.shape.moments import moments_ahead, moments_behind
from gbt_ocp.tracking.shape.motions import Motions, MotionShape
from gbt_ocp.tracking.shape.processes import ShapePrior, operators


def shape_of(dimension, span=24.0, knot=3.0, **keys):
    return MotionShape(dimension, ShapePrior(**keys), span=span, knot=knot)


def some_motions(shape, count=1, seed=0, size=0.5):
    rng = np.random.default_rng(seed)
    d = shape.dimension
    direction = unit_bearing(rng.standard_normal((count, d)), np.zeros(d))
    white = size * rng.standard_normal((count, shape.size))
    white[:, 1:d] = white[:, shape.heading_at] = 0.0
    theta = rng.integers(0, len(shape.grid), count)
    return Motions(theta, direction, rng.uniform(-3.0, 3.0, count), white)


@pytest.mark.parametrize("dimension", [2, 3])
def test_slopes_are_those_of_finite_differences(dimension):
    shape = shape_of(dimension)
    motions = some_motions(shape, 3)
    step = 1e-5
    for where, name in ((shape.past, "past"), (lambda m: shape.ahead(m, 10.0)[1], "ahead")):
        slopes = where(motions).slopes
        for one in range(shape.size):
            change = np.zeros((3, shape.size))
            change[:, one] = step
            there, back = (where(shape.moved(motions, sign * change)).positions for sign in (1.0, -1.0))
            assert slopes[..., one] == pytest.approx((there - back) / (2.0 * step), abs=2e-6), (name, one)


@pytest.mark.parametrize("dimension", [2, 3])
def test_slopes_by_the_future_are_those_of_finite_differences(dimension):
    shape = shape_of(dimension)
    motions = some_motions(shape)
    count = shape.coordinates_ahead(10.0)
    rng = np.random.default_rng(1)
    future = 0.3 * rng.standard_normal((1, count))
    slopes = shape.ahead(motions, 10.0, future)[1].slopes[..., shape.size :]
    assert slopes.shape[-1] == count
    for one in range(count):
        change = np.zeros((1, count))
        change[0, one] = 1e-5
        there, back = (shape.ahead(motions, 10.0, future + sign * change)[1].positions for sign in (1.0, -1.0))
        assert slopes[..., one] == pytest.approx((there - back) / 2e-5, abs=1e-6)


@pytest.mark.parametrize("dimension", [2, 3])
def test_positions_are_the_integral_of_the_motion(dimension):
    """The nodes against an adaptive integration of the same turn rate, log speed and climb angle."""
    shape = shape_of(dimension, knot=1.0)
    motions = some_motions(shape, seed=3)
    grid = shape.grid[int(motions.theta[0])]
    point = operators(shape.prior, 1.0, 2, 12, 0)
    turn, speed, climb = shape._turn, shape._speed, shape._climb
    z, theta = motions.white[0], int(motions.theta[0])
    nodes = point.nodes
    rate = point.rate[theta] @ z[turn]
    pace = np.exp(shape.prior.speed.log_std * z[shape.speed_at] + point.speed[theta] @ z[speed])
    angle = 0.0 * rate
    if dimension == 3:
        angle = shape.prior.climb_std * z[shape.climb_at] + point.climb[theta] @ z[climb]

    def motion(t, state):
        w, s, g = (np.interp(t, nodes[::-1], values[::-1]) for values in (rate, pace, angle))
        level = s * np.cos(g)
        return [w, level * np.cos(state[0]), level * np.sin(state[0]), s * np.sin(g)]

    out = np.exp(shape.log_range(motions))[0] * motions.direction[0]
    begin = [motions.heading[0], *out, *[0.0] * (3 - dimension)]
    found = solve_ivp(motion, (0.0, nodes[-1]), begin, t_eval=nodes, rtol=1e-9, atol=1e-9, max_step=0.25)
    assert grid.turn_std > 0.0
    assert shape.past(motions).positions[0] == pytest.approx(found.y[1 : 1 + dimension].T, abs=0.05)


def test_the_processes_have_their_covariances_and_the_change_of_speed_is_zero_now():
    prior = ShapePrior(turn_stds=(0.05,), turn_times=(10.0,), speed_stds=(0.2,), kernel="ou")
    past, ahead = operators(prior, 2.0, 1, 5, 0), operators(prior, 2.0, 1, 5, 3)
    lag = np.abs(past.nodes[:, None] - past.nodes[None, :])
    assert past.rate[0] @ past.rate[0].T == pytest.approx(0.05**2 * np.exp(-lag / 10.0), abs=1e-9)
    cross = past.rate[0] @ ahead.rate[0][:, : past.rate.shape[2]].T
    apart = np.abs(past.nodes[:, None] - ahead.nodes[None, :])
    assert cross == pytest.approx(0.05**2 * np.exp(-apart / 10.0), abs=1e-9)
    assert np.all(past.speed[0, 0] == 0.0)
    at_knots = past.nodes[::2]
    speed = past.speed[0, ::2] @ past.speed[0, ::2].T
    since = np.exp(-np.abs(at_knots) / 30.0)
    wanted = 0.04 * (np.exp(-np.abs(at_knots[:, None] - at_knots[None, :]) / 30.0) - np.outer(since, since))
    assert speed == pytest.approx(wanted, abs=1e-8)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_motion_told_from_a_later_now_is_the_same_motion(dimension):
    shape = shape_of(dimension)
    motions = some_motions(shape, 4, seed=5)
    own = np.arange(1.0, dimension + 1.0)
    later = shape.advanced(motions, 6.0, own)
    before, after = shape.past(motions).positions, shape.past(later).positions
    # what was now is two knots, four nodes, back; the far end of the window falls off
    assert after[:, 4:] + own == pytest.approx(before[:, :-4], abs=1e-6)
    times, ahead = shape.ahead(motions, 6.0)
    assert times[4] == pytest.approx(6.0)
    assert after[:, 0] + own == pytest.approx(ahead.positions[:, 4], abs=1e-9)


def test_a_motion_under_another_point_of_the_grid_is_the_same_motion():
    shape = shape_of(3)
    motions = some_motions(shape)
    told = shape.transferred(motions, np.arange(len(shape.grid)))
    one = shape.past(motions).positions[0]
    assert shape.past(told).positions == pytest.approx(np.broadcast_to(one, (len(shape.grid), *one.shape)), abs=1e-6)


def circled(dimension, sigma, seed=0, count=20, span=24.0):
    """Bearings from a circle of 30 m to a target that moves straight, relative to now."""
    rng = np.random.default_rng(seed)
    times = np.linspace(-span, 0.0, count)
    target = np.array([20.0, 5.0, 3.0])[:dimension] + np.outer(times, np.array([1.0, -0.2, 0.1])[:dimension])
    own = 30.0 * np.stack([np.cos(0.1 * times), np.sin(0.1 * times), 0.0 * times], axis=-1)[:, :dimension]
    own = own - own[-1]
    bearings = rotate_bearing(unit_bearing(target, own), sigma * rng.standard_normal((count, dimension - 1)))
    seen = Sightings(times, bearings, own, np.full((1, count), 1.0 / sigma), np.array([2.0 * count * np.log(sigma)]))
    return seen, target[-1]


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_mode_has_no_slope_and_its_precision_is_that_of_finite_differences(dimension):
    """Small noise: the neglected curvature of the residuals vanishes with them."""
    shape = shape_of(dimension, turn_stds=(0.03,), turn_times=(25.0,), speed_stds=(0.1,))
    seen, target = circled(dimension, 1e-4)
    velocity = np.array([[1.0, -0.2, 0.1]])[:, :dimension]
    start = shape.begin(np.zeros(1, dtype=np.intp), np.array([20.0]), seen.bearings[-1:], velocity)
    found = fit(shape, start, seen, 50)

    def objective(step):
        moved = shape.moved(found.motions, step[None])
        line = (shape.at(seen.times) @ shape.past(moved).positions)[0] - seen.own_positions
        unit = unit_bearing(line, np.zeros(dimension))
        tangent = np.einsum("nij,ni->nj", tangent_basis(unit), seen.bearings)
        # the flat coordinates are centred on the mode
        flat = [*range(1, dimension), shape.heading_at]
        white = moved.white[0].copy()
        white[flat] = step[flat]
        return 0.5 * (np.sum((tangent / 1e-4) ** 2) + white @ white)

    size = 1e-4
    identity = size * np.eye(shape.size)
    slope = np.array([objective(e) - objective(-e) for e in identity]) / (2.0 * size)
    precision = np.linalg.inv(found.covariance[0])
    deviations = np.sqrt(np.diag(found.covariance[0]))
    assert np.all(np.abs(slope * deviations) < 0.2)
    curvature = np.array([objective(e) - 2.0 * objective(0.0 * e) + objective(-e) for e in identity]) / size**2
    assert curvature == pytest.approx(np.diag(precision), rel=0.05)
    out = np.exp(shape.log_range(found.motions))[0] * found.motions.direction[0]
    assert out == pytest.approx(target, abs=0.3)


def test_evidence_and_moments_are_those_of_brute_force():
    """Importance sampling of the whole posterior, with weights from the exact density of the bearings."""
    prior = ShapePrior(
        speed=LogNormal(1.0, 0.5),
        range=LogNormal(25.0, 0.4),
        turn_stds=(0.03,),
        turn_times=(25.0,),
        speed_stds=(0.1,),
    )
    shape = MotionShape(2, prior, span=24.0, knot=12.0, steps=8)
    sigma = 0.03
    seen, _ = circled(2, sigma, count=8)
    start = shape.begin(np.zeros(1, dtype=np.intp), np.array([20.0]), seen.bearings[-1:], np.array([[1.0, -0.2]]))
    found = fit(shape, start, seen, 50)

    rng = np.random.default_rng(2)
    draws = 40_000
    # a proposal with heavier tails than the Gaussian about the mode
    factor = np.linalg.cholesky(found.covariance[0])
    freedom = 8.0
    normal = rng.standard_normal((draws, shape.size))
    heavy = normal * np.sqrt(freedom / rng.chisquare(freedom, draws))[:, None]
    step = heavy @ factor.T
    count = shape.size
    log_proposal = multivariate_t(np.zeros(count), np.eye(count), df=freedom).logpdf(heavy) - np.sum(
        np.log(np.diag(factor))
    )
    flat = [1, shape.heading_at]
    white = found.motions.white + step
    white[:, flat] = step[:, flat]
    log_prior = -0.5 * (np.sum(white**2, axis=1) + count * np.log(2.0 * np.pi))
    many = Motions(
        np.zeros(draws, dtype=np.intp),
        np.tile(found.motions.direction, (draws, 1)),
        np.tile(found.motions.heading, draws),
        np.tile(found.motions.white, (draws, 1)),
    )
    moved = shape.moved(many, step)
    positions = np.concatenate([shape.past(moved[part]).positions for part in np.array_split(np.arange(draws), 20)])
    line = shape.at(seen.times) @ positions - seen.own_positions
    angle = np.arctan2(
        line[..., 0] * seen.bearings[:, 1] - line[..., 1] * seen.bearings[:, 0], np.sum(line * seen.bearings, axis=2)
    )
    log_likelihood = -0.5 * np.sum((angle / sigma) ** 2 + np.log(2.0 * np.pi * sigma**2), axis=1)
    log_weight = log_likelihood + log_prior - log_proposal
    largest = log_weight.max()
    weight = np.exp(log_weight - largest)
    assert weight.sum() ** 2 / np.sum(weight**2) > 300  # enough draws count
    evidence = largest + np.log(weight.mean())
    assert found.log_evidence[0] == pytest.approx(evidence, abs=0.25)

    share = weight / weight.sum()
    mean = np.einsum("s,sgi->gi", share, positions)
    offset = positions - mean
    covariance = np.einsum("s,sgi,sgj->gij", share, offset, offset)
    moments = moments_behind(shape, found, np.ones(1))
    # of the latest quarter, which forecasts rest on; farther back the Gaussian about the mode is too wide
    recent = slice(0, 5)
    deviation = np.sqrt(np.trace(covariance[recent], axis1=1, axis2=2))
    assert np.all(np.linalg.norm(moments.mean - mean, axis=1)[recent] < 0.4 * deviation)
    assert np.sqrt(np.trace(moments.covariance[recent], axis1=1, axis2=2)) == pytest.approx(deviation, rel=0.25)


@pytest.mark.parametrize("dimension", [2, 3])
def test_moments_are_those_of_samples(dimension):
    """Draws from the Gaussian in the coordinates, pushed through the motion."""
    shape = shape_of(dimension)
    rng = np.random.default_rng(7)
    motions = some_motions(shape, 1, seed=8, size=0.2)
    n, d = shape.size, dimension
    root = 0.05 * np.tril(rng.standard_normal((n, n)))
    root[1:d] *= 0.05
    root[0, 0] = 0.1
    found = LaplaceFit(
        motions, (root @ root.T)[None], np.zeros(1), np.zeros((1, 0, 1)), np.zeros((1, 0, 1)), np.zeros((1, 0)), 0
    )
    moments = moments_ahead(shape, found, np.ones(1), 10.0)
    draws = 40_000
    many = Motions(
        np.repeat(motions.theta, draws),
        np.tile(motions.direction, (draws, 1)),
        np.repeat(motions.heading, draws),
        np.tile(motions.white, (draws, 1)),
    )
    moved = shape.moved(many, rng.standard_normal((draws, n)) @ root.T)
    future = rng.standard_normal((draws, shape.coordinates_ahead(10.0)))
    positions = np.concatenate(
        [shape.ahead(moved[part], 10.0, future[part])[1].positions for part in np.array_split(np.arange(draws), 20)]
    )
    mean = positions.mean(axis=0)
    deviation = positions.std(axis=0)
    assert np.all(np.abs(moments.mean - mean) < 0.1 * np.linalg.norm(deviation, axis=1)[:, None])
    assert np.sqrt(np.diagonal(moments.covariance, axis1=1, axis2=2)) == pytest.approx(deviation, rel=0.06, abs=0.05)


def test_wrong_shapes_are_refused():
    with pytest.raises(ValueError, match="dimension: found 4"):
        shape_of(4)
    with pytest.raises(ValueError, match="knot: found"):
        shape_of(2, span=1.0)
    with pytest.raises(ValueError, match="allowed: numbers > 0"):
        ShapePrior(turn_stds=())
    with pytest.raises(ValueError, match="median and log_std"):
        LogNormal(1.0, 0.0)
