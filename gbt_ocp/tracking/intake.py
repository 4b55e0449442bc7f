"""Give a tracker a measurement of any kind: the one way from a sensor into a tracker."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np

from gbt_ocp.models.measurements import MeasurementKind, Sighting
from gbt_ocp.tracking.polar import BEARINGS, is_bearing
from gbt_ocp.tracking.protocol import Forecast, PositionTracker


@runtime_checkable
class SightingTracker(Protocol):
    """A tracker that takes measurements of several kinds, each with its own noise.

    Attributes
    ----------
    takes
        Their kinds.
    """

    takes: tuple[MeasurementKind, ...]

    def take(self, sighting: Sighting) -> None:
        """Take in a measurement at or after the time of the latest one."""

    def predict(self, times: Any) -> Forecast:
        """Posterior of the target's position at the times ``(K,)`` in seconds."""


def taken_kinds(tracker: Any) -> tuple[MeasurementKind, ...]:
    """Kinds of measurements that a tracker takes: its ``takes``, positions of a position tracker, else bearings."""
    declared = getattr(tracker, "takes", None)
    if declared is not None:
        return tuple(declared)
    return ("position",) if isinstance(tracker, PositionTracker) else BEARINGS


def take_in(tracker: Any, sighting: Sighting) -> None:
    """Give the tracker a measurement.

    A bearing that does not say its noise goes to ``update``, as from the sensor of a run, unless the tracker has an
    attribute ``takes_unstated`` that is true. Trackers without a noise of each measurement are given bearings and
    positions alone.

    Parameters
    ----------
    tracker
        A :class:`~gbt_ocp.tracking.protocol.Tracker`, a :class:`~gbt_ocp.tracking.protocol.PositionTracker` or a
        :class:`SightingTracker`.
    sighting
        The measurement, placed in the earth frame.

    Raises
    ------
    ValueError
        If the tracker does not take the kind, or refuses this measurement. It is unchanged then.
    """
    kinds = taken_kinds(tracker)
    if sighting.kind not in kinds:
        raise ValueError(
            f"kind: found '{sighting.kind}'; {type(tracker).__name__.removeprefix('Compiled')} takes {', '.join(kinds)}"
        )
    silent = sighting.kind in BEARINGS and is_bearing(sighting) and bool(np.all(np.isnan(sighting.std)))
    # isinstance with a protocol takes as long as a step of a cheap tracker, so it is asked last
    if (not silent or getattr(tracker, "takes_unstated", False)) and isinstance(tracker, SightingTracker):
        tracker.take(sighting)
    elif sighting.kind == "position" and isinstance(tracker, PositionTracker):
        tracker.update_position(sighting.time, sighting.value)
    else:
        tracker.update(sighting.time, sighting.bearing, sighting.position)
