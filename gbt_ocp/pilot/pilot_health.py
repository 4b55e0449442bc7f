"""How a pilot is: what the planner said, how old its inputs are, and whether the track is lost."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from operator import mul, sub
from typing import Any, NamedTuple

from gbt_ocp.models.measurements import Sighting
from gbt_ocp.pilot.own_track import Received
from gbt_ocp.tracking.disagreement import LEAST_COUNT, MANY_TIMES
from gbt_ocp.tracking.polar import is_bearing
from gbt_ocp.tracking.protocol import RANGE_OBSERVABLE, Forecast
from gbt_ocp.typing import Array

LOST_DIRECTION = 0.5
"""Deviation in radians of the direction to the target above which a track counts as lost."""

LEAST_ANGLE_STD = math.radians(0.3)
"""Least deviation in radians that counts as noise: lines of sight bend by so much between bearings."""

NOTES = {
    "no navigation": "nothing was navigated yet; the thrust is zero",
    "navigation old": "the last navigation is older than pilot.navigation_gap_s",
    "time stepped back": "a command was asked for at a time before the last one, which is given again",
    "no bearing": "the tracker has taken no measurement yet",
    "track lost": "bearings and forecast disagree, or the direction to the target is not known",
    "forecast held": "the tracker's forecast was not finite; the last finite one is used",
    "fallback": "the first solve of the last plan failed; `fallback` says what is followed instead",
    "given up": "the plan does not keep all limits; `given_up` says which, and by how much",
}
"""What each note of a pilot's health says."""


@dataclass(frozen=True)
class PilotHealth:
    """How a pilot is at a time.

    Attributes
    ----------
    notes
        What is not as it should be; keys of :data:`NOTES`, none if all is well.
    planner
        Status of the last plan: ``solved``, ``given up``, or the word for what happened to the first attempt; empty
        before the first plan, and for a guidance that does not plan.
    fallback
        What is followed where the first attempt failed; see :attr:`gbt_ocp.ocp.plan.Plan.fallback`.
    given_up, broken_at_start
        Limits that the last plan does not keep, by name, with their worst violation in units of the limit.
    bearing_age
        Seconds since the last measurement that the tracker took; infinite before the first.
    navigation_age
        Seconds since the last navigation; infinite before the first, 0 if that is later.
    track_lost
        Whether a quarter of the last 20 bearings are off by more than six times what noise and forecast explain, or
        the deviation of the direction to the target is above 0.5 rad.
    waiting
        Measurements that wait for a navigation that is not older than they are.
    received
        How often each answer other than ``taken`` was given, by answer.
    new_tracks
        How often the tracker began a new track after a long gap.
    """

    notes: tuple[str, ...]
    planner: str = ""
    fallback: str = ""
    given_up: Mapping[str, float] = field(default_factory=dict)
    broken_at_start: Mapping[str, float] = field(default_factory=dict)
    bearing_age: float = math.inf
    navigation_age: float = math.inf
    track_lost: bool = False
    waiting: int = 0
    received: Mapping[Received, int] = field(default_factory=dict)
    new_tracks: int = 0

    @property
    def ok(self) -> bool:
        """Whether there are no notes."""
        return not self.notes


