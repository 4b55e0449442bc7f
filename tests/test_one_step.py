"""One step of the planner: the C that Python calls, the ladder in Python and a folder compiled apart say the same."""

import ctypes

import numpy as np
import pytest

from gbt_ocp.experiments.build.loop import build_planner, build_vehicle
from gbt_ocp.experiments.config.catalogue import config_names
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull
from gbt_ocp.guidance.target_limits import FieldOfView, RangeLimits
from gbt_ocp.models.fossen import FALCON_2D, FossenVehicle
from gbt_ocp.ocp import Planner, SpeedLimit, ThrustLimit, TrajectoryProblem, YawRateLimit
from gbt_ocp.ocp.braking import BrakingPlanner
from gbt_ocp.ocp.codegen.library import build_library, find_compiler, kernel_files
from gbt_ocp.ocp.codegen.problem_source import generate_problem
from gbt_ocp.ocp.export.folder import write_c
from gbt_ocp.ocp.export.verification import verify_folder
from gbt_ocp.ocp.ladder import Ladder, _Given
from gbt_ocp.tracking.protocol import Forecast

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
FALCON = FossenVehicle(FALCON_2D, (5000.0, 5000.0, 1500.0))
PIECES, PERIOD = 4, 0.5


class Own:
    """An objective with data of its own: its parameters are bound by Python for the C and for the ladder alike."""

    def __init__(self, term):
        self.shapes, self.value, self.bind = term.shapes, term.value, term.bind


def posed(name, given=Own):
    problem = TrajectoryProblem(FALCON, PIECES, PERIOD).maximize(given(BearingSimilarity(2))).maximize(RangePull(2))
    problem = problem.subject_to(ThrustLimit(FALCON), nodes=2)
    if name == "hard":
        problem = problem.subject_to(RangeLimits(2, nearest=4.0, foresee=False), nodes=2)
        return problem.subject_to(SpeedLimit(2, 2.0), nodes=2).subject_to(YawRateLimit(2, 0.7), nodes=2)
    problem = problem.subject_to_penalty(RangeLimits(2, nearest=4.0), weight=100.0, nodes=2)
    return problem.subject_to_penalty(SpeedLimit(2, 2.0), nodes=2).subject_to(FieldOfView(2, 1.0), nodes=2)


class Bare:
    """A solver that does not bring its own step, so that the ladder is taken."""

    def __init__(self, solver):
        self.name, self.solve = solver.name, solver.solve


def steps(count, seed):
    """Random steps: some follow their plan, some are pushed, some begin anew; the forecast jumps."""
    rng = np.random.default_rng(seed)
    target = np.zeros(2)
    for _ in range(count):
        kind = rng.integers(0, 4)
        if kind == 0:
            target = rng.uniform(-6.0, 6.0, 2)
        root = rng.normal(size=(PIECES + 1, 2, 2)) * 0.3
        covariance = root @ np.swapaxes(root, 1, 2)
        mean = target + np.arange(PIECES + 1)[:, None] * 0.2 * rng.normal(size=2)
        yield {
            "push": rng.normal(size=(2, 3)) * (0.0, 0.0, 0.3, 1.5)[kind],
            "reset": rng.random() < 0.2,
            "forecast": Forecast(mean[1:], covariance[1:]),
            "present": Forecast(mean[0], covariance[0]),
            "desired": np.tile([np.cos(kind), np.sin(kind)], (PIECES, 1)),
        }


def held_against(name, count, seed):
    """Differences of the step in C and of the ladder; returns how often each word was seen."""
    # solved closely: the last bits of an input, which differ between processors, decide where Newton's method stops
    planner = Planner(posed(name), "compiled", {"tolerance": 1.0e-8})
    ladder = Planner(planner.problem, Bare(planner.solver))
    state, words, different = np.zeros((2, 3)), {}, 0
    for step in steps(count, seed):
        state = state + step.pop("push")
        if step.pop("reset"):
            planner.reset()
        ladder.previous = planner.previous
        plan, other = planner.solve(state, **step), ladder.solve(state, **step)
        key = (plan.status, plan.fallback)
        words[key] = words.get(key, 0) + 1
        same = key == (other.status, other.fallback) and set(plan.given_up) == set(other.given_up)
        same &= np.abs(plan.endpoints - other.endpoints).max() < 1e-9
        different += not same
        assert plan.broken_at_start == pytest.approx(other.broken_at_start, abs=1e-9)
        state = plan.trajectory.knots[1]
    return words, different


@pytest.mark.long
@pytest.mark.parametrize("name", ["hard", "penalty"])
def test_the_ladder_takes_the_steps_of_the_generated_c(name):
    words, different = held_against(name, 60, 4)
    assert ("given up", "") in words
    assert ("solved", "") in words
    assert different == 0


