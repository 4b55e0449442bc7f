"""What the motion tracker remembers from before its window, against all bearings at once on a target at rest."""

import numpy as np
import pytest

from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.priors import LogNormal, PositionPrior
from gbt_ocp.tracking.shape.processes import ShapePrior
from gbt_ocp.tracking.shape.tracker import MotionShapeTracker

SIGMA = np.deg2rad(1.0)
# hardly moves, and of the range nothing is known
AT_REST = ShapePrior(speed=LogNormal(1e-4, 0.1), range=LogNormal(50.0, 3.0))


def around(times, dimension, rate=0.1):
    circle = [40.0 * np.cos(rate * times), 25.0 * np.sin(rate * times), 10.0 * np.sin(2.0 * rate * times)]
    return np.stack(circle, axis=-1)[:, :dimension]


def seen(target, own, seed=0):
    rng = np.random.default_rng(seed)
    return rotate_bearing(unit_bearing(target, own), SIGMA * rng.standard_normal((len(own), own.shape[1] - 1)))


def fed(tracker, times, own, bearings):
    for sample in zip(times, bearings, own, strict=True):
        tracker.update(*sample)
    return tracker


def at_rest(own, bearings, weights):
    """Weighted maximum likelihood of a position and its information, by Gauss-Newton in Cartesian coordinates."""
    position = own[-1] + 30.0 * bearings[-1]
    for _ in range(30):
        line = position - own
        distance = np.linalg.norm(line, axis=1)
        unit = line / distance[:, None]
        across = np.eye(len(position)) - unit[:, :, None] * unit[:, None, :]
        information = np.einsum("k,kij->ij", weights / (SIGMA * distance) ** 2, across)
        residual = np.einsum("kij,kj->ki", across, distance[:, None] * bearings)
        position = position + np.linalg.solve(information, weights / (SIGMA * distance) ** 2 @ residual)
    return position, information


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("memory", [1.0, 3.0, np.inf])
@pytest.mark.long
def test_bearings_that_left_the_window_count_as_much_as_they_are_trusted(dimension, memory):
    times = np.arange(0.0, 40.0 + 1e-9, 0.1)
    target = np.array([3.0, -2.0, 4.0])[:dimension]
    own = around(times, dimension)
    bearings = seen(target, own)
    tracker = MotionShapeTracker(
        dimension,
        noise=BearingNoise(SIGMA),
        prior=AT_REST,
        bin_width=0.5,
        window=20.0,
        update=0.5,
        knot=2.0,
        memory=memory,
        position=PositionPrior(own[0]),
    )
    fed(tracker, times, own, bearings)
    # whole bins are kept: the window begins at the first bin that ended less than 20 s ago
    kept = times >= tracker.bins.begins
    position, information = at_rest(own, bearings, np.where(kept, 1.0, 1.0 / memory**2))
    found = tracker.predict([times[-1]])
    root = np.linalg.cholesky(information)
    assert np.linalg.norm(root.T @ (found.mean[0] - position)) < 0.35
    assert root.T @ found.covariance[0] @ root == pytest.approx(np.eye(dimension), abs=0.12)


def alongside(memory):
    """A target that goes straight on; the observer circles it for 40 s, then keeps beside it."""
    times = np.arange(0.0, 76.0, 0.2)
    target = np.outer(times, [0.8, 0.6])
    angle = 0.1 * np.minimum(times, 40.0)
    own = target + 30.0 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    tracker = MotionShapeTracker(
        2, noise=BearingNoise(SIGMA), window=30.0, bin_width=1.5, memory=memory, position=PositionPrior(own[0])
    )
    return fed(tracker, times, own, seen(target, own, 1)), target[-1], times[-1]


def test_the_range_is_remembered_when_the_window_no_longer_tells_it():
    (with_it, target, now), (without, *_) = alongside(3.0), alongside(np.inf)
    forecast = with_it.predict([now])
    error = forecast.mean[0] - target
    assert np.linalg.norm(error) < 0.2 * 30.0
    assert error @ np.linalg.solve(forecast.covariance[0], error) < 9.2  # 99 %
    assert with_it.range_std_over_range < 0.5 * without.range_std_over_range


def test_a_lost_track_remembers_nothing():
    times = np.arange(0.0, 40.0, 0.2)
    own = around(times, 2)
    target = np.array([3.0, -2.0])
    tracker = MotionShapeTracker(
        2,
        noise=BearingNoise(SIGMA),
        prior=AT_REST,
        window=20.0,
        bin_width=1.0,
        memory=3.0,
        position=PositionPrior(own[0]),
    )
    fed(tracker, times, own, seen(target, own))
    assert tracker._memory.recall(tracker.bins.begins, times[-1]) is not None
    later = times + 40.0
    # the target is somewhere else all at once
    own = around(later, 2)
    elsewhere = np.array([-150.0, 90.0])
    fed(tracker, later[:100], own[:100], seen(elsewhere, own[:100]))
    assert tracker.restarts >= 1
    fed(tracker, later[100:], own[100:], seen(elsewhere, own[100:]))
    forecast = tracker.predict([later[-1]])
    assert np.linalg.norm(forecast.mean[0] - elsewhere) < 0.15 * np.linalg.norm(elsewhere)


@pytest.mark.parametrize("memory", [0.0, -1.0, np.nan])
def test_a_memory_that_is_no_factor_is_refused(memory):
    with pytest.raises(ValueError, match="memory and gate > 0"):
        MotionShapeTracker(2, noise=BearingNoise(SIGMA), memory=memory)
