import numpy as np
import pytest
from scipy.stats import chi2

from gbt_ocp.studies.paper.measures import (
    after_events,
    mean_interval,
    proportion,
    rank_correlation,
    share_within,
    squared_forecast_errors,
)


@pytest.mark.parametrize("dimension", [2, 3])
def test_calibrated_posteriors_have_the_chi_square_of_their_dimension_at_every_step_ahead(dimension):
    rng = np.random.default_rng(0)
    target = np.cumsum(rng.standard_normal((4003, dimension)), axis=0)
    roots = rng.standard_normal((4, dimension, dimension))
    truth = np.stack([target[i : 4000 + i] for i in range(4)], axis=1)
    error = np.einsum("iab,kib->kia", roots, rng.standard_normal((4000, 4, dimension)))
    mean, covariance = np.zeros((4003, 4, dimension)), np.tile(roots @ np.swapaxes(roots, 1, 2), (4003, 1, 1, 1))
    mean[:4000] = truth + error
    found = squared_forecast_errors(mean, covariance, target)
    assert found.shape == (4000, 4)
    np.testing.assert_allclose(found.mean(axis=0), dimension, rtol=0.1)
    np.testing.assert_allclose(share_within(found, dimension, 0.9), 0.9, atol=0.02)
    np.testing.assert_allclose(np.median(found), chi2.median(dimension), rtol=0.05)


def test_a_squared_error_by_hand_and_an_unknown_one():
    target = np.array([[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]])
    mean, covariance = np.zeros((3, 2, 2)), np.tile(np.diag([1.0, 4.0]), (3, 2, 1, 1))
    covariance[1, 0] = np.nan
    # step 0: (1, 1) now and (2, 2) next; step 1: unknown now, (3, 3) next; step 2 predicts beyond the run
    np.testing.assert_allclose(squared_forecast_errors(mean, covariance, target), [[1.25, 5.0], [np.nan, 11.25]])


def test_rank_correlation_counts_singular_matrices_as_the_worst():
    condition = np.array([np.inf, np.inf, 900.0, 10.0, 1.0])
    assert rank_correlation([5.0, 5.0, 4.0, 2.0, 1.0], condition) == pytest.approx(1.0)
    assert rank_correlation([1.0, 1.0, 2.0, 4.0, 5.0], np.log(condition)) == pytest.approx(-1.0)
    assert np.isnan(rank_correlation([1.0, 2.0, 3.0], [1.0, 1.0, 1.0]))


def test_rank_correlation_does_not_change_under_the_logarithm():
    rng = np.random.default_rng(1)
    condition = np.exp(rng.standard_normal(100))
    error = condition + rng.standard_normal(100)
    assert rank_correlation(error, condition) == pytest.approx(rank_correlation(error, np.log(condition)))


def test_bootstrap_interval_covers_the_mean_about_as_often_as_it_says():
    rng = np.random.default_rng(2)
    intervals = [mean_interval(rng.exponential(1.0, 25), 0.9) for _ in range(150)]
    held = np.mean([interval.low <= 1.0 <= interval.high for interval in intervals])
    assert 0.78 <= held <= 0.97
    assert all(interval.low <= interval.value <= interval.high for interval in intervals)


@pytest.mark.parametrize("values", [[0.4], [0.4, np.nan], [0.4, 0.4]])
def test_interval_of_one_value_is_that_value(values):
    assert mean_interval(values) == (0.4, 0.4, 0.4)


def test_interval_of_nothing_is_unknown():
    assert np.isnan(mean_interval([np.nan])).all()


def test_clopper_pearson_by_the_binomial_tails():
    from scipy.stats import binom

    found = proportion(47, 50)
    assert binom.cdf(47, 50, found.high) == pytest.approx(0.025, abs=1e-6)
    assert binom.sf(46, 50, found.low) == pytest.approx(0.025, abs=1e-6)
    assert proportion(50, 50)[::2] == (1.0, 1.0)


def test_values_after_events_begin_with_the_first_and_leave_out_the_last():
    t = 0.1 * np.arange(301)
    found = after_events(t, np.stack([t, -t]), (10.0, 20.0), 2.0, 2.3)
    np.testing.assert_allclose(
        found, [[12.0, 12.1, 12.2, 22.0, 22.1, 22.2], [-12.0, -12.1, -12.2, -22.0, -22.1, -22.2]]
    )
