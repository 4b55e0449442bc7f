import pickle

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.optimize import check_grad

from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull, sigma_points, sigma_weights
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.models.vehicles import PlanarPointMass, Unicycle
from gbt_ocp.ocp import FlatPoint, FlatTrajectory, KeepOut, ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.check import LimitCheck
from gbt_ocp.ocp.transcription import input_scale, transcribe
from gbt_ocp.tracking.protocol import Forecast

PLANAR = FossenVehicle(FALCON_2D, (5000.0, 5000.0, 1500.0))
SPATIAL = FossenVehicle(FALCON_3D, (5000.0, 5000.0, 5000.0, 1500.0))
PERIOD = 0.1


def data(dimension, pieces, seed=0):
    rng = np.random.default_rng(seed)
    root = 0.2 * rng.standard_normal((pieces, dimension, dimension))
    desired = rng.standard_normal((pieces, dimension))
    return {
        "forecast": Forecast(2.0 + rng.standard_normal((pieces, dimension)), root @ np.swapaxes(root, 1, 2)),
        "desired": desired / np.linalg.norm(desired, axis=1, keepdims=True),
    }


def start(vehicle, degree=2, seed=1):
    return 0.3 * np.random.default_rng(seed).standard_normal((degree, vehicle.flat_dimension))


def thrust(vehicle, point):
    symbols = [ca.SX.sym(name, vehicle.flat_dimension) for name in ("z", "dz", "ddz")]
    function = ca.Function("inputs", symbols, [vehicle.inputs(*symbols)])
    return np.array([np.asarray(function(*columns)).ravel() for columns in zip(*point, strict=True)])


def program(problem, numbers, start_point, stage=(), tightening=0.0):
    """Objective, penalty and limits of the nonlinear program as numbers of u."""
    built, binding = transcribe(problem), Binding(problem)
    parameters = binding.vector(start_point, binding.objective_parameters(numbers), list(stage), tightening)
    function = ca.Function(
        "program", [built.variables, built.parameters], [built.objective, built.penalty, built.limits]
    )
    return lambda u: [np.asarray(value).ravel() for value in function(np.ravel(u), parameters)], built


def by_hand(numbers, ends, dimension):
    """Similarity (eq28) and pull at the endpoints, straight from their definitions."""
    total = 0.0
    for mean, covariance, desired, own in zip(*numbers["forecast"], numbers["desired"], ends, strict=True):
        line = sigma_points(mean, covariance, 1.0) - own[:dimension]
        total += sigma_weights(dimension, 1.0) @ (line @ desired / np.linalg.norm(line, axis=1))
        total -= 0.02 * np.log1p(np.exp((np.linalg.norm(mean - own[:dimension]) - 1.0) / 0.1))
    return total


def bearing_problem(vehicle, pieces=3, degree=2):
    d = vehicle.position_dimension
    return TrajectoryProblem(vehicle, pieces, PERIOD, degree).maximize(BearingSimilarity(d)).maximize(RangePull(d))


@pytest.mark.parametrize("degree", [2, 3])
@pytest.mark.parametrize("vehicle", [PLANAR, SPATIAL], ids=["planar", "spatial"])
def test_program_is_objective_penalty_and_limits_of_the_trajectory(vehicle, degree):
    limit = ThrustLimit(vehicle, gamma=0.9)
    problem = bearing_problem(vehicle, degree=degree).subject_to(limit, nodes=4).subject_to_penalty(limit, nodes=6)
    numbers, origin = data(vehicle.position_dimension, 3), start(vehicle, degree)
    evaluate, built = program(problem, numbers, origin, [(0.05, 70.0)], tightening=0.03)
    u = 1.5 * np.random.default_rng(2).standard_normal((3, vehicle.flat_dimension))
    objective, penalty, limits = evaluate(u)
    plan = FlatTrajectory(PERIOD, origin, u * input_scale(problem))

    assert objective[0] == pytest.approx(by_hand(numbers, plan.endpoints, vehicle.position_dimension), rel=1e-6)

    # eq35 with γ = 0.9, in the first piece 0.9 - 0.03, and the hinge mended, by scipy's trapezoidal rule.
    expected = 0.0
    for i in range(3):
        share = thrust(vehicle, [values[i] for values in plan.sample(7)]) / vehicle.thrust_max
        gamma = 0.87 if i == 0 else 0.9
        for x in (share - gamma, -share - gamma):
            g = np.where(x > 0.05, x, np.where(x < -0.05, 0.0, (x + 0.05) ** 2 / 0.2))
            expected += 70.0 * trapezoid(g, dx=PERIOD / 6, axis=0).sum()
    assert expected > 1.0
    assert penalty[0] == pytest.approx(expected, rel=1e-9)

    # With degree 3 the first node of a piece is the last one of the piece before.
    nodes = [
        (thrust(vehicle, [values[i] for values in plan.sample(5)]) / vehicle.thrust_max)[0 if degree == 2 else 1 :]
        for i in range(3)
    ]
    np.testing.assert_allclose(limits, np.concatenate(nodes).ravel(), rtol=1e-9)
    np.testing.assert_allclose(built.upper, 0.9)
    np.testing.assert_allclose(built.lower, -0.9)
    moved, first = built.inward(0.03), nodes[0].size
    np.testing.assert_allclose(moved[:first], 0.03)
    np.testing.assert_array_equal(moved[first:], 0.0)
    assert len(moved) == limits.size


