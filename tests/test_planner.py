from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from test_one_step import Bare

from gbt_ocp.experiments.build.loop import build_planner, build_vehicle
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.models.vehicles import PlanarPointMass
from gbt_ocp.ocp import FlatTrajectory, KeepOut, Planner, ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.braking import BrakingPlanner
from gbt_ocp.ocp.check import LimitCheck
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.ocp.ladder import TIGHTENINGS
from gbt_ocp.ocp.solvers.base import Solution
from gbt_ocp.ocp.transcription import input_scale
from gbt_ocp.tracking.protocol import Forecast

PLANAR = FossenVehicle(FALCON_2D, (5000.0, 5000.0, 1500.0))
SPATIAL = FossenVehicle(FALCON_3D, (5000.0, 5000.0, 5000.0, 1500.0))
PERIOD, PIECES = 0.1, 4
REST = np.zeros((2, 3))
MOVING = np.array([[0.0, 0.0, 0.0], [1.0, -0.5, 0.4]])
FINE = np.full((PIECES, 3), 0.2)
WILD = np.full((PIECES, 3), 40.0)


def posed(vehicle=PLANAR, degree=2, nodes=4, gamma=0.98):
    d = vehicle.position_dimension
    problem = TrajectoryProblem(vehicle, PIECES, PERIOD, degree).maximize(BearingSimilarity(d)).maximize(RangePull(d))
    return problem.subject_to(ThrustLimit(vehicle, gamma), nodes=nodes)


def numbers(dimension=2):
    desired = np.tile([0.6, 0.8, 0.0][:dimension], (PIECES, 1))
    return {
        "forecast": Forecast(
            np.tile([2.0, 1.0, 0.5][:dimension], (PIECES, 1)), np.zeros((PIECES, dimension, dimension))
        ),
        "desired": desired,
    }


def solved(variables, iterations=3):
    return Solution(np.array(variables, dtype=float), True, "solved", iterations)


def failed(word="gave_up", variables=None, iterations=5):
    return Solution(np.full((PIECES, 3), np.nan) if variables is None else variables, False, word, iterations)


class Script:
    """A solver that answers from a list, and remembers what it was asked."""

    name = "script"

    def __init__(self, *answers):
        self.answers, self.asked = list(answers), []

    def solve(self, start, objectives, guess, *, cold, tightening=0.0, limits=()):
        self.asked.append({"start": start, "guess": np.array(guess), "cold": cold, "tightening": tightening})
        answer = self.answers.pop(0)
        return answer(tightening) if callable(answer) else answer


def planner_with(*answers, problem=None):
    script = Script(*answers)
    return Planner(problem or posed(), script), script


def follow(plan):
    """The state one period later."""
    return plan.trajectory.knots[1]


def test_a_solved_step_is_the_solvers_trajectory_and_the_next_starts_from_its_rest():
    planner, script = planner_with(solved(FINE), solved(0.5 * FINE))
    first = planner.solve(MOVING, **numbers())
    assert (first.status, first.fallback, first.solved, first.iterations, first.tightened) == ("solved", "", True, 3, 0)
    np.testing.assert_allclose(first.trajectory.top, FINE * input_scale(posed()))
    np.testing.assert_array_equal(script.asked[0]["guess"], planner.cold_guess(MOVING))
    assert script.asked[0]["cold"]
    planner.solve(follow(first), **numbers())
    np.testing.assert_allclose(script.asked[1]["guess"], np.vstack([FINE[1:], np.zeros((1, 3))]), atol=1e-12)
    assert not script.asked[1]["cold"]
    assert len(script.asked) == 2


@pytest.mark.parametrize("variables", [None, WILD], ids=["nan", "wild"])
def test_a_failed_solve_is_answered_by_the_rest_of_the_previous_plan(variables):
    planner, script = planner_with(solved(FINE), failed("Infeasible", variables), solved(FINE))
    first = planner.solve(MOVING, **numbers())
    second = planner.solve(follow(first), **numbers())
    assert (second.status, second.fallback, second.solved) == ("Infeasible", "shifted", False)
    assert second.iterations == 5
    times = np.linspace(0.0, (PIECES - 1) * PERIOD - 1e-6, 20)
    np.testing.assert_allclose(second(times), first(times + PERIOD), atol=1e-12)
    assert second.piece_violation[0] == 0.0
    assert len(script.asked) == 2
    # The failed solution is not the next warm start: the rest of the rest is.
    planner.solve(follow(second), **numbers())
    np.testing.assert_allclose(script.asked[2]["guess"], np.vstack([FINE[2:], np.zeros((2, 3))]), atol=1e-12)


