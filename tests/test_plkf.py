"""The pseudo-linear Kalman filter against an independent implementation's errors, plain algebra, and Monte Carlo."""

import numpy as np
import pytest

from gbt_ocp.models.bearings import rotate_bearing, tangent_basis, unit_bearing
from gbt_ocp.tracking.filters.plkf import PseudoLinearKalmanFilter
from gbt_ocp.tracking.priors import RangedPrior


def build(dimension=2, mean=None, covariance=None, **keys):
    known = {} if mean is None else {"mean": np.asarray(mean, dtype=float), "covariance": np.asarray(covariance)}
    keys = {"initial_variance": 1.0, "process_noise": 0.1, "bearing_std": 0.01, **keys}
    return PseudoLinearKalmanFilter(RangedPrior(np.zeros(dimension), **known, range=3.0), **keys)


def around_a_static_target(seed, bias_compensated=False):
    """Errors at 2, 4 … 10 s on a circle of 5 m at 3 m/s around a target at (0, 10); the noise is a tenth too large."""
    period, target = 0.02, np.array([0.0, 10.0])
    tracker = build(
        mean=[0.0, 13.0],
        covariance=0.1 * np.eye(2),
        initial_variance=0.1,
        process_noise=1e-6 / period,
        bias_compensated=bias_compensated,
    )
    angle = -0.5 * np.pi + 3.0 / 5.0 * period * np.arange(501)
    own = target + 5.0 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    noise = 0.011 * np.random.default_rng(seed).standard_normal((501, 1))
    errors = []
    for k, bearing in enumerate(rotate_bearing(unit_bearing(target, own), noise)):
        tracker.update(k * period, bearing, own[k])
        if k and k % 100 == 0:
            errors.append(np.linalg.norm(tracker.predict([k * period]).mean[0] - target))
    return errors


@pytest.mark.slow
def test_the_errors_are_those_of_an_independent_implementation():
    errors = np.array([around_a_static_target(seed) for seed in range(24)])
    # its mean is over 100 runs
    wanted = np.array([1.06, 0.059, 0.022, 0.019, 0.020])
    standard_error = errors.std(axis=0) * np.sqrt(1.0 / 24 + 1.0 / 100)
    assert np.all(np.abs(errors.mean(axis=0) - wanted) < 3.0 * standard_error + 5e-4)


@pytest.mark.slow
def test_compensation_lowers_the_settled_error_there():
    plain, compensated = (
        np.array([around_a_static_target(seed, how)[2:] for seed in range(12)]).mean() for how in (False, True)
    )
    assert compensated < 0.9 * plain


@pytest.mark.parametrize("dimension", [2, 3])
def test_an_update_is_that_with_the_projection_and_a_pseudo_inverse(dimension):
    rng = np.random.default_rng(dimension)
    root = rng.standard_normal((dimension, dimension))
    mean, covariance = rng.standard_normal(dimension), root @ root.T + np.eye(dimension)
    own = rng.standard_normal(dimension)
    g = unit_bearing(rng.standard_normal(dimension), own)
    tracker = build(dimension, mean, covariance, bearing_std=0.1)
    tracker.update(0.0, g, own)
    projection = np.eye(dimension) - np.outer(g, g)
    noise = (0.1 * np.linalg.norm(mean - own)) ** 2 * projection
    gain = covariance @ projection @ np.linalg.pinv(projection @ covariance @ projection + noise)
    forecast = tracker.predict([0.0])
    np.testing.assert_allclose(forecast.mean[0], mean + gain @ projection @ (own - mean), atol=1e-12)
    np.testing.assert_allclose(forecast.covariance[0], covariance - gain @ projection @ covariance, atol=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_compensation_takes_off_the_bias_of_an_update(dimension):
    """By Monte Carlo over the noise of one bearing."""
    deviation, count = 0.15, 1000
    target = np.array([3.0, 1.0, -0.5])[:dimension]
    own = np.zeros(dimension)
    covariance = np.diag([0.05, 0.2, 0.1][:dimension])
    covariance[0, 1] = covariance[1, 0] = 0.03
    rng = np.random.default_rng(0)
    noise = deviation * rng.standard_normal((count // 2, dimension - 1))
    # in pairs of opposite noise, of which only the even powers are left: the bias
    bearings = rotate_bearing(unit_bearing(target, own), np.concatenate([noise, -noise]))
    bias = []
    for compensated in (False, True):
        total = np.zeros(dimension)
        for bearing in bearings:
            tracker = build(dimension, target, covariance, bearing_std=deviation, bias_compensated=compensated)
            tracker.update(0.0, bearing, own)
            total += tracker.predict([0.0]).mean[0] - target
        bias.append(np.linalg.norm(total / count))
    assert bias[1] < 0.35 * bias[0]


def test_a_constant_velocity_is_found_exactly_with_exact_bearings_and_irregular_samples():
    tracker = build(mean=[0.0, 0.0], covariance=9.0 * np.eye(2))
    times = np.cumsum(np.random.default_rng(1).choice([0.05, 0.1, 0.4], 60))
    for t in times:
        target = np.array([-1.0 + t, 2.0 - 0.5 * t])
        bearing = np.array([np.cos(6.0 * t), np.sin(6.0 * t)])
        tracker.update(t, bearing, target - 0.5 * bearing)
    ahead = times[-1] + np.array([0.0, 1.0])
    wanted = np.stack([-1.0 + ahead, 2.0 - 0.5 * ahead], axis=-1)
    np.testing.assert_allclose(tracker.predict(ahead).mean, wanted, atol=1e-3)


def test_the_covariance_stays_symmetric_and_positive_definite_over_a_long_exact_run():
    tracker = build(bearing_std=1e-6, process_noise=1e-9, initial_variance=100.0)
    for k in range(2000):
        bearing = np.array([np.cos(0.3 * k), np.sin(0.3 * k)])
        tracker.update(0.1 * k, bearing, np.array([5.0, 0.0]) - 0.2 * bearing)
        covariance = tracker.predict([0.1 * k, 0.1 * k + 1.1]).covariance
        np.testing.assert_array_equal(covariance, np.swapaxes(covariance, -1, -2))
        assert np.all(np.linalg.eigvalsh(covariance) > 0.0)


def test_without_a_prior_it_begins_on_the_first_bearing_with_its_own_variance():
    tracker = build(3, initial_variance=4.0)
    assert np.isnan(tracker.predict([0.0]).covariance).all()
    g, own = np.array([0.6, 0.0, 0.8]), np.array([1.0, 2.0, 3.0])
    tracker.update(0.0, g, own)
    forecast = tracker.predict([0.0])
    np.testing.assert_allclose(forecast.mean[0], own + 3.0 * g, atol=1e-12)
    assert g @ forecast.covariance[0] @ g == pytest.approx(4.0)
    across = tangent_basis(g).T @ forecast.covariance[0] @ tangent_basis(g)
    np.testing.assert_allclose(across, np.eye(2) / (1.0 / 4.0 + 1.0 / 0.03**2), rtol=1e-9)


@pytest.mark.parametrize("key", ["initial_variance", "process_noise", "bearing_std"])
def test_parameters_out_of_range_are_refused(key):
    with pytest.raises(ValueError, match="allowed: numbers > 0"):
        build(**{key: 0.0})
