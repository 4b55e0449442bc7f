"""The coregionalised process: density, gradient, special cases, what of it the data can tell."""

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal

from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.tracking.gp.coregionalization import (
    CoregionalizedHyperparameters,
    CoregionalizedLikelihood,
    CoregionalizedPosterior,
)
from gbt_ocp.tracking.gp.kernels import KERNELS
from gbt_ocp.tracking.gp.likelihood import LogLikelihood, maximise
from gbt_ocp.tracking.gp.posterior import Hyperparameters, Posterior
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.tracking.window import Measurements, Window

# kernels of the latent functions, in the plane and in space, as many as axes and more
MODELS = [("se", "se"), ("se", "matern52", "rq"), ("se", "rq", "matern32"), ("se", "se", "se", "matern52")]
DIMENSIONS = [2, 2, 3, 3]
every_model = pytest.mark.parametrize(("names", "dimension"), list(zip(MODELS, DIMENSIONS, strict=True)))


def window(dimension, count=8, seed=1):
    rng = np.random.default_rng(seed)
    found = Window(count)
    for t in np.cumsum(rng.uniform(0.1, 0.4, count)):
        own = 3.0 * rng.standard_normal(dimension)
        target = np.array([np.sin(t), np.cos(0.7 * t) + 2.0, 0.3 * t][:dimension])
        found.append(t, unit_bearing(target, own), own)
    return found


def hyperparameters(names, dimension, nugget=1e-3):
    rng = np.random.default_rng(2)
    log_kernels = tuple(np.log([0.6 + 0.7 * q, 1.3][: len(KERNELS[name].names)]) for q, name in enumerate(names))
    return CoregionalizedHyperparameters(log_kernels, rng.standard_normal((dimension, len(names))), nugget)


def with_a_known_position(data, dimension):
    return Measurements(
        np.append(data.times, np.zeros(dimension)),
        np.vstack([data.directions, np.eye(dimension)]),
        np.append(data.values, np.zeros(dimension)),
        np.append(data.variances, np.full(dimension, 9.0)),
    )


@every_model
def test_value_is_scipys_multivariate_normal(names, dimension):
    data, centre, theta = window(dimension), np.arange(1.0, dimension + 1.0), hyperparameters(names, dimension)
    # Ω by G and K as the paper writes it, with tangent bases of its own.
    g = block_diag(*[np.linalg.svd(b[None])[2][1:] for b in data.bearings])
    lag = data.times[:, None] - data.times[None, :]
    process = sum(
        np.kron(KERNELS[name](lag, log_kernel), np.outer(column, column))
        for name, log_kernel, column in zip(names, theta.log_kernels, theta.weights.T, strict=True)
    )
    noise = np.trace(theta.weights @ theta.weights.T) / dimension * 1e-3
    omega = g @ process @ g.T + noise * np.eye(len(g))
    expected = multivariate_normal(g @ np.tile(centre, 8), omega).logpdf(g @ data.own_positions.ravel())
    kernels = [KERNELS[name] for name in names]
    for nugget, unit in ((None, 2.5), (1e-3, 1.0)):
        likelihood = CoregionalizedLikelihood(kernels, data.measurements(), centre, nugget, unit=unit)
        assert likelihood(likelihood.pack(theta))[0] == pytest.approx(expected, rel=1e-9)


@every_model
@pytest.mark.parametrize("nugget", [None, 1e-3])
def test_gradient_against_central_differences(names, dimension, nugget):
    data = with_a_known_position(window(dimension).measurements(), dimension)
    kernels = [KERNELS[name] for name in names]
    likelihood = CoregionalizedLikelihood(
        kernels, data, np.ones(dimension), nugget, unit=1.7, amplitude_prior=LogNormal(3.0, 0.5)
    )
    at, step = likelihood.pack(hyperparameters(names, dimension)), 1e-5
    numeric = [(likelihood(at + step * e)[0] - likelihood(at - step * e)[0]) / (2.0 * step) for e in np.eye(len(at))]
    np.testing.assert_allclose(likelihood(at)[1], numeric, rtol=1e-6, atol=1e-6)


