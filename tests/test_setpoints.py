"""Setpoints out of plans, and the autopilot that follows them."""

import math

import numpy as np
import pytest

import gbt_ocp as gbt
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.models import KNOWN_VEHICLES
from gbt_ocp.ocp.plan import Plan
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.pilot import Setpoint, setpoint_of
from gbt_ocp.simulation.autopilot import Autopilot
from gbt_ocp.simulation.flow import Flow
from gbt_ocp.simulation.mover import Mover
from gbt_ocp.simulation.plant import Motion, Plant


def held(dimension, speed, heading, depth=0.0, water=None):
    """A setpoint of a constant velocity through the water along a heading."""
    pose = np.zeros(dimension + 1)
    pose[-1] = heading
    if dimension == 3:
        pose[2] = -depth
    velocity = np.zeros(dimension + 1)
    flow = np.zeros(dimension) if water is None else np.asarray(water, dtype=float)
    # body velocity over ground: along the bow through the water, and the water
    velocity[0] = speed + flow[0] * math.cos(heading) + flow[1] * math.sin(heading)
    velocity[1] = -flow[0] * math.sin(heading) + flow[1] * math.cos(heading)
    return Setpoint(0.0, pose, velocity, flow)


def test_a_setpoint_says_course_speed_heading_and_depth():
    found = held(3, 1.2, 0.5, depth=7.0, water=[0.0, 0.4, 0.0])
    assert found.speed == pytest.approx(1.2)
    assert found.heading == 0.5
    assert found.depth == 7.0
    east, north = 1.2 * math.cos(0.5), 1.2 * math.sin(0.5) + 0.4
    assert found.course == pytest.approx(math.atan2(north, east))
    assert held(2, 1.0, 0.0).depth is None


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_autopilot_answers_as_its_equations_say(dimension):
    """Small steps, so that no thrust is clipped: 1 - e^(-t/τ) in speed, 1 - (1 + t/τ) e^(-t/τ) in heading and depth."""
    vehicle, lag = KNOWN_VEHICLES["bluerov2_heavy"].make(dimension), 1.0
    autopilot, plant = Autopilot(vehicle, lag), Plant(vehicle)
    setpoint = held(dimension, 0.1, 0.2, depth=-0.1)
    motion, state = Motion(plant), np.zeros(2 * dimension + 2)
    for _ in range(100):
        thrust = autopilot.thrust(setpoint, *vehicle.flat(state))
        state = motion.advance(state, lambda s, held=thrust: held, 0.02)
    z, dz = vehicle.flat(state)
    first, second = 1.0 - math.exp(-2.0), 1.0 - 3.0 * math.exp(-2.0)
    np.testing.assert_allclose(dz[:2], first * setpoint.through_water[:2], atol=2e-3)
    assert z[dimension] == pytest.approx(second * 0.2, abs=4e-3)
    if dimension == 3:
        assert z[2] == pytest.approx(second * 0.1, abs=2e-3)


def test_in_water_that_moves_the_vehicle_keeps_its_speed_through_it():
    vehicle = KNOWN_VEHICLES["bluerov2_heavy"].make(2)
    autopilot, water = Autopilot(vehicle, 0.5), np.array([0.0, 0.3])
    motion, state = Motion(Plant(vehicle, flow=Flow(water))), np.zeros(6)
    for _ in range(400):
        thrust = autopilot.thrust(held(2, 0.4, 0.0, water=water), *vehicle.flat(state))
        state = motion.advance(state, lambda s, held=thrust: held, 0.02)
    np.testing.assert_allclose(vehicle.flat(state)[1][:2], [0.4, 0.3], atol=0.01)


def test_a_plan_gives_its_own_state_as_a_setpoint_and_its_end_beyond_it():
    vehicle = KNOWN_VEHICLES["falcon"].make(2)
    trajectory = FlatTrajectory(0.5, np.array([[0.0, 0.0, 0.3], [1.0, 0.5, 0.0]]), np.array([[0.2, -0.1, 0.1]] * 2))
    plan = Plan.__new__(Plan)
    object.__setattr__(plan, "trajectory", trajectory)
    object.__setattr__(plan, "current", None)
    found = setpoint_of(plan, vehicle, 0.7, 9.0)
    np.testing.assert_allclose(found.pose, trajectory(0.7), atol=1e-12)
    np.testing.assert_allclose(found.over_ground, trajectory(0.7, 1)[:2], atol=1e-12)
    np.testing.assert_allclose(setpoint_of(plan, vehicle, 5.0, 9.0).pose, trajectory(1.0), atol=1e-12)


def test_a_run_with_setpoints_keeps_its_target():
    run = gbt.run("case2", overrides=["duration_s=4", "command=setpoint", "plant.autopilot_s=0.1"], seed=1)
    thrust = gbt.run("case2", overrides=["duration_s=4"], seed=1)
    assert run.summary["off_plan_max"] > 0.0
    assert run.summary["error_final"] < 10.0 * thrust.summary["error_final"] + 0.05
    assert run.history.piece_thrust_peak[:-1].max() <= 1.0 + 1e-9


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (["command=setpoint", "vehicle.follow=feedback"], 'vehicle.follow: found "feedback"; allowed: exact'),
        (["plant.autopilot_s=0.5"], "plant.autopilot_s: found 0.5; allowed: 1.0, the default, without command"),
        (["command=setpoint", "guidance.kind=random"], "command: found setpoint; allowed: thrust"),
    ],
)
def test_keys_that_would_do_nothing_are_refused(lines, says):
    with pytest.raises(ConfigurationError, match=says.replace("(", r"\(")):
        load_config("case2", lines)


def test_a_mover_with_an_autopilot_takes_no_thrust_of_the_plan():
    vehicle = KNOWN_VEHICLES["falcon"].make(2)
    with pytest.raises(ValueError, match="found exact beside a plant"):
        Mover(vehicle, 0.1, "exact", Plant(vehicle, lag=0.2))
    Mover(vehicle, 0.1, "exact", Plant(vehicle, lag=0.2), autopilot=1.0)
