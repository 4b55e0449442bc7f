"""From a wished acceleration or velocity to thrust: the flatness map of the vehicle, within its limits."""

from __future__ import annotations

import casadi as ca
import numpy as np

from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.typing import Array


class InverseDynamics:
    """Thrust that gives the position a wished acceleration and brings all else, the yaw, to rest.

    Parameters
    ----------
    vehicle
        Its first d flat outputs are the position.
    period
        T in seconds, over which a wished change of velocity is brought about.
    """

    def __init__(self, vehicle: Vehicle, period: float) -> None:
        n = vehicle.flat_dimension
        point = [ca.SX.sym(name, n) for name in ("z", "dz", "ddz")]
        self._inputs = ca.Function("inputs", point, [vehicle.inputs(*point)])
        self._limit = vehicle.thrust_max
        self._dimension = vehicle.position_dimension
        self._period = period

    def accelerate(self, flat: Array, acceleration: Array) -> Array:
        """Thrust ``(m,)`` for an acceleration ``(d,)`` in m/s² at the flat output ``(L, n)``, each input clipped."""
        wished = -flat[1] / self._period
        wished[: self._dimension] = acceleration
        thrust = np.asarray(self._inputs(flat[0], flat[1], wished), dtype=float).ravel()
        return np.asarray(np.clip(thrust, -self._limit, self._limit))

    def reach_velocity(self, flat: Array, velocity: Array) -> Array:
        """Thrust ``(m,)`` that reaches a velocity ``(d,)`` in m/s within a period, as far as the limits allow."""
        return self.accelerate(flat, (velocity - flat[1, : self._dimension]) / self._period)
