"""Followers of vehicles that are not their model: what is estimated, and thrusters that lag; in C too."""

import ctypes
import math

import numpy as np
import pytest
from pilots_in_c import closed_loop
from test_codegen import fossen
from test_pilot_in_c import only_bearings

import gbt_ocp as gbt
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.models.vehicles import PlanarPointMass
from gbt_ocp.ocp import FlatTrajectory
from gbt_ocp.ocp.codegen.library import build_library, find_compiler, kernel_files
from gbt_ocp.ocp.codegen.problem_source import generate_problem
from gbt_ocp.ocp.disturbance import DisturbanceObserver
from gbt_ocp.ocp.thrusters import QUICKER, LaggingThrusters
from gbt_ocp.pilot.plan_follower import PlanFollower
from gbt_ocp.simulation.plant import Motion, Plant, scaled

PLANAR = FossenVehicle(FALCON_2D, [5000.0, 5000.0, 1500.0])
HOLD = 0.02
EXACT_MODEL = {"mass": 1.0, "added_mass": 1.0, "drag": 1.0}


def furthest_off(plant, lag=None, duration=4.0):
    """Largest distance from a plan in its second half, on which the vehicle begins."""
    top = np.array([[0.5, 0.2, 0.1], [0.2, -0.4, -0.2], [-0.3, 0.3, 0.2], [0.1, 0.3, -0.1]])
    plan = FlatTrajectory(1.0, np.array([[0.0, 0.0, 0.3], [1.0, 0.2, 0.1]]), top)
    follower, motion = PlanFollower(PLANAR, lag=lag), Motion(plant)
    state, off = PLANAR.state(*plan.start), []
    for k in range(round(duration / HOLD)):
        now = k * HOLD
        z, dz = PLANAR.flat(state)
        off.append(np.linalg.norm(plan(now)[:2] - z[:2]))
        thrust = follower.thrust(plan, now, now + 0.5 * HOLD, np.zeros(2), z, dz, HOLD if k else 0.0)
        state = motion.advance(state, lambda s, thrust=thrust: thrust, HOLD)
    return max(off[len(off) // 2 :])


@pytest.mark.parametrize(
    ("factors", "more"),
    [
        ({"mass": 1.5, "added_mass": 1.5, "drag": 1.5}, {}),
        (EXACT_MODEL, {"thrust": 0.8}),
        (EXACT_MODEL, {"force": [40.0, -40.0, 0.0]}),
    ],
    ids=["heavier", "weaker", "pushed"],
)
def test_what_the_vehicle_needs_beyond_its_model_is_added(factors, more):
    plant = Plant(FossenVehicle(scaled(FALCON_2D, **factors), PLANAR.thrust_max), **more)
    without, observed = furthest_off(plant), furthest_off(plant, lag=0.0)
    assert without > 5e-3
    assert observed < without / 2.5


def test_on_the_model_nothing_is_added():
    assert furthest_off(Plant(PLANAR), lag=0.0) < 1e-3


def course_kept(yaw, speed, seconds=3.0):
    """Yaw in the end of a vehicle half as heavy again as its model, that begins askew of a straight plan."""
    heavier = FossenVehicle(scaled(FALCON_2D, mass=1.5, added_mass=1.5, drag=1.5), PLANAR.thrust_max)
    follower, motion = PlanFollower(PLANAR, lag=0.0), Motion(Plant(heavier, thrust=0.9))
    plan = FlatTrajectory(seconds, np.array([[0.0, 0.0, 0.0], [speed, 0.0, 0.0]]), np.zeros((1, 3)))
    state = PLANAR.state(np.array([0.0, 0.0, yaw]), plan.start[1])
    for k in range(round(seconds / HOLD)):
        now, (z, dz) = k * HOLD, PLANAR.flat(state)
        thrust = follower.thrust(plan, now, now + 0.5 * HOLD, np.zeros(2), z, dz, HOLD if k else 0.0)
        state = motion.advance(state, lambda s, thrust=thrust: thrust, HOLD)
    return state[2]


@pytest.mark.parametrize("yaw", [-1.2, 0.8])
def test_a_vehicle_that_cannot_turn_against_its_munk_moment_is_slowed_down_until_it_can(yaw, monkeypatch):
    assert abs(course_kept(yaw, 3.0)) < 0.1
    monkeypatch.setattr("gbt_ocp.ocp.follower.TURN_SHARE", 1e9)
    assert abs(course_kept(yaw, 3.0)) > 1.0, "it stays broadside"
    assert abs(course_kept(yaw, 2.0)) < 0.1, "the moment goes with the square of the speed"


def test_a_constant_force_is_estimated_as_it_is():
    mass = PlanarPointMass(2.0, 0.0, (50.0, 50.0))
    observer, force, asked = DisturbanceObserver(mass), np.array([3.0, -4.0]), np.array([1.0, 5.0])
    state, t = np.zeros(4), 0.0
    for _ in range(100):
        z, dz = mass.flat(state)
        found = observer.observe(z, dz, asked, HOLD)
        # the exact motion under a constant acceleration
        acceleration = (asked + force) / 2.0
        state = mass.state(z + HOLD * dz + 0.5 * HOLD**2 * acceleration, dz + HOLD * acceleration)
        t += HOLD
    np.testing.assert_allclose(found, -force, rtol=2e-2)
    assert observer.observe(*mass.flat(state), asked, 9.0) is observer.estimate, "too long ago to tell"


@pytest.mark.parametrize("step", [0.1, 0.9])
def test_lagging_thrusters_act_after_a_tenth_of_their_lag(step):
    lag, wanted = 0.3, step * PLANAR.thrust_max
    thrusters, acting, found = LaggingThrusters(PLANAR, lag), np.zeros(3), []
    for k in range(40):
        asked = thrusters.ask(wanted, HOLD if k else 0.0, HOLD)
        assert np.all(np.abs(asked) <= PLANAR.thrust_max)
        before = acting
        acting = asked + (acting - asked) * math.exp(-HOLD / lag)
        # the mean of what acts, by many points
        points = asked + (before - asked) * np.exp(-np.linspace(0.0, HOLD, 20001)[:, None] / lag)
        np.testing.assert_allclose(thrusters.acted(HOLD), points.mean(axis=0), rtol=1e-4)
        found.append(acting[0] / wanted[0])
    late = next(k for k, share in enumerate(found) if share > 1.0 - math.exp(-1.0)) * HOLD
    # limits make a large step slower
    assert late <= QUICKER * lag + HOLD if step < 0.2 else late < lag
    assert found[-1] == pytest.approx(1.0, abs=5e-3)
    assert np.all(np.diff(found) >= 0.0), "no overshoot"


def test_a_lag_that_is_known_takes_a_vehicle_less_off_its_plan():
    plant = Plant(PLANAR, lag=0.3)
    assert furthest_off(plant, lag=0.3) < furthest_off(plant) / 3.0


class _Thrusters(ctypes.Structure):
    _fields_ = [("lag", ctypes.c_double), ("asked", ctypes.c_double * 4), ("acting", ctypes.c_double * 4)]


class _Disturbance(ctypes.Structure):
    _fields_ = [("known", ctypes.c_int), *((name, ctypes.c_double * 4) for name in ("z", "dz", "estimate"))]


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
@pytest.mark.parametrize("lag", [0.0, 0.2])
def test_thrusters_and_the_estimate_in_c_are_those_of_python(lag):
    problem = fossen(3, "penalty")
    vehicle = FossenVehicle(FALCON_3D, problem.vehicle.thrust_max)
    library = ctypes.CDLL(str(build_library(kernel_files() | generate_problem(problem).files)))
    real, pointer = ctypes.c_double, ctypes.c_void_p
    library.gbt_thrusters_init.argtypes = [pointer, real]
    library.gbt_thrusters_ask.argtypes = [pointer, real, real, pointer]
    library.gbt_thrusters_acted.argtypes = [pointer, real, pointer]
    library.gbt_disturbance_init.argtypes = [pointer]
    library.gbt_disturbance_observe.argtypes = [pointer, pointer, pointer, pointer, real]
    thrusters, disturbance = _Thrusters(), _Disturbance()
    library.gbt_thrusters_init(ctypes.byref(thrusters), lag)
    library.gbt_disturbance_init(ctypes.byref(disturbance))
    python, observer, rng = LaggingThrusters(vehicle, lag), DisturbanceObserver(vehicle), np.random.default_rng(3)
    z, dz = np.zeros(4), np.zeros(4)
    for number in range(300):
        passed, hold = rng.choice([0.0, 0.01, 0.1, 0.7], p=[0.1, 0.5, 0.3, 0.1]), rng.uniform(0.005, 0.1)
        dz = dz + rng.normal(scale=0.5, size=4) * hold
        z = z + passed * dz
        acted = np.zeros(4)
        library.gbt_thrusters_acted(ctypes.byref(thrusters), passed, acted.ctypes.data)
        np.testing.assert_allclose(acted, python.acted(passed), rtol=1e-12, atol=1e-9)
        library.gbt_disturbance_observe(
            ctypes.byref(disturbance), z.ctypes.data, dz.ctypes.data, acted.ctypes.data, passed
        )
        found = observer.observe(z, dz, acted, passed)
        np.testing.assert_allclose(list(disturbance.estimate), found, rtol=1e-10, atol=1e-7)
        wanted = rng.uniform(-1.0, 1.0, 4) * vehicle.thrust_max
        asked = wanted.copy()
        library.gbt_thrusters_ask(ctypes.byref(thrusters), passed, hold, asked.ctypes.data)
        np.testing.assert_allclose(asked, python.ask(wanted, passed, hold), rtol=1e-12, atol=1e-9)
        if number == 150:
            observer.forget()
            disturbance.known = 0
    assert np.abs(observer.estimate).max() > 100.0


@pytest.mark.long
@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
@pytest.mark.parametrize("lag", [0.0, 0.05])
def test_a_pilot_that_follows_with_feedback_gives_the_commands_of_python(lag):
    """The vehicle of this loop has thrusters that do not lag, so that one of the pilots is off its plan."""
    changes = ["tracker.kind=ekf", "tracker.engine=compiled", "sensor.noise_deg=0.5", "vehicle.follow=feedback"]
    exact = "planner.solver_options={compiled: {tolerance: 1.0e-7, gap: 1.0e-9}}"
    config = gbt.load_config("case2", [*changes, exact, f"vehicle.thrust_lag_s={lag}"])
    pilot = closed_loop(config, 4.0, only_bearings, interval=(0.01, 0.12))
    assert pilot.commands > 50
    assert pilot.worst < 1e-8


@pytest.mark.parametrize(
    "given",
    [["vehicle.thrust_lag_s=0.3"], ["vehicle.thrust_lag_s=0.3", "vehicle.follow=feedback", "planner.form=shooting"]],
)
def test_a_known_lag_that_nothing_makes_up_for_is_refused(given):
    with pytest.raises(gbt.ConfigurationError, match=r"vehicle\.thrust_lag_s: found 0\.3; allowed: null without"):
        gbt.load_config("case2", given)
