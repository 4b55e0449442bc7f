"""Corners, stops and sprints under exact bearings: the window is cut where the motion breaks, and nowhere else."""

import numpy as np
import pytest

from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.models.targets import case_target
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker
from gbt_ocp.tracking.priors import PositionPrior

DURATION = 16.0


def square(t):
    return 0.8 * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])[int(t // 4.03) % 4]


def stop_and_go(t):
    return (0.8 if int(t // 4.03) % 2 == 0 else 0.0) * np.array([0.8, 0.6])


def sprint_and_drift(t):
    return (0.8 if int(t // 4.03) % 2 == 0 else 0.1) * np.array([np.cos(0.1 * t), np.sin(0.1 * t)])


def travelled(velocity, times, fine=100):
    """Positions ``(K, 2)`` of a target whose velocity jumps, by small steps."""
    step = (times[1] - times[0]) / fine
    moves = np.array([velocity(step * (k + 0.5)) for k in range(fine * len(times))]) * step
    return np.vstack([np.zeros(2), np.cumsum(moves, axis=0)])[::fine][: len(times)]


def circled(target, times, radius=0.6, phase=0.0, samples=10):
    """An own path round a target that follows it some samples late, as a vehicle does, one turn a second."""
    late = np.maximum(np.arange(len(times)) - samples, 0)
    angle = 2.0 * np.pi * times + phase
    return target[late] + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def errors(tracker, times, target, own, bearings=None):
    found, sizes = [], []
    bearings = unit_bearing(target, own) if bearings is None else bearings
    for k, time in enumerate(times):
        tracker.update(float(time), bearings[k], own[k])
        found.append(np.linalg.norm(tracker.predict(times[k : k + 1]).mean[0] - target[k]))
        sizes.append(len(tracker.window))
    return np.array(found), np.array(sizes)


def sprint_on_a_sample(t):
    """Away from a vehicle that is near, and so along the line of sight, where bearings show nothing of it."""
    return np.array([1.2 if int(t // 4.0) % 2 else 0.2, 0.0])


def test_a_corner_on_a_sample_and_along_the_line_of_sight_is_past_within_a_second():
    times = 0.1 * np.arange(int(10 * DURATION))
    target = travelled(sprint_on_a_sample, times)
    for turn in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False):
        own = circled(target, times, radius=0.05, phase=turn, samples=5)
        found, sizes = errors(GaussianProcessTracker(2, breaks=True), times, target, own)
        since = np.mod(times, 4.0)
        assert found[times > 2.5].max() < 0.5
        assert found[(times > 2.5) & (since > 0.8)].max() < 0.05, turn
        assert np.sum(np.diff(sizes) < 0) == 3, "one cut at each corner"


@pytest.mark.parametrize("velocity", [square, stop_and_go, sprint_and_drift])
def test_a_corner_is_past_within_a_second(velocity):
    times = 0.1 * np.arange(int(10 * DURATION))
    target = travelled(velocity, times)
    own = circled(target, times)
    found, sizes = errors(GaussianProcessTracker(2, breaks=True), times, target, own)
    settled = times > 2.5
    assert found[settled].max() < 0.5
    since = np.mod(times, 4.03)
    assert found[settled & (since > 0.8)].max() < 0.05
    assert np.sum(np.diff(sizes) < 0) == 3, "one cut at each corner"
    joined, _ = errors(GaussianProcessTracker(2), times, target, own)
    assert joined[settled & (since > 0.8)].max() > 0.05, "a window across the corner is wrong for longer"


@pytest.mark.parametrize("case", [1, 2, 3])
def test_smooth_motions_are_left_as_they_are(case):
    times = 0.1 * np.arange(120)
    target = case_target(case).position(times)
    own = circled(target, times)
    with_breaks, sizes = errors(GaussianProcessTracker(2, breaks=True), times, target, own)
    without, _ = errors(GaussianProcessTracker(2), times, target, own)
    np.testing.assert_array_equal(with_breaks, without)
    assert np.all(np.diff(sizes) >= 0)


def test_a_stray_bearing_is_no_break_and_moves_nothing():
    times = 0.1 * np.arange(110)
    target = travelled(lambda t: np.array([0.5, 0.3]), times)
    own = circled(target, times)
    bearings = unit_bearing(target, own)
    bearings[60] = rotate_bearing(bearings[60], np.array([0.3]))
    found, sizes = errors(GaussianProcessTracker(2, breaks=True), times, target, own, bearings)
    assert sizes.max() == sizes[-1] == 20, "no cut, and the place of the stray is filled"
    assert found[25:].max() < 0.01


def test_noise_that_a_tracker_does_not_know_is_no_break():
    times = 0.1 * np.arange(150)
    target = travelled(lambda t: np.array([0.5, 0.3]), times)
    own = circled(target, times)
    noisy = rotate_bearing(unit_bearing(target, own), np.deg2rad(1.0) * np.random.default_rng(0).normal(size=(150, 1)))
    for nugget in (None, 1e-8):
        _, sizes = errors(GaussianProcessTracker(2, nugget=nugget, breaks=True), times, target, own, noisy)
        assert np.all(np.diff(sizes) >= 0)


def test_the_position_at_a_break_is_kept_until_the_first_bearing_after_it_leaves_the_window():
    times = 0.1 * np.arange(80)
    target = travelled(square, times)
    own = circled(target, times)
    tracker = GaussianProcessTracker(2, breaks=True, prior=PositionPrior(own[0]))
    rows = []
    for k, time in enumerate(times):
        tracker.update(float(time), unit_bearing(target[k], own[k]), own[k])
        rows.append(len(tracker._measurements().times))
    cut = int(np.argmin(np.where(times > 3.0, np.diff(rows, prepend=0), 0)))
    assert rows[cut] == 2 + 2, "two bearings and two coordinates"
    assert rows[cut + 18] == 20 + 2
    assert rows[cut + 19] == 20


@pytest.mark.parametrize(("preset", "breaks"), [("default", True), ("paper", False)])
def test_the_papers_window_is_what_it_is(preset, breaks):
    configuration = load_config({"problem": "case2", "preset": preset})
    assert build_tracker(configuration.tracker, np.zeros(2), BearingSensor(0.1))._breaks is breaks
