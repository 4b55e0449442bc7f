"""How fast the vehicle may move and turn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gbt_ocp.ocp.trajectory import FlatPoint

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SpeedLimit:
    """``‖Ṗ_A‖ <= speed``.

    Parameters
    ----------
    dimension
        d.
    speed
        In m/s; violations are reported in units of it.
    """

    dimension: int
    speed: float

    lower: ClassVar[Array] = np.full(1, -np.inf)
    upper: ClassVar[Array] = np.ones(1)
    backoff: ClassVar[Array] = np.zeros(1)
    # the squared speed changes twice as fast as the speed at the boundary
    scale: ClassVar[Array] = np.full(1, 2.0)

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
    """

    dimension: int
    rate: float

    lower: ClassVar[Array] = -np.ones(1)
    upper: ClassVar[Array] = np.ones(1)
    backoff: ClassVar[Array] = np.zeros(1)
    scale: ClassVar[Array] = np.ones(1)

    def value(self, point: FlatPoint) -> Any:
        """The yaw rate over its limit."""
        return point.dz[self.dimension] / self.rate
