"""The extended filters against finite differences, a posterior on a grid, and the collapse that they do not share."""

import numpy as np
import pytest

from gbt_ocp.models.bearings import rotate_bearing, tangent_basis, unit_bearing
from gbt_ocp.tracking.filters.ekf import ExtendedKalmanFilter, FirstGuess, ImmExtendedTracker, angle_measurement
from gbt_ocp.tracking.filters.imm import InteractingMultipleModel
from gbt_ocp.tracking.filters.plkf import PseudoLinearKalmanFilter
from gbt_ocp.tracking.priors import RangedPrior

SIGMA = np.deg2rad(1.0)


def known(mean, covariance, speed_std=1.0):
    prior = RangedPrior(np.zeros(len(mean)), np.asarray(mean, dtype=float), np.asarray(covariance), range=3.0)
    return FirstGuess(prior, 1.0, speed_std)


def models(**keys):
    keys = {"process_noise": 1e-4, "jerk_noise": 1e-4, "stay_probability": 0.99, "turn_rate_max": 0.1, **keys}
    return InteractingMultipleModel(initial_variance=1.0, **keys)


def circling(seed, dimension=2, duration=100.0):
    """Times, target, own positions and noisy bearings: 30 m around a target at 1 m/s."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, duration, 0.1)
    target = np.stack([0.8 * times, 0.5 * times, 0.1 * times], axis=-1)[:, :dimension]
    circle = np.stack([np.cos(0.1 * times), np.sin(0.1 * times), 0.4 * np.sin(0.2 * times)], axis=-1)
    own = target + 30.0 * circle[:, :dimension]
    noise = SIGMA * rng.standard_normal((len(times), dimension - 1))
    return times, target, own, rotate_bearing(unit_bearing(target, own), noise)


def errors(tracker, times, target, own, bearings):
    found = []
    for k, t in enumerate(times):
        tracker.update(t, bearings[k], own[k])
        if t > 60.0:
            found.append(np.linalg.norm(tracker.predict([t]).mean[0] - target[k]))
    return np.array(found)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_measurement_matrix_is_that_of_finite_differences(dimension):
    rng = np.random.default_rng(dimension)
    position, own = 20.0 * rng.standard_normal((2, dimension))
    bearing = rotate_bearing(unit_bearing(position, own), np.full(dimension - 1, 0.02))
    observation, innovation = angle_measurement(position, own, bearing, 2 * dimension)
    basis = tangent_basis(unit_bearing(position, own))
    assert np.linalg.norm(innovation) == pytest.approx(np.arccos(bearing @ unit_bearing(position, own)), rel=1e-6)
    for axis in range(dimension):
        step = 1e-6 * np.eye(dimension)[axis]
        slope = (unit_bearing(position + step, own) - unit_bearing(position - step, own)) / 2e-6
        assert observation[:, axis] == pytest.approx(basis.T @ slope, abs=1e-8)
    assert np.all(observation[:, dimension:] == 0.0)


def test_an_update_is_the_posterior_on_a_grid():
    mean, covariance, own = np.array([20.0, 5.0]), np.array([[2.0, 0.8], [0.8, 1.0]]), np.array([1.0, -2.0])
    bearing = rotate_bearing(unit_bearing(mean, own), np.array([0.03]))
    tracker = ExtendedKalmanFilter(known(mean, covariance), process_noise=1e-3, bearing_std=0.05)
    tracker.update(0.0, bearing, own)
    forecast = tracker.predict([0.0])
    axis = np.linspace(-6.0, 6.0, 401)
    points = mean + np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    line = points - own
    angle = np.arctan2(line[:, 0] * bearing[1] - line[:, 1] * bearing[0], line @ bearing)
    offset = points - mean
    log_density = -0.5 * ((angle / 0.05) ** 2 + np.einsum("ki,ij,kj->k", offset, np.linalg.inv(covariance), offset))
    weight = np.exp(log_density - log_density.max())
    weight /= weight.sum()
    exact = weight @ points
    away = points - exact
    assert forecast.mean[0] == pytest.approx(exact, abs=0.05)
    assert forecast.covariance[0] == pytest.approx(np.einsum("k,ki,kj->ij", weight, away, away), rel=0.05, abs=0.02)


def test_the_pseudo_linear_filter_ends_on_the_vehicle_where_the_extended_one_does_not():
    """At 1 degree and 10 Hz, the reason for these filters."""
    times, target, own, bearings = circling(0)
    guess = FirstGuess(RangedPrior(np.zeros(2), range=50.0), 25.0, 1.0)
    prior = RangedPrior(np.zeros(2), range=50.0)
    plain = PseudoLinearKalmanFilter(prior, initial_variance=100.0, process_noise=3e-3, bearing_std=SIGMA)
    extended = ExtendedKalmanFilter(guess, process_noise=3e-3, bearing_std=SIGMA)
    interacting = ImmExtendedTracker(guess, models(), bearing_std=SIGMA)
    assert errors(plain, times, target, own, bearings).mean() > 20.0
    assert errors(extended, times, target, own, bearings).mean() < 3.0
    assert errors(interacting, times, target, own, bearings).mean() < 3.0


@pytest.mark.parametrize("seed", [1, 2])
def test_in_space_both_find_the_target_with_an_honest_spread(seed):
    times, target, own, bearings = circling(seed, 3)
    guess = FirstGuess(RangedPrior(np.zeros(3), range=50.0), 25.0, 1.0)
    for tracker in (
        ExtendedKalmanFilter(guess, process_noise=3e-3, bearing_std=SIGMA),
        ImmExtendedTracker(guess, models(), bearing_std=SIGMA),
    ):
        assert errors(tracker, times, target, own, bearings).mean() < 3.0
        forecast = tracker.predict([times[-1]])
        error = forecast.mean[0] - target[-1]
        assert error @ np.linalg.solve(forecast.covariance[0], error) < 16.0


def test_before_the_first_bearing_there_is_no_covariance_and_wrong_parameters_are_refused():
    guess = FirstGuess(RangedPrior(np.zeros(2), range=50.0), 25.0, 1.0)
    tracker = ExtendedKalmanFilter(guess, process_noise=1e-3, bearing_std=SIGMA)
    assert np.all(np.isnan(tracker.predict([0.0]).covariance))
    with pytest.raises(ValueError, match="allowed: numbers > 0"):
        ExtendedKalmanFilter(guess, process_noise=0.0, bearing_std=SIGMA)
    with pytest.raises(ValueError, match="range_std and speed_std"):
        FirstGuess(RangedPrior(np.zeros(2), range=50.0), 0.0, 1.0)
    with pytest.raises(ValueError, match="bearing_std: found"):
        ImmExtendedTracker(guess, models(), bearing_std=0.0)
    # on top of the vehicle there is no bearing, and no fault
    observation, innovation = angle_measurement(np.zeros(2), np.zeros(2), np.array([0.0, 1.0]), 4)
    assert np.all(np.isfinite(observation))
    assert innovation == pytest.approx(0.0)
