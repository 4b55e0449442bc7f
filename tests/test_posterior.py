import numpy as np
import pytest
from scipy.linalg import block_diag
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process import kernels as theirs

from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.tracking.gp import posterior as module
from gbt_ocp.tracking.gp.kernels import KERNELS
from gbt_ocp.tracking.gp.posterior import Hyperparameters, Posterior, condition
from gbt_ocp.tracking.linalg import NotPositiveDefiniteError, cholesky
from gbt_ocp.tracking.window import Measurements, Window

both_dimensions = pytest.mark.parametrize("dimension", [2, 3])
FUTURE = np.array([0.4, 1.0, 2.6, 3.1])


def times(count=8):
    return np.cumsum(np.random.default_rng(0).uniform(0.1, 0.4, count))


def target(t, dimension):
    return np.stack([np.sin(t), np.cos(0.7 * t) + 2.0, 0.3 * t][:dimension], axis=-1)


def window(dimension, count=8, seed=1):
    """Bearings at uneven times from a vehicle that moves about."""
    rng = np.random.default_rng(seed)
    found = Window(count)
    for t in times(count):
        own = 3.0 * rng.standard_normal(dimension)
        found.append(t, unit_bearing(target(t, dimension), own), own)
    return found


def textbook(kernel, log_kernel, amplitude, nugget, bearings, centre, future):
    """eq14 to eq17 with G, K and plain inverses, as the paper writes them."""
    t, dimension = bearings.times, len(centre)
    g = block_diag(*[np.linalg.svd(b[None])[2][1:] for b in bearings.bearings])
    k = amplitude**2 * np.kron(kernel(t[:, None] - t[None, :], log_kernel), np.eye(dimension))
    y = g @ (bearings.own_positions - centre).ravel()
    omega = g @ k @ g.T + nugget * amplitude**2 * np.eye(len(y))
    means, covariances = [], []
    for s in future:
        cross = g @ np.kron(amplitude**2 * kernel(t - s, log_kernel)[:, None], np.eye(dimension))
        means.append(centre + cross.T @ np.linalg.inv(omega) @ y)
        covariances.append(amplitude**2 * np.eye(dimension) - cross.T @ np.linalg.inv(omega) @ cross)
    return np.array(means), np.array(covariances)


@both_dimensions
@pytest.mark.parametrize("name", list(KERNELS))
def test_posterior_is_the_papers_with_plain_matrices(dimension, name):
    # The tangent bases of the textbook come from an SVD: another basis of the same plane.
    log_kernel = np.log([0.9, 1.3][: len(KERNELS[name].names)])
    centre = np.arange(1.0, dimension + 1.0)
    theta = Hyperparameters(log_kernel, np.log(2.5), 1e-4)
    data = window(dimension)
    found = Posterior(KERNELS[name], theta, data.measurements(), centre).predict(FUTURE)
    mean, covariance = textbook(KERNELS[name], log_kernel, 2.5, 1e-4, data, centre, FUTURE)
    np.testing.assert_allclose(found.mean, mean, atol=1e-8)
    np.testing.assert_allclose(found.covariance, covariance, atol=1e-8)


@both_dimensions
def test_positions_observed_directly_give_scikit_learns_regression(dimension):
    t = times()
    positions = target(t, dimension) + np.random.default_rng(2).standard_normal((8, dimension))
    data = Measurements(
        np.repeat(t, dimension), np.tile(np.eye(dimension), (8, 1)), positions.ravel(), np.full(8 * dimension, 0.03)
    )
    theta = Hyperparameters(np.log([0.8]), np.log(1.7), 1e-6)
    found = Posterior(KERNELS["matern52"], theta, data, np.zeros(dimension)).predict(FUTURE)
    regression = GaussianProcessRegressor(
        theirs.ConstantKernel(1.7**2) * theirs.Matern(0.8, nu=2.5), alpha=0.03 + 1e-6 * 1.7**2, optimizer=None
    ).fit(t[:, None], positions)
    mean, std = regression.predict(FUTURE[:, None], return_std=True)
    np.testing.assert_allclose(found.mean, mean, atol=1e-9)
    for k in range(len(FUTURE)):
        np.testing.assert_allclose(found.covariance[k], np.diag(std[k] ** 2), atol=1e-9)


@both_dimensions
def test_posterior_does_not_depend_on_the_choice_of_tangent_bases(dimension):
    data, rng = window(dimension).measurements(), np.random.default_rng(3)
    rows = dimension - 1
    turned, values = data.directions.copy(), data.values.copy()
    for k in range(8):
        block = slice(k * rows, (k + 1) * rows)
        turn = np.linalg.qr(rng.standard_normal((rows, rows)))[0] * (-1.0) ** k
        turned[block], values[block] = turn @ data.directions[block], turn @ data.values[block]
    theta = Hyperparameters(np.log([0.9]), 0.3, 1e-6)
    first = Posterior(KERNELS["se"], theta, data, np.zeros(dimension)).predict(FUTURE)
    second = Posterior(
        KERNELS["se"], theta, Measurements(data.times, turned, values, data.variances), np.zeros(dimension)
    ).predict(FUTURE)
    assert not np.allclose(turned, data.directions)
    np.testing.assert_allclose(first.mean, second.mean, atol=1e-9)
    np.testing.assert_allclose(first.covariance, second.covariance, atol=1e-9)