def test_information_is_the_covariance_of_the_score():
    names, dimension = ("se", "matern52"), 2
    theta, data = hyperparameters(names, dimension, 0.05), window(dimension).measurements()
    kernels, rng = [KERNELS[name] for name in names], np.random.default_rng(3)
    drawn = draws(names, theta, data.times, data.directions, 4000, rng)

    def likelihood(values):
        rows = Measurements(data.times, data.directions, values, data.variances)
        return CoregionalizedLikelihood(kernels, rows, np.zeros(dimension), None)

    at = likelihood(drawn[0]).pack(theta)
    scores = np.array([likelihood(values)(at)[1] for values in drawn])
    information = likelihood(drawn[0]).expand(at)[2]
    # standard error of a covariance of N draws: about sqrt((C_ii C_jj + C_ij²)/N)
    spread = np.sqrt((np.outer(np.diag(information), np.diag(information)) + information**2) / len(scores))
    assert np.all(np.abs(np.cov(scores.T) - information) < 5.0 * spread)


def draws(names, theta, times, directions, count, rng):
    """Measurements ``(count, R)`` of targets drawn from the process, latent function by latent function."""
    lag = times[:, None] - times[None, :]
    found = theta.amplitude * np.sqrt(theta.nugget) * rng.standard_normal((count, len(times)))
    for name, log_kernel, column in zip(names, theta.log_kernels, theta.weights.T, strict=True):
        values, vectors = np.linalg.eigh(KERNELS[name](lag, log_kernel))
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        found += (rng.standard_normal((count, len(times))) @ root.T) * (directions @ column)
    return found


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_diagonal_with_equal_kernels_is_the_plain_process(dimension):
    data = with_a_known_position(window(dimension).measurements(), dimension)
    centre, nugget = np.ones(dimension), 1e-6
    kernels, shape = [KERNELS["rq"]] * dimension, np.log([0.9, 1.4])
    plain = Posterior(KERNELS["rq"], Hyperparameters(shape, np.log(2.5), nugget), data, centre)
    turn = np.linalg.qr(np.random.default_rng(4).standard_normal((dimension, dimension)))[0]
    ahead = np.linspace(0.0, 5.0, 7)
    expected = plain.predict(ahead)
    value, gradient = LogLikelihood(KERNELS["rq"], data, centre, nugget)(np.append(shape, np.log(2.5)))
    # a rotation of the columns changes nothing where the kernels are equal
    for weights in (2.5 * np.eye(dimension), 2.5 * turn):
        theta = CoregionalizedHyperparameters((shape,) * dimension, weights, nugget)
        posterior = CoregionalizedPosterior(kernels, theta, data, centre)
        found = posterior.predict(ahead)
        np.testing.assert_allclose(found.mean, expected.mean, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(found.covariance, expected.covariance, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(posterior.prior_covariance, plain.prior_covariance, rtol=0.0, atol=1e-12)
        assert theta.amplitude == pytest.approx(2.5, rel=1e-12)
        likelihood = CoregionalizedLikelihood(kernels, data, centre, nugget)
        coregionalised = likelihood(likelihood.pack(theta))
        assert coregionalised[0] == pytest.approx(value, abs=1e-9)
        # what belongs to one parameter there is shared by several here
        slopes = coregionalised[1]
        np.testing.assert_allclose(slopes[: 2 * dimension].reshape(dimension, 2).sum(axis=0), gradient[:2], atol=1e-8)
        assert slopes[2 * dimension :] @ weights.ravel() == pytest.approx(gradient[2], abs=1e-8)


def test_signs_and_order_of_the_columns_change_nothing():
    names, data = ("se", "matern52", "rq"), window(2).measurements()
    theta, order, signs = hyperparameters(names, 2), [2, 0, 1], np.array([1.0, -1.0, -1.0])
    other = CoregionalizedHyperparameters(
        tuple(theta.log_kernels[q] for q in order), (theta.weights * signs)[:, order], theta.nugget
    )
    ahead = np.linspace(0.0, 4.0, 5)
    one = CoregionalizedPosterior([KERNELS[name] for name in names], theta, data, np.zeros(2))
    two = CoregionalizedPosterior([KERNELS[names[q]] for q in order], other, data, np.zeros(2))
    np.testing.assert_allclose(one.predict(ahead).mean, two.predict(ahead).mean, atol=1e-10)
    np.testing.assert_allclose(one.predict(ahead).covariance, two.predict(ahead).covariance, atol=1e-10)
    np.testing.assert_allclose(theta.coregionalization[order], other.coregionalization, atol=1e-12)


@pytest.mark.parametrize("names", [("se", "se"), ("se", "matern52", "rq")])
def test_covariances_of_the_posterior_are_those_of_draws(names):
    theta, rng = hyperparameters(names, 2), np.random.default_rng(5)
    times, others = np.array([0.0, 0.7]), np.array([0.2, 1.5, 2.0])
    posterior = CoregionalizedPosterior([KERNELS[name] for name in names], theta, window(2).measurements(), np.zeros(2))
    # coordinates as measurements of their own, without noise
    both = np.concatenate([times, others])
    exact = CoregionalizedHyperparameters(theta.log_kernels, theta.weights, 0.0)
    drawn = draws(names, exact, np.repeat(both, 2), np.tile(np.eye(2), (5, 1)), 100_000, rng)
    sampled = np.cov(drawn.T).reshape(5, 2, 5, 2).transpose(0, 2, 1, 3)
    largest = np.abs(sampled).max()
    np.testing.assert_allclose(posterior.covariances(times, others), sampled[:2, 2:], atol=0.02 * largest)
    np.testing.assert_allclose(posterior.prior_covariance, sampled[0, 0], atol=0.02 * largest)


def test_maximum_likelihood_recovers_the_coregionalisation_matrices():
    """Two latent functions of 0.6 and 2.5 s, 260 measurements in 120 s, four draws.

    The slow function has about 120/2.5 independent values, so one draw tells B to √(2/48) = 20 %; allowed are 45 % in
    each draw and 20 % in their mean, in the Frobenius norm.
    """
    truth = CoregionalizedHyperparameters((np.log([0.6]), np.log([2.5])), np.array([[1.0, 2.0], [-0.8, 1.2]]), 1e-4)
    rng, kernels = np.random.default_rng(6), [KERNELS["se"]] * 2
    times = np.sort(rng.uniform(0.0, 120.0, 260))
    directions = rng.standard_normal((260, 2))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    bounds = [(np.log(0.1), np.log(20.0))] * 2 + [(-20.0, 20.0)] * 4 + [(np.log(1e-6), np.log(1e-2))]
    errors, matrices = [], []
    for values in draws(("se", "se"), truth, times, directions, 4, rng):
        data = Measurements(times, directions, values, np.zeros(260))
        likelihood = CoregionalizedLikelihood(kernels, data, np.zeros(2), None)
        # starts that differ only in which latent function is the faster, at no known direction
        start = likelihood.pack(CoregionalizedHyperparameters((np.log([1.0]), np.log([1.5])), np.eye(2), 1e-3))
        found = likelihood.unpack(maximise(likelihood, start, bounds, [None] * len(start)))
        order = np.argsort(found.length_scales)
        matrices.append(found.coregionalization[order])
        errors.append(relative(matrices[-1], truth.coregionalization))
        np.testing.assert_allclose(found.length_scales[order], truth.length_scales, rtol=0.2)
    assert np.max(errors) < 0.45
    assert np.all(relative(np.mean(matrices, axis=0), truth.coregionalization) < 0.2)


def relative(found, truth):
    return np.linalg.norm(found - truth, axis=(1, 2)) / np.linalg.norm(truth, axis=(1, 2))
