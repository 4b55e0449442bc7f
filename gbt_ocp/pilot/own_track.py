"""Where the vehicle was: own poses by time, interpolated between navigations."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from typing import Literal, NamedTuple

import numpy as np

from gbt_ocp.typing import Array

Received = Literal[
    "taken", "late", "waiting", "duplicate", "too old", "ahead", "not finite", "no navigation", "refused"
]
"""What became of something that a pilot was given."""


class OwnState(NamedTuple):
    """Own pose and motion at a time.

    Attributes
    ----------
    time
        In seconds.
    pose
        Position and yaw ``(d+1,)``, earth frame, metres and radians; the pitch after them where it is known.
    rates
        Their time derivative, earth frame.
    heading_std
        Standard deviation of the yaw in radians.
    """

    time: float
    pose: Array
    rates: Array
    heading_std: float = 0.0


def earth_rates(pose: list[float], velocity: list[float], dimension: int) -> Array:
    """The rates of a pose, of a velocity in the body frame and the rates of the angles, as many numbers.

    The angles follow the d of the position: yaw, a turn about the vertical, and where there is one the pitch, bow up.
    """
    ahead, aside, *rest = velocity
    if len(pose) > dimension + 1:
        c, s = math.cos(pose[dimension + 1]), math.sin(pose[dimension + 1])
        ahead, rest[0] = c * ahead - s * rest[0], s * ahead + c * rest[0]
    c, s = math.cos(pose[dimension]), math.sin(pose[dimension])
    return np.array([c * ahead - s * aside, s * ahead + c * aside, *rest])


class OwnTrack:
    """Own states of the last seconds in the order of time.

    Between two navigations the pose is the cubic through both with their rates (Hermite), the yaw the short way round.
    After the last one it goes on at its rates, for as long as a gap may be, unless a plan is followed (``piloting``).

    Parameters
    ----------
    late
        Age in seconds up to which a navigation is still sorted in.
    gap
        Longest time in seconds between two navigations that is bridged.
    dimension
        d: the numbers of a pose after that many are angles.
    """

    def __init__(self, late: float, gap: float, dimension: int) -> None:
        self._late, self._gap, self._dimension = late, gap, dimension
        self._times: list[float] = []
        self._states: list[OwnState] = []
        self._doubtful: OwnState | None = None

    @property
    def latest(self) -> OwnState | None:
        """The last of them in time."""
        return self._states[-1] if self._states else None

    def add(self, state: OwnState, now: float) -> Received:
        """Sort a state in.

        Parameters
        ----------
        state
            Its numbers are finite.
        now
            Latest time in seconds at which the pilot was asked for a command; minus infinity before.

        Returns
        -------
        ``taken``; ``late`` if it was sorted in before others; ``duplicate`` if there is one of that time; ``too old``;
        ``ahead`` if it is ahead of all else by more than a gap: it waits until another one confirms its time.
        """
        times, time = self._times, state.time
        if not times or (times[-1] < time <= max(times[-1], now) + self._gap):
            self._doubtful = None
            return self._append(state)
        if time > times[-1]:
            before, self._doubtful = self._doubtful, state
            if before is None or not 0.0 < abs(time - before.time) <= self._gap:
                return "ahead"
            self._doubtful = None
            for one in sorted((before, state), key=lambda one: one.time):
                self._append(one)
            return "taken"
        if time < max(times[-1], now) - self._late:
            return "too old"
        place = bisect_left(times, time)
        if times[place] == time:
            return "duplicate"
        times.insert(place, time)
        self._states.insert(place, state)
        return "late"

    def _append(self, state: OwnState) -> Received:
        self._times.append(state.time)
        self._states.append(state)
        oldest = state.time - self._late - self._gap
        while len(self._times) > 2 and self._times[1] < oldest:
            del self._times[0], self._states[0]
        return "taken"

    def covers(self, time: float) -> bool:
        """Whether navigation has come as far as a time in seconds."""
        return bool(self._times) and time <= self._times[-1]

    def at(self, time: float, bridging: bool = False) -> OwnState | None:
        """The state at a time in seconds; ``None`` before the first one, and in a gap that is not to be bridged."""
        place = bisect_right(self._times, time)
        if place == 0:
            return None
        before = self._states[place - 1]
        if before.time == time:
            return before
        if place == len(self._times):
            ahead = min(time - before.time, self._gap)
            return OwnState(time, before.pose + ahead * before.rates, before.rates, before.heading_std)
        after = self._states[place]
        span = after.time - before.time
        if span > self._gap and not bridging:
            return None
        s, pose, rates = (time - before.time) / span, [], []
        # of three or four numbers arrays are slower than lists
        ends = zip(*(values.tolist() for values in (*before[1:3], *after[1:3])), strict=True)
        for place, (begin, rate, end, last_rate) in enumerate(ends):
            step = end - begin
            if place >= self._dimension:
                step = math.remainder(step, 2.0 * math.pi)
            # the cubic of Hermite about the straight line between both
            bent = (1.0 - s) * (span * rate - step) - s * (span * last_rate - step)
            pose.append(begin + s * step + s * (1.0 - s) * bent)
            slope = (1.0 - 2.0 * s) * bent - s * (1.0 - s) * (span * (rate + last_rate) - 2.0 * step)
            rates.append((step + slope) / span)
        return OwnState(time, np.array(pose), np.array(rates), max(before.heading_std, after.heading_std))


def checked_numbers(name: str, values: object, shape: tuple[int, ...]) -> Array:
    """Numbers as an array of its own; they need not be finite.

    Raises
    ------
    ValueError
        If the shape is another one.
    """
    try:
        found = np.array(values, dtype=float)
    except (TypeError, ValueError):
        found = np.zeros(0)
    if found.shape != shape:
        raise ValueError(f"{name}: found {values!r}; allowed: numbers of shape {shape}")
    return found
