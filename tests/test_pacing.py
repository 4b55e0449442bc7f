import numpy as np
import pytest

from gbt_ocp.guidance.pacing import FASTEST, PacedBearing, circling_speed, largest_speed, steady_speed
from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.models.fossen import FALCON_2D, FossenVehicle
from gbt_ocp.models.vehicles import PlanarPointMass


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_near_target_leaves_the_bearing_as_it_is(dimension):
    desired = DesiredBearing(dimension, 6.0)
    paced = PacedBearing(desired, 3.0)
    for time in (0.0, 0.1, 0.2):
        paced.pace(time, 0.01)
    np.testing.assert_allclose(paced([0.2, 0.5, 3.0]), desired([0.2, 0.5, 3.0]), atol=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_going_round_a_far_target_asks_for_no_more_than_the_speed(dimension):
    paced = PacedBearing(DesiredBearing(dimension, 6.0), 3.0)
    paced.pace(1.0, 8.0)
    step = 1e-4
    path = -8.0 * paced([2.0, 2.0 + step])
    assert np.linalg.norm(path[1] - path[0]) / step == pytest.approx(3.0, rel=1e-3)


def test_a_change_of_pace_does_not_make_the_bearing_jump():
    paced = PacedBearing(DesiredBearing(2, 6.0), 3.0)
    rng = np.random.default_rng(0)
    for time in 0.1 * np.arange(1, 20):
        before = paced(time)
        paced.pace(time, rng.uniform(0.1, 20.0))
        np.testing.assert_allclose(paced(time), before, atol=1e-12)


def test_reversals_are_by_the_clock_whatever_the_pace():
    paced = PacedBearing(DesiredBearing(2, 6.0, reverse=2.0), 3.0)
    rng = np.random.default_rng(1)
    angle, fine = 0.0, 1e-3
    for time in np.arange(0.0, 8.0, 0.5):
        distance = rng.uniform(0.2, 20.0)
        paced.pace(time, distance)
        np.testing.assert_allclose(paced(time), [np.cos(angle), np.sin(angle)], atol=1e-9)
        sense = 1.0 if time % 4.0 < 2.0 else -1.0
        angle += 0.5 * sense * min(6.0, 3.0 / distance)
        ahead = paced(time + fine)
        assert np.sign(ahead[1] * paced(time)[0] - ahead[0] * paced(time)[1]) == sense


def test_no_speed_is_refused():
    with pytest.raises(ValueError, match="speed"):
        PacedBearing(DesiredBearing(2, 6.0), 0.0)


def test_the_steady_speed_is_where_the_forward_dynamics_stop_accelerating():
    vehicle = FossenVehicle(FALCON_2D, (500.0, 500.0, 150.0))
    speeds = []
    for axis in range(2):
        thrust = np.zeros(3)
        thrust[axis] = 500.0
        state = np.zeros(6)
        for _ in range(4000):
            # straight ahead: only the motion along the axis is integrated
            state[3 + axis] += 0.01 * vehicle.rates(state, thrust)[3 + axis]
        speeds.append(state[3 + axis])
    assert steady_speed(vehicle) == pytest.approx(np.sqrt(speeds[0] * speeds[1]), rel=1e-4)


def test_without_drag_there_is_none():
    assert steady_speed(PlanarPointMass(1.0, 0.0)) is None
    assert steady_speed(PlanarPointMass(1.0, 0.5, (1.0, 1.0))) == pytest.approx(2.0, rel=1e-6)


@pytest.mark.parametrize("speed", [1e-3, 0.7, 1.0, 37.0, 999.0])
def test_the_largest_speed_is_where_the_load_reaches_one(speed):
    assert largest_speed(lambda v: (v / speed) ** 2) == pytest.approx(speed, rel=1e-12)


def test_a_load_that_never_reaches_one_has_no_largest_speed():
    assert largest_speed(lambda v: v / (2.0 * FASTEST)) is None
    free = PlanarPointMass(1.0, 0.0)
    assert steady_speed(free) is None
    # without drag only the centripetal force limits the speed: m v² / R = τ_max
    assert circling_speed(free, 100.0) == pytest.approx(10.0)
    assert circling_speed(free, 1e12) == FASTEST
