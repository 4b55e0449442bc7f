"""Water that moves: the plant in it, the plans for it, the estimate of it."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gbt_ocp as gbt
from gbt_ocp.guidance.current import CurrentObserver, KnownCurrent
from gbt_ocp.guidance.water import OverGround
from gbt_ocp.models import FALCON_2D, FALCON_3D, FossenVehicle, PlanarPointMass
from gbt_ocp.ocp import FlatPoint, FlatTrajectory, KeepOut, KeepOutPolygon
from gbt_ocp.simulation.flow import Flow
from gbt_ocp.simulation.plant import Motion, Plant

LIMIT = (5000.0, 5000.0, 1500.0)
VEHICLES = {2: FossenVehicle(FALCON_2D, LIMIT), 3: FossenVehicle(FALCON_3D, (5000.0, 5000.0, 5000.0, 1500.0))}


def fossen_in_current(vehicle, state, thrust, water):
    """Fossen 2011, equation 8.29, with matrices: all forces act on the velocity through the water."""
    n = vehicle.flat_dimension
    pose, nu = state[:n], state[n:]
    turn = np.eye(n)
    turn[:2, :2] = [[np.cos(pose[-1]), -np.sin(pose[-1])], [np.sin(pose[-1]), np.cos(pose[-1])]]
    flow = turn.T @ np.append(water, 0.0)
    through = nu - flow
    swirl = np.zeros((n, n))  # the body turns in water of constant velocity: dν_c/dt = -S(r) ν_c
    swirl[0, 1], swirl[1, 0] = -nu[-1], nu[-1]
    inertia = np.diag(vehicle.parameters.inertia_diagonal)
    resistance = (vehicle.coriolis_matrix(through) + vehicle.damping_matrix(through)) @ through
    return np.concatenate([turn @ nu, np.linalg.solve(inertia, thrust - resistance) - swirl @ flow])


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_plant_obeys_fossens_equations_in_a_current(dimension):
    vehicle, rng = VEHICLES[dimension], np.random.default_rng(4)
    water = rng.normal(0.0, 0.5, dimension)
    motion = Motion(Plant(vehicle, flow=Flow(water)))
    state = np.concatenate(
        [rng.normal(0.0, 5.0, dimension), rng.uniform(-3, 3, 1), rng.normal(0.0, 1.0, dimension + 1)]
    )
    thrust = 0.1 * rng.uniform(-1.0, 1.0, dimension + 1) * vehicle.thrust_max
    expected = solve_ivp(
        lambda t, x: fossen_in_current(vehicle, x, thrust, water), (0.0, 0.4), state, rtol=1e-10, atol=1e-12
    ).y[:, -1]
    for _ in range(4):
        state = motion.advance(state, lambda s: thrust, 0.1)
    np.testing.assert_allclose(state, expected, atol=2e-7)


def test_a_vehicle_without_thrust_drifts_with_the_water():
    motion = Motion(Plant(VEHICLES[2], flow=Flow((0.3, -0.4))))
    state = np.zeros(6)
    for _ in range(600):
        state = motion.advance(state, lambda s: np.zeros(3), 0.5)
    np.testing.assert_allclose(VEHICLES[2].flat(state)[1][:2], (0.3, -0.4), atol=2e-3)


def test_the_flow_is_sheared_and_varies_slowly():
    sheared = Flow((0.5, 0.0, 0.0), shear=(-0.01, 0.02, 0.0))
    np.testing.assert_allclose(sheared.velocity(3.0, 10.0), (0.4, 0.2, 0.0))
    slow = Flow((0.2, 0.1), std=0.1, correlation_time=50.0, rng=np.random.default_rng(1))
    values = np.array([slow.velocity(t) for t in np.arange(0.0, 40000.0, 10.0)])
    np.testing.assert_allclose(values.mean(axis=0), (0.2, 0.1), atol=0.015)
    np.testing.assert_allclose(values.std(axis=0), 0.1, atol=0.012)
    lagged = [np.corrcoef(values[:-5, axis], values[5:, axis])[0, 1] for axis in range(2)]
    np.testing.assert_allclose(lagged, np.exp(-1.0), atol=0.06)


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_the_observer_finds_the_current_and_says_how_well(dimension):
    """Twenty vehicles with noisy rates, pushed about at random: estimates against what was simulated."""
    vehicle, rng = VEHICLES[dimension], np.random.default_rng(8)
    scores = []
    for _ in range(20):
        water = rng.normal(0.0, 0.4, dimension)
        motion, observer = Motion(Plant(vehicle, flow=Flow(water))), CurrentObserver(vehicle)
        state = np.zeros(2 * dimension + 2)
        last = np.array(vehicle.flat(state))
        for step in range(300):
            if step % 10 == 0:
                thrust = 0.1 * rng.uniform(-1.0, 1.0, dimension + 1) * vehicle.thrust_max
            state = motion.advance(state, lambda s, held=thrust: held, 0.1)
            seen = np.array(vehicle.flat(state))
            seen[1] += 0.003 * rng.standard_normal(dimension + 1)
            observer.observe(last, seen, thrust, 0.1)
            last = seen
        wrong = observer.velocity - water
        assert np.linalg.norm(wrong) < 0.05
        scores.append(wrong @ np.linalg.solve(observer.covariance, wrong) / dimension)
    assert np.mean(scores) < 2.0  # not sure of what is wrong


def test_the_observer_crosses_a_full_turn_of_the_yaw_and_passes_over_what_is_not_finite():
    vehicle = VEHICLES[2]
    observer = CurrentObserver(vehicle)
    before, after = np.zeros((2, 3)), np.zeros((2, 3))
    before[0, 2], after[0, 2] = np.pi - 0.01, -np.pi + 0.01
    before[1] = after[1] = (0.3, 0.2, 0.2)
    observer.observe(before, after, np.zeros(3), 0.1)
    known = observer.velocity
    assert np.linalg.norm(known) < 2.0
    observer.observe(before, np.full((2, 3), np.nan), np.zeros(3), 0.1)
    np.testing.assert_array_equal(observer.velocity, known)


def test_a_trajectory_seen_from_the_water_is_the_same_motion():
    rng = np.random.default_rng(2)
    trajectory = FlatTrajectory(0.5, rng.normal(size=(2, 3)), rng.normal(size=(4, 6)))
    moved = trajectory.moving((0.3, -0.2))
    times = np.linspace(0.0, 2.0, 9)
    drift = np.outer(times, (0.3, -0.2, 0.0))
    np.testing.assert_allclose(moved(times), trajectory(times) + drift, atol=1e-12)
    np.testing.assert_allclose(moved(times, 1), trajectory(times, 1) + np.array((0.3, -0.2, 0.0)), atol=1e-12)
    np.testing.assert_allclose(moved(times, 2), trajectory(times, 2), atol=1e-12)


@pytest.mark.parametrize("zone", [KeepOut((1.0, 2.0), 0.5), KeepOutPolygon(((0.0, 0.0), (1.0, 0.0), (0.5, 1.0)))])
def test_a_zone_over_ground_is_where_it_is(zone):
    limit = OverGround(zone, KnownCurrent((0.3, -0.4)), 0.5)
    numbers = limit.bind(3, {})["drift"]
    assert numbers.shape == (4, 2, 1)
    place = np.array([0.7, 0.1, 0.2])
    through = place - np.append(2 * 0.5 * np.array([0.3, -0.4]), 0.0)
    seen = limit.value(FlatPoint(through, np.zeros(3), np.zeros(3)), {"drift": ca.DM(numbers[2])})
    still = zone.value(FlatPoint(place, np.zeros(3), np.zeros(3)))
    assert float(seen) == pytest.approx(float(still), abs=1e-12)


def _run(*overrides, name="case2", seconds=4.0):
    given = [f"duration_s={seconds}", "vehicle.follow=feedback", *overrides]
    return gbt.run(name, overrides=given, seed=101)


@pytest.mark.long
def test_a_current_that_is_known_or_estimated_is_planned_for_and_one_that_is_not_is_felt():
    water = "plant.current=[0.4,-0.3]"
    off = {
        known: _run(water, f"vehicle.current={known}").summary["off_plan_median"]
        for known in ("none", "unknown", "[0.4,-0.3]")
    }
    still = _run().summary["off_plan_median"]
    assert off["[0.4,-0.3]"] < 3.0 * still
    assert off["unknown"] < 0.2 * off["none"]
    assert off["none"] > 20.0 * still


def test_a_run_records_the_current_and_what_was_believed_of_it():
    result = _run("plant.current=[0.4,-0.3]", "vehicle.current=unknown")
    history = result.history
    np.testing.assert_allclose(history.current, np.tile((0.4, -0.3), (len(history.t), 1)))
    assert result.summary["current_error_final"] == pytest.approx(
        np.linalg.norm(history.current_estimate[-1] - (0.4, -0.3))
    )
    assert result.summary["current_error_final"] < 0.05
    assert np.all(np.linalg.eigvalsh(history.current_cov) > 0.0)
    still = _run(seconds=0.5)
    assert np.isnan(still.history.current).all()
    assert still.summary["current_error_final"] is None


def test_a_zone_is_kept_out_of_in_a_current():
    """The zone stands across the way; the clearance over ground is read from the history."""
    zone = "limits.keep_out=[{centre_m: [2.0, 2.0], radius_m: 0.8}]"
    shared = (zone, "limits.hard=[keep_out]", "plant.current=[0.5,0.0]", "vehicle.current=[0.5,0.0]")
    history = _run(*shared, seconds=6.0).history
    clearance = np.linalg.norm(history.vehicle_pose[:, :2] - (2.0, 2.0), axis=1) - 0.8
    assert clearance.min() > -0.01


@pytest.mark.parametrize(
    ("overrides", "line"),
    [
        (["vehicle.follow=exact", "vehicle.current=unknown"], "vehicle.follow: found exact; allowed: dynamics or"),
        (["vehicle.current=[1,2,3]"], "vehicle.current"),
        (["vehicle.current=some"], 'vehicle.current: found "some"; allowed: none, unknown, or 2 numbers'),
        (["plant.current=[1]"], "plant.current"),
        (["plant.current_shear=[0.1,0.1]"], "plant.current_shear: found [0.1, 0.1]; allowed: null in the plane"),
        (["plant.current=[1,0]", "vehicle.follow=exact"], "vehicle.follow: found exact"),
        (
            ["guidance={kind: static}", "vehicle.current=unknown"],
            'vehicle.current: found "unknown"; allowed: none beside',
        ),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(overrides, line):
    with pytest.raises(gbt.ConfigurationError) as fault:
        gbt.load_config("case2", ["vehicle.follow=feedback", *overrides])
    assert line in str(fault.value)


def test_a_point_mass_drifts_too():
    motion = Motion(Plant(PlanarPointMass(1.0, 1.0), flow=Flow((0.2, 0.0))))
    state = np.array([0.0, 0.0, 0.2, 0.0])
    np.testing.assert_allclose(motion.advance(state, lambda s: np.zeros(2), 1.0), (0.2, 0.0, 0.2, 0.0), atol=1e-9)