@pytest.mark.parametrize("degree", [2, 3])
def test_gradients_of_the_program_against_differences(degree):
    limit = ThrustLimit(PLANAR, gamma=0.9)
    problem = bearing_problem(PLANAR, degree=degree).subject_to_penalty(limit, nodes=6).subject_to(limit, nodes=2)
    evaluate, built = program(problem, data(2, 3), start(PLANAR, degree), [(0.05, 10.0)])
    binding = Binding(problem)
    parameters = binding.vector(start(PLANAR, degree), binding.objective_parameters(data(2, 3)), [(0.05, 10.0)], 0.0)
    rows = np.random.default_rng(3).standard_normal(built.limits.size1())
    cost = built.nlp["f"] + ca.dot(ca.DM(rows), built.limits)
    gradient = ca.Function("gradient", [built.variables, built.parameters], [ca.gradient(cost, built.variables)])

    def value(u):
        objective, penalty, limits = evaluate(u)
        return float(-objective[0] + penalty[0] + rows @ limits)

    u = np.random.default_rng(4).standard_normal(9)
    slope = np.asarray(gradient(u, parameters)).ravel()
    assert check_grad(value, lambda u: np.asarray(gradient(u, parameters)).ravel(), u) < 1e-5 * np.linalg.norm(slope)


def test_newtons_and_shares_of_the_limit_are_the_same_limits():
    shares = bearing_problem(PLANAR).subject_to(ThrustLimit(PLANAR, 0.9), nodes=3)
    newtons = bearing_problem(PLANAR).subject_to(ThrustLimit(PLANAR, 0.9, "newton"), nodes=3)
    u = np.random.default_rng(5).standard_normal((3, 3))
    (first, one), (second, other) = (program(p, data(2, 3), start(PLANAR)) for p in (shares, newtons))
    scale = np.tile(PLANAR.thrust_max, 12)
    np.testing.assert_allclose(second(u)[2], first(u)[2] * scale)
    np.testing.assert_allclose(other.upper, one.upper * scale)
    plan = FlatTrajectory(PERIOD, start(PLANAR), 3.0 * u * input_scale(shares))
    np.testing.assert_allclose(LimitCheck(shares)(plan), LimitCheck(newtons)(plan))


def test_check_finds_the_worst_of_each_piece_in_units_of_the_limits():
    problem = bearing_problem(PLANAR).subject_to(ThrustLimit(PLANAR, gamma=0.5))
    plan = FlatTrajectory(PERIOD, start(PLANAR), 2.0 * np.eye(3) * input_scale(problem))
    worst = [
        (np.abs(thrust(PLANAR, [values[i] for values in plan.sample(101)])) / PLANAR.thrust_max).max() - 1.0
        for i in range(3)
    ]
    np.testing.assert_allclose(LimitCheck(problem)(plan), worst, rtol=1e-12)
    assert max(worst) > 0.0
    np.testing.assert_array_equal(LimitCheck(bearing_problem(PLANAR))(plan), -np.inf)


