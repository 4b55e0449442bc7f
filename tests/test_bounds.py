import numpy as np
import pytest
from scipy.stats import chi2

from gbt_ocp.models.bearings import cumulative_bearing_matrix, tangent_basis
from gbt_ocp.tracking.gp.bounds import (
    bearing_bound,
    confidence_radius,
    coregionalized_bound,
    posterior_bound,
    weighted_bearing_bound,
)
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker


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


def test_tightening_the_constant_of_theorem_1_to_one_keeps_it_above_the_posterior():
    rng = np.random.default_rng(8)
    nearest = np.inf
    for _ in range(60):
        times, bearings, ahead = random_window(rng, 2)
        scale = 10.0 ** rng.uniform(-0.5, 1.0)
        cross, sigma = coregionalised(times, bearings, ahead, np.eye(2), [scale, scale])
        k = cross[:, :, 0, 0]
        bound = bearing_bound(k, 1.0, cumulative_bearing_matrix(bearings), delta=0.1, constant=1.0)
        ratio = bound / posterior_bound(sigma, delta=0.1)
        assert np.all(ratio > 1.0 - 1e-6)
        assert np.all(bound <= bearing_bound(k, 1.0, cumulative_bearing_matrix(bearings), delta=0.1))
        nearest = min(nearest, ratio.min())
    assert nearest < 1.5


def test_bound_of_the_lemma_holds_with_its_probability_at_all_times_at_once():
    """Monte Carlo: three correlated errors of four times, the last along one direction only."""
    rng = np.random.default_rng(9)
    roots = rng.standard_normal((4, 3, 3)) * np.array([1.0, 0.3, 0.1])
    roots[3, :, 1:] = 0.0
    bound = posterior_bound(roots @ np.swapaxes(roots, 1, 2), delta=0.1)
    draws = rng.standard_normal((200_000, 3))
    held = np.mean(np.all(np.linalg.norm(np.einsum("kij,nj->nki", roots, draws), axis=2) <= bound, axis=1))
    assert held >= 0.9
    # of many steps at once, each has its own
    np.testing.assert_array_equal(
        posterior_bound(np.stack([roots @ np.swapaxes(roots, 1, 2)] * 2), delta=0.1)[1], bound
    )
    # it is the largest eigenvalue that counts, and no more than it
    assert np.all(bound == pytest.approx(confidence_radius(3, 0.1, 4) * np.linalg.norm(roots, 2, axis=(1, 2))))


def test_bound_of_an_estimator_without_covariance_is_unknown():
    sigma = np.stack([np.eye(2), np.full((2, 2), np.nan)])
    np.testing.assert_array_equal(np.isnan(posterior_bound(sigma, delta=0.1)), [False, True])


def random_window(rng, dimension, count=10):
    times = np.sort(rng.uniform(0.0, 2.0, count))
    bearings = unit(
        rng.standard_normal(dimension) + 10.0 ** rng.uniform(-1, 1) * rng.standard_normal((count, dimension))
    )
    return times, bearings, times[-1] + np.array([0.0, 0.2, 1.0])


def coregionalised(times, bearings, ahead, weights, scales, rates=0.0, noise=1e-10):
    """k_f between T_k and the window, and Σ at T_k, both by dense matrices."""

    def k(lag):
        lag = np.asarray(lag)[..., None]
        return np.einsum(
            "aq,...q,bq->...ab", weights, np.exp(-0.5 * (lag / scales) ** 2) * np.cos(rates * lag), weights
        )

    count, d = bearings.shape
    g = np.zeros((count * (d - 1), count * d))
    for i, basis in enumerate(tangent_basis(bearings)):
        g[i * (d - 1) : (i + 1) * (d - 1), i * d : (i + 1) * d] = basis.T
    full = np.block([[k(s - t) for t in times] for s in times])
    omega = g @ full @ g.T + noise * np.eye(len(g))
    cross = k(ahead[:, None] - times[None, :])
    sigma = []
    for row in cross:
        c = np.hstack(list(row)) @ g.T
        sigma.append(k(0.0) - c @ np.linalg.solve(omega, c.T))
    return cross, np.array(sigma)


