"""NEES and its regions, against the inverse, draws, and what is known of singular covariances."""

import numpy as np
import pytest
from scipy.stats import chi2

from gbt_ocp.simulation.calibration import CONFIDENCE, region_radius, squared_errors, within


@pytest.mark.parametrize("shape", [(), (50,), (5, 4)])
@pytest.mark.parametrize("dimension", [2, 3])
def test_squared_errors_are_those_of_the_inverse(shape, dimension):
    rng = np.random.default_rng(1)
    roots, errors = rng.standard_normal((*shape, dimension, dimension)), rng.standard_normal((*shape, dimension))
    sigma = roots @ np.swapaxes(roots, -1, -2)
    expected = np.einsum("...i,...ij,...j->...", errors, np.linalg.inv(sigma), errors)
    found = squared_errors(errors, sigma)
    assert found.shape == shape
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_what_is_not_known_has_no_squared_error():
    sigma = np.tile(np.eye(2), (4, 1, 1))
    sigma[1, 0, 1] = np.nan
    sigma[2, 1, 1] = np.inf
    error = np.ones((4, 2))
    error[3, 0] = np.nan
    assert np.isnan(squared_errors(error, sigma)).tolist() == [False, True, True, True]


def test_a_certain_posterior_is_right_or_infinitely_wrong():
    flat = np.diag([4.0, 0.0])
    assert squared_errors([2.0, 0.0], flat) == pytest.approx(1.0)
    assert squared_errors([0.0, 1.0], flat) > 1e15
    assert squared_errors([0.0, 0.0], np.zeros((2, 2))) == 0.0
    assert squared_errors([0.0, 1.0], np.zeros((2, 2))) == np.inf
    assert not within(squared_errors([0.0, 1.0], np.zeros((2, 2))), 2)


@pytest.mark.parametrize("dimension", [2, 3])
def test_regions_hold_the_share_of_normal_draws_that_they_say(dimension):
    draws = np.random.default_rng(2).standard_normal((40000, dimension))
    squared = np.sum(draws**2, axis=1)
    assert region_radius(dimension) == pytest.approx(np.sqrt(chi2.ppf(0.95, dimension)), rel=1e-12)
    assert np.mean(within(squared, dimension)) == pytest.approx(CONFIDENCE, abs=0.004)
    assert np.mean(within(squared, dimension, 0.5)) == pytest.approx(0.5, abs=0.01)
    assert not within(np.nan, dimension)
