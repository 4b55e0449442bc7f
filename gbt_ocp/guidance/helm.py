"""The helm of a vehicle that is not flat: from a velocity to the inputs that steer towards it."""

from __future__ import annotations

import math

import numpy as np

from gbt_ocp.guidance.inverse_dynamics import InverseDynamics
from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.steady_motion import push_for
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.typing import Array

COURSE_GAIN, RATE_GAIN = 1.5, 1.0
"""Share of the turn for a rad of deviation of the course, and for a rad/s of yaw rate against it."""

STEEPEST = math.radians(25.0)
"""Largest pitch in rad that a change of depth asks for."""

SPEED_GAIN = 0.5
"""Share of the push for a m/s that is missing."""

SPEEDS = 12
"""Speeds at which the push is known; between them it is linear."""

FASTEST_KNOWN = 5.0
"""The largest of them in m/s."""


class Helm:
    """Steers the course of a velocity and keeps its speed, no slower than the vehicle can be steered.

    Parameters
    ----------
    vehicle
        With :meth:`~gbt_ocp.models.driven.DrivenBody.steering`.
    slowest
        Least speed ahead in m/s.
    """

    def __init__(self, vehicle: DrivenBody, slowest: float = 0.0) -> None:
        self._vehicle, self._slowest = vehicle, slowest
        self._speeds = np.linspace(0.0, FASTEST_KNOWN, SPEEDS)
        self._pushes = np.array([push_for(vehicle, speed) for speed in self._speeds])

    def reach_velocity(self, flat: Array, velocity: Array) -> Array:
        """Inputs ``(m,)`` that steer towards a velocity ``(d,)`` in m/s, at a pose and its rate ``(2, n)``."""
        vehicle, d = self._vehicle, self._vehicle.position_dimension
        state = vehicle.state(flat[0], flat[1])
        surge, rate = state[vehicle.flat_dimension], flat[1, d]
        course = math.atan2(velocity[1], velocity[0])
        off = math.remainder(course - flat[0, d], 2.0 * math.pi)
        speed = max(float(np.linalg.norm(velocity)), self._slowest)
        push = float(np.interp(speed, self._speeds, self._pushes)) + SPEED_GAIN * (speed - surge)
        turn = float(np.clip(COURSE_GAIN * off - RATE_GAIN * rate, -1.0, 1.0))
        inputs = vehicle.steering(float(np.clip(push, 0.0, 1.0)), turn)
        if d == 3:
            pitch = float(np.clip(math.asin(np.clip(velocity[2] / speed, -1.0, 1.0)), -STEEPEST, STEEPEST))
            inputs[2] = (COURSE_GAIN * (pitch - flat[0, 4]) - RATE_GAIN * flat[1, 4]) * vehicle.thrust_max[2]
        return vehicle.clipped(inputs)


def helm_of(vehicle: Vehicle | DrivenBody, period: float, slowest: float = 0.0) -> Helm | InverseDynamics:
    """What brings a vehicle to a velocity: its inverse dynamics, or a helm where it has none.

    Parameters
    ----------
    vehicle
        Flat or not.
    period
        T in seconds, over which a flat vehicle reaches it.
    slowest
        Least speed ahead in m/s of one that is not flat.
    """
    return Helm(vehicle, slowest) if isinstance(vehicle, DrivenBody) else InverseDynamics(vehicle, period)
