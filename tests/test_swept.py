"""The desired bearing of a vehicle that moves at a speed of its own."""

import math

import numpy as np
import pytest

from gbt_ocp import ConfigurationError, load_config
from gbt_ocp.experiments.build.desired import build_desired_bearing, paced, unreachable_bearings
from gbt_ocp.experiments.build.loop import build_vehicle
from gbt_ocp.guidance import SweptBearing
from gbt_ocp.models.bearings import DesiredBearing


def paths(dimension: int, velocity: list[float], speed: float, reverse: float = math.inf, rate: float = 0.1):
    """Positions of a vehicle that sees what it desires from 36 m, and of its target, each 10 ms."""
    period, distance = 0.01, 36.0
    turn = DesiredBearing(dimension, rate, reverse=reverse)
    line = distance * turn.direction(0.7)
    target = period * np.arange(1601)[:, None] * np.array(velocity)
    swept = SweptBearing(turn, speed).sweeping_from(0.0, line, target, period)
    return target - distance * swept(period * np.arange(1601)), target, period


@pytest.mark.parametrize("reverse", [math.inf, 8.0])
@pytest.mark.parametrize("rate", [0.1, -0.1])
@pytest.mark.parametrize("velocity", [[0.0, 0.0], [1.0, 0.5], [0.3, -1.2, 0.4]])
def test_a_vehicle_that_sees_what_it_desires_keeps_its_speed_whatever_the_target_does(velocity, rate, reverse):
    own, _, period = paths(len(velocity), velocity, 2.9, reverse, rate)
    speed = np.linalg.norm(np.diff(own, axis=0), axis=1) / period
    assert np.allclose(speed, 2.9, atol=0.01)


def test_it_goes_forth_and_back_across_the_line_of_sight():
    own, target, _ = paths(2, [0.0, 0.0], 2.9, 8.0)
    line = np.unwrap(np.arctan2(*(target - own).T[::-1]))
    assert line[800] - line[0] == pytest.approx(8.0 * 2.9 / 36.0)
    assert line[1600] == pytest.approx(line[0])


@pytest.mark.parametrize("rate", [0.1, -0.1])
@pytest.mark.parametrize("late", [0.0, 0.3, 0.49, 0.51, 0.8])
def test_plans_that_do_not_begin_with_a_leg_turn_at_their_knots(late, rate):
    """Bearings at the ends of pieces reach as far as legs of 8 s do, whenever in its first second the plan begins."""
    turn = DesiredBearing(2, rate, reverse=8.0)
    swept = SweptBearing(turn, 2.0).sweeping_from(late, [36.0, 0.0], np.zeros((21, 2)), 1.0)
    steps = np.round(np.diff(swept.angles) * 36.0 / 2.0 * math.copysign(1.0, rate), 9)
    turns = round(8.0 - late)
    assert np.array_equal(steps, [1.0] * turns + [-1.0] * 8 + [1.0] * (12 - turns))


def test_legs_within_a_piece_are_averaged():
    turn = DesiredBearing(2, 0.1, reverse=0.4)
    swept = SweptBearing(turn, 2.0).sweeping_from(0.0, [36.0, 0.0], np.zeros((3, 2)), 1.0)
    assert np.allclose(np.diff(swept.angles), np.array([0.2, 0.2]) * 2.0 / 36.0)


def test_a_target_that_is_faster_is_still_seen_from_the_side():
    own, target, period = paths(2, [4.0 * math.cos(0.7), 4.0 * math.sin(0.7)], 2.9)
    across = np.diff(np.unwrap(np.arctan2(*(target - own).T[::-1])))[0] * 36.0 / period
    assert across == pytest.approx(0.3 * 2.9)


def test_between_plans_it_goes_on_and_before_the_first_it_turns_by_the_clock():
    turn = DesiredBearing(2, 0.1)
    swept = SweptBearing(turn, 2.0)
    assert np.array_equal(swept([0.0, 3.0]), turn([0.0, 3.0]))
    begun = swept.sweeping_from(5.0, [30.0, 0.0], np.zeros((4, 2)), 1.0)
    angle = np.arctan2(*begun([5.0, 5.5, 8.0, 9.0]).T[::-1])
    assert np.allclose(angle, np.array([0.0, 0.5, 3.0, 3.0]) * 2.0 / 30.0)
    assert np.array_equal(swept.reversing_from(5.0, [30.0, 0.0], [0.0, 1.0]).turn(1.0), turn(1.0)), "no legs, no change"


@pytest.mark.parametrize("speed", [0.0, -1.0, math.nan])
def test_a_speed_is_above_zero(speed):
    with pytest.raises(ValueError, match="speed: found"):
        SweptBearing(DesiredBearing(2, 0.1), speed)


def test_at_sea_a_speed_replaces_the_time_of_a_turn():
    configuration = load_config("sea2d", ["desired_bearing.speed_mps=2.7"])
    vehicle = build_vehicle(configuration)
    desired = paced(configuration, build_desired_bearing(configuration, vehicle), vehicle)
    assert isinstance(desired, SweptBearing)
    assert (desired.speed, desired.turn.reverse) == (2.7, configuration.desired_bearing.reverse_s)
    assert unreachable_bearings(configuration, vehicle) == []
    fast = load_config("sea2d", ["desired_bearing.speed_mps=6"])
    (line,) = unreachable_bearings(fast, vehicle)
    assert line == f"desired_bearing.speed_mps: found 6; the vehicle reaches {fast.limits.speed:.3g} m/s"
    for key in ("period_s=90", "target_speed=0.5"):
        with pytest.raises(ConfigurationError, match=r"only with desired_bearing\.speed_mps: sensor or null"):
            load_config("sea2d", [f"desired_bearing.{key}", "desired_bearing.speed_mps=2.7"])
        load_config("sea2d", [f"desired_bearing.{key}", "desired_bearing.speed_mps=sensor"])


@pytest.mark.parametrize("slow", ["vehicle.model=torpedo2d", "vehicle.model=vessel", "limits.speed=2"])
def test_a_slow_vehicle_turns_by_the_clock(slow):
    found = load_config("sea2d", [slow])
    assert found.desired_bearing.speed_mps == "sensor"
    assert found.desired_bearing.reverse_s >= 12.0
