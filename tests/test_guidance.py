from types import SimpleNamespace

import numpy as np
import pytest

from gbt_ocp.guidance.open_loop import ConstantForce, RandomThrust, Static
from gbt_ocp.guidance.planned import PlannedMotion
from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.models.fossen import FALCON_2D, FossenVehicle
from gbt_ocp.tracking.protocol import Forecast

VEHICLE = FossenVehicle(FALCON_2D, [5000.0, 5000.0, 1500.0])
ANY = (np.zeros((2, 3)), Forecast(np.zeros((12, 2)), np.zeros((12, 2, 2))))


def test_static_does_nothing():
    np.testing.assert_array_equal(Static(VEHICLE).decide(3.0, *ANY), np.zeros(3))


def test_constant_force_is_held_within_the_limits():
    np.testing.assert_array_equal(ConstantForce(VEHICLE, [500.0, -500.0, 0.0]).decide(0.0, *ANY), [500.0, -500.0, 0.0])
    np.testing.assert_array_equal(ConstantForce(VEHICLE, [9e9, -9e9, 1.0]).decide(9.0, *ANY), [5000.0, -5000.0, 1.0])


@pytest.mark.parametrize("force", [[500.0], [500.0, 500.0], [1.0, 2.0, 3.0, 4.0], 500.0, [1.0, np.nan, 0.0]])
def test_a_force_that_does_not_fit_the_vehicle_is_refused(force):
    with pytest.raises(ValueError, match=r"guidance\.force: found .*; allowed: 3 finite numbers"):
        ConstantForce(VEHICLE, force)


def test_random_thrust_is_held_and_stays_within_the_limits():
    law = RandomThrust(VEHICLE, 0.5, np.random.default_rng(1))
    drawn = np.array([law.decide(0.1 * k, *ANY) for k in range(4000)])
    held = drawn.reshape(-1, 5, 3)
    np.testing.assert_array_equal(held, np.repeat(held[:, :1], 5, axis=1))
    share = held[:, 0] / VEHICLE.thrust_max
    assert np.all(np.abs(share) <= 1.0)
    assert np.all(np.any(np.diff(share, axis=0) != 0.0, axis=1))
    # Uniform: mean 0, variance 1/3; 800 draws.
    np.testing.assert_allclose(share.mean(axis=0), 0.0, atol=5.0 / np.sqrt(3.0 * 800))
    np.testing.assert_allclose(share.var(axis=0), 1.0 / 3.0, rtol=0.15)


def test_random_thrust_depends_on_time_and_not_on_how_often_it_is_asked():
    often, seldom = (RandomThrust(VEHICLE, 1.0, np.random.default_rng(2)) for _ in range(2))
    every = {k: often.decide(0.1 * k, *ANY) for k in range(60)}
    for k in (0, 25, 59):
        np.testing.assert_array_equal(seldom.decide(0.1 * k, *ANY), every[k])


def test_the_planner_gets_forecast_and_desired_bearings_of_its_endpoints():
    asked = []
    planner = SimpleNamespace(
        problem=SimpleNamespace(period=0.2, pieces=3, joined=2),
        solve=lambda state, forecast, desired, present: asked.append((state, forecast, desired)),
    )
    mean = np.arange(24.0).reshape(12, 2)
    forecast = Forecast(mean, np.broadcast_to(np.eye(2), (12, 2, 2)) * mean[:, :1, None])
    rate = 1.3
    PlannedMotion(planner, DesiredBearing(2, rate)).decide(5.0, ANY[0], forecast)
    state, ahead, desired = asked[0]
    np.testing.assert_array_equal(state, ANY[0])
    # The forecast begins now, at t_k; the first endpoint is t_{k+1}.
    np.testing.assert_array_equal(ahead.mean[:3], mean[1:4])
    np.testing.assert_array_equal(ahead.covariance[:3], forecast.covariance[1:4])
    angles = rate * np.array([5.2, 5.4, 5.6])
    np.testing.assert_allclose(desired, np.stack([np.cos(angles), np.sin(angles)], axis=-1), atol=1e-12)
