import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal, norm

from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.tracking.gp.kernels import KERNELS
from gbt_ocp.tracking.gp.likelihood import LogLikelihood, maximise
from gbt_ocp.tracking.linalg import NotPositiveDefiniteError
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.tracking.window import Measurements, Window

CASES = [(name, dimension) for name in KERNELS for dimension in (2, 3)]
every_case = pytest.mark.parametrize(("name", "dimension"), CASES)


def window(dimension, count=8, seed=1):
    rng = np.random.default_rng(seed)
    found = Window(count)
    for t in np.cumsum(rng.uniform(0.1, 0.4, count)):
        own = 3.0 * rng.standard_normal(dimension)
        target = np.array([np.sin(t), np.cos(0.7 * t) + 2.0, 0.3 * t][:dimension])
        found.append(t, unit_bearing(target, own), own)
    return found


def log_theta(name, length=0.9, amplitude=2.5):
    return np.log([*[length, 1.3][: len(KERNELS[name].names)], amplitude])


@every_case
def test_value_is_scipys_multivariate_normal(name, dimension):
    data, centre, theta = window(dimension), np.arange(1.0, dimension + 1.0), log_theta(name)
    # Ω by G and K as the paper writes it, with tangent bases of its own.
    g = block_diag(*[np.linalg.svd(b[None])[2][1:] for b in data.bearings])
    lag = data.times[:, None] - data.times[None, :]
    omega = 2.5**2 * (g @ np.kron(KERNELS[name](lag, theta[:-1]), np.eye(dimension)) @ g.T + 1e-4 * np.eye(len(g)))
    y = g @ data.own_positions.ravel()
    expected = multivariate_normal(g @ np.tile(centre, 8), omega).logpdf(y)
    found, _ = LogLikelihood(KERNELS[name], data.measurements(), centre, 1e-4)(theta)
    assert found == pytest.approx(expected, rel=1e-9)


@every_case
def test_gradient_against_central_differences(name, dimension):
    data = window(dimension).measurements()
    # A known position beside the bearings: its variance does not scale with the amplitude.
    data = Measurements(
        np.append(data.times, np.zeros(dimension)),
        np.vstack([data.directions, np.eye(dimension)]),
        np.append(data.values, np.zeros(dimension)),
        np.append(data.variances, np.full(dimension, 9.0)),
    )
    likelihood = LogLikelihood(KERNELS[name], data, np.ones(dimension), 1e-3)
    theta, step = log_theta(name), 1e-5
    numeric = [
        (likelihood(theta + step * e)[0] - likelihood(theta - step * e)[0]) / (2.0 * step) for e in np.eye(len(theta))
    ]
    np.testing.assert_allclose(likelihood(theta)[1], numeric, rtol=1e-6, atol=1e-6)


def test_a_singular_window_is_said_so():
    found = Window(20)
    for k in range(20):
        found.append(1e-9 * k, [0.6, 0.8], [1.0, 2.0])
    with pytest.raises(NotPositiveDefiniteError):
        LogLikelihood(KERNELS["se"], found.measurements(), np.zeros(2), 1e-18)(np.log([1.0, 1.0]))


def grid_maximum(likelihood, priors, lengths, amplitudes):
    best = (-np.inf, None)
    for length in lengths:
        for amplitude in amplitudes:
            theta = np.log([length, amplitude])
            value = likelihood(theta)[0]
            value += sum(prior(log)[0] for prior, log in zip(priors, theta, strict=True) if prior)
            best = max(best, (value, (length, amplitude)), key=lambda pair: pair[0])
    return best


@pytest.mark.parametrize("priors", [(None, None), (LogNormal(0.5, 0.3), LogNormal(4.0, 0.3))])
def test_maximum_is_that_of_a_grid(priors):
    likelihood = LogLikelihood(KERNELS["se"], window(2, count=12).measurements(), np.zeros(2), 1e-4)
    bounds = [(np.log(0.05), np.log(20.0)), (np.log(0.05), np.log(50.0))]
    found = maximise(likelihood, np.log([1.0, 1.0]), bounds, priors)
    value = likelihood(found)[0] + sum(prior(log)[0] for prior, log in zip(priors, found, strict=True) if prior)
    best, where = grid_maximum(likelihood, priors, np.geomspace(0.06, 19.0, 60), np.geomspace(0.06, 49.0, 60))
    assert value >= best - 1e-9
    np.testing.assert_allclose(np.exp(found), where, rtol=0.12)


