import casadi as ca
import numpy as np
import pytest

from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull, sigma_points, sigma_weights
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.tracking.protocol import Forecast

both_dimensions = pytest.mark.parametrize("dimension", [2, 3])
every_kappa = pytest.mark.parametrize("kappa", [-0.5, 0.0, 1.0, 2.0])


def covariance(dimension, seed=0):
    root = np.random.default_rng(seed).standard_normal((dimension, dimension))
    return root @ root.T


def term(objective, own, data, pieces=1):
    """The objective at positions ``own`` (p, d) as numbers."""
    bound = objective.bind(pieces, data)
    values = []
    for i in range(pieces):
        z = ca.DM(np.append(own[i], 0.4))
        values.append(float(objective.value(FlatPoint(z, 0 * z, 0 * z), {k: ca.DM(v[i]) for k, v in bound.items()})))
    return values


@both_dimensions
@every_kappa
def test_sigma_points_have_the_mean_and_covariance(dimension, kappa):
    mean, sigma = np.arange(1.0, dimension + 1.0), covariance(dimension)
    points, weights = sigma_points(mean, sigma, kappa), sigma_weights(dimension, kappa)
    assert points.shape == (2 * dimension + 1, dimension)
    np.testing.assert_allclose(weights @ points, mean, atol=1e-13)
    spread = points - mean
    np.testing.assert_allclose(spread.T @ (weights[:, None] * spread), sigma, atol=1e-12)
    np.testing.assert_array_equal(points[0], mean)


@both_dimensions
def test_sigma_points_of_many_times_are_those_of_each(dimension):
    means = np.random.default_rng(1).standard_normal((6, dimension))
    sigmas = np.array([covariance(dimension, seed) for seed in range(6)])
    together = sigma_points(means, sigmas, 1.0)
    for k in range(6):
        np.testing.assert_allclose(together[k], sigma_points(means[k], sigmas[k], 1.0), atol=1e-12)


@both_dimensions
def test_a_turn_of_the_axes_turns_the_sigma_points(dimension):
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((dimension, dimension)))[0]
    sigma = covariance(dimension)
    # The symmetric root is the only one that turns with the axes: R √Σ Rᵀ = √(R Σ Rᵀ).
    root = sigma_points(np.zeros(dimension), sigma, 1.0)[dimension + 1 :]
    turned = sigma_points(np.zeros(dimension), turn @ sigma @ turn.T, 1.0)[dimension + 1 :]
    np.testing.assert_allclose(turned, turn @ root @ turn.T, atol=1e-12)


