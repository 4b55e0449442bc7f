"""Where a motion's shape leads: velocities at nodes of time, the positions they add up to, and the slopes of both.

Positions are linear in the velocities, and the velocities' slopes are products of a vector at each node and a factor of
a process. Slopes of a few projections of the position (an estimate needs those across the line of sight) are therefore
products of small matrices; the slopes of the positions themselves, many times as large, are made only when asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.typing import Array

Indices = NDArray[np.intp]


class Part(NamedTuple):
    """One of the processes that make the velocity: heading, log speed or climb angle.

    Attributes
    ----------
    slope
        Derivative of the velocity by it ``(B, G, d)`` in m/s.
    at, deviation
        Coordinate of its value now, and standard deviation of that.
    factor
        From its knots to its changes at the nodes ``(B, G, m)``.
    block
        Coordinates of its knots, m of n.
    """

    slope: Array
    at: int
    deviation: float
    factor: Array
    block: Indices | slice


@dataclass(frozen=True)
class Course:
    """B motions at nodes of time, G of them and the first of them now, in n whitened coordinates.

    Attributes
    ----------
    velocity
        ``(B, G, d)`` in m/s.
    parts
        What it is made of.
    place, place_slopes
        Position now relative to the own position ``(B, d)`` in metres, and its derivatives by the first d coordinates
        ``(B, d, d)``.
    step
        Time between nodes in seconds, negative into the past.
    size
        n.
    """

    velocity: Array
    parts: Sequence[Part]
    place: Array
    place_slopes: Array
    step: float
    size: int

    @cached_property
    def positions(self) -> Array:
        """Relative to the own position now ``(B, G, d)`` in metres."""
        return _integrated(self.velocity, self.step) + self.place[:, None, :]

    @cached_property
    def slopes(self) -> Array:
        """Derivatives of :attr:`positions` by the whitened coordinates ``(B, G, d, n)`` in metres."""
        rates = np.zeros((*self.velocity.shape, self.size))
        for part in self.parts:
            rates[..., part.at] = part.deviation * part.slope
            rates[..., part.block] = part.slope[..., None] * part.factor[:, :, None, :]
        slopes = _integrated(rates, self.step)
        slopes[..., : self.place.shape[1]] = self.place_slopes[:, None]
        return slopes

    def positions_after(self, way: Array) -> Array:
        """Positions ``(B, K, d)`` that the velocities lead to with the weights ``(K, G)`` of :func:`way`."""
        return np.asarray(way @ self.velocity + self.place[:, None, :])

    def slopes_after(self, way: Array, rows: Array, out: Array) -> None:
        """Derivatives of rows ``(B, K, j, d)`` times the positions there, by the coordinates, into ``(B, K j, n)``."""
        count, times, each, d = rows.shape
        flat = rows.reshape(count, times * each, d)
        out[..., :d] = flat @ self.place_slopes
        weights, ones = np.repeat(way, each, axis=0), np.ones(way.shape[1])
        along = np.empty_like(weights)
        # a motion at a time: what is used again at once then stays in the processor's cache
        for one, mine in enumerate(out):
            for part in self.parts:
                np.matmul(flat[one], part.slope[one].T, out=along)
                along *= weights
                mine[:, part.at] = part.deviation * (along @ ones)
                mine[:, part.block] = along @ part.factor[one]


def way(weights: Array, step: float) -> Array:
    """Weights ``(K, G)`` of the velocities in the way since now, from those of the nodes at K times.

    Between nodes velocities are integrated by trapezoids.
    """
    return np.asarray(weights @ _integrated(np.eye(weights.shape[1])[None], step)[0])


def _integrated(values: Array, step: float) -> Array:
    """Integral from the first node along axis 1, by trapezoids."""
    # in place: these arrays can be large
    integral = np.empty_like(values)
    integral[:, 0] = 0.0
    parts = integral[:, 1:]
    np.add(values[:, 1:], values[:, :-1], out=parts)
    parts *= 0.5 * step
    np.add.accumulate(parts, axis=1, out=parts)
    return integral