def test_check_sees_what_happens_between_the_points_the_solver_sees():
    # A circle of 1 cm on the way, passed between two nodes at 2 m/s.
    problem = bearing_problem(PLANAR, 1).subject_to(KeepOut((0.05, 0.0), 0.01), nodes=1)
    evaluate, built = program(problem, data(2, 1), np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    assert np.all(evaluate(np.zeros((1, 3)))[2] >= built.lower)
    plan = FlatTrajectory(PERIOD, np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.zeros((1, 3)))
    assert LimitCheck(problem)(plan)[0] == pytest.approx(0.5)


def test_keeping_out_is_a_bound_on_the_distance():
    limit = KeepOut((1.0, 2.0), 0.5)
    at = FlatPoint(ca.DM([1.0, 2.5, 0.3]), ca.DM.zeros(3), ca.DM.zeros(3))
    assert float(limit.value(at)) == pytest.approx(1.0)
    close = FlatPoint(ca.DM([1.0, 2.5 - 0.005, 0.3]), ca.DM.zeros(3), ca.DM.zeros(3))
    # One hundredth of the radius inside.
    assert (limit.lower[0] - float(limit.value(close))) / limit.scale[0] == pytest.approx(0.01, rel=0.01)


def brute_force(vehicle, period, origin, numbers):
    """Objective and acceleration of the best single piece that keeps |τ| <= τ_max at five nodes.

    A grid of the two position axes, yaw held, that closes in on its best point; nothing of the toolbox but τ(z, ż, z̈).
    """
    n = vehicle.flat_dimension
    symbols = [ca.SX.sym(name, n) for name in ("z", "dz", "ddz")]
    inputs = ca.Function("inputs", symbols, [vehicle.inputs(*symbols)])
    z, dz = (np.array(row)[:, None] for row in origin)
    points = sigma_points(*(part[0] for part in numbers["forecast"]), 1.0)
    centre, size, best = np.zeros(2), 4.0 * vehicle.acceleration_scale[:2], (-np.inf, None)
    for _ in range(12):
        axes = [np.linspace(c - w, c + w, 41) for c, w in zip(centre, size, strict=True)]
        a = np.zeros((n, 41 * 41))
        a[:2] = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2).T
        end = (z + period * dz + 0.5 * period**2 * a)[:2].T
        line = points - end[:, None, :]
        similarity = (line @ numbers["desired"][0] / np.linalg.norm(line, axis=2)) @ sigma_weights(2, 1.0)
        value = similarity - 0.02 * np.logaddexp(0.0, (np.linalg.norm(points[0] - end, axis=1) - 1.0) / 0.1)
        for s in np.linspace(0.0, period, 5):
            thrust_there = np.asarray(inputs(z + s * dz + 0.5 * s * s * a, dz + s * a, a))
            value[np.any(np.abs(thrust_there) > vehicle.thrust_max[:, None], axis=0)] = -np.inf
        if value.max() > best[0]:
            best = (value.max(), a[:, value.argmax()])
        centre, size = best[1][:2], size / 2.5
    return best


ONE_PIECE = {
    "point mass": (PlanarPointMass(2.0, 0.5, (3.0, 2.0)), 1.0, [[0.0, 0.0], [0.3, -0.2]], [3.0, 1.0], [0.28, 0.96]),
    "at rest": (PlanarPointMass(2.0, 0.5, (3.0, 2.0)), 1.0, [[0.0, 0.0], [0.0, 0.0]], [1.0, 1.5], [-0.6, 0.8]),
    # Straight ahead along its surge axis a symmetric vehicle has no reason to turn: yaw stays zero.
    "falcon": (PLANAR, 0.4, [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]], [3.0, 0.0], [1.0, 0.0]),
}