@pytest.mark.parametrize(("distance", "anew"), [(1.0, True), (6.0, False)])
def test_a_long_plan_that_begins_far_inside_a_limit_does_not_go_on_from_the_last_one(distance, anew):
    problem = TrajectoryProblem(FALCON, 8, PERIOD).maximize(BearingSimilarity(2)).maximize(RangePull(2))
    problem = problem.subject_to(ThrustLimit(FALCON), nodes=2)
    planner = Planner(problem.subject_to(RangeLimits(2, nearest=4.0, foresee=False), nodes=2), "compiled")

    def plan(state, away):
        mean, spread = np.tile(state[0, :2] + np.array([away, 0.3]), (8, 1)), np.tile(0.01 * np.eye(2), (8, 1, 1))
        present = Forecast(mean[0], spread[0])
        return planner.solve(state, Forecast(mean, spread), np.tile([0.0, 1.0], (8, 1)), present=present)

    state = plan(np.zeros((2, 3)), 20.0).trajectory.knots[1]
    warm = plan(state, distance)
    planner.reset()
    cold = plan(state, distance)
    assert warm.status == ("given up" if anew else "solved")
    assert np.array_equal(warm.endpoints, cold.endpoints) == anew
    if anew:  # the one after it goes on from a plan that leads out already
        moved = cold.trajectory.knots[1]
        distance -= moved[0, 0] - state[0, 0]
        later = plan(moved, distance)
        planner.reset()
        again = plan(moved, distance)
        assert max(later.broken_at_start.values()) > 0.1
        assert not np.array_equal(later.endpoints, again.endpoints)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", ["hard", "penalty"])
def test_the_ladder_takes_ten_thousand_steps_of_the_generated_c(name, seed):
    words, different = held_against(name, 1667, seed + 1)
    assert len(words) > 2
    # the C computes limits relative to the start, so its last bits differ; a few ill-conditioned steps magnify them
    assert different <= 16


@pytest.mark.long
@pytest.mark.parametrize("degree", [2, 3])
def test_braking_in_c_is_braking_in_python(degree):
    problem = (
        TrajectoryProblem(FALCON, 5, PERIOD, degree).maximize(BearingSimilarity(2)).subject_to(ThrustLimit(FALCON))
    )
    library = ctypes.CDLL(str(build_library(kernel_files() | generate_problem(problem).files)))
    brake, rng = BrakingPlanner(problem), np.random.default_rng(0)
    for _ in range(10):
        start = rng.normal(size=(degree, 3)) * np.array([[3.0], [2.0], [1.0]])[:degree]
        found = np.empty((5, problem.freedoms))
        library.gbt_brake(ctypes.c_void_p(start.ctypes.data), ctypes.c_void_p(found.ctypes.data))
        expected = brake(start).top
        np.testing.assert_allclose(found[:2], expected[:2], rtol=1e-9, atol=1e-9)
        # each piece magnifies what rounding did to those before it
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


@pytest.mark.long
def test_what_serves_better_than_braking_in_c_does_so_in_the_ladder():
    """Random plans, also such as leave for infinity; braking itself is no worse than braking."""
    planner = Planner(posed("hard"), "compiled")
    problem, solver = planner.problem, planner.solver
    library = ctypes.CDLL(str(build_library(kernel_files() | generate_problem(problem).files)))
    ladder, rng, said = Ladder(problem, solver), np.random.default_rng(0), set()
    for number, step in enumerate(steps(40, 7)):
        start = planner.start(np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]) + step["push"])
        data = {name: step[name] for name in ("forecast", "present", "desired")}
        objectives, limits = planner._binding.objective_parameters(data), planner._binding.limit_parameters(data)
        braking = ladder._form.braking(start)
        top = braking + rng.normal(size=braking.shape) * 10.0 ** rng.uniform(-4.0, 2.0) * (number % 4 > 0)
        if number % 8 == 5:
            top = top + 1.0e30
        solver._call.fill(start, objectives, limits)
        at = (array.ctypes.data for array in (solver._call.arrays["begin"], top, solver._call.arrays["numbers"]))
        found = library.gbt_beats_braking(*map(ctypes.c_void_p, at))
        given = _Given(start, objectives, limits, np.zeros(len(problem.constraints)))
        assert bool(found) == ladder._beats_braking(given, ladder._form.trajectory(start, top))
        if number % 8 == 5:
            assert not found
        said.add((number % 4 > 0, bool(found)))
    assert {(True, True), (True, False), (False, True)} <= said


@pytest.mark.long
def test_the_present_spread_is_handed_on_to_the_c(tmp_path):
    found = verify_folder(write_c(Planner(posed("hard", lambda term: term), "compiled"), tmp_path / "planner"))
    assert found.faults == ()
    assert found.difference < 1e-9


def verified(name, formulation, degree, folder):
    changes = [f"planner.formulation={formulation}"]
    if degree is not None:
        changes.append(f"planner.degree={degree}")
    if formulation == "penalty":
        changes.append("limits.hard=[]")
    configuration = load_config(name, ["planner.solver=compiled", *changes])
    return verify_folder(write_c(build_planner(configuration, build_vehicle(configuration)), folder))


def degrees(name):
    """Of the pieces; a motion by integration has none."""
    return [None] if load_config(name).planner.form == "shooting" else [2, 3, 4]


SHIPPED = [(name, degree) for name in config_names() if not load_config(name).vehicles for degree in degrees(name)]


@pytest.mark.slow
@pytest.mark.parametrize("formulation", ["hard", "penalty"])
@pytest.mark.parametrize(("name", "degree"), SHIPPED)
def test_the_c_of_every_shipped_configuration_says_what_python_says(name, formulation, degree, tmp_path):
    found = verified(name, formulation, degree, tmp_path / "planner")
    assert found.faults == ()
    assert found.difference < 1e-9


@pytest.mark.long
def test_the_c_of_a_configuration_at_sea_says_what_python_says(tmp_path):
    found = verified("sea2d", "hard", 2, tmp_path / "planner")
    assert found.faults == ()
    assert found.vectors == 20
    assert found.difference < 1e-9