def test_the_rest_of_the_previous_plan_starts_where_the_vehicle_is():
    planner, _ = planner_with(solved(FINE), failed())
    first = planner.solve(MOVING, **numbers())
    pushed = follow(first) + 0.01
    second = planner.solve(pushed, **numbers())
    assert second.fallback == "shifted"
    np.testing.assert_allclose(second(0.0), pushed[0])
    np.testing.assert_allclose(second(0.0, 1), pushed[1])


@pytest.mark.parametrize("turns", [0, 1])
def test_the_guess_of_a_pushed_vehicle_leads_back_to_the_previous_plan(turns):
    """Position, heading and both rates are on the plan again after two pieces; a heading counts the short way round."""
    planner, script = planner_with(solved(FINE), solved(FINE))
    first = planner.solve(MOVING, **numbers())
    start = follow(first) + np.array([[0.3, -0.2, 0.1], [0.05, 0.1, -0.3]])
    start[0, 2] += 2.0 * np.pi * turns
    planner.solve(start, **numbers())
    guess = FlatTrajectory(PERIOD, start, script.asked[1]["guess"] * input_scale(posed()))
    wanted = first.trajectory.shifted().knots[2:]
    wanted[:, 0, 2] += 2.0 * np.pi * turns
    np.testing.assert_allclose(guess.knots[2:], wanted, atol=1e-12)
    assert np.abs(guess.knots[1] - first.trajectory.knots[2]).max() > 0.01


@pytest.mark.parametrize("variables", [None, WILD], ids=["nan", "wild"])
def test_where_the_rest_breaks_the_limits_a_cold_solve_comes_next(variables):
    late = np.vstack([FINE[:1], WILD[1:]])
    planner, script = planner_with(solved(late), failed("first", variables), solved(-FINE, 7), solved(FINE))
    first = planner.solve(MOVING, **numbers())
    assert first.piece_violation[0] == 0.0
    assert first.violation == first.piece_violation[1:].max() > 1.0
    second = planner.solve(follow(first), **numbers())
    assert (second.status, second.fallback, second.iterations) == ("first", "cold", 12)
    np.testing.assert_allclose(second.trajectory.top, -FINE * input_scale(posed()))
    assert script.asked[2]["cold"]
    np.testing.assert_array_equal(script.asked[2]["guess"], planner.cold_guess(MOVING))
    third = planner.solve(follow(second), **numbers())
    assert third.solved
    np.testing.assert_allclose(script.asked[3]["guess"], np.vstack([-FINE[1:], np.zeros((1, 3))]), atol=1e-12)


@pytest.mark.parametrize("variables", [None, WILD], ids=["nan", "wild"])
def test_braking_is_the_last_resort_and_the_next_warm_start(variables):
    late = np.vstack([FINE[:1], WILD[1:]])
    planner, script = planner_with(solved(late), failed("first", variables), failed("second", variables), solved(FINE))
    first = planner.solve(MOVING, **numbers())
    second = planner.solve(follow(first), **numbers())
    assert (second.status, second.fallback, second.iterations) == ("first", "braking", 10)
    assert second.violation == 0.0
    speeds = np.linalg.norm(second.trajectory.knots[:, 1], axis=1)
    assert np.all(np.diff(speeds) <= 0.0)
    assert speeds[-1] < 0.01
    planner.solve(follow(second), **numbers())
    expected = np.vstack([second.trajectory.top[1:], np.zeros((1, 3))]) / input_scale(posed())
    np.testing.assert_allclose(script.asked[3]["guess"], expected, atol=1e-12)
    assert not script.asked[3]["cold"]


def test_without_a_previous_plan_a_failure_ends_in_braking():
    planner, _ = planner_with(failed("first"), failed("second"))
    plan = planner.solve(MOVING, **numbers())
    assert (plan.status, plan.fallback) == ("first", "braking")
    assert plan.violation == 0.0


def test_a_cold_solve_that_failed_is_not_repeated():
    planner, script = planner_with(failed("first"), failed("second"))
    planner.solve(MOVING, **numbers())
    assert len(script.asked) == 1


def test_reset_forgets():
    planner, script = planner_with(solved(FINE), solved(FINE))
    planner.solve(MOVING, **numbers())
    planner.reset()
    planner.solve(MOVING, **numbers())
    assert script.asked[1]["cold"]
    np.testing.assert_array_equal(script.asked[1]["guess"], planner.cold_guess(MOVING))