@pytest.mark.parametrize("formulation", ["hard", "penalty"])
@pytest.mark.parametrize("name", ONE_PIECE)
def test_one_piece_against_brute_force_with_active_limits(name, formulation):
    vehicle, period, origin, mean, desired = ONE_PIECE[name]
    numbers = {"forecast": Forecast(np.array([mean]), 0.04 * np.eye(2)[None]), "desired": np.array([desired])}
    best, acceleration = brute_force(vehicle, period, origin, numbers)
    base = TrajectoryProblem(vehicle, 1, period).maximize(BearingSimilarity(2)).maximize(RangePull(2))
    if formulation == "hard":
        posed, allowed = base.subject_to(ThrustLimit(vehicle), nodes=4), 1e-5
    else:
        # The penalty begins ϖ inside the limit and is not quite infinite: both shift the optimum by about ϖ.
        posed = base.subject_to_penalty(ThrustLimit(vehicle), weight=1000.0, width=1e-3, nodes=20)
        allowed = 2e-3
    # The solution as the solver gave it, before the planner tightens anything.
    binding = Binding(posed)
    solver = posed.compile("ipopt").solver
    found = solver.solve(
        np.array(origin), binding.objective_parameters(numbers), np.zeros((1, vehicle.flat_dimension)), cold=True
    )
    assert found.solved
    plan = FlatTrajectory(period, np.array(origin), found.variables * input_scale(posed))
    np.testing.assert_allclose(plan.top[0][:2], acceleration[:2], atol=allowed * vehicle.acceleration_scale.max() * 5.0)
    reached = by_hand(numbers, plan.endpoints, 2)
    assert reached == pytest.approx(best, abs=allowed)
    # The optimum lies on a limit, or the grid would have shown nothing of them.
    assert abs(LimitCheck(base.subject_to(ThrustLimit(vehicle), nodes=4))(plan)[0]) < 0.02


class Waypoints:
    """Minus the squared distance to a pose at each endpoint: a user's own objective, with a known maximum."""

    def __init__(self, size):
        self.shapes = {"pose": (size, 1)}

    def value(self, point, parameters):
        return -ca.sumsqr(point.z - parameters["pose"])

    def bind(self, pieces, data):
        return {"pose": data["poses"][:pieces, :, None]}


@pytest.mark.parametrize("vehicle", [PLANAR, SPATIAL], ids=["planar", "spatial"])
def test_both_formulations_agree_where_the_limits_are_inactive(vehicle):
    n = vehicle.flat_dimension
    origin = np.array([np.zeros(n), np.full(n, 0.1)])
    base = TrajectoryProblem(vehicle, 3, 0.4).maximize(Waypoints(n))
    limit = ThrustLimit(vehicle, 0.98)
    poses = FlatTrajectory(0.4, origin, 0.2 * np.random.default_rng(9).standard_normal((3, n))).endpoints
    for posed in (base.subject_to(limit, nodes=4), base.subject_to_penalty(limit, nodes=20)):
        plan = posed.compile("ipopt").solve(origin, poses=poses)
        assert plan.solved
        assert LimitCheck(posed)(plan.trajectory).max() < -0.5
        np.testing.assert_allclose(plan.endpoints, poses, atol=1e-5)
        assert plan.objective == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("vehicle", [PLANAR, SPATIAL], ids=["planar", "spatial"])
def test_both_formulations_reach_the_same_objective_at_the_limits(vehicle):
    d = vehicle.position_dimension
    numbers = data(d, 5, seed=7)
    base = bearing_problem(vehicle, 5)
    origin = start(vehicle, seed=8)
    hard = base.subject_to(ThrustLimit(vehicle, 0.98), nodes=4).compile("ipopt").solve(origin, **numbers)
    soft = base.subject_to_penalty(ThrustLimit(vehicle, 0.98)).compile("ipopt").solve(origin, **numbers)
    assert hard.solved
    assert soft.solved
    # The penalty backs off by about its width from where the hard limits stand.
    assert soft.objective == pytest.approx(hard.objective, abs=0.02)
    for plan in (hard, soft):
        assert plan.piece_violation[0] == 0.0
        assert plan.violation == plan.piece_violation.max()


@pytest.mark.parametrize("vehicle", [PLANAR, SPATIAL], ids=["planar", "spatial"])
@pytest.mark.parametrize("formulation", ["hard", "penalty"])
def test_random_cold_starts_are_solved_within_the_limits(vehicle, formulation):
    d = vehicle.position_dimension
    limit = ThrustLimit(vehicle, 0.98)
    base = bearing_problem(vehicle, 5)
    posed = base.subject_to(limit, nodes=4) if formulation == "hard" else base.subject_to_penalty(limit)
    planner = posed.compile("ipopt")
    for seed in range(5):
        planner.reset()
        plan = planner.solve(start(vehicle, seed=seed), **data(d, 5, seed=10 + seed))
        assert plan.solved, plan.status
        assert plan.fallback == ""
        assert plan.piece_violation[0] == 0.0


