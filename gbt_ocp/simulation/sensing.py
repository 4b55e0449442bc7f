"""Several sensors in the loop: what each measures, and when it arrives at the tracker."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gbt_ocp.models.measurements import Sighting
from gbt_ocp.models.sensors import SimulatedSensor
from gbt_ocp.typing import Array


class Sensing:
    """Sensors side by side, each with its period, noise, missed share, latency and mounting.

    Parameters
    ----------
    sensors
        Their periods are whole multiples of that of the loop.
    period
        Of the loop in seconds.
    rngs
        A generator for each, so that none changes the draws of another.

    Raises
    ------
    ValueError
        If a period is no multiple of the loop's.
    """

    def __init__(self, sensors: Sequence[SimulatedSensor], period: float, rngs: Sequence[np.random.Generator]) -> None:
        self._sensors = tuple(sensors)
        self._rngs = tuple(rngs)
        self._every = []
        for one in self._sensors:
            every = round(one.period / period)
            if every < 1 or abs(one.period / period - every) > 1e-6:
                raise ValueError(f"period: found {one.period} of {one.name}; allowed: whole multiples of {period}")
            self._every.append(every)
        self._underway: list[tuple[float, Sighting]] = []

    def measure(self, step: int, time: float, target: Array, pose: Array) -> list[Sighting]:
        """What is measured at a step of the loop, at a time in seconds; it is then underway to the tracker.

        Parameters
        ----------
        step, time
            Of the loop, in seconds.
        target, pose
            Position of the target ``(d,)``, and position and yaw of the vehicle ``(d+1,)``, metres and radians.
        """
        found = []
        for one, every, rng in zip(self._sensors, self._every, self._rngs, strict=True):
            if step % every == 0:
                sighting = one.sight(time, target, pose, rng)
                if sighting is not None:
                    found.append(sighting)
                    self._underway.append((time + one.latency, sighting))
        return found

    def arrived(self, time: float, ordered: bool = True) -> list[Sighting]:
        """What the tracker is to be given at a time in seconds, in the order in which it was measured.

        Parameters
        ----------
        time
            In seconds.
        ordered
            A tracker takes measurements in the order of their times: so what has arrived waits here for what was
            measured before it and is still underway. If not, all that has arrived is given, for one that can be set
            back.
        """
        on_the_way = [sighting.time for arrival, sighting in self._underway if arrival > time + 1e-9]
        first = min(on_the_way, default=np.inf) if ordered else np.inf
        given: list[tuple[float, Sighting]] = []
        kept: list[tuple[float, Sighting]] = []
        for arrival, sighting in self._underway:
            ready = arrival <= time + 1e-9 and sighting.time <= first
            (given if ready else kept).append((arrival, sighting))
        self._underway = kept
        return sorted((sighting for _, sighting in given), key=lambda one: one.time)
