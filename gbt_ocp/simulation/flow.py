"""Water that flows: constant, sheared by depth, slowly varying."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.sizes import not_negative, positive, vector
from gbt_ocp.typing import Array

KNOT_S = 1.0
"""Time in s between the draws of what varies slowly; it is linear between them."""


class SlowProcess:
    """A stationary Ornstein-Uhlenbeck process of mean zero on each axis, linear between draws.

    Parameters
    ----------
    std
        Standard deviation, in the unit of what varies.
    dimension
        d, axes.
    rng
        Source of the draws, which depend on nothing but the time that is asked for.
    correlation_time
        In seconds.
    """

    def __init__(self, std: float, dimension: int, rng: np.random.Generator, correlation_time: float) -> None:
        self._std, self._rng, self._memory = std, rng, correlation_time
        self._knots = [std * rng.standard_normal(dimension)]

    def __call__(self, time: float) -> Array:
        """The value ``(d,)`` at a time in s, at least 0."""
        share, knot = np.modf(time / KNOT_S)
        keep = float(np.exp(-KNOT_S / self._memory))
        while len(self._knots) < int(knot) + 2:
            fresh = self._std * self._rng.standard_normal(self._knots[0].shape)
            self._knots.append(keep * self._knots[-1] + np.sqrt(1.0 - keep**2) * fresh)
        before, after = self._knots[int(knot) : int(knot) + 2]
        return np.asarray(before + share * (after - before))


class Flow:
    """The velocity of the water over ground, the same at every place of a depth.

    Parameters
    ----------
    mean
        ``(d,)`` in m/s, earth frame, at the surface (z = 0).
    shear
        Its change with depth ``(d,)`` in m/s for each metre; zero by default.
    std
        Standard deviation in m/s on each horizontal axis of what varies.
    correlation_time
        Time constant in seconds of what varies.
    rng
        Source of its draws; needed if ``std`` is positive.

    Raises
    ------
    ValueError
        If a number is out of range, or there is nothing to draw from.
    """

    def __init__(
        self,
        mean: ArrayLike,
        shear: ArrayLike | None = None,
        std: float = 0.0,
        correlation_time: float = 300.0,
        rng: np.random.Generator | None = None,
    ) -> None:
        size = 3 if np.size(mean) == 3 else 2
        self._mean = vector("mean", mean, size)
        self._shear = np.zeros(size) if shear is None else vector("shear", shear, size)
        self._slow = None
        positive("correlation_time", correlation_time)
        if not_negative("std", std) > 0.0:
            if rng is None:
                raise ValueError("rng: found None; allowed: a generator where std is positive")
            self._slow = SlowProcess(std, 2, rng, correlation_time)

    def velocity(self, time: float, depth: float = 0.0) -> Array:
        """``(d,)`` in m/s over ground at a time in seconds, at least 0, and a depth in metres."""
        found = self._mean + depth * self._shear
        if self._slow is not None:
            found[:2] += self._slow(time)
        return found
