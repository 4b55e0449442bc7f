"""Helical guidance: a pursuit in space whose heading winds around the line of sight."""

from __future__ import annotations

import numpy as np

from gbt_ocp.guidance.inverse_dynamics import InverseDynamics
from gbt_ocp.guidance.line_of_sight import LineOfSight
from gbt_ocp.models.fossen import rotation
from gbt_ocp.models.sizes import positive
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array


def rotation_to(direction: Array) -> Array:
    """R_η ``(3, 3)``: the smallest rotation that takes e_x to a unit vector ``(3,)``; half a turn about z to -e_x."""
    axis = np.array([0.0, -direction[2], direction[1]])
    cosine = float(direction[0])
    if cosine <= -1.0 + 1e-12:
        return np.diag([-1.0, -1.0, 1.0])
    skew = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.asarray(np.eye(3) + skew + skew @ skew / (1.0 + cosine))


class HelicalGuidance:
    """``a = N (v × h) × λ + [k_r (r̂ - r_d) - k_v (v - v̂_T)·λ] λ``, ``h = R_η R_z(c_z sin kt) R_y(c_y cos kt) e_x``.

    λ is the line of sight, v the vehicle's own velocity, and h a heading that winds around λ with amplitudes c_z and
    c_y in radians at k rad/s; ``(v × h) × λ = h (v·λ) - v (h·λ)``. The first term is a helical law that maximises the
    determinant of the Fisher information, after the line of work the paper cites, reconstructed: the published law
    scales the angles by the inverse range. It does not control range, hence the second term.

    Parameters
    ----------
    vehicle
        In space; its dynamics and limits are obeyed.
    period
        T in seconds.
    gain
        N.
    amplitude_z, amplitude_y
        c_z and c_y in radians.
    frequency
        k in rad/s.
    standoff
        r_d in metres.
    range_gain
        k_r in 1/s².
    range_damping
        k_v in 1/s.

    Raises
    ------
    ValueError
        If the vehicle does not move in space, or frequency or standoff are not above 0.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        period: float,
        *,
        gain: float,
        amplitude_z: float,
        amplitude_y: float,
        frequency: float,
        standoff: float,
        range_gain: float,
        range_damping: float,
    ) -> None:
        if vehicle.position_dimension != 3:
            raise ValueError('guidance.kind: found "helical" in the plane; allowed: helical in 3 dimensions only')
        self._dynamics = InverseDynamics(vehicle, period)
        self._period = period
        self._gain = gain
        self._amplitudes = amplitude_z, amplitude_y
        self._frequency = positive("frequency", frequency)
        self._standoff = positive("standoff", standoff)
        self._range_gain = range_gain
        self._range_damping = range_damping

    def heading(self, time: float, direction: Array) -> Array:
        """h ``(3,)`` at a time in seconds for the line of sight ``(3,)``."""
        phase = self._frequency * time
        about_z, about_y = self._amplitudes[0] * np.sin(phase), self._amplitudes[1] * np.cos(phase)
        dipped = np.array([np.cos(about_y), 0.0, -np.sin(about_y)])
        return np.asarray(rotation_to(direction) @ rotation(about_z, 3) @ dipped)

    def decide(self, time: float, flat: Array, forecast: Forecast) -> Array:
        """The thrust for the acceleration of the law."""
        sight = LineOfSight.of(flat[0, :3], forecast, self._period)
        own, line = flat[1, :3], sight.direction
        heading = self.heading(time, line)
        turn = self._gain * (heading * (own @ line) - own * (heading @ line))
        radial = self._range_gain * (sight.range - self._standoff)
        radial -= self._range_damping * float((own - sight.target_velocity) @ line)
        return self._dynamics.accelerate(flat, turn + radial * line)