def just_over(excess):
    """Surge accelerations whose first piece exceeds the true limit by this share."""
    top = np.zeros((PIECES, 3))
    check = LimitCheck(posed())
    for _ in range(60):
        top[0, 0] += 0.5 * (excess - check(FlatTrajectory(PERIOD, REST, top * input_scale(posed())))[0])
    return top


@pytest.mark.long
def test_limits_are_tightened_when_the_executed_piece_breaks_them_between_nodes():
    planner, script = planner_with(solved(just_over(0.02)), solved(just_over(0.005)), solved(just_over(-0.01)))
    plan = planner.solve(REST, **numbers())
    assert (plan.status, plan.fallback, plan.tightened, plan.iterations) == ("solved", "", 2, 9)
    assert plan.piece_violation[0] == 0.0
    tightenings = [float(asked["tightening"][0]) for asked in script.asked]
    assert tightenings[0] == 0.0
    assert tightenings[1] == pytest.approx(1.2 * 0.02 + 1e-4, rel=1e-6)
    # the first round left a quarter of what it was to gain: the second asks for a third more
    assert tightenings[2] == pytest.approx(tightenings[1] + 1.2 * 0.005 / 0.75 + 1e-4, rel=1e-6)
    # The solution that was a little over is the start of the next try.
    np.testing.assert_array_equal(script.asked[1]["guess"], just_over(0.02))
    assert [asked["cold"] for asked in script.asked] == [True, False, False]


def test_later_pieces_may_break_the_limits_and_are_reported():
    late = np.vstack([FINE[:1], WILD[1:]])
    planner, script = planner_with(solved(late))
    plan = planner.solve(MOVING, **numbers())
    assert plan.fallback == ""
    assert len(script.asked) == 1
    assert plan.piece_violation[0] == 0.0
    assert plan.violation > 1.0


@pytest.mark.long
def test_tightening_ends_and_counts_as_a_failure():
    tries = [solved(just_over(0.2))] * (TIGHTENINGS + 1)
    planner, script = planner_with(solved(FINE), *tries)
    first = planner.solve(REST, **numbers())
    second = planner.solve(first.trajectory.knots[1], **numbers())
    assert first.solved
    assert (second.status, second.fallback) == ("limits broken between nodes", "shifted")
    assert second.tightened == TIGHTENINGS
    assert len(script.asked) == TIGHTENINGS + 2


@pytest.mark.long
def test_a_tightened_solve_that_fails_counts_as_a_failure():
    planner, _ = planner_with(solved(FINE), solved(just_over(0.2)), failed("Infeasible"))
    first = planner.solve(REST, **numbers())
    plan = planner.solve(first.trajectory.knots[1], **numbers())
    assert (plan.status, plan.fallback, plan.tightened) == ("Infeasible", "shifted", 1)


@pytest.mark.long
@pytest.mark.parametrize("last", [[solved(just_over(0.03))], [failed("Infeasible")]])
def test_the_solution_that_breaks_the_thrust_least_is_mended_where_tightening_does_not_help(last):
    planner, _ = planner_with(solved(FINE), solved(just_over(0.02)), *last)
    first = planner.solve(REST, **numbers())
    start = first.trajectory.knots[1]
    plan = planner.solve(start, **numbers())
    asked = just_over(0.02) * input_scale(posed())
    assert (plan.fallback, plan.tightened) == ("", len(last))
    assert plan.piece_violation[0] == 0.0
    # the rest comes back to what was asked for: in two pieces, since position and velocity are continuous
    meant = FlatTrajectory(PERIOD, start, asked)
    changed = np.abs(plan.trajectory.knots - meant.knots).max(axis=(1, 2))
    assert 0.0 < changed[1] < 0.05 * PERIOD * posed().vehicle.acceleration_scale.max()
    np.testing.assert_allclose(changed[3:], 0.0, atol=1e-12)
    np.testing.assert_allclose(plan.trajectory.top[3:], asked[3:], atol=1e-9)


