"""The nugget as a hyperparameter: derivatives, and what it adapts to."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from test_noisy_gp import circling, drawn_target

from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.tracking.gp import tuning
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker
from gbt_ocp.tracking.gp.kernels import KERNELS
from gbt_ocp.tracking.gp.likelihood import LogLikelihood
from gbt_ocp.tracking.window import Measurements


def rows(rng, count=14, dimension=2):
    directions = rng.normal(size=(count, dimension))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return Measurements(np.sort(rng.uniform(0, 3, count)), directions, rng.normal(size=count), np.zeros(count))


def covariance(data, log_theta):
    length, amplitude, nugget = np.exp(log_theta)
    lag = data.times[:, None] - data.times[None, :]
    plain = np.exp(-0.5 * (lag / length) ** 2) * (data.directions @ data.directions.T)
    return amplitude**2 * (plain + nugget * np.eye(len(lag)))


THETA = np.log([0.8, 2.0, 0.03])


def test_value_is_the_density_and_gradient_its_derivative():
    data = rows(np.random.default_rng(0))
    likelihood = LogLikelihood(KERNELS["se"], data, np.zeros(2), None)

    def density(log_theta):
        return multivariate_normal(np.zeros(len(data.values)), covariance(data, log_theta)).logpdf(data.values)

    value, gradient = likelihood(THETA)
    assert value == pytest.approx(density(THETA), abs=1e-9)
    numeric = [(density(THETA + step) - density(THETA - step)) / 2e-5 for step in 1e-5 * np.eye(3)]
    np.testing.assert_allclose(gradient, numeric, rtol=1e-6, atol=1e-6)


def test_information_is_the_covariance_of_the_score():
    rng = np.random.default_rng(1)
    data = rows(rng)
    root = np.linalg.cholesky(covariance(data, THETA))
    scores = []
    for _ in range(6000):
        drawn = Measurements(data.times, data.directions, root @ rng.normal(size=len(root)), data.variances)
        scores.append(LogLikelihood(KERNELS["se"], drawn, np.zeros(2), None)(THETA)[1])
    information = LogLikelihood(KERNELS["se"], data, np.zeros(2), None).expand(THETA)[2]
    # standard error of a covariance of N draws: about sqrt((C_ii C_jj + C_ij²)/N)
    spread = np.sqrt((np.outer(np.diag(information), np.diag(information)) + information**2) / len(scores))
    assert np.all(np.abs(np.cov(np.array(scores).T) - information) < 5.0 * spread)


AHEAD = 3.9 + 0.1 * np.arange(12)


def motion(t):
    return 3.0 * np.stack([np.cos(0.4 * t), np.sin(0.4 * t)], axis=-1)


def fed(rounding, **settings):
    """A tracker after four seconds of circling a target on a curve, whose positions were rounded."""
    tracker = GaussianProcessTracker(2, **settings)
    for t in 0.1 * np.arange(40):
        target = motion(t)
        own = target - 0.4 * np.array([np.cos(6.28 * t), np.sin(6.28 * t)])
        if rounding:
            target = np.round(target / rounding) * rounding
        tracker.update(t, unit_bearing(target, own), own)
    return tracker


def test_the_nugget_finds_the_rounding_of_the_data():
    exact, rounded, coarse = (fed(rounding) for rounding in (0.0, 1e-4, 1e-2))
    # exact bearings: as small as it may be
    assert exact.hyperparameters.nugget < 1e-12
    for tracker, rounding in ((rounded, 1e-4), (coarse, 1e-2)):
        theta = tracker.hyperparameters
        # a rounding to r has a variance of r²/12
        found = theta.nugget * theta.amplitude**2
        assert rounding**2 / 12 / 20 < found < 20 * rounding**2 / 12
        assert mean_error(tracker) < 0.1


def mean_error(tracker):
    return np.linalg.norm(tracker.predict(AHEAD).mean - motion(AHEAD), axis=1).mean()


def test_a_fixed_nugget_below_the_rounding_loses_the_forecast():
    """Why it is tuned: the same data with the nugget held where exact bearings would have it."""
    assert mean_error(fed(1e-2, nugget=1e-13)) > 0.1


@pytest.mark.parametrize("noise", [1e-3, 3e-3, 1e-2])
def test_where_bearings_are_explained_a_second_search_finds_nothing(monkeypatch, noise):
    """Hyperparameters after every bearing, with the search that is left out where a first one needs no noise."""
    searches, found = [], []

    def counted(*arguments, search=tuning.maximise):
        searches[-1] += 1
        return search(*arguments)

    monkeypatch.setattr(tuning, "maximise", counted)
    times = 0.1 * np.arange(50)
    for least in (tuning.TELLTALE, 1e-300):
        monkeypatch.setattr(tuning, "TELLTALE", least)
        rng, tracker = np.random.default_rng(300), GaussianProcessTracker(2)
        target, own = drawn_target(rng, times, 2, length=1.0), circling(times, 2)
        searches.append(0)
        found.append([])
        for k, t in enumerate(times):
            bearing = rotate_bearing(unit_bearing(target[k], own[k]), noise * rng.standard_normal(1))
            tracker.update(t, bearing, own[k])
            theta = tracker.hyperparameters
            found[-1].append([*theta.log_kernel, theta.log_amplitude, theta.nugget])
    assert searches[0] < searches[1]
    np.testing.assert_array_equal(*found)
