"""Other vehicles that watch the same target: where they will be, what they will see from there, and room for them.

All that is known of another vehicle is what it said last: a few places on its last plan. Beyond the end of that plan it
is taken to move on as it does in the mean over the plan, which for a vehicle that goes round a target is the target's
own motion.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.guidance.current import Current
from gbt_ocp.guidance.objectives import NEAR
from gbt_ocp.models.sizes import at_least, positive
from gbt_ocp.ocp.terms import needed
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.typing import Array

UNHEARD = 100.0
"""Where a vehicle stands in a plan that has said nothing yet, in units of the distance to keep."""


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
    dimension
        d.
    count
        How many others there are.
    current
        What is known of the current, for plans in the frame of the water.

    Attributes
    ----------
    count, current
        As given.

    Raises
    ------
    ValueError
        If there is none.
    """

    def __init__(self, dimension: int, count: int, current: Current | None = None) -> None:
        self.count = at_least("count", count, 1)
        self._dimension = dimension
        self.current = current
        self._paths: dict[int, SaidPath] = {}

    def hear(self, number: int, path: SaidPath) -> None:
        """Take note of what one of them (counted from 0) said last; what is older than that is passed over."""
        if number not in self._paths or path.time >= self._paths[number].time:
            self._paths[number] = path

    def places(self, now: float, times: ArrayLike) -> Array:
        """Where they will be ``(M, K, d)``, in the frame that moves with the water since ``now``; NaN if unheard."""
        t = np.asarray(times, dtype=float)
        found = np.full((self.count, len(t), self._dimension), np.nan)
        for number, path in self._paths.items():
            found[number] = path.at(t)
        if self.current is not None:
            found -= (t - now)[:, None] * self.current.velocity
        return found


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


@dataclass(frozen=True)
class KeepApart:
    """Keep a distance from where other vehicles will be.

    Needs ``others``, places at the knots ``(M, p+1, d)`` in metres, NaN for a vehicle that has said nothing.

    Parameters
    ----------
    dimension
        d.
    distance
        In metres; violations are reported in units of it.
    count
        M, how many others there are.

    Raises
    ------
    ValueError
        If the distance is not above 0, or there is none.
    """

    name: ClassVar[str] = "separation"

    dimension: int
    distance: float
    count: int = 1

    def __post_init__(self) -> None:
        positive("distance", self.distance)
        at_least("count", self.count, 1)

    @property
    def lower(self) -> Array:
        """One for each."""
        return np.ones(self.count)

    @property
    def upper(self) -> Array:
        """None."""
        return np.full(self.count, np.inf)

    @property
    def backoff(self) -> Array:
        """None."""
        return np.zeros(self.count)

    @property
    def scale(self) -> Array:
        """Units of the distance."""
        return np.ones(self.count)

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """Places of the others, one a column."""
        return {"places": (self.dimension, self.count)}

    def value(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """Distances over the one to keep."""
        own = point.z[: self.dimension]
        lines = [place - own for place in ca.horzsplit(parameters["places"])]
        return ca.vertcat(*(ca.sqrt(ca.sumsqr(line) + NEAR**2) / self.distance for line in lines))

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Places at the knots ``(p+1, d, M)``; who has said nothing is far away."""
        places = np.asarray(needed(data, "others", self), dtype=float)[:, : pieces + 1]
        away = np.asarray(needed(data, "present", self).mean) + UNHEARD * self.distance
        return {"places": np.moveaxis(np.where(np.isfinite(places), places, away), 0, -1)}
