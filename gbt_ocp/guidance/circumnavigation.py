"""Circumnavigation: the vehicle circles the estimate at a standoff, so that the line of sight keeps turning."""

from __future__ import annotations

import numpy as np

from gbt_ocp.guidance.inverse_dynamics import InverseDynamics
from gbt_ocp.guidance.line_of_sight import LineOfSight
from gbt_ocp.models.sizes import not_negative, positive
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array


class Circumnavigation:
    """Velocity ``u = v̂_T + β (r̂ - r_d) λ + s λ_⊥``, reached as fast as the thrust allows.

    Law: Deghat, Shames, Anderson and Yu (2014), with the velocity of the estimate added for a moving target and the
    vehicle's dynamics in place of an integrator; the paper gives neither, so this is a reconstruction. λ is the
    measured bearing and r̂ the distance of the estimate: the vehicle goes around the target itself, however wrong the
    estimate is, and that excites the estimator. Circling a wrong estimate hardly turns the line of sight. A missed
    bearing is replaced by the direction of the estimate. The circle is horizontal: λ_⊥ is λ turned by +90° in the
    plane, and ``e_z × λ`` normalised in space.

    Parameters
    ----------
    vehicle
        Whose dynamics and limits the law obeys.
    period
        T in seconds.
    speed
        s in m/s, above the target's.
    radial_gain
        β in 1/s.
    standoff
        r_d in metres.

    Raises
    ------
    ValueError
        If a number is not above 0 (the gain may be 0).
    """

    def __init__(self, vehicle: Vehicle, period: float, *, speed: float, radial_gain: float, standoff: float) -> None:
        self._dynamics = InverseDynamics(vehicle, period)
        self._dimension = vehicle.position_dimension
        self._period = period
        self._speed = positive("speed", speed)
        self._radial_gain = not_negative("radial_gain", radial_gain)
        self._standoff = positive("standoff", standoff)
        self._bearing: Array | None = None

    def see(self, bearing: Array | None) -> None:
        """Take in the bearing ``(d,)``, or ``None`` where it was missed."""
        self._bearing = bearing

    def decide(self, time: float, flat: Array, forecast: Forecast) -> Array:
        """The thrust that turns the velocity towards that of the law."""
        sight = LineOfSight.of(flat[0, : self._dimension], forecast, self._period, self._bearing)
        across = np.zeros(self._dimension)
        across[:2] = -sight.direction[1], sight.direction[0]
        size = float(np.linalg.norm(across))
        across = across / size if size > 0.0 else np.eye(self._dimension)[0]
        closing = self._radial_gain * (sight.range - self._standoff)
        velocity = sight.target_velocity + closing * sight.direction + self._speed * across
        return self._dynamics.reach_velocity(flat, velocity)
