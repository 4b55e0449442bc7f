"""Setpoints for a vehicle that has an autopilot of its own: course, speed, heading and depth, out of a plan."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.ocp.plan import Plan
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class Setpoint:
    """Where the vehicle should be, and how it should move there.

    Attributes
    ----------
    time
        In seconds: the next waypoint is :attr:`pose` at this time.
    pose
        Position and yaw ``(d+1,)``, earth frame, metres and radians.
    velocity
        Velocity over ground in the body frame and yaw rate ``(d+1,)``, m/s and rad/s.
    water
        Velocity of the water over ground for which is planned ``(d,)``, earth frame, m/s.
    """

    time: float
    pose: Array
    velocity: Array
    water: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def over_ground(self) -> Array:
        """Velocity over ground ``(d,)``, earth frame, m/s."""
        yaw, body = self.pose[-1], self.velocity
        level = [body[0] * math.cos(yaw) - body[1] * math.sin(yaw), body[0] * math.sin(yaw) + body[1] * math.cos(yaw)]
        return np.array([*level, *body[2:-1]])

    @property
    def through_water(self) -> Array:
        """Velocity through the water ``(d,)``, earth frame, m/s."""
        return self.over_ground - (self.water if self.water.size else 0.0)

    @property
    def course(self) -> float:
        """Course over ground in rad, counter-clockwise from +x."""
        return math.atan2(self.over_ground[1], self.over_ground[0])

    @property
    def heading(self) -> float:
        """Yaw in rad, counter-clockwise from +x."""
        return float(self.pose[-1])

    @property
    def speed(self) -> float:
        """Speed through the water in the horizontal plane, m/s."""
        return float(np.hypot(*self.through_water[:2]))

    @property
    def depth(self) -> float | None:
        """Depth in m, positive down; ``None`` in the plane."""
        return -float(self.pose[2]) if len(self.pose) == 4 else None


def setpoint_of(plan: Plan, vehicle: Vehicle, since: float, time: float) -> Setpoint:
    """The setpoint that a plan gives.

    Parameters
    ----------
    plan
        The plan.
    vehicle
        Its model.
    since
        Seconds since the plan begins; beyond its end, its end.
    time
        When that is.
    """
    trajectory = plan.trajectory
    since = min(since, trajectory.pieces * trajectory.period)
    state = vehicle.state(trajectory(since), trajectory(since, 1))
    water = np.zeros(vehicle.position_dimension) if plan.current is None else plan.current
    return Setpoint(time, vehicle.pose(state), vehicle.velocity(state), water)
