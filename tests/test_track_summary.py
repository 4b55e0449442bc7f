"""Numbers of a run at sea, against what comes out by hand."""

from dataclasses import fields

import numpy as np
import pytest
import synthetic_run
from scipy.stats import chi2

from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.track_summary import track_numbers


def history(steps=201, ahead=10, **changes):
    """Samples a second apart, a target at rest 40 m away, errors drawn from the stated covariance."""
    rng = np.random.default_rng(0)
    covariance = np.array([[4.0, 1.0], [1.0, 2.0]])
    target = np.tile([40.0, 0.0], (steps, 1))
    error = rng.multivariate_normal(np.zeros(2), covariance, (steps, ahead + 1))
    base = synthetic_run.history(2, steps=steps - 1)
    arrays = {field.name: getattr(base, field.name) for field in fields(History)}
    arrays |= {
        "t": np.arange(steps, dtype=float),
        "vehicle_pose": np.zeros((steps, 3)),
        "target": target,
        "forecast_mean": target[:, None] + error,
        "forecast_cov": np.tile(covariance, (steps, ahead + 1, 1, 1)),
        "error": np.linalg.norm(error, axis=2),
        "bound": np.ones((steps, ahead + 1)),
    }
    return History.of({**arrays, **changes})


def test_a_calibrated_posterior_is_found_calibrated():
    run = history(steps=3001)
    found = track_numbers(run, 1.0, 30.0)
    assert found["track_settling_s"] == 60.0
    assert found["relative_error"] == pytest.approx(np.mean(run.error[60:, 0]) / 40.0)
    assert found["relative_error_10s"] == pytest.approx(np.mean(run.error[60:, 10]) / 40.0)
    for suffix in ("", "_10s"):
        assert found[f"nees_mean{suffix}"] == pytest.approx(2.0, abs=0.12)
        assert found[f"coverage_95{suffix}"] == pytest.approx(0.95, abs=0.015)
    assert (found["steps_below_standoff"], found["lost"]) == (0, False)
    tight = track_numbers(history(steps=3001, forecast_cov=run.forecast_cov / 4.0), 1.0, None)
    assert tight["nees_mean"] == pytest.approx(8.0, abs=0.5)
    assert tight["coverage_95"] == pytest.approx(1.0 - np.exp(-chi2.ppf(0.95, 2) / 8.0), abs=0.03)
    assert "steps_below_standoff" not in tight


def test_ten_seconds_ahead_is_the_truth_ten_seconds_later_and_no_more_than_there_is():
    t = np.arange(201.0)
    target = np.column_stack([40.0 + 0.5 * t, np.zeros(201)])
    ahead = np.arange(11.0)
    mean = target[:, None] + np.column_stack([0.5 * ahead, np.full(11, 0.3)])
    right = history(target=target, forecast_mean=mean, forecast_cov=np.tile(0.09 * np.eye(2), (201, 11, 1, 1)))
    found = track_numbers(right, 1.0, None)
    assert found["nees_mean_10s"] == pytest.approx(1.0)
    assert found["nees_mean"] == pytest.approx(1.0)
    assert "relative_error_10s" not in track_numbers(right, 0.1, None)  # eleven tenths of a second do not reach


def test_steps_below_the_standoff_count_from_when_it_was_reached():
    distance = np.full(201, 40.0)
    distance[:20] = 10.0  # begun within it
    distance[50:57] = 29.9
    pose = np.column_stack([40.0 - distance, np.zeros((201, 2))])
    assert track_numbers(history(vehicle_pose=pose), 1.0, 30.0)["steps_below_standoff"] == 7
    assert track_numbers(history(vehicle_pose=np.zeros((201, 3))), 1.0, 50.0)["steps_below_standoff"] == 201


def test_a_run_is_lost_by_its_end():
    error = np.ones((201, 11))
    error[-8:] = 25.0
    assert track_numbers(history(error=error), 1.0, None)["lost"]
    error[-6:] = 1.0
    assert not track_numbers(history(error=error), 1.0, None)["lost"]
