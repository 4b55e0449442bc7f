"""Pieces that join with fewer continuous derivatives than the paper's, and have more freedom for it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import PPoly
from scipy.optimize import minimize
from test_compiled_solver import fossen
from test_compiled_solver import instance as drawn

from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.ocp.braking import BrakingPlanner
from gbt_ocp.ocp.check import LimitCheck
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.ocp.export.folder import write_c
from gbt_ocp.ocp.export.verification import verify_folder
from gbt_ocp.ocp.solvers.compiled import CompiledSolver
from gbt_ocp.ocp.solvers.ipopt import IpoptSolver
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.ocp.transcription import input_scale
from gbt_ocp.simulation.loop import simulate
from gbt_ocp.studies.limits.exchange import ExchangeIpoptSolver

PERIOD, PIECES = 0.1, 4
needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


def posed(dimension=2, degree=4, continuity=1, nodes=8, form="hard"):
    return fossen(dimension, form, PIECES, nodes, degree, continuity)


def instance(problem, seed):
    return drawn(problem, seed, 2.0 * np.pi)


def solved(kind, problem, seed, guess=None):
    """Objective and trajectory from a guess, from coasting if there is none."""
    start, parameters = instance(problem, seed)
    cold = guess is None
    first = np.zeros((problem.pieces, problem.freedoms)) if cold else guess
    found = kind(problem, {}).solve(start, parameters, first, cold=cold, tightening=0.0)
    assert found.solved
    trajectory = FlatTrajectory(PERIOD, start, found.variables * input_scale(problem))
    return value_of(problem, trajectory, parameters), trajectory


def value_of(problem, trajectory, parameters):
    return problem.compile("ipopt").objective(trajectory, parameters)


@pytest.mark.parametrize(("degree", "continuity"), [(3, 1), (4, 1), (4, 2), (5, 2)])
def test_continuous_as_far_as_it_says_and_no_further(degree, continuity):
    rng = np.random.default_rng(0)
    free = rng.standard_normal((PIECES, (degree - continuity) * 3))
    plan = FlatTrajectory(PERIOD, rng.standard_normal((continuity + 1, 3)), free)
    assert plan.degree == degree
    reference = PPoly(np.swapaxes(plan.coefficients, 0, 1)[::-1], PERIOD * np.arange(PIECES + 1))
    times = rng.uniform(0.0, PIECES * PERIOD, 40)
    for order in range(degree + 1):
        np.testing.assert_allclose(plan(times, order), reference(times, nu=order), atol=1e-9)
        # one and the same boundary from both sides, by the polynomials of either piece
        before = [np.polyval(reference.derivative(order).c[:, i], PERIOD) for i in range(PIECES - 1)]
        after = [reference.derivative(order).c[-1, i + 1] for i in range(PIECES - 1)]
        if order <= continuity:
            np.testing.assert_allclose(before, after, atol=1e-10)
        else:
            assert np.abs(np.subtract(before, after)).min() > 1e-4
    for order, point in enumerate(plan.sample(5)):
        np.testing.assert_allclose(point[2, 1:4], plan(2 * PERIOD + PERIOD * np.array([0.25, 0.5, 0.75]), order))


def test_a_segment_and_the_rest_are_the_same_motion():
    rng = np.random.default_rng(1)
    plan = FlatTrajectory(PERIOD, rng.standard_normal((2, 3)), rng.standard_normal((PIECES, 9)))
    part, rest = plan.segment(0.23, 0.05), plan.shifted()
    s = np.linspace(0.0, 0.05, 6)[:-1]
    for order in range(5):
        np.testing.assert_allclose(part(s, order), plan(0.23 + s, order), atol=1e-10)
        np.testing.assert_allclose(rest(s + 0.02, order), plan(s + PERIOD + 0.02, order), atol=1e-10)
    np.testing.assert_array_equal(rest.top[-1], 0.0)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.long
def test_more_freedom_reaches_more(dimension, seed):
    # every parabola is a polynomial of degree 4 too, so its optimum cannot be less; from coasting both find a local one
    least, _ = solved(IpoptSolver, posed(dimension, 2, None), seed)
    most, plan = solved(IpoptSolver, posed(dimension), seed)
    assert most > least + 1e-3
    assert LimitCheck(posed(dimension))(plan).max() <= 0.0


@needs_compiler
@pytest.mark.parametrize(
    ("form", "dimension", "degree", "continuity"),
    [
        ("hard", 2, 4, 1),
        ("penalty", 3, 3, 1),
        pytest.param("penalty", 2, 4, 1, marks=pytest.mark.slow),
        pytest.param("hard", 3, 3, 1, marks=pytest.mark.slow),
        pytest.param("hard", 2, 4, 2, marks=pytest.mark.slow),
        pytest.param("penalty", 2, 4, 2, marks=pytest.mark.slow),
    ],
)
@pytest.mark.long
def test_both_solvers_reach_the_same(form, dimension, degree, continuity):
    problem = posed(dimension, degree, continuity, 6, form)
    for seed in range(3):
        # from coasting either may end in another local optimum
        _, anywhere = solved(CompiledSolver, problem, seed)
        guess = anywhere.top / input_scale(problem)
        reference, _ = solved(IpoptSolver, problem, seed, guess)
        found, _ = solved(CompiledSolver, problem, seed, guess)
        assert found == pytest.approx(reference, abs=2e-3)


def test_without_limits_it_is_the_optimum_of_a_general_minimiser():
    problem = replace(posed(2, 3, 1), hard=())
    start, parameters = instance(problem, 5)
    reached, plan = solved(IpoptSolver, problem, 5)

    def cost(u):
        top = u.reshape(plan.top.shape) * input_scale(problem)
        return -value_of(problem, FlatTrajectory(PERIOD, start, top), parameters)

    u = (plan.top / input_scale(problem)).ravel()
    assert cost(u + 0.3) > -reached
    assert minimize(cost, u, method="BFGS", options={"maxiter": 10}).fun > -reached - 1e-6


@pytest.mark.long
def test_nodes_are_added_where_the_free_pieces_break_a_limit():
    problem = posed(2, 4, 1, 2)
    broken = 0
    for seed in range(4):
        start, parameters = instance(problem, seed)
        guess = np.zeros((problem.pieces, problem.freedoms))
        alone = IpoptSolver(problem, {}).solve(start, parameters, guess, cold=True, tightening=0.0)
        found = ExchangeIpoptSolver(problem, nodes=24).solve(start, parameters, guess, cold=True)
        after = FlatTrajectory(PERIOD, start, found.variables * input_scale(problem))
        before = FlatTrajectory(PERIOD, start, alone.variables * input_scale(problem))
        broken += LimitCheck(problem)(before).max() > 1e-3
        assert found.solved
        assert LimitCheck(problem)(after).max() <= 0.0
    assert broken > 0


def test_the_last_resort_brakes_within_the_limits():
    problem = posed()
    start = np.array([[0.0, 0.0, 0.3], [1.0, -0.5, 0.5]])
    plan = BrakingPlanner(problem)(start)
    assert plan.top.shape == (PIECES, problem.freedoms)
    assert LimitCheck(problem)(plan).max() <= 0.0
    assert np.linalg.norm(plan.knots[-1, 1]) < 0.2 * np.linalg.norm(start[1])


@needs_compiler
@pytest.mark.parametrize("dimension", [pytest.param(2, marks=pytest.mark.slow), 3])
@pytest.mark.long
def test_a_generated_planner_repeats_pythons_plans(dimension, tmp_path):
    folder = write_c(posed(dimension).compile("compiled"), tmp_path / "planner")
    found = verify_folder(folder)
    assert found.faults == ()
    assert found.vectors > 5
    assert "| 4, 0.1 s, flat, degree 4, continuous up to derivative 1 |" in (folder / "README.md").read_text()


@pytest.mark.slow
@pytest.mark.parametrize("case", ["case2", "case5"])
def test_a_closed_loop_keeps_the_limits(case):
    solver = "compiled" if find_compiler() else "ipopt"
    overrides = ["planner.degree=4", "planner.continuity=1", "planner.nodes=8", "planner.formulation=hard"]
    loop, start = build_loop(load_config(case, overrides=[*overrides, f"planner.solver={solver}"], seed=1))
    arrays = simulate(loop, start, 4.0).arrays
    assert np.all(arrays["piece_thrust_peak"] <= 1.0)
    assert np.all(arrays["solver_status"] == "solved")
    assert arrays["error"][-1].mean() < 0.1


@pytest.mark.parametrize("continuity", [0, 2, 5])
def test_a_continuity_that_cannot_be_is_refused(continuity):
    with pytest.raises(
        ValueError, match=rf"continuity: found {continuity}; allowed: (a whole number >= 1|at most degree - 1 = 1)"
    ):
        posed(2, 2, continuity)