@pytest.mark.parametrize("formulation", ["hard", "penalty"])
def test_the_real_solver_is_tightened_until_the_executed_piece_keeps_the_limits(formulation):
    # One interval of half a second: thrust peaks between its ends, since drag and turn change along it.
    problem = TrajectoryProblem(PLANAR, 2, 0.5).maximize(BearingSimilarity(2)).maximize(RangePull(2))
    limit = ThrustLimit(PLANAR)
    problem = (
        problem.subject_to(limit, nodes=1) if formulation == "hard" else problem.subject_to_penalty(limit, nodes=1)
    )
    planner = problem.compile("ipopt")
    tightened = 0
    for seed in range(6):
        planner.reset()
        state = np.random.default_rng(seed).standard_normal((2, 3)) * [[1.0], [0.8]]
        plan = planner.solve(state, **numbers())
        tightened += plan.tightened
        assert plan.fallback == ""
        assert plan.piece_violation[0] == 0.0
        symbols = [ca.SX.sym(name, 3) for name in ("z", "dz", "ddz")]
        inputs = ca.Function("inputs", symbols, [PLANAR.inputs(*symbols)])
        times = np.linspace(0.0, 0.5 - 1e-6, 501)
        share = np.array([np.asarray(inputs(plan(t), plan(t, 1), plan(t, 2))).ravel() for t in times])
        assert np.all(np.abs(share) <= PLANAR.thrust_max * (1.0 + 1e-4))
    assert tightened > 0


