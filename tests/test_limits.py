"""Limits on where the vehicle is, how it moves, and how it stands to the target: against geometry and chance."""

import casadi as ca
import numpy as np
import pytest
from scipy.stats import norm

from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull
from gbt_ocp.guidance.target_limits import FieldOfView, RangeLimits
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.ocp import (
    DepthLimits,
    FlatPoint,
    FlatTrajectory,
    KeepOutPolygon,
    SpeedLimit,
    ThrustLimit,
    TrajectoryProblem,
    YawRateLimit,
)
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.check import LimitCheck
from gbt_ocp.ocp.transcription import transcribe
from gbt_ocp.tracking.protocol import Forecast

FALCON = FossenVehicle(FALCON_2D, (5000.0, 5000.0, 1500.0))
SPACE = FossenVehicle(FALCON_3D, (5000.0, 5000.0, 5000.0, 1500.0))
SQUARE = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))


def at(position, velocity=None, yaw=0.0, yaw_rate=0.0):
    z = ca.DM([*position, yaw])
    dz = ca.DM([*(velocity if velocity is not None else [0.0] * len(position)), yaw_rate])
    return FlatPoint(z, dz, ca.DM.zeros(z.shape))


def numbers(expression):
    return np.asarray(ca.evalf(expression)).ravel()


def kept(limit, value):
    return bool(np.all(limit.lower <= value) and np.all(value <= limit.upper))


def true_distance(point):
    """Signed distance of a point to the square, positive outside."""
    outside = np.maximum(np.maximum(-point, point - 2.0), 0.0)
    return np.linalg.norm(outside) if outside.any() else -np.min(np.concatenate([point, 2.0 - point]))


@pytest.mark.parametrize("corners", [SQUARE, SQUARE[::-1]])
def test_no_point_inside_the_polygon_is_allowed_and_all_points_well_outside_are(corners):
    limit = KeepOutPolygon(corners, softness=0.05)
    rng = np.random.default_rng(0)
    for point in rng.uniform(-1.0, 3.0, (300, 2)):
        distance = true_distance(point)
        allowed = kept(limit, numbers(limit.value(at(point))))
        if distance <= 0.0:
            assert not allowed
        elif distance > 0.05 * np.log(4) * np.sqrt(2.0):
            assert allowed


@pytest.mark.parametrize(
    "corners",
    [
        SQUARE[:2],
        ((0.0, 0.0), (2.0, 0.0), (0.5, 0.5), (0.0, 2.0)),
        ((0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0)),
        tuple((np.cos(a), np.sin(a)) for a in 4.0 * np.pi / 5.0 * np.arange(5)),  # a star
        ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (1.0, 1.0)),
    ],
)
def test_a_polygon_that_is_not_strictly_convex_is_refused(corners):
    with pytest.raises(ValueError, match="corners: found"):
        KeepOutPolygon(corners)


def test_depth_speed_and_yaw_rate():
    depth = DepthLimits(-20.0, -2.0)
    assert [kept(depth, numbers(depth.value(at((0.0, 0.0, z))))) for z in (-21.0, -19.0, -2.5, -1.0)] == [0, 1, 1, 0]
    speed = SpeedLimit(2, 2.0)
    assert [kept(speed, numbers(speed.value(at((9.0, 9.0), (v, v))))) for v in (1.4, 1.42)] == [1, 0]
    yaw = YawRateLimit(2, 0.5)
    assert [kept(yaw, numbers(yaw.value(at((9.0, 9.0), yaw_rate=r)))) for r in (-0.51, -0.49, 0.49, 0.51)] == [
        0,
        1,
        1,
        0,
    ]
    with pytest.raises(ValueError, match="lowest: found -1"):
        DepthLimits(-1.0, -2.0)


