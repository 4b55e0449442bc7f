import numpy as np
import pytest
from scipy.stats import chi2

from gbt_ocp.bearings import cumulative_bearing_matrix
from gbt_ocp.tracking.bounds import bearing_bound, confidence_radius
from gbt_ocp.tracking.gp import GaussianProcessTracker


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def test_radius_is_a_quantile_of_the_norm_of_a_normal_vector():
    draws = np.linalg.norm(np.random.default_rng(0).standard_normal((400_000, 3)), axis=1)
    assert confidence_radius(3, 0.2, 4) == pytest.approx(np.quantile(draws, 1.0 - 0.2 / 4), rel=5e-3)


def test_bound_by_hand():
    # Two bearings at right angles, seen once and three times: P = diag(3, 1), cond(P) = 3.
    matrix = cumulative_bearing_matrix([[1.0, 0.0], [0.0, 1.0], [0.0, 1.0], [0.0, 1.0]])
    k = np.array([[3.0, 2.0, 3.5, 2.5], [1.0, 1.5, 0.5, 2.0]])
    radius = np.sqrt(chi2.ppf(1.0 - 0.05 / 2, 2))
    expected = radius * np.sqrt(4.0 - np.array([2.0, 0.5]) ** 2 / (np.sqrt(2.0) * 4.0 * 3.0))
    np.testing.assert_allclose(bearing_bound(k, 4.0, matrix, delta=0.05), expected, rtol=1e-12)
    # σ_n² / λ_min(P) joins the denominator.
    expected = radius * np.sqrt(4.0 - np.array([2.0, 0.5]) ** 2 / (np.sqrt(2.0) * 4.0 * 3.0 + 0.7 / 1.0))
    np.testing.assert_allclose(bearing_bound(k, 4.0, matrix, delta=0.05, noise_variance=0.7), expected, rtol=1e-12)


@pytest.mark.parametrize("bearing", [[1.0, 0.0], [0.6, 0.8], [0.0, 0.0, 1.0]])
def test_without_a_second_direction_the_bound_is_the_priors(bearing):
    d = len(bearing)
    # In space one direction repeated leaves the range unseen as well.
    matrix = cumulative_bearing_matrix([bearing] * 5)
    found = bearing_bound(np.full((3, 5), 3.9), 4.0, matrix, delta=0.1)
    np.testing.assert_allclose(found, 2.0 * confidence_radius(d, 0.1, 3))


def test_a_tracker_without_bearings_has_the_priors_bound():
    tracker = GaussianProcessTracker(2, amplitude=3.0, length_scale=2.0)
    np.testing.assert_allclose(tracker.bound([0.0, 1.0], 0.05), 3.0 * confidence_radius(2, 0.05, 2))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("kernel", ["se", "matern32", "matern52", "rq"])
def test_bound_is_never_below_the_posterior(dimension, kernel):
    rng = np.random.default_rng(7)
    closest = np.inf
    for _ in range(40):
        count = int(rng.integers(2, 13))
        spread = 10.0 ** rng.uniform(-1.5, 0.5)
        tracker = GaussianProcessTracker(
            dimension,
            window=12,
            kernel=kernel,
            length_scale=10.0 ** rng.uniform(-0.5, 1.5),
            amplitude=2.0,
            nugget=1e-12,
        )
        heading = rng.standard_normal(dimension)
        for time in np.sort(rng.uniform(0.0, 2.0, count)):
            bearing = unit(heading + spread * rng.standard_normal(dimension))
            tracker.update(float(time), bearing, rng.uniform(-3.0, 3.0, dimension))
        times = tracker.window.times[-1] + np.array([0.0, 0.1, 0.5, 2.0])
        largest = np.sqrt(np.maximum(np.linalg.eigvalsh(tracker.predict(times).covariance)[:, -1], 0.0))
        bound = tracker.bound(times, 0.05)
        assert np.all(bound >= confidence_radius(dimension, 0.05, 4) * largest * (1.0 - 1e-9))
        assert np.all(bound <= 2.0 * confidence_radius(dimension, 0.05, 4))
        closest = min(closest, bound.min())
    # The windows taught something, or the bound would be the prior's throughout.
    assert closest < 1.9 * confidence_radius(dimension, 0.05, 4)
