"""A recorded log, and the track that a tracker makes of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from gbt_ocp.frames import LocalPlane
from gbt_ocp.models.bearings import log_map
from gbt_ocp.models.measurements import Measurement, Sighting
from gbt_ocp.tracking.gaps import new_tracks
from gbt_ocp.tracking.intake import take_in
from gbt_ocp.tracking.protocol import Forecast, Tracker, relative_range_std
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class ReplayedTrack:
    """The track that one tracker made of a log, at the times of its K bearings.

    Attributes
    ----------
    name
        Of the tracker.
    times
        ``(K,)`` in seconds.
    mean, covariance
        Position after the bearing, ``(K, d)`` in m and ``(K, d, d)`` in m²; NaN where the tracker has none.
    ahead_mean, ahead_covariance
        The same predicted ``ahead_s`` ahead.
    before
        Position predicted before each bearing was known, ``(K, d)`` and ``(K, d, d)``; NaN of the first.
    residual
        Measured bearing less the one predicted before it was known, in the tangent plane, ``(K, d-1)`` in radians.
    seconds
        Time the update took ``(K,)``.
    new_tracks
        Times in seconds of the bearings with which a new track began, after a gap far longer than the window.
    left_out
        Lines about measurements that the tracker did not take, by kind.
    """

    name: str
    times: Array
    mean: Array
    covariance: Array
    ahead_mean: Array
    ahead_covariance: Array
    before: Forecast
    residual: Array
    seconds: Array
    new_tracks: tuple[float, ...] = ()
    left_out: tuple[str, ...] = ()

    def range_std_over_range(self, own: Array) -> Array:
        """Posterior deviation of the range over the range, seen from ``own`` ``(K, d)``: ``(K,)``."""
        return relative_range_std(self.mean, self.covariance, own)


def _followed(
    name: str,
    tracker: Tracker,
    log: BearingLog,
    ahead: float,
    progress: Callable[[str, int, int], None] | None,
) -> ReplayedTrack:
    count, d = log.own.shape
    means, covariances = np.full((2, count, d), np.nan), np.full((2, count, d, d), np.nan)
    residual, seconds = np.full((count, d - 1), np.nan), np.empty(count)
    before = Forecast(np.full((count, d), np.nan), np.full((count, d, d), np.nan))
    begun: list[float] = []
    refused: dict[str, list[str]] = {}
    taken = 0
    for k, t in enumerate(log.times):
        if taken:
            expected = tracker.predict([t])
            before.mean[k], before.covariance[k] = expected.mean[0], expected.covariance[0]
            if np.isfinite(log.bearings[k]).all():
                residual[k] = _angle_from(expected.mean[0] - log.own[k], log.bearings[k])
        began = perf_counter()
        taken += _taken(tracker, log, k, refused)
        seconds[k] = perf_counter() - began
        if progress is not None:
            progress(name, k + 1, count)
        if not taken:
            continue
        if new_tracks(tracker) > len(begun):
            begun.append(float(t))
        forecast = tracker.predict([t, t + ahead])
        means[:, k], covariances[:, k] = forecast.mean, forecast.covariance
    left_out = [
        f"{len(lines)} of {log.kinds[kind]} measurements of the kind {kind} were left out: {lines[0]}"
        for kind, lines in refused.items()
    ]
    return ReplayedTrack(
        name,
        log.times,
        means[0],
        covariances[0],
        means[1],
        covariances[1],
        before,
        residual,
        seconds,
        tuple(begun),
        tuple(left_out),
    )


def _taken(tracker: Tracker, log: BearingLog, k: int, refused: dict[str, list[str]]) -> bool:
    """Give a tracker a measurement; whether it takes it. What it says of one that is no bearing is kept by kind."""
    try:
        take_in(tracker, log.sightings[k])
    except np.linalg.LinAlgError:
        raise
    except ValueError as fault:
        if np.isfinite(log.bearings[k]).all():
            raise
        refused.setdefault(log.sightings[k].kind, []).append(str(fault))
        return False
    return True


def _angle_from(line: Array, bearing: Array) -> Array:
    """Angle from a line of sight to a bearing, along the tangent plane of the line ``(d-1,)`` in radians.

    It is not a number where the line has no direction.
    """
    distance = float(np.linalg.norm(line))
    if not distance > 0.0 or not np.isfinite(distance):
        return np.full(len(line) - 1, np.nan)
    return log_map(line / distance, bearing)


@dataclass(frozen=True)
class BearingLog:
    """K measurements in the order of time, most of them bearings.

    Attributes
    ----------
    times
        When they were measured ``(K,)`` in seconds: the time stamps less the latency.
    own
        Own positions then ``(K, d)`` in metres.
    bearings
        ``(K, d)``, unit vectors; NaN where the measurement is of another kind.
    truth
        The target's positions ``(K, d)`` in metres, NaN where they are not known; ``None`` if the log has none.
    own_rows
        Rows of the log that hold an own position and no bearing.
    warnings
        Lines about what is suspicious in the log.
    sightings
        The measurements in the earth frame, each with its kind, noise and sensor, at ``own``.
    plane
        Where on the earth the origin of the positions is; ``None`` if that is not known.
    since_epoch
        Whether times are seconds since 1970-01-01T00:00:00Z.
    """

    times: Array
    own: Array
    bearings: Array
    truth: Array | None
    own_rows: int = 0
    warnings: tuple[str, ...] = ()
    sightings: tuple[Sighting, ...] = ()
    plane: LocalPlane | None = None
    since_epoch: bool = False

    @property
    def dimension(self) -> int:
        """Space dimension d."""
        return int(self.own.shape[1])

    @property
    def period(self) -> float:
        """Median time between bearings in seconds; between all measurements where there is one bearing at most."""
        times = self.times[np.isfinite(self.bearings[:, 0])]
        return float(np.median(np.diff(times if len(times) > 1 else self.times)))

    @property
    def kinds(self) -> dict[str, int]:
        """How many measurements there are of each kind."""
        return dict(Counter(one.kind for one in self.sightings))

    @property
    def measurements(self) -> list[Measurement]:
        """The measurements as a pilot or a tracker of one's own takes them: in the earth frame, each at ``own``."""
        return [
            Measurement(
                one.time,
                one.kind,
                float(one.value[0]) if one.value.size == 1 else one.value,
                None if np.isnan(one.std).any() else one.std,
                one.sensor,
                "earth",
            )
            for one in self.sightings
        ]