@both_dimensions
def test_unscented_similarity_converges_to_monte_carlo_with_its_known_order(dimension):
    """κ = 3 - d matches the fourth moments along the axes; the error falls like the fourth power of the deviation."""
    kappa = 3.0 - dimension
    objective = BearingSimilarity(dimension, kappa=kappa)
    mean = np.array([2.0, 1.0, 0.5][:dimension])
    shape = covariance(dimension, seed=3)
    shape /= np.linalg.norm(shape, 2)
    own, desired = np.zeros(dimension), np.array([0.6, -0.8, 0.0][:dimension])
    # Gauss-Hermite quadrature is the Monte Carlo integral without its noise: it resolves errors of 1e-9.
    nodes, weights = np.polynomial.hermite_e.hermegauss(31)
    grid = np.stack(np.meshgrid(*[nodes] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
    share = np.prod(np.stack(np.meshgrid(*[weights] * dimension, indexing="ij"), axis=-1), axis=-1).ravel()
    errors, linearised = [], []
    for size in (0.4, 0.2, 0.1):
        sigma = size**2 * shape
        line = mean + grid @ np.linalg.cholesky(sigma).T
        true = share @ (line @ desired / np.linalg.norm(line, axis=1)) / share.sum()
        data = {"forecast": Forecast(mean[None], sigma[None]), "desired": desired[None]}
        errors.append(abs(term(objective, own[None], data)[0] - true))
        linearised.append(abs(mean @ desired / np.linalg.norm(mean) - true))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 3.6), (errors, orders)
    # Without sigma points, at the mean alone, the order is 2.
    assert np.all(np.abs(np.log2(np.array(linearised[:-1]) / linearised[1:]) - 2.0) < 0.5)
    assert errors[-1] < 0.05 * linearised[-1]


@both_dimensions
def test_unscented_similarity_agrees_with_random_draws(dimension):
    rng = np.random.default_rng(4)
    mean, sigma = np.array([2.0, 1.0, 0.5][:dimension]), 0.01 * covariance(dimension, seed=5)
    desired = np.array([0.6, -0.8, 0.0][:dimension])
    line = rng.multivariate_normal(mean, sigma, 200_000)
    draws = line @ desired / np.linalg.norm(line, axis=1)
    data = {"forecast": Forecast(mean[None], sigma[None]), "desired": desired[None]}
    found = term(BearingSimilarity(dimension), np.zeros((1, dimension)), data)[0]
    assert found == pytest.approx(draws.mean(), abs=4.0 * draws.std() / np.sqrt(200_000) + 2e-4)


def test_similarity_of_a_certain_target_is_the_cosine():
    data = {"forecast": Forecast(np.array([[3.0, 4.0], [0.0, 1.0]]), np.zeros((2, 2, 2))), "desired": np.eye(2)}
    np.testing.assert_allclose(term(BearingSimilarity(2), np.array([[0.0, 0.0], [0.0, 3.0]]), data, 2), [0.6, -1.0])


def test_similarity_is_finite_where_the_vehicle_meets_the_target():
    objective = BearingSimilarity(2)
    z = ca.SX.sym("z", 3)
    numbers = {"sigma_points": ca.DM(np.ones((2, 5))), "desired": ca.DM([1.0, 0.0])}
    value = objective.value(FlatPoint(z, 0 * z, 0 * z), numbers)
    hessian = ca.Function("h", [z], [value, *ca.hessian(value, z)])
    for result in hessian(ca.DM([1.0, 1.0, 0.0])):
        assert np.all(np.isfinite(np.asarray(result)))


def test_pull_is_the_softplus_of_the_range_beyond_its_reference():
    ranges = np.array([0.0, 0.5, 1.0, 2.0, 30.0, 5000.0])
    data = {"forecast": Forecast(np.stack([ranges, 0.0 * ranges], axis=-1), np.zeros((6, 2, 2)))}
    found = term(RangePull(2, weight=0.2, reference=1.0), np.zeros((6, 2)), data, 6)
    np.testing.assert_allclose(found, -0.2 * 0.1 * np.logaddexp(0.0, (ranges - 1.0) / 0.1), atol=1e-6)


@pytest.mark.parametrize("objective", [BearingSimilarity(2), RangePull(2)])
@pytest.mark.parametrize("reach", [0.3, 1.0, 40.0])
def test_gradients_against_central_differences(objective, reach):
    sigma = 0.04 * covariance(2)
    data = {"forecast": Forecast(np.array([[reach, 0.2 * reach]]), sigma[None]), "desired": np.array([[0.6, -0.8]])}
    bound = {name: ca.DM(values[0]) for name, values in objective.bind(1, data).items()}
    z = ca.SX.sym("z", 3)
    value = objective.value(FlatPoint(z, 0 * z, 0 * z), bound)
    function = ca.Function("f", [z], [value, ca.gradient(value, z)])
    at, step = np.array([0.1, -0.3, 0.7]), 1e-6
    numeric = [float(function(at + step * e)[0] - function(at - step * e)[0]) / (2.0 * step) for e in np.eye(3)]
    np.testing.assert_allclose(np.asarray(function(at)[1]).ravel(), numeric, atol=1e-7)


def test_what_is_missing_is_named():
    with pytest.raises(ValueError, match="BearingSimilarity needs 'forecast'; given: desired"):
        BearingSimilarity(2).bind(1, {"desired": np.ones((1, 2))})
    with pytest.raises(ValueError, match="RangePull needs 'forecast'; given: nothing"):
        RangePull(2).bind(1, {})


def test_what_was_left_at_none_is_not_listed_as_given():
    with pytest.raises(ValueError, match=r"given: desired$"):
        BearingSimilarity(2).bind(1, {"forecast": None, "desired": np.ones((1, 2))})