@pytest.mark.parametrize("dimension", [2, 3])
def test_theorem_2_with_one_kernel_is_above_the_posterior_and_by_hand(dimension):
    rng = np.random.default_rng(10)
    for _ in range(40):
        times, bearings, ahead = random_window(rng, dimension)
        weights = rng.standard_normal((dimension, dimension))
        scale = 10.0 ** rng.uniform(-0.5, 1.0)
        cross, sigma = coregionalised(times, bearings, ahead, weights, np.full(dimension, scale))
        prior = weights @ weights.T
        bound = coregionalized_bound(cross, prior, bearings, delta=0.05)
        assert np.all(bound >= posterior_bound(sigma, delta=0.05) * (1.0 - 1e-6))
        values = np.linalg.eigvalsh(cumulative_bearing_matrix(bearings))
        smallest = (np.linalg.eigvalsh(prior)[0] * np.exp(-0.5 * ((ahead - times[0]) / scale) ** 2)) ** 2
        printed = (dimension / (dimension - 1)) ** 0.75 * np.linalg.norm(prior, 2) * values[-1] / values[0]
        expected = np.sqrt(np.linalg.norm(prior, 2) - smallest / printed)
        np.testing.assert_allclose(bound, confidence_radius(dimension, 0.05, 3) * expected, rtol=1e-9)


@pytest.mark.parametrize("dimension", [2, 3])
def test_theorem_2_with_equal_weights_and_one_kernel_is_theorem_1_with_its_own_constant(dimension):
    times, bearings, ahead = random_window(np.random.default_rng(11), dimension)
    cross, _ = coregionalised(times, bearings, ahead, 1.5 * np.eye(dimension), np.full(dimension, 3.0))
    first = bearing_bound(
        cross[:, :, 0, 0], 2.25, cumulative_bearing_matrix(bearings), delta=0.1, noise_variance=0.02, constant=1.3
    )
    second = coregionalized_bound(
        cross, 2.25 * np.eye(dimension), bearings, delta=0.1, noise_variance=0.02, constant=1.3
    )
    np.testing.assert_allclose(second, first, rtol=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_weighted_bound_is_above_the_posterior_for_all_kernels(dimension):
    rng = np.random.default_rng(12)
    closest = np.inf
    for _ in range(80):
        times, bearings, ahead = random_window(rng, dimension)
        weights = rng.standard_normal((dimension, dimension))
        scales, rates = 10.0 ** rng.uniform(-0.5, 1.5, dimension), rng.uniform(0.0, 4.0, dimension)
        noise = 10.0 ** rng.uniform(-9.0, 0.0)
        cross, sigma = coregionalised(times, bearings, ahead, weights, scales, rates, noise)
        bound = weighted_bearing_bound(cross, weights @ weights.T, bearings, delta=0.05, noise_variance=noise)
        ratio = bound / np.maximum(posterior_bound(sigma, delta=0.05), 1e-12)
        assert np.all(ratio > 1.0 - 1e-6)
        prior = np.sqrt(np.linalg.norm(weights, 2) ** 2) * confidence_radius(dimension, 0.05, 3)
        assert np.all(bound <= prior * (1.0 + 1e-12))
        closest = min(closest, np.min(bound / prior))
    assert closest < 0.95  # it learns from the bearings


def test_theorem_2_as_printed_is_broken_by_two_axes_of_which_one_changes_sign():
    """Every bearing sees the same sum of two unknowns: nothing is known of their difference, yet cond(P) = 1."""
    signs = (-1.0) ** np.arange(12)
    times = 0.1 * np.arange(12)
    bearings = np.column_stack([-signs, np.ones(12)]) / np.sqrt(2.0)
    matrix = cumulative_bearing_matrix(bearings)
    np.testing.assert_allclose(matrix, 6.0 * np.eye(2), atol=1e-12)
    cross, sigma = coregionalised(times, bearings, np.array([1.2]), np.eye(2), [1e4, 1e4], np.array([np.pi / 0.1, 0.0]))
    posterior = posterior_bound(sigma, delta=0.05)[0]
    assert posterior == pytest.approx(confidence_radius(2, 0.05, 1), rel=1e-6)
    for constant in (None, 2.0):
        assert coregionalized_bound(cross, np.eye(2), bearings, delta=0.05, constant=constant)[0] < 0.75 * posterior
    assert weighted_bearing_bound(cross, np.eye(2), bearings, delta=0.05)[0] >= posterior * (1.0 - 1e-6)
    # The error is along one direction: the printed bound holds in 88 % of the draws instead of 95 %.
    printed = coregionalized_bound(cross, np.eye(2), bearings, delta=0.05)[0]
    draws = np.random.default_rng(13).multivariate_normal(np.zeros(2), sigma[0], 100_000)
    assert np.mean(np.linalg.norm(draws, axis=1) <= printed) == pytest.approx(0.881, abs=0.004)


@pytest.mark.parametrize("bound", [coregionalized_bound, weighted_bearing_bound])
def test_without_bearings_the_coregionalised_bounds_are_the_priors(bound):
    prior = np.array([[4.0, 1.0], [1.0, 2.0]])
    found = bound(np.zeros((3, 0, 2, 2)), prior, np.zeros((0, 2)), delta=0.1)
    np.testing.assert_allclose(found, confidence_radius(2, 0.1, 3) * np.sqrt(np.linalg.norm(prior, 2)))