def test_bounds_hold_and_equal_bounds_fix_a_parameter():
    likelihood = LogLikelihood(KERNELS["se"], window(2).measurements(), np.zeros(2), 1e-4)
    start = np.log([1.0, 1.0])
    found = maximise(likelihood, start, [(0.0, 0.0), (np.log(0.9), np.log(1.1))], (None, None))
    assert found[0] == 0.0
    assert np.log(0.9) <= found[1] <= np.log(1.1)
    # The likelihood rises towards a larger amplitude here: the bound is reached.
    assert likelihood(start)[1][1] > 0.0
    assert found[1] == pytest.approx(np.log(1.1))


def test_a_start_that_is_worthless_is_returned():
    found = Window(20)
    for k in range(20):
        found.append(1e-9 * k, [0.6, 0.8], [1.0, 2.0])
    likelihood = LogLikelihood(KERNELS["se"], found.measurements(), np.zeros(2), 1e-18)
    start = np.log([1.0, 2.0])
    np.testing.assert_array_equal(maximise(likelihood, start, [(-3.0, 3.0)] * 2, (None, None)), start)


def exact_bearings(count):
    """A window of a smooth motion, seen without noise."""
    found = Window(count)
    for t in 0.1 * np.arange(count):
        own = 2.0 * np.array([np.sin(1.3 * t), np.cos(1.3 * t)])
        found.append(t, unit_bearing(np.array([np.sin(t), np.cos(0.7 * t) + 4.0]), own), own)
    return found.measurements()


class Counted(LogLikelihood):
    expansions = 0

    def expand(self, log_theta):
        self.expansions += 1
        return super().expand(log_theta)


PROCESS_BOUNDS = np.log([(0.3, 200.0), (0.5, 200.0), (1e-14, 1e-2)])


def test_a_search_ends_where_rounding_hides_what_a_step_promises():
    """With a nugget of 1e-14 the likelihood is known to a few thousandths: what a step gains of less is chance."""
    likelihood = Counted(KERNELS["se"], exact_bearings(20), np.zeros(2), None)
    found = maximise(likelihood, np.log([1.0, 1.0, 1e-11]), PROCESS_BOUNDS, (None,) * 3)
    nearby = [likelihood(found + 1e-10 * k * np.eye(3)[0])[0] for k in range(30)]
    assert np.std(nearby) > 100.0 * 1e-5, "more than the gain at which a search would end without rounding"
    assert np.std(nearby) < 4.0 * np.finfo(float).eps / np.exp(found[2]), "and about what it is taken for"
    likelihood.expansions = 0
    again = maximise(likelihood, found, PROCESS_BOUNDS, (None,) * 3)
    assert likelihood.expansions <= 2
    assert likelihood(again)[0] > likelihood(found)[0] - 0.05


def test_a_search_for_a_noisy_motion_ends_where_there_is_no_noise():
    likelihood = Counted(KERNELS["se"], exact_bearings(20), np.zeros(2), None)
    start = np.log([3.0, 3.0, 1e-4])
    found = maximise(likelihood, start, PROCESS_BOUNDS, (None,) * 3, 1e-8)
    few = likelihood.expansions
    whole = maximise(likelihood, start, PROCESS_BOUNDS, (None,) * 3)
    assert 1e-14 < np.exp(found[2]) < 1e-8
    assert np.exp(whole[2]) < 1e-12
    assert few < likelihood.expansions - few


def test_prior_is_normal_in_the_logarithm():
    prior, step = LogNormal(2.0, 0.5), 1e-6
    for log in (-1.0, 0.3, np.log(2.0), 4.0):
        expected = norm(np.log(2.0), 0.5).logpdf(log) - norm(np.log(2.0), 0.5).logpdf(np.log(2.0))
        assert prior(log)[0] == pytest.approx(expected)
        assert prior(log)[1] == pytest.approx((prior(log + step)[0] - prior(log - step)[0]) / (2 * step), abs=1e-7)
