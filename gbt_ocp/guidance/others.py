"""Other vehicles that watch the same target: where they will be, and what they will see from there.

All that is known of another vehicle is what it said last: a few places on its last plan. Beyond the end of that plan it
is taken to move on as it does in the mean over the plan, which for a vehicle that goes round a target is the target's
own motion.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.guidance.apart import Apart
from gbt_ocp.guidance.current import Current
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class SaidPath:
    """Where another vehicle has said that it will be.

    Attributes
    ----------
    time
        Of the first place, in seconds.
    step
        Seconds from one place to the next.
    places
        ``(N, d)`` in metres, N at least 2.
    """

    time: float
    step: float
    places: Array

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import CubicSpline  # which takes long to load

        return CubicSpline(self.step * np.arange(len(self.places)), self.places)

    def at(self, times: ArrayLike) -> Array:
        """Places at the times ``(K,)`` in seconds ``(K, d)``: before the first the first, beyond the last see above."""
        since, end = np.asarray(times, dtype=float) - self.time, self.step * (len(self.places) - 1)
        mean = (self.places[-1] - self.places[0]) / end
        beyond = np.maximum(since - end, 0.0)
        return np.asarray(self._spline(np.clip(since, 0.0, end)) + beyond[..., None] * mean)


class OtherVehicles:
    """The other vehicles, as far as they have been heard.

    Parameters
    ----------
    sides
        Directions from the target to the own side of what lies between this vehicle and each of them, unit vectors
        ``(M, d)``; see :func:`~gbt_ocp.guidance.apart.sides_of`.
    speed
        Largest speed of any of them through the water in m/s; ``None`` where none is known.
    current
        What is known of the current, for plans in the frame of the water.

    Attributes
    ----------
    sides, speed, current
        As given.
    """

    def __init__(self, sides: Array, speed: float | None = None, current: Current | None = None) -> None:
        self.sides = sides
        self.speed = speed
        self.current = current
        self._paths: dict[int, SaidPath] = {}

    def hear(self, number: int, path: SaidPath) -> None:
        """Take note of what one of them (counted from 0) said last; what is older than that is passed over."""
        if number not in self._paths or path.time >= self._paths[number].time:
            self._paths[number] = path

    def places(self, now: float, times: ArrayLike) -> Array:
        """Where they will be ``(M, K, d)``, in the frame that moves with the water since ``now``; NaN if unheard."""
        t = np.asarray(times, dtype=float)
        count, dimension = self.sides.shape
        found = np.full((count, len(t), dimension), np.nan)
        for number, path in self._paths.items():
            found[number] = path.at(t)
        if self.current is not None:
            found -= (t - now)[:, None] * self.current.velocity
        return found

    def apart(self, now: float, times: ArrayLike) -> Apart:
        """What plans keep apart from: the sides, and the balls in which the others are at the times ``(K,)``.

        Each can be as far from where it was when it was heard last as its speed has taken it since. The centres are in
        the frame that moves with the water since ``now``.
        """
        t = np.asarray(times, dtype=float)
        centres, radii = np.full(self.sides.shape, np.nan), np.full((len(self.sides), len(t)), np.inf)
        for number, path in self._paths.items():
            centres[number] = path.places[0]
            if self.current is not None:
                centres[number] -= (path.time - now) * self.current.velocity
            if self.speed is not None:
                radii[number] = self.speed * np.maximum(t - path.time, 0.0)
        return Apart(self.sides, centres, radii)


def lines_of_others(data: Mapping[str, Any], mean: Array) -> Iterator[tuple[int, Array]]:
    """Each line of sight that other vehicles will have, with the number of its endpoint.

    Parameters
    ----------
    data
        Of a solve; ``others`` are places at the knots ``(M, p+1, d)``, if there are any.
    mean
        Positions of the target at the endpoints ``(p, d)``.
    """
    for places in data.get("others", ()):
        for number, (there, place) in enumerate(zip(mean, places[1:], strict=False)):
            if np.all(np.isfinite(place)):
                yield number, there - place
