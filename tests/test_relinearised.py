import numpy as np
import pytest

from gbt_ocp.models.bearings import rotate_bearing, tangent_basis, unit_bearing
from gbt_ocp.tracking.bins import BinnedBearings
from gbt_ocp.tracking.displacement.rows import FARTHEST, bearing_rows, row_covariance
from gbt_ocp.tracking.noise import BearingNoise


def seen(target, own, angles=0.0, counts=None):
    bearings = rotate_bearing(unit_bearing(target, own), np.broadcast_to(angles, (len(own), own.shape[1] - 1)))
    times = np.arange(float(len(own)))
    return BinnedBearings(times, bearings, own, np.ones(len(own)) if counts is None else counts)


def places(dimension, count=12, seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(0.0, 5.0, (count, dimension)), rng.normal(0.0, 5.0, (count, dimension))


@pytest.mark.parametrize("dimension", [2, 3])
def test_at_the_truth_rows_of_exact_bearings_hold_exactly(dimension):
    target, own = places(dimension)
    rows = bearing_rows(seen(target, own), target)
    np.testing.assert_allclose(np.einsum("ri,ri->r", rows.directions, target[rows.sample]), rows.values, atol=1e-9)
    np.testing.assert_allclose(rows.residuals, 0.0, atol=1e-7)
    np.testing.assert_allclose(rows.ranges, np.linalg.norm(target - own, axis=1)[rows.sample])


@pytest.mark.parametrize("dimension", [2, 3])
def test_residuals_are_the_angles_the_bearing_was_turned_by(dimension):
    target, own = places(dimension)
    angles = np.random.default_rng(1).normal(0.0, 0.1, (len(own), dimension - 1))
    rows = bearing_rows(seen(target, own, angles), target)
    np.testing.assert_allclose(rows.residuals, angles.ravel(), atol=1e-9)


@pytest.mark.parametrize("dimension", [2, 3])
def test_rows_are_the_first_order_change_of_the_angle(dimension):
    """hᵀ dp / r is minus the derivative of the residual by the predicted position, by finite differences."""
    target, own = places(dimension)
    samples = seen(target, own)
    rows = bearing_rows(samples, target)
    step = 1e-6
    for axis in range(dimension):
        moved = target + step * np.eye(dimension)[axis]
        slope = (bearing_rows(samples, moved).residuals - rows.residuals) / step
        np.testing.assert_allclose(slope * rows.ranges, -rows.directions[:, axis], atol=1e-5)


def test_the_measured_tangent_is_biased_and_the_predicted_one_is_not():
    """Monte Carlo of the value that a row gives for the range, with the target abeam at 10 m and 5° of noise."""
    rng = np.random.default_rng(2)
    count = 20000
    target, own = np.tile([10.0, 0.0], (count, 1)), np.zeros((count, 2))
    samples = seen(target, own, rng.normal(0.0, np.radians(5.0), (count, 1)))
    rows = bearing_rows(samples, target)
    errors = rows.values - np.einsum("ri,ri->r", rows.directions, target)
    assert abs(errors.mean()) < 4.0 * errors.std() / np.sqrt(count)
    np.testing.assert_allclose(errors.std(), 10.0 * np.radians(5.0), rtol=0.03)
    # least squares of one static target from all bearings and a second place: the measured tangents shorten the range
    second = np.tile([0.0, 3.0], (count, 1))
    both = seen(np.tile([10.0, 0.0], (2 * count, 1)), np.vstack([own, second]), rng.normal(0, 0.0873, (2 * count, 1)))
    measured = np.swapaxes(tangent_basis(both.bearings), 1, 2)[:, 0]
    pseudo = np.linalg.lstsq(measured, np.einsum("ri,ri->r", measured, both.own_positions), rcond=None)[0]
    new = bearing_rows(both, np.tile([10.0, 0.0], (2 * count, 1)))
    ours = np.linalg.lstsq(new.directions, new.values, rcond=None)[0]
    assert np.linalg.norm(pseudo - [10.0, 0.0]) > 2.0
    assert np.linalg.norm(ours - [10.0, 0.0]) < 0.3


@pytest.mark.parametrize("dimension", [2, 3])
def test_far_from_the_prediction_the_measured_tangent_is_kept(dimension):
    target, own = places(dimension)
    angle = np.zeros(dimension - 1)
    angle[0] = 2.0 * FARTHEST
    samples = seen(target, own, angle)
    rows = bearing_rows(samples, target)
    measured = np.swapaxes(tangent_basis(samples.bearings), 1, 2).reshape(-1, dimension)
    np.testing.assert_allclose(rows.directions, measured)
    np.testing.assert_allclose(rows.values, np.einsum("ri,ri->r", measured, own[rows.sample]))
    np.testing.assert_allclose(np.linalg.norm(rows.residuals.reshape(-1, dimension - 1), axis=1), 2.0 * FARTHEST)


@pytest.mark.parametrize("dimension", [2, 3])
def test_predictions_at_the_vehicle_or_opposite_stay_finite(dimension):
    target, own = places(dimension)
    samples = seen(target, own)
    for predicted in (own, 2.0 * own - target):
        rows = bearing_rows(samples, predicted)
        for values in (rows.directions, rows.values, rows.residuals, rows.ranges, rows.axes):
            assert np.all(np.isfinite(values))
        assert np.all(rows.ranges > 0.0)


@pytest.mark.parametrize("dimension", [2, 3])
def test_covariance_of_rows_is_that_of_a_sensor_that_rotates_and_shakes(dimension):
    """Monte Carlo: one slowly varying rotation vector, white angles and a shaken own position, to first order."""
    target, own = places(dimension, 4, seed=5)
    own = own + 20.0
    noise = BearingNoise(2e-3, correlated_std=3e-3, correlation_time=2.0, own_std=0.02)
    samples = seen(target, own, counts=np.array([1.0, 2.0, 1.0, 4.0]))
    rows = bearing_rows(samples, target)
    found = row_covariance(rows, samples, noise, noise.std**2, np.ones(len(rows.values)))
    rng = np.random.default_rng(3)
    runs = 20000
    root = np.linalg.cholesky(noise.correlated(samples.times))
    rotations = np.einsum("nm,kmi->kni", root, rng.standard_normal((runs, 4, 3)))
    if dimension == 2:
        rotations[:, :, :2] = 0.0
    size = len(rows.values)
    scale = 1.0 / np.sqrt(samples.counts[rows.sample])
    # a rotation ω moves the direction by ω × λ, whose part along h is ω · (λ × h)
    turned = np.einsum("kri,ri->kr", rotations[:, rows.sample], rows.axes) * rows.ranges
    white = rng.standard_normal((runs, size)) * noise.std * rows.ranges * scale
    shaken = rng.standard_normal((runs, size)) * noise.own_std * scale
    np.testing.assert_allclose(np.cov((turned + white + shaken).T), found, atol=0.05 * found.max())


def test_less_trust_is_more_variance():
    target, own = places(2)
    rows = bearing_rows(seen(target, own), target)
    noise = BearingNoise(0.1)
    plain = row_covariance(rows, seen(target, own), noise, 0.01, np.ones(len(rows.values)))
    doubted = row_covariance(rows, seen(target, own), noise, 0.01, np.full(len(rows.values), 0.25))
    np.testing.assert_allclose(doubted, 4.0 * plain)
