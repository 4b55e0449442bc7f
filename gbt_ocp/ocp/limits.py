"""Path constraints: bounds on functions of the flat output that must hold all along a trajectory.

A constraint says what is bounded, not how: :meth:`TrajectoryProblem.subject_to` imposes it exactly at nodes, and
:meth:`TrajectoryProblem.subject_to_penalty` turns it into the integral penalty of the paper.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from gbt_ocp.models.sizes import positive, vector
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class KeepOut:
    """Stay outside a circle (a sphere in 3D): ``‖P_A - centre‖ >= radius``.

    Parameters
    ----------
    centre
        ``(d,)`` in metres; two numbers for a vehicle in space make an upright cylinder.
    radius
        In metres; violations are reported in units of it.

    Raises
    ------
    ValueError
        If the centre is not two or three finite numbers, or the radius is not above 0.
    """

    name: ClassVar[str] = "keep_out"
    over_ground: ClassVar[bool] = True

    centre: tuple[float, ...]
    radius: float

    lower: ClassVar[Array] = np.ones(1)
    upper: ClassVar[Array] = np.full(1, np.inf)
    backoff: ClassVar[Array] = np.zeros(1)
    # the squared distance changes twice as fast as the distance at the boundary
    scale: ClassVar[Array] = np.full(1, 2.0)

    def __post_init__(self) -> None:
        vector("centre", self.centre, 3 if len(self.centre) == 3 else 2)
        positive("radius", self.radius)

    def value(self, point: FlatPoint) -> Any:
        """Squared distance over squared radius: smooth everywhere, unlike the distance.

        Raises
        ------
        ValueError
            If the centre has three numbers and the vehicle moves in the plane.
        """
        if len(self.centre) > point.z.shape[0]:
            raise ValueError(f"centre: found {len(self.centre)} numbers; allowed: 2 for a vehicle in the plane")
        return ca.sumsqr(point.z[: len(self.centre)] - ca.DM(self.centre)) / self.radius**2


@dataclass(frozen=True)
class KeepOutPolygon:
    """Stay outside a convex polygon, in 3D outside the upright prism above and below it.

    The distance to the farthest edge line is smoothed from below, so that keeping the smooth limit keeps the true one;
    what that adds to the zone is at most ``softness · log(edges)`` at a corner.

    Parameters
    ----------
    corners
        At least three, ``((x, y), …)`` in metres, in either sense.
    softness
        In metres; violations are reported in metres.

    Raises
    ------
    ValueError
        If there are fewer than three corners, the polygon is not strictly convex, or the softness is not above 0.
    """

    name: ClassVar[str] = "keep_out"
    over_ground: ClassVar[bool] = True

    corners: tuple[tuple[float, float], ...]
    softness: float = 0.1

    lower: ClassVar[Array] = np.zeros(1)
    upper: ClassVar[Array] = np.full(1, np.inf)
    backoff: ClassVar[Array] = np.zeros(1)
    scale: ClassVar[Array] = np.ones(1)

    def __post_init__(self) -> None:
        positive("softness", self.softness)
        if len(self.corners) < 3:
            raise ValueError(f"corners: found {len(self.corners)}; allowed: at least 3")
        for corner in self.corners:
            vector("corners", corner, 2)
        turns = self._turns()
        if not (np.all(turns > 0.0) or np.all(turns < 0.0)) or abs(self._windings() - 1.0) > 1e-6:
            raise ValueError("corners: found a polygon that is not convex; allowed: a convex one, or several of them")

    def _edges(self) -> Array:
        points = np.array(self.corners, dtype=float)
        return np.asarray(np.roll(points, -1, axis=0) - points)

    def _turns(self) -> Array:
        """Cross product of each edge with the next: all of one sign round a convex polygon."""
        edge = self._edges()
        after = np.roll(edge, -1, axis=0)
        return np.asarray(edge[:, 0] * after[:, 1] - edge[:, 1] * after[:, 0])

    def _windings(self) -> float:
        """How often the edges turn round: once, but twice and more for a star."""
        edge = self._edges()
        after = np.roll(edge, -1, axis=0)
        return float(abs(np.sum(np.arctan2(self._turns(), np.sum(edge * after, axis=1)))) / (2.0 * np.pi))

    @property
    def half_planes(self) -> tuple[Array, Array]:
        """Outward normals ``(m, 2)`` and offsets ``(m,)``: inside, ``normal · x <= offset`` for all of them."""
        edge = self._edges()
        outward = np.stack([edge[:, 1], -edge[:, 0]], axis=1) * np.sign(self._turns()[0])
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        return outward, np.sum(outward * np.array(self.corners), axis=1)

    def value(self, point: FlatPoint) -> Any:
        """A smooth number that is no larger than the distance to the farthest edge line."""
        normals, offsets = self.half_planes
        distances = ca.mtimes(ca.DM(normals), point.z[:2]) - ca.DM(offsets)
        return self.softness * (ca.logsumexp(distances / self.softness) - np.log(len(offsets)))


@dataclass(frozen=True)
class DepthLimits:
    """Stay between seabed and surface, in 3D: ``lowest <= z <= highest`` (z up).

    Parameters
    ----------
    lowest, highest
        In metres, ``lowest < highest``; violations are reported in metres.

    Raises
    ------
    ValueError
        If ``lowest`` is not below ``highest``.
    """

    name: ClassVar[str] = "depth"

    lowest: float
    highest: float

    backoff: ClassVar[Array] = np.zeros(1)
    scale: ClassVar[Array] = np.ones(1)

    def __post_init__(self) -> None:
        if not self.lowest < self.highest:
            raise ValueError(f"lowest: found {self.lowest}; allowed: a number below highest, {self.highest}")

    @property
    def lower(self) -> Array:
        """The seabed."""
        return np.array([self.lowest])

    @property
    def upper(self) -> Array:
        """The surface."""
        return np.array([self.highest])

    def value(self, point: FlatPoint) -> Any:
        """The height z."""
        return point.z[2]


@dataclass(frozen=True)
class SpeedLimit:
    """``‖Ṗ_A‖ <= speed``.

    Parameters
    ----------
    dimension
        d.
    speed
        In m/s; violations are reported in units of it.

    Raises
    ------
    ValueError
        If the speed is not above 0.
    """

    name: ClassVar[str] = "speed"

    dimension: int
    speed: float

    lower: ClassVar[Array] = np.full(1, -np.inf)
    upper: ClassVar[Array] = np.ones(1)
    backoff: ClassVar[Array] = np.zeros(1)
    # the squared speed changes twice as fast as the speed at the boundary
    scale: ClassVar[Array] = np.full(1, 2.0)

    def __post_init__(self) -> None:
        positive("speed", self.speed)

    def value(self, point: FlatPoint) -> Any:
        """Squared speed over its squared limit: smooth at rest."""
        return ca.sumsqr(point.dz[: self.dimension]) / self.speed**2


@dataclass(frozen=True)
class YawRateLimit:
    """``|ψ̇| <= rate``, for vehicles whose flat output carries the yaw after the position.

    Parameters
    ----------
    dimension
        d.
    rate
        In rad/s; violations are reported in units of it.

    Raises
    ------
    ValueError
        If the rate is not above 0.
    """

    name: ClassVar[str] = "yaw_rate"

    dimension: int
    rate: float

    lower: ClassVar[Array] = -np.ones(1)
    upper: ClassVar[Array] = np.ones(1)
    backoff: ClassVar[Array] = np.zeros(1)
    scale: ClassVar[Array] = np.ones(1)

    def __post_init__(self) -> None:
        positive("rate", self.rate)

    def value(self, point: FlatPoint) -> Any:
        """The yaw rate over its limit."""
        return point.dz[self.dimension] / self.rate
