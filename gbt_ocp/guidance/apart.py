"""Keeping apart from other vehicles with the same target, whatever is heard of them.

Two things are known of another vehicle. It is in the ball that its largest speed has taken it through since it was
heard last, which grows with the age of that. And it keeps a rule that needs no link: each has a side of the target,
agreed before the run, and stays there unless it is clear of the others' balls. So of two vehicles that keep the rule
either one is clear of wherever the other can be, or both are on their own sides, and they are apart. A plan keeps it to
its end without anything that is yet to be heard: it ends on the own side, where the vehicle can stay.

On its side is what it sees: the direction of the target is measured, whether or not the range is known. Two vehicles in
the directions u and u' from the target, farther than r from it, with ``n·u >= a/(2 r)`` and ``-n·u' >= a/(2 r)``, are
at least a apart.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri

from gbt_ocp.guidance.objectives import NEAR
from gbt_ocp.guidance.target_limits import moments_at_knots
from gbt_ocp.models.sizes import at_least, positive
from gbt_ocp.ocp.terms import needed
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.typing import Array

ANYWHERE = 1.0e3
"""Radius of the ball of a vehicle that has said nothing yet, in units of the distance to keep."""

TURNING_S = 1.5
"""Time in seconds in which a vehicle that crosses the line of sight turns."""

OPPOSITE = math.cos(math.radians(4.0))
"""Share ``n·u`` from which on two vehicles count as at opposite ends of one line of sight."""

CORNER = 0.05
"""By how much the corner between being on the own side and being clear is rounded off, in units of each."""


class Apart(NamedTuple):
    """What a plan keeps apart from.

    Attributes
    ----------
    sides
        Directions from the target to the own side of what lies between the vehicle and each other one ``(M, d)``.
    centres
        Where each was when it was heard last ``(M, d)`` in metres; NaN if it never was.
    radii
        How far from there each can be at the knots ``(M, p+1)`` in metres; infinite if nothing is known.
    """

    sides: Array
    centres: Array
    radii: Array


def sides_of(starts: ArrayLike) -> Array:
    """The sides of N vehicles ``(N, N-1, d)``, unit vectors: row i has those of vehicle i towards each other one.

    The vehicles have as many equal sectors round the target, level and fixed in the earth frame, in the order in which
    they start round the middle of all starts, and turned to where these are. A side is the half-space between the
    middles of two sectors; those of one vehicle together are its sector.

    Parameters
    ----------
    starts
        Where they start ``(N, d)`` in metres.
    """
    places = np.asarray(starts, dtype=float)
    count, dimension = places.shape
    level = (places - places.mean(axis=0))[:, :2]
    angles = np.arctan2(level[:, 1], level[:, 0])
    even = np.empty(count)
    even[np.argsort(angles, kind="stable")] = 2.0 * math.pi / count * np.arange(count)
    middles = even + np.angle(np.sum(np.exp(1j * (angles - even))))
    units = np.zeros((count, dimension))
    units[:, 0], units[:, 1] = np.cos(middles), np.sin(middles)
    sides = [[one - other for m, other in enumerate(units) if m != n] for n, one in enumerate(units)]
    return np.array([[line / np.linalg.norm(line) for line in row] for row in sides])


def _unit(line: Array) -> Array:
    return np.asarray(line / max(float(np.linalg.norm(line)), NEAR))


@dataclass(frozen=True)
class OwnSide:
    """The own side of the target for a vehicle that does not know the range.

    Attributes
    ----------
    sides
        Towards each other vehicle ``(M, d)``; see :func:`sides_of`.
    sine
        Sine of the angle from the border by which the vehicle stays on its side.
    """

    sides: Array
    sine: float

    def asks_back(self, own: Array, velocity: Array, target: Array, begins: bool) -> bool:
        """Whether a leg should go the other way: it leads off the own side, or begins in a sense that opposes."""
        return self.left(own, velocity, target) or (begins and self.opposes(own, velocity, target))

    def left(self, own: Array, velocity: Array, target: Array) -> bool:
        """Whether a velocity leads off the own side, or further off it, within :data:`TURNING_S`.

        Parameters
        ----------
        own, velocity
            Of the vehicle, in metres and m/s ``(d,)``.
        target
            Where it is believed ``(d,)``.
        """
        now, then = (self.sides @ _unit(line) for line in (own - target, own + TURNING_S * velocity - target))
        return bool(np.any((then < self.sine) & (then < now)))

    def opposes(self, own: Array, velocity: Array, target: Array) -> bool:
        """Whether a velocity turns the line of sight away from right angles to those of the others.

        From opposite ends of one line two vehicles see the same, and stay there if both turn the same way. On a side
        through the middle of two vehicles at the same range, half the angle between them has the sine ``n·u``.
        """
        sight = _unit(own - target)
        shares = self.sides @ sight
        aims = [self._aim(side, share) for side, share in zip(self.sides, shares, strict=True)]
        aim = np.sum(aims, axis=0)
        return bool(velocity @ (aim - (aim @ sight) * sight) < 0.0)

    def _aim(self, side: Array, share: float) -> Array:
        """Which way is nearer to right angles, as far as one other vehicle is concerned ``(d,)``."""
        if share < OPPOSITE:
            return np.asarray((math.sqrt(0.5) - share) * side)
        # both must go to the same end of the border between them, of which each has one
        across = np.zeros(len(side))
        across[:2] = -side[1], side[0]
        return across if (side[0], side[1]) > (0.0, 0.0) else -across


@dataclass(frozen=True)
class KeepApart:
    """Keep a distance from other vehicles: on the own side of the target, or clear of wherever they can be.

    Needs ``apart`` (:class:`Apart`), ``present`` and ``forecast``. A side is kept with the spread of the direction in
    which the target is believed now: what it does beside counts for both vehicles alike.

    Parameters
    ----------
    dimension
        d.
    distance
        In metres; violations are reported in units of it.
    nearest
        Range in metres from the target that is kept, so that a side is an angle; ``None`` if none is.
    confidence
        Probability in [0.5, 1) with which a side is kept.
    count
        M, how many others there are.

    Raises
    ------
    ValueError
        If the distance or the range is not above 0, the confidence lies outside [0.5, 1), or there is none.
    """

    name: ClassVar[str] = "separation"

    dimension: int
    distance: float
    nearest: float | None = None
    confidence: float = 0.95
    count: int = 1

    def __post_init__(self) -> None:
        positive("distance", self.distance)
        if self.nearest is not None:
            positive("nearest", self.nearest)
        if not 0.5 <= self.confidence < 1.0:
            raise ValueError(f"confidence: found {self.confidence}; allowed: a number in [0.5, 1)")
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
        """The posterior, and of each other vehicle, one a column, the side, and centre and radius of its ball."""
        d, m = self.dimension, self.count
        return {"mean": (d, 1), "covariance": (d, d), "sides": (d, m), "centres": (d, m), "radii": (1, m)}

    def value(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """The larger of two for each: by how much it is on its side, and clear of the other, over what is asked."""
        own = point.z[: self.dimension]
        line = own - parameters["mean"]
        range_ = ca.sqrt(ca.sumsqr(line) + NEAR**2)
        asked = 0.5 * self.distance * (1.0 if self.nearest is None else range_ / self.nearest)
        rows = []
        for number in range(self.count):
            side = parameters["sides"][:, number]
            along = ca.dot(side, line)
            across = side - along / range_**2 * line
            spread = ca.sqrt(ca.mtimes([across.T, parameters["covariance"], across]) + NEAR**2)
            kept = (along - float(ndtri(self.confidence)) * spread) / asked
            away = ca.sqrt(ca.sumsqr(own - parameters["centres"][:, number]) + NEAR**2)
            clear = (away - parameters["radii"][number]) / self.distance
            # no more than the larger one
            rows.append(0.5 * (kept + clear + ca.sqrt((kept - clear) ** 2 + CORNER**2) - CORNER))
        return ca.vertcat(*rows)

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Means ``(p+1, d, 1)``, the present covariance, sides, centres and radii ``(p+1, 1, M)`` at the knots."""
        apart: Apart = needed(data, "apart", self)
        mean, covariance = moments_at_knots(pieces, data, self)
        knots, most = pieces + 1, ANYWHERE * self.distance
        centres = np.where(np.isfinite(apart.centres), apart.centres, mean[0])
        return {
            "mean": mean[..., None],
            "covariance": np.tile(covariance[:1], (knots, 1, 1)),
            "sides": np.tile(apart.sides.T, (knots, 1, 1)),
            "centres": np.tile(centres.T, (knots, 1, 1)),
            "radii": np.minimum(apart.radii[:, :knots], most).T[:, None, :],
        }
