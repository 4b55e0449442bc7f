"""Limits of vehicles that are steered by fins: least speed ahead, least radius of their turns, and pitch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from gbt_ocp.models.sizes import positive
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.typing import Array


def ahead(point: FlatPoint, dimension: int) -> Any:
    """Speed along the bow in m/s at a pose with its rates: position, yaw, and in space the pitch if there is one."""
    c, s = ca.cos(point.z[dimension]), ca.sin(point.z[dimension])
    level = c * point.dz[0] + s * point.dz[1]
    if dimension == 2 or point.z.shape[0] < 5:
        return level
    return ca.cos(point.z[4]) * level + ca.sin(point.z[4]) * point.dz[2]


@dataclass(frozen=True)
class LeastSpeed:
    """``u >= speed``: ahead through the water, since the force of a fin grows with the square of that.

    Parameters
    ----------
    dimension
        d; the yaw follows the position.
    speed
        In m/s; violations are reported in units of it.

    Raises
    ------
    ValueError
        If the speed is not above 0.
    """

    name: ClassVar[str] = "speed_min"

    dimension: int
    speed: float

    lower: ClassVar[Array] = np.ones(1)
    upper: ClassVar[Array] = np.full(1, np.inf)
    backoff: ClassVar[Array] = np.zeros(1)
    scale: ClassVar[Array] = np.ones(1)

    def __post_init__(self) -> None:
        positive("speed", self.speed)

    def value(self, point: FlatPoint) -> Any:
        """Speed along the bow over its limit."""
        return ahead(point, self.dimension) / self.speed


@dataclass(frozen=True)
class LeastTurnRadius:
    """``|ψ̇| radius <= u``: no turn is tighter, u the speed ahead.

    Parameters
    ----------
    dimension
        d; the yaw follows the position.
    radius
        In metres.
    speed
        In m/s: violations are reported in units of it.

    Raises
    ------
    ValueError
        If radius or speed are not above 0.
    """

    name: ClassVar[str] = "turn_radius"

    dimension: int
    radius: float
    speed: float = 1.0

    lower: ClassVar[Array] = np.zeros(2)
    upper: ClassVar[Array] = np.full(2, np.inf)
    backoff: ClassVar[Array] = np.zeros(2)
    scale: ClassVar[Array] = np.ones(2)

    def __post_init__(self) -> None:
        positive("radius", self.radius)
        positive("speed", self.speed)

    def value(self, point: FlatPoint) -> Any:
        """``u - radius ψ̇`` and ``u + radius ψ̇``, over the speed."""
        speed, turn = ahead(point, self.dimension), self.radius * point.dz[self.dimension]
        return ca.vertcat(speed - turn, speed + turn) / self.speed


@dataclass(frozen=True)
class PitchLimit:
    """``|θ| <= angle``, where the pitch θ follows position and yaw: upright, a yaw has no meaning.

    Parameters
    ----------
    angle
        In rad, below a right angle.

    Raises
    ------
    ValueError
        If the angle is not above 0 and below π/2.
    """

    name: ClassVar[str] = "pitch"

    angle: float

    lower: ClassVar[Array] = np.full(1, -1.0)
    upper: ClassVar[Array] = np.ones(1)
    backoff: ClassVar[Array] = np.zeros(1)
    scale: ClassVar[Array] = np.ones(1)

    def __post_init__(self) -> None:
        if not positive("angle", self.angle) < np.pi / 2.0:
            raise ValueError(f"angle: found {self.angle}; allowed: a number in (0, π/2)")

    def value(self, point: FlatPoint) -> Any:
        """The pitch over its limit."""
        return point.z[4] / self.angle
