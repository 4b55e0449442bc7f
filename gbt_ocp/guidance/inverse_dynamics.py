"""From an acceleration or a velocity to the thrust that brings it about, by the flatness map, within the limits."""

from __future__ import annotations

import casadi as ca

from gbt_ocp.models.evaluated import Evaluated
from gbt_ocp.models.sizes import positive
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.typing import Array


class InverseDynamics:
    """Thrust that gives the position an acceleration and brings the yaw, where there is one, to rest.

    Parameters
    ----------
    vehicle
        Its first d flat outputs are the position.
    period
        T in seconds, over which a change of velocity is brought about.

    Raises
    ------
    ValueError
        If the period is not above 0.
    """

    def __init__(self, vehicle: Vehicle, period: float) -> None:
        n = vehicle.flat_dimension
        point = [ca.SX.sym(name, n) for name in ("z", "dz", "ddz")]
        self._inputs = Evaluated("inputs", point, [vehicle.inputs(*point)])
        self._range = ThrustRange.of(vehicle)
        self._dimension = vehicle.position_dimension
        self._period = positive("period", period)

    def accelerate(self, flat: Array, acceleration: Array) -> Array:
        """Thrust ``(m,)`` for an acceleration ``(d,)`` in m/s² at the flat output ``(L, n)``, each input clipped."""
        whole = -flat[1] / self._period
        whole[: self._dimension] = acceleration
        return self._range.clip(self._inputs(flat[0], flat[1], whole))

    def reach_velocity(self, flat: Array, velocity: Array) -> Array:
        """Thrust ``(m,)`` that reaches a velocity ``(d,)`` in m/s within a period, as far as the limits allow."""
        return self.accelerate(flat, (velocity - flat[1, : self._dimension]) / self._period)