def test_a_unicycle_and_a_cubic_are_planned_too():
    unicycle = Unicycle(thrust_max=(1.0, 2.0))
    posed = bearing_problem(unicycle, 4).subject_to(ThrustLimit(unicycle))
    assert posed.compile().solve([[0.0, 0.0], [0.5, 0.0]], **data(2, 4)).solved
    cubic = bearing_problem(PLANAR, 4, degree=3).subject_to(ThrustLimit(PLANAR, 0.98))
    plan = cubic.compile().solve(np.zeros((3, 3)), **data(2, 4))
    assert plan.solved
    assert plan.piece_violation[0] == 0.0
    boundary = plan.trajectory.period
    np.testing.assert_allclose(plan(boundary - 1e-9, 2), plan(boundary + 1e-9, 2), atol=1e-5)


def test_only_what_is_needed_of_a_long_forecast_is_read():
    long = data(2, 11)
    short = {"forecast": Forecast(*(part[:3] for part in long["forecast"])), "desired": long["desired"][:3]}
    binding = Binding(bearing_problem(PLANAR))
    for first, second in zip(binding.objective_parameters(long), binding.objective_parameters(short), strict=True):
        np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"desired": None}, "needs 'desired'"),
        (
            {"desired": np.ones((2, 2))},
            r"BearingSimilarity.bind, 'desired': found shape \(2, 2, 1\).*\(3, 2, 1\)",
        ),
        (
            {"desired": np.full((3, 2), np.nan)},
            "'desired': found .*nan.*; allowed: finite",
        ),
        ({"forecast": Forecast(np.ones((2, 2)), np.zeros((2, 2, 2)))}, r"'sigma_points': found shape \(2, 2, 5\)"),
        (
            {"forecast": Forecast(np.ones((3, 2)), np.full((3, 2, 2), np.nan))},
            "'sigma_points': .*; allowed: finite",
        ),
        ({"forecast": Forecast(np.full((3, 2), np.inf), np.zeros((3, 2, 2)))}, "allowed: finite numbers"),
    ],
)
def test_data_that_do_not_fit_are_refused(change, says):
    with pytest.raises(ValueError, match=says):
        Binding(bearing_problem(PLANAR)).objective_parameters(data(2, 3) | change)


def test_a_problem_is_a_value():
    base = bearing_problem(PLANAR)
    limited = base.subject_to(ThrustLimit(PLANAR), nodes=2)
    assert base.hard == ()
    assert [limit.nodes for limit in limited.hard] == [2]
    assert len(limited.subject_to_penalty(KeepOut((0.0, 0.0), 1.0)).constraints) == 2
    assert pickle.loads(pickle.dumps(limited)).pieces == 3


@pytest.mark.parametrize(
    ("build", "says"),
    [
        (lambda: TrajectoryProblem(PLANAR, 0, 0.1), "pieces: found 0; allowed: a whole number >= 1"),
        (lambda: TrajectoryProblem(PLANAR, 3, 0.1, 1), "degree: found 1; allowed: a whole number >= 2"),
        (lambda: TrajectoryProblem(PLANAR, 3, 0.0), "period: found 0.0; allowed: a number > 0"),
        (lambda: TrajectoryProblem(PLANAR, 3, np.nan), "period: found nan"),
        (lambda: TrajectoryProblem(PLANAR, 3, 0.1).compile(), "no objective"),
        (lambda: bearing_problem(PLANAR).compile("simplex"), "found 'simplex'; allowed: auto, compiled, ipopt"),
        (
            lambda: bearing_problem(PLANAR).subject_to(ThrustLimit(PLANAR), nodes=0),
            "nodes: found 0",
        ),
        (
            lambda: bearing_problem(PLANAR).subject_to_penalty(ThrustLimit(PLANAR), nodes=0),
            "nodes: found 0",
        ),
        (
            lambda: bearing_problem(PLANAR).subject_to_penalty(ThrustLimit(PLANAR), width=0.0),
            "width: found 0.0",
        ),
        (
            lambda: bearing_problem(PLANAR).subject_to_penalty(ThrustLimit(PLANAR), weight=-1.0),
            "weight: found -1.0",
        ),
        (lambda: ThrustLimit(PLANAR, gamma=0.0), r"gamma must lie in \(0, 1\], found 0.0"),
        (lambda: ThrustLimit(PLANAR, gamma=1.01), "gamma must lie"),
        (lambda: ThrustLimit(PLANAR, units="pound"), "found 'pound'"),
    ],
)
def test_impossible_problems_are_refused(build, says):
    with pytest.raises(ValueError, match=says):
        build()