class PilotState(NamedTuple):
    """What the health at a time follows from. It is asked for less often than commands are, and built when it is.

    Attributes
    ----------
    time
        Of the command, in seconds.
    navigated, heard
        Times in seconds of the last navigation and of the last measurement that the tracker took; minus infinity
        before.
    navigation_gap
        Age in seconds above which a navigation is old.
    decided, held
        Whether the online loop has taken a step, and whether its forecast was not finite.
    said
        What the last plan says, by the name of the attribute of the health.
    track_lost, waiting, received, new_tracks
        As in the health.
    stepped_back
        Whether the command was asked for at a time before this one.
    """

    time: float
    navigated: float
    heard: float
    navigation_gap: float
    decided: bool
    held: bool
    said: Mapping[str, Any]
    track_lost: bool
    waiting: int
    received: Mapping[Received, int]
    new_tracks: int
    stepped_back: bool = False

    def health(self) -> PilotHealth:
        """The health that follows."""
        age, said = max(0.0, self.time - self.navigated), self.said
        found = {
            "time stepped back": self.stepped_back,
            "no navigation": not self.decided,
            "navigation old": math.inf > age > self.navigation_gap,
            "no bearing": self.heard == -math.inf,
            "track lost": self.track_lost,
            "forecast held": self.held,
            "fallback": bool(said and said["fallback"]),
            "given up": bool(said and said["given_up"]),
        }
        return PilotHealth(
            notes=tuple(note for note, holds in found.items() if holds),
            bearing_age=self.time - self.heard,
            navigation_age=age,
            track_lost=self.track_lost,
            waiting=self.waiting,
            received=self.received,
            new_tracks=self.new_tracks,
            **said,
        )


class TrackWatch:
    """Compares bearings with what was forecast of them.

    Parameters
    ----------
    bearing_std
        Deviation in radians of bearings that do not state one.

    Attributes
    ----------
    vague
        Whether the last forecast does not know the direction to the target.
    range_known
        Whether the deviation of its range was below a quarter of the range.
    """

    def __init__(self, bearing_std: float) -> None:
        self._std = max(bearing_std, LEAST_ANGLE_STD)
        self._off: deque[bool] = deque(maxlen=LEAST_COUNT)
        self._times: list[float] = []
        self._forecast: Forecast | None = None
        self.vague = self.range_known = self._disagrees = False

    @property
    def lost(self) -> bool:
        """Whether the track is lost."""
        return self.vague or self._disagrees

    def forecast(self, times: Array, forecast: Forecast, own: Array) -> None:
        """Take note of a forecast at the times ``(K,)``, made at an own position ``(d,)``."""
        self._times, self._forecast = times.tolist(), forecast
        # of two or three numbers arrays are slower than lists
        line = list(map(sub, forecast.mean[0].tolist(), own.tolist()))
        across, along = _spreads(line, forecast.covariance[0].tolist())
        self.vague, self.range_known = across > LOST_DIRECTION**2, along < RANGE_OBSERVABLE**2

    def see(self, sighting: Sighting) -> None:
        """Compare a bearing with the last forecast; other kinds, and times that it does not reach, say nothing."""
        times, forecast = self._times, self._forecast
        if forecast is None or not is_bearing(sighting) or len(times) < 2 or not times[0] <= sighting.time <= times[-1]:
            return
        place = (sighting.time - times[0]) / (times[1] - times[0])
        index = min(int(place), len(times) - 2)
        share = place - index
        ends = zip(*forecast.mean[index : index + 2].tolist(), sighting.position.tolist(), strict=True)
        line = [(1.0 - share) * begin + share * end - own for begin, end, own in ends]
        spread, _ = _spreads(line, forecast.covariance[index].tolist())
        if math.isfinite(spread):
            along = sum(map(mul, line, sighting.bearing.tolist())) / math.hypot(*line)
            angle = math.acos(min(max(along, -1.0), 1.0))
            std = self._std if math.isnan(sighting.std[0]) else max(float(sighting.std[0]), LEAST_ANGLE_STD)
            self._off.append(angle**2 > MANY_TIMES**2 * (spread + std**2))
            self._disagrees = len(self._off) == LEAST_COUNT and 4 * sum(self._off) > LEAST_COUNT


def _spreads(line: list[float], covariance: list[list[float]]) -> tuple[float, float]:
    """Variance in rad² of the direction of a line ``(d,)``, the mean over its axes, and that of its length over itself.

    NaN where they are not known.
    """
    square = sum(map(mul, line, line))
    if not square > 0.0:
        return math.nan, math.nan
    trace = along = 0.0
    for i, row in enumerate(covariance):
        trace += row[i]
        along += line[i] * sum(map(mul, row, line))
    along /= square
    return (trace - along) / (len(line) - 1) / square, along / square
