"""The helm of a vehicle that is not flat: from a velocity to the inputs that steer towards it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from gbt_ocp.guidance.inverse_dynamics import InverseDynamics
from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.steady_motion import push_for, turning_circle
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.typing import Array

TURN_MARGIN = 1.4
"""Factor on the least radius: what is kept of it, with feedback and rates of the inputs between."""

COURSE_GAIN, RATE_GAIN, PITCH_GAIN = 0.8, 0.6, 1.5
"""Yaw rate in rad/s for a rad off the course, share of the turn for a rad/s of deviation of the yaw rate, and
share of the elevator for a rad of pitch."""

FULL_TURN_PUSH = 0.6
"""Share of the push at which the tightest circle is measured."""

BEGINNING = 0.3
"""Speed in m/s below which a vehicle is steered as at this speed."""

STEEPEST = math.radians(25.0)
"""Largest pitch in rad that a change of depth asks for."""

AWAY = 0.5
"""Cosine of the angle from the course away from the target at which a turn goes on by that side by itself."""

SPEED_GAIN = 0.5
"""Share of the push for a m/s that is missing."""

SPEEDS = 12
"""Speeds at which the push is known; between them it is linear."""

FASTEST_KNOWN = 5.0
"""The largest of them in m/s."""


@dataclass(frozen=True)
class SteeringLimits:
    """What a :class:`Helm` keeps.

    Attributes
    ----------
    slowest
        Least speed ahead in m/s.
    radius
        Least radius of turns in m.
    rate
        Largest rates of the inputs ``(m,)`` in their units a second; ``None`` for no limit.
    """

    slowest: float = 0.0
    radius: float = 0.0
    rate: tuple[float, ...] | None = None


class Helm:
    """Steers the course of a velocity and keeps its speed, no slower and turning no tighter than the limits allow.

    Parameters
    ----------
    vehicle
        With :meth:`~gbt_ocp.models.driven.DrivenBody.steering`.
    period
        Seconds between two calls.
    limits
        Its own.
    """

    def __init__(self, vehicle: DrivenBody, period: float, limits: SteeringLimits) -> None:
        self._vehicle, self._slowest = vehicle, limits.slowest
        self._step = None if limits.rate is None else period * np.array(limits.rate)
        self._last: Array | None = None
        _, circle = turning_circle(vehicle, FULL_TURN_PUSH, 1.0)
        self._tightest, self._radius = circle, max(TURN_MARGIN * limits.radius, circle)
        self._speeds = np.linspace(0.0, FASTEST_KNOWN, SPEEDS)
        self._pushes = np.array([push_for(vehicle, speed) for speed in self._speeds])

    @property
    def numbers(self) -> dict[str, Any]:
        """What it works with, by the names that the generated C has for them."""
        return {
            "helm_push": self._pushes,
            "helm_fastest": FASTEST_KNOWN,
            "helm_slowest": self._slowest,
            "helm_radius": self._radius,
            "helm_tightest": self._tightest,
        }

    def reach_velocity(self, flat: Array, velocity: Array) -> Array:
        """Inputs ``(m,)`` that steer towards a velocity ``(d,)`` in m/s, at a pose and its rate ``(2, n)``."""
        vehicle, d = self._vehicle, self._vehicle.position_dimension
        state = vehicle.state(flat[0], flat[1])
        surge, rate = state[vehicle.flat_dimension], flat[1, d]
        course = math.atan2(velocity[1], velocity[0])
        off = math.remainder(course - flat[0, d], 2.0 * math.pi)
        speed = max(float(np.linalg.norm(velocity)), self._slowest)
        push = float(np.interp(speed, self._speeds, self._pushes)) + SPEED_GAIN * (speed - surge)
        # a rate that the radius allows; what a circle takes of the turn, and feedback on the rate
        moving = max(float(surge), BEGINNING)
        wanted = float(np.clip(COURSE_GAIN * off, -moving / self._radius, moving / self._radius))
        turn = float(np.clip(wanted * self._tightest / moving + RATE_GAIN * (wanted - rate), -1.0, 1.0))
        inputs = vehicle.steering(float(np.clip(push, 0.0, 1.0)), turn)
        if d == 3:
            pitch = float(np.clip(math.asin(np.clip(velocity[2] / speed, -1.0, 1.0)), -STEEPEST, STEEPEST))
            inputs[2] = (PITCH_GAIN * (pitch - flat[0, 4]) - RATE_GAIN * flat[1, 4]) * vehicle.thrust_max[2]
        inputs = vehicle.clipped(inputs)
        if self._step is not None:
            before = np.zeros(len(inputs)) if self._last is None else self._last
            inputs = np.clip(inputs, before - self._step, before + self._step)
        self._last = inputs
        return inputs


def turning_away(velocity: Array, yaw: float, line: Array) -> Array:
    """The velocity to steer for first, so that a wide turn does not lead towards the target.

    Where the course is more than a right angle off the heading, that is the course away from the target until the
    vehicle has turned to that side: one that turns in a circle would else come nearer by its diameter, by chance.

    Parameters
    ----------
    velocity
        To be reached ``(d,)`` in m/s.
    yaw
        In radians.
    line
        From the vehicle to the target ``(d,)`` in m.
    """
    distance, c, s = math.hypot(line[0], line[1]), math.cos(yaw), math.sin(yaw)
    if c * velocity[0] + s * velocity[1] >= 0.0 or -c * line[0] - s * line[1] >= AWAY * distance:
        return velocity
    share = -math.hypot(velocity[0], velocity[1]) / distance
    return np.array([share * line[0], share * line[1], *velocity[2:]])


def helm_of(
    vehicle: Vehicle | DrivenBody, period: float, limits: SteeringLimits | None = None
) -> Helm | InverseDynamics:
    """What brings a vehicle to a velocity: its inverse dynamics, or a helm where it has none.

    Parameters
    ----------
    vehicle
        Flat or not.
    period
        T in seconds, between two calls; a flat vehicle reaches the velocity within it.
    limits
        Of a vehicle that is not flat.
    """
    if isinstance(vehicle, DrivenBody):
        return Helm(vehicle, period, limits or SteeringLimits())
    return InverseDynamics(vehicle, period)