@both_dimensions
def test_posterior_returns_to_the_prior_far_away(dimension):
    centre = np.full(dimension, 7.0)
    theta = Hyperparameters(np.log([0.5]), np.log(3.0), 1e-8)
    far = Posterior(KERNELS["se"], theta, window(dimension).measurements(), centre).predict(np.array([500.0]))
    np.testing.assert_allclose(far.mean[0], centre)
    np.testing.assert_allclose(far.covariance[0], 9.0 * np.eye(dimension))


@both_dimensions
def test_what_a_bearing_says_holds_at_its_own_time(dimension):
    data = window(dimension)
    theta = Hyperparameters(np.log([1.2]), np.log(5.0), 1e-10)
    found = Posterior(KERNELS["se"], theta, data.measurements(), np.zeros(dimension)).predict(data.times)
    # The mean lies on every line of sight, and the variance across it is that of the nugget.
    line = found.mean - data.own_positions
    along = np.einsum("ki,ki->k", line, data.bearings)
    np.testing.assert_allclose(line, along[:, None] * data.bearings, atol=1e-4)
    for covariance, b in zip(found.covariance, data.bearings, strict=True):
        across = np.eye(dimension) - np.outer(b, b)
        assert np.linalg.norm(across @ covariance @ across, 2) < 1e-6


def test_a_known_position_enters_with_its_own_variance():
    data = Measurements(np.full(2, 1.0), np.eye(2), np.array([3.0, -1.0]), np.full(2, 4.0))
    theta = Hyperparameters(np.log([1.0]), np.log(2.0), 1e-12)
    found = Posterior(KERNELS["se"], theta, data, np.array([1.0, 1.0])).predict(np.array([1.0]))
    # Prior variance 4 and measurement variance 4: half way, at half the variance.
    np.testing.assert_allclose(found.mean[0], [2.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(found.covariance[0], 2.0 * np.eye(2), atol=1e-9)


def duplicated(count):
    """The same bearing from the same place many times over, an instant apart: Ω is singular to working precision."""
    found = Window(count)
    for k in range(count):
        found.append(1e-9 * k, [0.6, 0.8], [1.0, 2.0])
    return found.measurements()


def test_a_singular_window_raises_the_nugget_by_tens_until_it_factors():
    theta = Hyperparameters(np.log([1.0]), np.log(2.0), 1e-18)
    with pytest.raises(NotPositiveDefiniteError):
        Posterior(KERNELS["se"], theta, duplicated(20), np.zeros(2))
    found, retries = condition(KERNELS["se"], theta, duplicated(20), np.zeros(2))
    assert retries >= 1
    assert found.hyperparameters.nugget == pytest.approx(1e-18 * 10.0**retries)
    assert found.hyperparameters.nugget < 1e-12
    forecast = found.predict(np.array([0.0]))
    assert np.all(np.isfinite(forecast.mean))
    # One bearing is all that was said: the mean lies on its line, and nothing is known along it.
    assert [0.8, -0.6] @ forecast.mean[0] == pytest.approx([0.8, -0.6] @ np.array([1.0, 2.0]), abs=1e-5)
    assert [0.6, 0.8] @ forecast.covariance[0] @ [0.6, 0.8] == pytest.approx(4.0)


def test_a_good_window_keeps_its_nugget():
    theta = Hyperparameters(np.log([1.0]), 0.0, 1e-6)
    found, retries = condition(KERNELS["se"], theta, window(2).measurements(), np.zeros(2))
    assert (retries, found.hyperparameters.nugget) == (0, 1e-6)


def test_the_nugget_is_raised_by_tens_and_never_beyond_its_largest(monkeypatch):
    tried = []

    def refuse(kernel, theta, measurements, centre, rounding):
        tried.append(theta.nugget)
        raise NotPositiveDefiniteError

    monkeypatch.setattr(module, "Posterior", refuse)
    with pytest.raises(NotPositiveDefiniteError):
        condition(KERNELS["se"], Hyperparameters(np.log([1.0]), 0.0, 3e-5), duplicated(2), np.zeros(2))
    np.testing.assert_allclose(tried, [3e-5, 3e-4, 3e-3, 1e-2])


def test_a_nugget_of_zero_is_raised_too(monkeypatch):
    tried = []

    def refuse(kernel, theta, measurements, centre, rounding):
        tried.append(theta.nugget)
        assert len(tried) < 50, "the retry does not end"
        raise NotPositiveDefiniteError

    monkeypatch.setattr(module, "Posterior", refuse)
    with pytest.raises(NotPositiveDefiniteError):
        condition(KERNELS["se"], Hyperparameters(np.log([1.0]), 0.0, 0.0), duplicated(2), np.zeros(2))


@pytest.mark.parametrize("matrix", [-np.eye(2), np.full((2, 2), np.nan), np.array([[1.0, 2.0], [2.0, 1.0]])])
def test_what_has_no_factor_is_said_so(matrix):
    with pytest.raises(NotPositiveDefiniteError):
        cholesky(matrix)


def test_cholesky_is_the_lower_factor():
    matrix = np.array([[4.0, 2.0], [2.0, 3.0]])
    np.testing.assert_allclose(cholesky(matrix), np.linalg.cholesky(matrix))