def test_the_nearest_range_is_kept_with_the_stated_probability():
    """Monte Carlo: at the boundary of the limit the target is too near in 1 - confidence of all draws."""
    covariance = np.array([[2.0, 0.7], [0.7, 1.0]])
    mean = np.array([30.0, 10.0])
    limit = RangeLimits(2, nearest=20.0, confidence=0.9)
    direction = mean / np.linalg.norm(mean)
    near, far = 0.0, 40.0
    for _ in range(60):  # bisection for the own position on the line of sight at which the limit is just kept
        middle = 0.5 * (near + far)
        value = numbers(
            limit.value(at(mean - middle * direction), {"mean": ca.DM(mean), "covariance": ca.DM(covariance)})
        )
        near, far = (near, middle) if kept(limit, value) else (middle, far)
    own = mean - far * direction
    draws = np.random.default_rng(0).multivariate_normal(mean, covariance, 200_000)
    share = np.mean(np.linalg.norm(draws - own, axis=1) >= 20.0)
    # second order in spread over range: a little above the stated probability
    assert 0.9 - 0.003 < share < 0.92


def test_both_ranges_count_the_spread_along_the_line_of_sight_only():
    limit = RangeLimits(2, nearest=1.0, farthest=10.0, confidence=0.95)
    parameters = {"mean": ca.DM([5.0, 0.0]), "covariance": ca.DM([[0.25, 0.0], [0.0, 400.0]])}
    quantile = norm.ppf(0.95)
    np.testing.assert_allclose(
        numbers(limit.value(at((0.0, 0.0)), parameters)),
        [5.0 - 0.5 * quantile, (5.0 + 0.5 * quantile) / 10.0],
        rtol=1e-6,
    )
    np.testing.assert_array_equal(limit.lower, [1.0, -np.inf])
    np.testing.assert_array_equal(limit.upper, [np.inf, 1.0])


@pytest.mark.parametrize(("yaw", "inside"), [(0.0, True), (0.5, True), (0.55, False), (-0.55, False), (np.pi, False)])
def test_the_field_of_view_is_an_angle_from_the_bow(yaw, inside):
    limit = FieldOfView(2, np.deg2rad(30.0))
    assert kept(limit, numbers(limit.value(at((1.0, 1.0), yaw=yaw), {"mean": ca.DM([8.0, 1.0])}))) is inside


@pytest.mark.parametrize(
    "make",
    [
        lambda: RangeLimits(2),
        lambda: RangeLimits(2, nearest=3.0, farthest=2.0),
        lambda: RangeLimits(2, nearest=3.0, confidence=0.4),
        lambda: FieldOfView(2, 0.0),
    ],
)
def test_limits_that_mean_nothing_are_refused(make):
    with pytest.raises(ValueError, match=r"found .*; allowed:"):
        make()


def approaching(pieces):
    """A target that comes nearer, with a spread that grows, at the boundaries of the pieces."""
    knots = np.arange(pieces + 1)
    mean = np.stack([6.0 - 0.4 * knots, 0.3 * knots], axis=1)
    covariance = (0.01 + 0.02 * knots)[:, None, None] * np.eye(2)
    return Forecast(mean, covariance)


def solve(problem, solver, knots, state):
    ahead = Forecast(knots.mean[1:], knots.covariance[1:])
    present = Forecast(knots.mean[0], knots.covariance[0])
    desired = np.tile([1.0, 0.0], (problem.pieces, 1))
    return problem.compile(solver).solve(state, ahead, desired, present=present)


def posed(pieces=6, hard=True, vehicle=FALCON):
    limit = RangeLimits(2, nearest=4.0, confidence=0.95)
    problem = TrajectoryProblem(vehicle, pieces, 0.5).maximize(BearingSimilarity(2)).maximize(RangePull(2, 0.2, 2.0))
    problem = problem.subject_to(ThrustLimit(vehicle))
    if hard is None:
        return problem
    if hard:
        return problem.subject_to(limit, nodes=3)
    return problem.subject_to_penalty(limit, weight=100.0, width=0.01, nodes=3)