@pytest.mark.parametrize("formulation", ["hard", "penalty"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_tightened_solve_stays_that_far_inside_both_bounds(formulation, sign):
    base = TrajectoryProblem(PLANAR, PIECES, PERIOD).maximize(RangePull(2))
    limit = ThrustLimit(PLANAR, 0.9)
    problem = base.subject_to(limit, nodes=4) if formulation == "hard" else base.subject_to_penalty(limit)
    planner = problem.compile("ipopt")
    # A target far away on the diagonal pulls surge and sway to their limits.
    far = Forecast(np.full((PIECES, 2), sign * 50.0), np.zeros((PIECES, 2, 2)))
    parameters = planner._binding.objective_parameters({"forecast": far})
    for tightening, inner in ((0.0, 0.9), (0.2, 0.7)):
        found = planner.solver.solve(REST, parameters, np.zeros((PIECES, 3)), cold=True, tightening=tightening)
        assert found.solved
        plan = FlatTrajectory(PERIOD, REST, found.variables * input_scale(problem))
        assert LimitCheck(problem)(plan)[0] == pytest.approx(inner - 1.0, abs=0.02)


@pytest.mark.parametrize("wrong", [np.zeros((3, 3)), np.zeros((2, 2)), np.full((2, 3), np.nan)])
def test_a_state_that_does_not_fit_is_refused_and_forgets_nothing(wrong):
    planner, script = planner_with(solved(FINE), solved(FINE))
    first = planner.solve(MOVING, **numbers())
    with pytest.raises(ValueError, match=r"state: .*allowed: \(2, 3\)"):
        planner.solve(wrong, **numbers())
    planner.solve(follow(first), **numbers())
    assert not script.asked[1]["cold"]


def test_a_solution_that_is_no_number_is_never_executed():
    nan = solved(np.full((PIECES, 3), np.nan))
    planner, _ = planner_with(solved(FINE), *[nan] * (2 * TIGHTENINGS + 2))
    first = planner.solve(MOVING, **numbers())
    second = planner.solve(follow(first), **numbers())
    assert second.fallback == "shifted"
    assert not second.solved
    assert np.all(np.isfinite(second.trajectory.top))


def test_a_solution_that_is_no_number_is_never_a_guess():
    nan = solved(np.full((PIECES, 3), np.nan))
    planner, script = planner_with(solved(FINE), *[nan] * (2 * TIGHTENINGS + 2))
    first = planner.solve(MOVING, **numbers())
    planner.solve(follow(first), **numbers())
    assert all(np.all(np.isfinite(asked["guess"])) for asked in script.asked)


def test_a_tightening_beyond_the_limits_is_a_failed_solve():
    planner = posed().compile("ipopt")
    parameters = planner._binding.objective_parameters(numbers())
    found = planner.solver.solve(REST, parameters, np.zeros((PIECES, 3)), cold=False, tightening=1.2)
    assert not found.solved


def brake(problem, state):
    check = LimitCheck(problem)
    trajectory = BrakingPlanner(problem)(np.asarray(state, dtype=float))
    return trajectory, check(trajectory)


# Four fifths of what full thrust on one axis sustains against the drag.
TERMINAL = {3: [3.5, 2.4, 3.4], 4: [3.5, 2.4, 5.0, 3.4]}


@pytest.mark.parametrize("vehicle", [PLANAR, SPATIAL], ids=["planar", "spatial"])
@pytest.mark.parametrize("seed", range(6))
def test_braking_keeps_the_limits_and_slows_down(vehicle, seed):
    n, rng = vehicle.flat_dimension, np.random.default_rng(seed)
    z = np.full(n, rng.uniform(-3.0, 3.0))
    _, velocity = vehicle.flat(np.concatenate([z, rng.uniform(-1.0, 1.0, n) * TERMINAL[n]]))
    trajectory, broken = brake(posed(vehicle), [z, velocity])
    assert broken.max() <= 0.0
    np.testing.assert_allclose(trajectory.knots[0], [z, velocity])
    energy = np.sum((trajectory.knots[:, 1] / vehicle.acceleration_scale) ** 2, axis=1)
    assert np.all(np.diff(energy) <= 1e-12)
    assert energy[-1] < 0.1 * energy[0]


def test_braking_at_rest_stays():
    trajectory, broken = brake(posed(), REST)
    np.testing.assert_allclose(trajectory.endpoints, 0.0, atol=1e-12)
    assert broken.max() == pytest.approx(-1.0)


def test_a_piece_that_can_stop_stops():
    problem = replace(posed(), pieces=20, period=1.0)
    trajectory, broken = brake(problem, [[0.0, 0.0, 0.0], [0.5, -0.2, 0.0]])
    np.testing.assert_allclose(trajectory.knots[1:, 1], 0.0, atol=1e-12)
    assert broken.max() <= 0.0


def test_braking_of_a_cubic_keeps_the_limits_and_ends_slow():
    trajectory, broken = brake(posed(degree=3), [[0.0, 0.0, 0.0], [1.5, -1.0, 0.5], [0.0, 0.0, 0.0]])
    assert broken.max() <= 0.0
    speeds = np.linalg.norm(trajectory.knots[:, 1], axis=1)
    assert speeds[-1] < 0.4 * speeds[0]


@pytest.mark.parametrize("drag", [0.0, 0.2])
def test_braking_of_a_weak_vehicle_uses_most_of_its_thrust(drag):
    vehicle = PlanarPointMass(2.0, drag, (1.0, 1.0))
    trajectory, broken = brake(posed(vehicle), [[0.0, 0.0], [1.0, 0.5]])
    assert broken.max() <= 0.0
    # 0.5 m/s² for 0.4 s; half of that is asked for.
    assert trajectory.knots[-1, 1, 0] < 0.9


def test_a_start_a_hair_inside_a_forbidden_circle_is_planned_out_of_it():
    problem = posed().subject_to(KeepOut((0.0, 0.0), 0.5), nodes=4)
    plan = problem.compile("ipopt").solve([[0.5 - 1e-6, 0.0, 0.0], [0.0, 0.0, 0.0]], **numbers())
    assert plan.fallback == ""
    assert np.hypot(*plan.endpoints[0][:2]) >= 0.5


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
@pytest.mark.parametrize("rates", [(-3.1, 0.3, 0.6), (-3.15, 0.2, 0.65)])
def test_thrust_that_tightening_does_not_bring_within_its_limits_is_mended(rates):
    """At full speed askew the yaw torque peaks between the nodes, whatever is asked of it there.

    The target is believed to be nearer than the standoff allows. To ask for more than a round has gained ended in a
    braking plan, or turned the vehicle at four times its yaw rate; both forms of the step answer alike.
    """
    configuration = load_config("sea2d_speed")
    planner = build_planner(configuration, build_vehicle(configuration))
    ladder = Planner(planner.problem, Bare(planner.solver))
    start = np.array([[34.4, -84.54, 8.37], rates])
    seconds, spread = np.arange(1.0, 21.0), np.array([[3.0, 0.2], [0.2, 0.05]])
    mean = np.array([69.9, -84.6])
    given = {
        "forecast": Forecast(mean + seconds[:, None] * [-0.65, 0.35], (1.0 + 0.05 * seconds)[:, None, None] * spread),
        "present": Forecast(mean, spread),
        "desired": np.stack([np.cos(0.062 * seconds), -np.sin(0.062 * seconds)], axis=1),
    }
    for asked in (planner, ladder):
        plan = asked.solve(start, **given)
        assert (plan.status, plan.fallback) == ("given up", "")
        assert plan.tightened == 1
        assert plan.given_up == pytest.approx({"range": plan.broken_at_start["range"]}, rel=1e-2)
        vehicle, top = planner.problem.vehicle, plan.trajectory.top[0]
        for t in np.linspace(0.0, planner.problem.period, 401):
            point = start[0] + t * start[1] + 0.5 * t**2 * top, start[1] + t * top, top
            thrust = np.asarray(vehicle.inputs(*map(ca.DM, point))).ravel()
            assert np.all(np.abs(thrust) <= vehicle.thrust_max)
