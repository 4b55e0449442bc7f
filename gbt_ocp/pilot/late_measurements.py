"""Measurements into a tracker in the order of their times, whenever they arrive."""

from __future__ import annotations

import math
from collections.abc import Iterable
from operator import attrgetter
from typing import Any

from gbt_ocp.models.measurements import Sighting
from gbt_ocp.pilot.online_loop import OnlineLoop
from gbt_ocp.pilot.skeleton import Skeleton

_BY_TIME = attrgetter("time")


class OrderedIntake:
    """Gives an online loop its measurements in the order of their times.

    A tracker takes measurements in that order only. Where one arrives that is older than the last that was taken, the
    tracker is set back to a state from before it and is given all of them again, with the late one at its place.

    Parameters
    ----------
    online
        Its tracker has taken nothing yet.
    late
        Age in seconds up to which a measurement can be late; 0 refuses all that are late.
    every
        Time in seconds after which a state is kept; by default ``late``. States that lie closer cost memory, and save
        measurements that are given again.
    """

    def __init__(self, online: OnlineLoop, late: float, every: float | None = None) -> None:
        self._online = online
        self._late = late
        self._every = late if every is None else every
        self._skeleton = Skeleton()
        self._skeleton.explore(online.tracker)
        self._taken: list[Sighting] = []
        self._states: list[tuple[float, dict[str, dict[str, Any]]]] = []
        self.latest = -math.inf
        self._keep_state()

    def settle(self, arrived: Iterable[Sighting]) -> list[Sighting]:
        """Give the tracker what has arrived; returns what it did not take."""
        fresh = sorted(arrived, key=_BY_TIME)
        if fresh and fresh[0].time < self.latest:
            fresh, refused = self._set_back(fresh)
        else:
            refused = []
        for sighting in fresh:
            # not between measurements of one time: those after a state are told from those in it by their times
            if self._states and sighting.time > self.latest and self.latest - self._states[-1][0] >= self._every:
                self._keep_state()
            if not self._online.take(sighting):
                refused.append(sighting)
                continue
            self._taken.append(sighting)
            self.latest = sighting.time
        return refused

    def _keep_state(self) -> None:
        """Keep the tracker's state, and forget what is older than a late measurement can be."""
        if self._late > 0.0:
            self._states.append((self.latest, self._skeleton.remembered()))
        while len(self._states) > 1 and self._states[1][0] <= self.latest - self._late:
            del self._states[0]
        oldest = self._states[0][0] if self._states else math.inf
        self._taken = [sighting for sighting in self._taken if sighting.time > oldest]

    def _set_back(self, fresh: list[Sighting]) -> tuple[list[Sighting], list[Sighting]]:
        """Set the tracker back to before what is late; returns what is to be given again, and what is too old."""
        oldest = self._states[0][0] if self._states else math.inf
        refused = [sighting for sighting in fresh if sighting.time <= oldest and sighting.time < self.latest]
        fresh = [sighting for sighting in fresh if sighting.time > oldest or sighting.time >= self.latest]
        if not fresh or fresh[0].time >= self.latest:
            return fresh, refused
        while self._states[-1][0] >= fresh[0].time:
            del self._states[-1]
        self.latest, state = self._states[-1]
        self._skeleton.remember(state)
        again = [sighting for sighting in self._taken if sighting.time > self.latest]
        self._taken = [sighting for sighting in self._taken if sighting.time <= self.latest]
        return sorted([*again, *fresh], key=_BY_TIME), refused
