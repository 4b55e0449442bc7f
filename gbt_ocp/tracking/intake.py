"""Give a tracker a measurement of any kind: the one way from a sensor into a tracker."""

from __future__ import annotations

from typing import Any

from gbt_ocp.models.measurements import Sighting
from gbt_ocp.tracking.protocol import PositionTracker


def take_in(tracker: Any, sighting: Sighting) -> None:
    """Give the tracker a measurement.

    Parameters
    ----------
    tracker
        A :class:`~gbt_ocp.tracking.protocol.Tracker` or a :class:`~gbt_ocp.tracking.protocol.PositionTracker`.
    sighting
        The measurement, placed in the earth frame.

    Raises
    ------
    ValueError
        If the tracker does not take the kind, or refuses this measurement. It is unchanged then.
    """
    if isinstance(tracker, PositionTracker):
        if sighting.kind != "position":
            raise ValueError(f"{type(tracker).__name__} takes measurements of kind 'position', not '{sighting.kind}'")
        tracker.update_position(sighting.time, sighting.value)
    else:
        tracker.update(sighting.time, sighting.bearing, sighting.position)