@pytest.mark.parametrize("hard", [True, False])
def test_ipopt_and_compiled_keep_the_distance_and_agree(hard):
    knots, state = approaching(6), np.zeros((2, 3))
    plans = [solve(posed(hard=hard), solver, knots, state) for solver in ("ipopt", "compiled")]
    assert [plan.status for plan in plans] == ["solved", "solved"]
    assert plans[1].objective == pytest.approx(plans[0].objective, abs=2e-3)
    for plan in plans:
        times = np.linspace(0.0, 3.0, 121)
        shares = times / 0.5
        mean = np.stack([np.interp(shares, np.arange(7), column) for column in knots.mean.T], axis=1)
        spread = np.sqrt(np.interp(shares, np.arange(7), knots.covariance[:, 0, 0]))
        clearance = np.linalg.norm(mean - plan(times)[:, :2], axis=1) - norm.ppf(0.95) * spread
        assert clearance.min() > (3.95 if hard else 3.9)  # between the nodes a little less
    free = solve(posed(hard=None), "compiled", knots, state)
    assert np.linalg.norm(knots.mean - np.vstack([state[:1], free.endpoints])[:, :2], axis=1).min() < 4.0


def test_the_checks_of_both_solvers_agree_and_see_the_distance():
    problem, knots = posed(), approaching(6)
    binding = Binding(problem)
    limits = binding.limit_parameters(
        {
            "forecast": Forecast(knots.mean[1:], knots.covariance[1:]),
            "present": Forecast(knots.mean[0], knots.covariance[0]),
        }
    )
    top = 0.5 * np.random.default_rng(1).normal(size=(6, 3))
    plan = FlatTrajectory(0.5, np.zeros((2, 3)), top)
    slow = LimitCheck(problem)(plan, limits)
    np.testing.assert_allclose(problem.compile("compiled").solver.check(plan, limits), slow, rtol=1e-9, atol=1e-12)
    at_end = np.linalg.norm(knots.mean[6] - plan.endpoints[5, :2]) - norm.ppf(0.95) * np.sqrt(knots.covariance[6, 0, 0])
    assert slow[5] >= (4.0 - at_end) / 4.0 - 1e-6
    # a braking plan is checked piece by piece, each against its own part of the forecast
    part = FlatTrajectory(0.5, plan.knots[4], top[4:5])
    np.testing.assert_allclose(LimitCheck(problem)(part, [values[:, 4:] for values in limits]), slow[4:5], rtol=1e-9)


def test_a_penalty_on_what_is_only_believed_is_never_a_reason_to_refuse_a_plan():
    hard, soft = posed(hard=True), posed(hard=False)
    assert hard.judged == (True, True)
    assert soft.judged == (True, False)
    knots = Forecast(np.tile([1.0, 0.2], (7, 1)), np.tile(0.01 * np.eye(2), (7, 1, 1)))  # much too near already
    plan = solve(soft, "compiled", knots, np.zeros((2, 3)))
    assert plan.status == "solved"
    assert plan.fallback == ""
    assert plan.violation < 0.1, "of the thrust, between nodes: the range, broken by 0.8 of it, does not count"
    assert np.linalg.norm(plan.endpoints[-1, :2] - [1.0, 0.2]) > 2.0
    plan = solve(hard, "compiled", knots, np.zeros((2, 3)))
    assert (plan.status, plan.fallback) == ("given up", "")
    assert set(plan.given_up) == set(plan.broken_at_start) == {"range"}
    assert not plan.solved
    assert plan.answered


def test_derivatives_of_a_moving_limit_are_those_of_the_program():
    """CasADi's own finite differences of the program with respect to u, at a random point."""
    problem = posed(pieces=2)
    program = transcribe(problem)
    jacobian = ca.Function(
        "j", [program.variables, program.parameters], [ca.jacobian(program.limits, program.variables)]
    )
    limits = ca.Function("g", [program.variables, program.parameters], [program.limits])
    rng = np.random.default_rng(2)
    u, p = rng.normal(size=program.variables.numel()), rng.normal(size=program.parameters.numel())
    covariance = np.eye(2).ravel()
    p[-6 * 3 :] = np.concatenate([np.concatenate([rng.normal(size=2) * 5.0, covariance]) for _ in range(3)])
    found = np.asarray(jacobian(u, p))
    for column in range(len(u)):
        step = 1e-6 * np.eye(len(u))[column]
        difference = (np.asarray(limits(u + step, p)) - np.asarray(limits(u - step, p))).ravel() / 2e-6
        np.testing.assert_allclose(found[:, column], difference, rtol=1e-5, atol=1e-6)


