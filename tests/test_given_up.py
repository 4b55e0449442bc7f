"""Limits that cannot all be kept: which give, by how little, and what is said of it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull
from gbt_ocp.guidance.target_limits import FieldOfView, RangeLimits
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.models.vehicles import PlanarPointMass
from gbt_ocp.ocp import DepthLimits, KeepOut, SpeedLimit, ThrustLimit, TrajectoryProblem, YawRateLimit
from gbt_ocp.ocp.check import LimitCheck
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.ocp.limit_classes import LimitClass, hard_weights, limit_class, limit_names
from gbt_ocp.tracking.protocol import Forecast

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
both_solvers = pytest.mark.parametrize("solver", ["ipopt", pytest.param("compiled", marks=needs_compiler)])
FALCON = FossenVehicle(FALCON_2D, (5000.0, 5000.0, 1500.0))
PERIOD, PIECES = 0.5, 4


def posed(vehicle=FALCON, *constraints, pieces=PIECES):
    d = vehicle.position_dimension
    problem = TrajectoryProblem(vehicle, pieces, PERIOD).maximize(BearingSimilarity(d)).maximize(RangePull(d))
    for constraint in (ThrustLimit(vehicle), *constraints):
        problem = problem.subject_to(constraint, nodes=2)
    return problem


def data(target, problem, spread=0.01):
    d, p = problem.vehicle.position_dimension, problem.pieces
    covariance = spread * np.eye(d)
    return {
        "forecast": Forecast(np.tile(target, (p, 1)), np.tile(covariance, (p, 1, 1))),
        "present": Forecast(np.asarray(target, dtype=float), covariance),
        "desired": np.tile(np.eye(d)[0], (p, 1)),
    }


def test_the_classes_follow_from_what_a_limit_depends_on_and_weigh_ten_times_as_much_each():
    problem = posed(FALCON, RangeLimits(2, nearest=3.0), SpeedLimit(2, 3.0), KeepOut((9.0, 9.0), 1.0))
    problem = problem.subject_to(KeepOut((-9.0, 9.0), 1.0)).subject_to_penalty(FieldOfView(2, 1.0))
    found = [limit_class(problem, constraint) for constraint in problem.constraints]
    certain, believed = LimitClass.CERTAIN, LimitClass.BELIEVED
    assert found == [LimitClass.THRUST, believed, certain, certain, certain, believed]
    assert hard_weights(problem) == [300.0, 3.0, 30.0, 30.0, 30.0]
    assert limit_names(problem) == ("thrust", "range", "speed", "keep_out", "keep_out 2", "bow_angle")
    cubic = replace(posed(), degree=3)  # where the acceleration is inherited thrust is still thrust
    assert limit_class(cubic, cubic.constraints[0]) == LimitClass.THRUST
    assert hard_weights(cubic) == [1.0], "alone, its weight is raised where needed"


@both_solvers
def test_what_is_broken_at_the_start_is_mended_as_fast_as_the_thrust_allows(solver):
    """Least sum of violations over the nodes, by a linear program for a double integrator along one axis."""
    vehicle = PlanarPointMass(1.0, 0.0, (1.0, 1.0))
    zone = Strip(1.0)
    problem = TrajectoryProblem(vehicle, 5, 1.0).maximize(BearingSimilarity(2))
    problem = problem.subject_to(ThrustLimit(vehicle), nodes=1).subject_to(zone, nodes=1)
    start = np.array([[-3.0, 0.0], [-0.5, 0.0]])  # inside the strip, and going further in
    plan = problem.compile(solver).solve(start, **data([0.0, 50.0], problem))
    assert (plan.status, plan.fallback) == ("given up", "")
    assert set(plan.given_up) == {"Strip"}
    assert plan.broken_at_start["Strip"] == pytest.approx(4.0)
    # unknowns: accelerations, then violations s_i >= 1 - x_i at the ends of the pieces
    reach = np.array([[max(i - j - 0.5, 0.0) for j in range(5)] for i in range(1, 6)])
    coasted = -3.0 - 0.5 * np.arange(1, 6)
    least = linprog(
        np.r_[np.zeros(5), np.ones(5)],
        A_ub=np.hstack([-reach, -np.eye(5)]),
        b_ub=coasted - 1.0,
        bounds=[(-1.0, 1.0)] * 5 + [(0.0, None)] * 5,
    )
    found = np.maximum(1.0 - plan.endpoints[:, 0], 0.0).sum()
    assert found == pytest.approx(least.fun, abs=2e-3)
    assert LimitCheck(problem).survey(plan.trajectory)[0].max() <= 1e-6, "thrust is never given up"


class Strip:
    """``x >= edge``."""

    upper, backoff, scale = np.full(1, np.inf), np.zeros(1), np.ones(1)

    def __init__(self, edge):
        self.lower = np.array([edge])

    def value(self, point):
        return point.z[0]


@both_solvers
def test_a_limit_on_the_target_gives_before_one_on_the_vehicle(solver):
    # the wanted distance is beyond the wall
    problem = posed(PlanarPointMass(1.0, 0.0, (4.0, 4.0)), Strip(-1.0), RangeLimits(2, nearest=3.0))
    plan = problem.compile(solver).solve(np.zeros((2, 2)), **data([1.0, 0.0], problem, 1e-4))
    assert plan.status == "given up"
    assert set(plan.given_up) == {"range"}
    assert set(plan.broken_at_start) == {"range"}
    assert plan.endpoints[:, 0].min() > -1.0 - 1e-3
    # the same two, both certain: the wall and a zone around the same place
    zone = posed(PlanarPointMass(1.0, 0.0, (4.0, 4.0)), Strip(-1.0), KeepOut((1.0, 0.0), 3.0))
    again = zone.compile(solver).solve(np.zeros((2, 2)), **data([1.0, 0.0], zone, 1e-4))
    assert again.answered
    assert "keep_out" in again.broken_at_start


@needs_compiler
@pytest.mark.parametrize("seed", range(4))
def test_both_solvers_give_up_the_same(seed):
    rng = np.random.default_rng(seed)
    problem = posed(FALCON, RangeLimits(2, nearest=4.0), SpeedLimit(2, 2.0), YawRateLimit(2, 0.7))
    state = np.array([[0.0, 0.0, rng.uniform(-3.0, 3.0)], [*rng.uniform(-2.0, 2.0, 2), rng.uniform(-1.0, 1.0)]])
    target = rng.uniform(-3.0, 3.0, 2)
    plans = [problem.compile(name).solve(state, **data(target, problem)) for name in ("compiled", "ipopt")]
    assert [plan.fallback for plan in plans] == ["", ""]
    assert [plan.answered for plan in plans] == [True, True]
    assert plans[0].broken_at_start == pytest.approx(plans[1].broken_at_start, abs=1e-9)
    assert "range" in plans[0].given_up
    costs = []
    for plan in plans:
        check = LimitCheck(problem)
        # at the nodes of the finished plans: the problem is not convex, but no plan may be far off
        nodes = check.survey(plan.trajectory, planner_limits(problem, target), nodes=True)
        costs.append(np.maximum(nodes[1:], 0.0).max(axis=1))
        assert nodes[0].max() <= 1e-6
    np.testing.assert_allclose(costs[0], costs[1], atol=0.05)


def planner_limits(problem, target):
    from gbt_ocp.ocp.binding import Binding

    return Binding(problem).limit_parameters(data(target, problem))


@needs_compiler
def test_only_the_limit_that_was_broken_between_nodes_is_tightened():
    """A centimetre of water, and thrust that bulges between the nodes: what is taken off is taken off thrust."""
    space = FossenVehicle(FALCON_3D, (5000.0, 5000.0, 5000.0, 1500.0))
    problem = TrajectoryProblem(space, 3, 0.5).maximize(BearingSimilarity(3)).maximize(RangePull(3))
    problem = problem.subject_to(ThrustLimit(space), nodes=1).subject_to(DepthLimits(-10.001, -9.999), nodes=2)
    tightened = 0
    planner = problem.compile("compiled")
    for seed in range(5):
        planner.reset()
        rng = np.random.default_rng(seed)
        state = np.array([[0.0, 0.0, -10.0, rng.uniform(-3, 3)], [*rng.uniform(-1, 1, 2), 0.0, rng.uniform(-1, 1)]])
        plan = planner.solve(state, **data([40.0, 30.0, -10.0], problem))
        assert (plan.status, plan.fallback) == ("solved", "")
        assert plan.piece_violation[0] <= 1e-6
        tightened += plan.tightened
    assert tightened > 0


@needs_compiler
@pytest.mark.parametrize("deadline", [10, 40])
def test_all_attempts_of_a_step_together_keep_the_deadline(deadline):
    problem = posed(FALCON, RangeLimits(2, nearest=4.0), SpeedLimit(2, 2.0))
    planner = problem.compile("compiled", {"deadline": deadline})
    rng = np.random.default_rng(0)
    fallbacks = set()
    for _ in range(60):
        state = rng.normal(size=(2, 3)) * [[3.0], [2.0]]
        plan = planner.solve(state, **data(rng.uniform(-6.0, 6.0, 2), problem))
        assert plan.iterations <= deadline
        assert np.all(np.isfinite(plan.trajectory.top))
        fallbacks.add(plan.fallback)
    assert fallbacks & {"shifted", "unfinished", "braking"} if deadline == 10 else "" in fallbacks
