import numpy as np
import pytest
from scipy.stats import multivariate_normal

from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.tracking.bins import BinnedBearings
from gbt_ocp.tracking.displacement.fit import Anchor, DisplacementFit, Node, PosteriorMixture, grid
from gbt_ocp.tracking.displacement.kernels import DISPLACEMENT_KERNELS
from gbt_ocp.tracking.displacement.rows import bearing_rows
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.priors import LogNormal

NODE = Node(np.log(1.5), np.log(2.0), 0.01**2, -0.3)


def toy(dimension, kernel="velocity_matern32"):
    rng = np.random.default_rng(dimension)
    times = np.linspace(0.0, 3.0, 7)
    target = np.stack([np.ones(7) * 3.0, times, *([0.3 * times] if dimension == 3 else [])], axis=-1)
    own = rng.normal(0.0, 1.0, (7, dimension))
    samples = BinnedBearings(times, unit_bearing(target, own), own, np.arange(1.0, 8.0))
    rows = bearing_rows(samples, target + 0.1)
    anchor = Anchor(3.0, np.full(dimension, 0.5), np.diag([4.0, 9.0, 1.0][:dimension]))
    trust = rng.uniform(0.3, 1.0, len(rows.values))
    fit = DisplacementFit(DISPLACEMENT_KERNELS[kernel], anchor, BearingNoise(0.01, own_std=0.02), samples, rows, trust)
    return fit, np.array([3.0, 3.4, 1.2])


def joint(fit, node, ahead):
    """Mean and covariance of rows and positions from the definition: coordinate by coordinate, no shortcut."""
    d = fit.anchor.mean.size
    times = np.concatenate([fit.samples.times, ahead]) - fit.anchor.time
    k = np.exp(2.0 * node.log_scale) * fit.kernel(times, times, node.log_length)
    positions = np.kron(k, np.eye(d)) + np.kron(np.ones_like(k), fit.anchor.covariance)
    n = len(fit.samples.times)
    observe = np.zeros((len(fit.rows.values), len(times) * d))
    for r, sample in enumerate(fit.rows.sample):
        observe[r, sample * d : (sample + 1) * d] = fit.rows.directions[r]
    counts = fit.samples.counts[fit.rows.sample]
    noise = (fit.rows.ranges**2 * node.white_variance / fit.trust + fit.noise.own_std**2) / counts
    omega = observe @ positions @ observe.T + np.diag(noise)
    mean = observe @ np.tile(fit.anchor.mean, len(times))
    return mean, omega, positions[n * d :] @ observe.T, positions[n * d :, n * d :]


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("kernel", ["velocity_se", "velocity_ou", "matern52"])
def test_posterior_and_evidence_are_those_of_the_joint_gaussian(dimension, kernel):
    fit, ahead = toy(dimension, kernel)
    mean, omega, cross, prior = joint(fit, NODE, ahead)
    gain = np.linalg.solve(omega, cross.T).T
    solution = fit.solve(NODE)
    forecast = fit.predict(solution, ahead)
    expected = np.tile(fit.anchor.mean, len(ahead)) + gain @ (fit.rows.values - mean)
    np.testing.assert_allclose(forecast.mean.ravel(), expected, atol=1e-8)
    covariance = prior - gain @ cross.T
    for k in range(len(ahead)):
        block = slice(k * dimension, (k + 1) * dimension)
        np.testing.assert_allclose(forecast.covariance[k], covariance[block, block], atol=1e-7)
    density = multivariate_normal(mean, omega).logpdf(fit.rows.values)
    # the density of the angles, values over ranges
    assert solution.log_evidence == pytest.approx(density + np.log(fit.rows.ranges).sum() + NODE.log_prior, rel=1e-9)


def test_misfit_vanishes_where_the_linearisation_has_settled():
    fit, _ = toy(3)
    for _ in range(30):
        solution = fit.solve(NODE)
        places = fit.predict(solution, fit.samples.times).mean
        fit = DisplacementFit(
            fit.kernel, fit.anchor, fit.noise, fit.samples, bearing_rows(fit.samples, places), fit.trust
        )
    assert fit.misfit(fit.solve(NODE)) == pytest.approx(0.0, abs=1e-6)
    # linearised far from where the solution is, the true angles differ from the linear ones
    rows = bearing_rows(fit.samples, places + 2.0)
    off = DisplacementFit(fit.kernel, fit.anchor, fit.noise, fit.samples, rows, fit.trust)
    assert abs(off.misfit(off.solve(NODE))) > 1.0


def test_a_mixture_has_the_moments_of_its_parts():
    fit, ahead = toy(2)
    nodes = grid(LogNormal(1.0, 0.5), LogNormal(2.0, 0.5), [(1e-4, 0.0), (4e-4, -1.0)])
    assert len(nodes) == 40
    mixture = PosteriorMixture.over(fit, nodes)
    weights = np.array([weight for _, _, weight in mixture.parts])
    assert weights.sum() == pytest.approx(1.0)
    rng = np.random.default_rng(0)
    draws = []
    for solution, weight in ((s, w) for _, s, w in mixture.parts):
        forecast = fit.predict(solution, ahead[:1])
        draws.append(rng.multivariate_normal(forecast.mean[0], forecast.covariance[0], int(400_000 * weight)))
    drawn = np.concatenate(draws)
    forecast = mixture.predict(ahead[:1])
    np.testing.assert_allclose(drawn.mean(axis=0), forecast.mean[0], atol=0.02 * drawn.std())
    np.testing.assert_allclose(np.cov(drawn.T), forecast.covariance[0], atol=0.03 * drawn.var())


def test_evidence_adds_up_over_the_grid_and_over_mixtures():
    fit, _ = toy(2)
    nodes = grid(LogNormal(1.0, 0.5), LogNormal(2.0, 0.5), [(1e-4, 0.0)])
    logs = [fit.solve(node).log_evidence for node in nodes]
    whole = PosteriorMixture.over(fit, nodes)
    assert whole.log_evidence == pytest.approx(np.logaddexp.reduce(logs))
    halves = PosteriorMixture.of(
        [PosteriorMixture.over(fit, nodes[:10]), PosteriorMixture.over(fit, nodes[10:])], [0.0, 0.0]
    )
    assert halves.log_evidence == pytest.approx(whole.log_evidence, abs=0.02)
    first, second = (mixture.predict(np.array([3.5])) for mixture in (halves, whole))
    np.testing.assert_allclose(first.mean, second.mean, atol=0.01)