def test_the_present_spread_may_stand_for_that_of_the_forecast():
    ahead = Forecast(np.tile([9.0, 0.0], (4, 1)), np.arange(1.0, 5.0)[:, None, None] * np.eye(2))
    data = {"present": Forecast(np.array([9.0, 0.0]), 0.5 * np.eye(2)), "forecast": ahead}
    foreseen = RangeLimits(2, nearest=3.0).bind(4, data)["covariance"]
    np.testing.assert_array_equal(foreseen[:, 0, 0], [0.5, 1.0, 2.0, 3.0, 4.0])
    present = RangeLimits(2, nearest=3.0, foresee=False).bind(4, data)["covariance"]
    np.testing.assert_array_equal(present, np.tile(0.5 * np.eye(2), (5, 1, 1)))


def test_what_a_moving_limit_needs_is_asked_for():
    with pytest.raises(ValueError, match="RangeLimits needs 'present'"):
        posed().compile("compiled").solve(
            np.zeros((2, 3)), Forecast(np.ones((6, 2)), np.tile(np.eye(2), (6, 1, 1))), np.tile([1.0, 0.0], (6, 1))
        )


def test_depth_and_yaw_rate_hold_in_space():
    problem = TrajectoryProblem(SPACE, 5, 0.5).maximize(BearingSimilarity(3)).subject_to(ThrustLimit(SPACE))
    problem = problem.subject_to(DepthLimits(-1.0, 0.5), nodes=4).subject_to(YawRateLimit(3, 0.3), nodes=4)
    problem = problem.subject_to(SpeedLimit(3, 1.0), nodes=4)
    mean = np.tile([3.0, 0.0, 0.0], (5, 1))
    desired = np.tile([0.0, 0.0, -1.0], (5, 1))  # wants to be far above the target
    plan = problem.compile("compiled").solve(
        np.zeros((2, 4)), Forecast(mean, np.tile(0.01 * np.eye(3), (5, 1, 1))), desired
    )
    assert plan.solved
    times = np.linspace(0.0, 2.5, 251)
    assert 0.4 < plan(times)[:, 2].max() < 0.505
    assert np.linalg.norm(plan(times, 1)[:, :3], axis=1).max() < 1.01


def test_a_segment_is_a_part_of_its_piece():
    plan = FlatTrajectory(0.5, np.random.default_rng(0).normal(size=(3, 2)), np.ones((4, 2)))
    part = plan.segment(0.7, 0.1)
    for order in range(3):
        np.testing.assert_allclose(part([0.0, 0.06], order), plan([0.7, 0.76], order), rtol=1e-12)
    with pytest.raises(ValueError, match=r"duration: found 0\.2"):
        plan.segment(0.4, 0.2)


def test_a_speed_broken_at_the_start_is_mended_within_the_thrust():
    """Refusing every plan would leave the vehicle braking for as long as the speed is too high."""
    problem = TrajectoryProblem(FALCON, 4, 1.0).maximize(BearingSimilarity(2)).subject_to(ThrustLimit(FALCON))
    problem = problem.subject_to(YawRateLimit(2, 0.7)).subject_to(SpeedLimit(2, 3.0))
    start = np.array([[0.0, 0.0, 0.0], [3.02, 0.0, 0.9]])
    ahead = Forecast(np.tile([30.0, 10.0], (4, 1)), np.tile(0.01 * np.eye(2), (4, 1, 1)))
    plan = problem.compile("compiled").solve(start, ahead, np.tile([1.0, 0.0], (4, 1)))
    assert (plan.status, plan.fallback) == ("solved", "")
    times = np.linspace(0.3, 4.0, 200)
    assert np.max(np.abs(plan(times, 1)[:, 2])) < 0.7 + 1e-6
    assert np.max(np.linalg.norm(plan(times, 1)[:, :2], axis=1)) < 3.0 + 1e-6
    thrust = TrajectoryProblem(FALCON, 4, 1.0).maximize(BearingSimilarity(2)).subject_to(ThrustLimit(FALCON))
    assert LimitCheck(thrust)(plan.trajectory)[0] <= 0.0
