"""Gaps between bearings after which a track begins again.

A tracker remembers a window: a time, or a number of bearings. A gap of many windows leaves nothing in it that says
where the target is now, and a clock that is set makes gaps of years. The track then begins again from the bearing that
ends the gap, so that time and memory are bounded by the window and not by the gap.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

from gbt_ocp.typing import Array

WINDOWS = 10.0
"""Windows that a gap may last before the track begins again."""

FILTER_WINDOW = 100
"""Bearings that count as the window of a filter, which has none of its own: it forgets more slowly than a window."""

ENOUGH_INTERVALS = 10
"""Intervals from whose mean the length of a window of so many bearings is known."""

LONGEST_UNKNOWN = 3600.0
"""Longest gap in seconds before that, unless an earlier track of few bearings has ended in a longer one."""

MOST_TIMES = 5
"""Times of new tracks that a warning names."""


class Gaps:
    """Finds the bearings that end a long gap.

    Parameters
    ----------
    span
        Window in seconds, of a tracker that keeps the bearings of a time.
    bearings
        Window as a number of bearings, of one that does not: their mean interval since the track began makes it a
        time.

    Attributes
    ----------
    count
        Long gaps that have ended.
    """

    def __init__(self, *, span: float | None = None, bearings: int = FILTER_WINDOW) -> None:
        self.count = 0
        self._span = span
        self._bearings = bearings
        self._unknown = LONGEST_UNKNOWN
        self._began = self._latest = float("nan")
        self._taken = 0

    @property
    def longest(self) -> float:
        """Gap in seconds beyond which a track begins again."""
        if self._span is not None:
            return WINDOWS * self._span
        if self._taken <= ENOUGH_INTERVALS:
            return self._unknown
        return WINDOWS * self._bearings * (self._latest - self._began) / (self._taken - 1)

    def ended(self, time: float) -> bool:
        """Note a bearing at a time in seconds; whether it ends a long gap, so that it is the first of a new track."""
        long = self._taken > 0 and time - self._latest > self.longest
        if long:
            self.count += 1
            if self._taken <= ENOUGH_INTERVALS:
                # bearings may come once a day: only the first such interval is taken for a gap
                self._unknown = WINDOWS * self._bearings * (time - self._latest)
            self._taken = 0
        if not self._taken:
            self._began = time
        self._latest = time
        self._taken += 1
        return long


class RestartingTracker(ABC):
    """A tracker that begins a new track after a long gap.

    The new track has nothing of the old one: neither its bearings nor a position that was known before its first one.
    """

    _gaps: Gaps

    @property
    def new_tracks(self) -> int:
        """How often a gap of more than ten windows has ended and a new track has begun."""
        return self._gaps.count

    @abstractmethod
    def _restart(self, own: Array) -> None:
        """Set the state of a tracker that has seen no bearing, with the vehicle at ``own`` ``(d,)``."""


def new_tracks(tracker: object) -> int:
    """How often a tracker has begun a new track after a gap; 0 for one that never does."""
    return tracker.new_tracks if isinstance(tracker, RestartingTracker) else 0


def gap_warning(name: str, times: Sequence[float]) -> str:
    """A line that says when a tracker began new tracks.

    Parameters
    ----------
    name
        Of the tracker, or the names of several.
    times
        In seconds; at least one.
    """
    count = len(times)
    shown = ", ".join(f"{time:.10g}" for time in times[:MOST_TIMES]) + (", ..." if count > MOST_TIMES else "")
    return (
        f"{name}: {count} new track{'s' * (count > 1)}, at t = {shown} s: before {'each' if count > 1 else 'it'}, no "
        f"bearing for more than {WINDOWS:g} times the window (a pause, or a clock that was set)"
    )
