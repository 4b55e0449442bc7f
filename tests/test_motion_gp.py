"""The tracker of noisy bearings: start-up without a guess, silences, strays, manoeuvres, and honest spread."""

import numpy as np
import pytest

from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.priors import PositionPrior
from gbt_ocp.tracking.shape.tracker import MotionShapeTracker

SIGMA = np.deg2rad(1.0)


def tracker_of(dimension=2, **keys):
    keys = {"window": 40.0, "update": 2.0, "bin_width": 2.0, **keys}
    return MotionShapeTracker(dimension, noise=BearingNoise(SIGMA), **keys)


def sailed(dimension=2, duration=50.0, turn=0.02, seed=0, around=True):
    """Times, target, own positions and bearings: a target that turns, an observer on a circle of 30 m around it."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, duration, 0.2)
    heading = 0.5 + turn * times
    target = np.cumsum(0.2 * np.stack([np.cos(heading), np.sin(heading), 0.1 + 0.0 * times], axis=-1), axis=0)
    own = np.stack([-30.0 * np.cos(0.1 * times), 30.0 * np.sin(0.1 * times), 8.0 * np.sin(0.2 * times)], axis=-1)
    target, own = target[:, :dimension], own[:, :dimension] + around * target[:, :dimension]
    noise = SIGMA * rng.standard_normal((len(times), dimension - 1))
    return times, target, own, rotate_bearing(unit_bearing(target, own), noise)


def fed(tracker, times, own, bearings):
    for sample in zip(times, bearings, own, strict=True):
        tracker.update(*sample)
    return tracker


def test_one_bearing_says_nothing_about_range():
    tracker = tracker_of()
    before = tracker.predict([0.0, 1.0])
    assert np.all(np.isfinite(before.mean))
    assert np.all(np.linalg.eigvalsh(before.covariance) > 0.0)
    assert not tracker.range_observable
    assert tracker.hypotheses == []
    tracker.update(0.0, [1.0, 0.0], [3.0, 4.0])
    assert not tracker.range_observable
    # the log-normal prior, at its median
    assert tracker.range_std_over_range == pytest.approx(1.0, rel=0.05)
    assert tracker.predict([0.0]).mean[0] == pytest.approx([53.0, 4.0], rel=0.02)


@pytest.mark.parametrize("dimension", [2, 3])
def test_circling_makes_the_range_observable_and_the_target_is_found(dimension):
    times, target, own, bearings = sailed(dimension)
    tracker = fed(tracker_of(dimension), times, own, bearings)
    assert tracker.range_observable
    forecast = tracker.predict([times[-1], times[-1] + 5.0])
    error = forecast.mean[0] - target[-1]
    assert np.linalg.norm(error) < 0.08 * 30.0
    assert error @ np.linalg.solve(forecast.covariance[0], error) < 16.0
    assert np.trace(forecast.covariance[1]) > np.trace(forecast.covariance[0])
    # the track that lies behind is smoothed
    behind = tracker.predict(times[-100::10])
    assert np.linalg.norm(behind.mean - target[-100::10], axis=1).max() < 3.0


def test_a_still_observer_does_not_claim_to_know_the_range():
    times, _, _, _ = sailed()
    target = np.array([60.0, 0.0]) + np.outer(times, [0.0, 0.8])
    rng = np.random.default_rng(1)
    own = np.zeros_like(target)
    bearings = rotate_bearing(unit_bearing(target, own), SIGMA * rng.standard_normal((len(times), 1)))
    tracker = fed(tracker_of(), times, own, bearings)
    assert not tracker.range_observable
    forecast = tracker.predict([times[-1]])
    error = forecast.mean[0] - target[-1]
    assert error @ np.linalg.solve(forecast.covariance[0], error) < 9.0


def test_between_estimates_the_last_one_is_predicted():
    times, _, own, bearings = sailed(duration=20.0)
    tracker = fed(tracker_of(update=5.0), times, own, bearings)
    estimates = tracker._estimates
    assert estimates in (4, 5)
    assert tracker.predict([25.0]).mean[0] == pytest.approx(tracker.predict([25.0, 40.0]).mean[0], abs=0.05)


def test_the_track_survives_a_silence_and_irregular_samples():
    times, target, own, bearings = sailed(duration=70.0)
    rng = np.random.default_rng(3)
    kept = (rng.random(len(times)) < 0.4) & ((times < 35.0) | (times > 50.0))
    tracker = fed(tracker_of(), times[kept], own[kept], bearings[kept])
    error = tracker.predict([times[-1]]).mean[0] - target[-1]
    assert np.linalg.norm(error) < 0.1 * 30.0
    # and one that is longer than the window
    tracker.update(200.0, [1.0, 0.0], own[-1])
    assert len(tracker.bins) == 1
    assert np.all(np.isfinite(tracker.predict([201.0]).mean))


def with_strays(bearings, every=7):
    found = bearings.copy()
    found[::every] = rotate_bearing(found[::every], np.full((len(found[::every]), bearings.shape[1] - 1), 0.5))
    return found


def test_strays_are_gated():
    times, target, own, bearings = sailed()
    strays = with_strays(bearings)
    gated = fed(tracker_of(gate=4.0), times, own, strays)
    plain = fed(tracker_of(gate=np.inf), times, own, strays)
    wrong = [np.linalg.norm(one.predict([times[-1]]).mean[0] - target[-1]) for one in (gated, plain)]
    assert wrong[0] < 0.1 * 30.0
    assert wrong[0] < wrong[1]


def test_a_manoeuvre_is_not_gated():
    """A hard turn, six times what the grid expects."""
    times, target, own, _ = sailed(duration=60.0)
    turned = np.maximum(times - 40.0, 0.0)
    heading = 0.5 + 0.5 * np.minimum(turned, 4.0)
    target = np.cumsum(0.2 * np.stack([np.cos(heading), np.sin(heading)], axis=-1), axis=0)
    rng = np.random.default_rng(5)
    bearings = rotate_bearing(unit_bearing(target, own), SIGMA * rng.standard_normal((len(times), 1)))
    tracker = fed(tracker_of(gate=4.0), times, own, bearings)
    assert np.linalg.norm(tracker.predict([times[-1]]).mean[0] - target[-1]) < 0.15 * 30.0


def test_a_lost_track_is_noticed_and_begun_anew():
    """The target is replaced by another one elsewhere."""
    times, target, own, bearings = sailed(duration=90.0)
    other = target + np.array([0.0, 25.0])
    jumped = np.where((times > 40.0)[:, None], unit_bearing(other, own), bearings)
    tracker = fed(tracker_of(gate=4.0), times, own, jumped)
    assert tracker.restarts > 0
    assert np.linalg.norm(tracker.predict([times[-1]]).mean[0] - other[-1]) < 0.15 * 55.0


def test_a_known_position_is_used_while_its_time_is_in_the_window():
    times, _, own, bearings = sailed(duration=60.0)
    tracker = tracker_of(position=PositionPrior(np.zeros(2), np.array([5.0, 0.0]), 4.0 * np.eye(2)))
    assert tracker.predict([0.0]).mean[0] == pytest.approx([5.0, 0.0])
    fed(tracker, times[:2], own[:2], bearings[:2])
    assert tracker.range_observable
    assert np.linalg.norm(tracker.predict([0.2]).mean[0] - [5.0, 0.0]) < 6.0
    fed(tracker, times[2:], own[2:], bearings[2:])
    assert np.all(np.isfinite(tracker.predict([60.0]).mean))


def test_wrong_parameters_are_refused():
    with pytest.raises(ValueError, match="gate > 0"):
        tracker_of(gate=0.0)
    tracker = tracker_of()
    tracker.update(1.0, [1.0, 0.0], [0.0, 0.0])
    with pytest.raises(ValueError, match="time must increase"):
        tracker.update(0.5, [1.0, 0.0], [0.0, 0.0])
