"""A desired bearing that turns no faster than the vehicle can follow.

The desired bearing of the paper turns once in T m seconds wherever the target is. From a range r that asks for a speed
of ``ω ρ r`` round the target, ρ being the radius of the circle that the bearing runs on the unit sphere. Where the
vehicle cannot reach it, the best plan is to stay, and bearings from one place say nothing about range: with noise the
track is then lost. Slowed down, the same motion leads round the target at every range.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.sizes import positive
from gbt_ocp.models.steady_motion import speed_on_circle, turning_circle
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.typing import Array

FASTEST = 2.0**10
"""Speed in m/s up to which a vehicle's largest speed is searched, by doubling; beyond it counts as free of drag."""


class PacedBearing:
    """λ*(t) of a :class:`~gbt_ocp.models.bearings.DesiredBearing`, slowed down where the target is far.

    Parameters
    ----------
    desired
        The bearing at full pace.
    speed
        Speed in m/s that going round the target may ask for.

    Raises
    ------
    ValueError
        If the speed is not above 0.
    """

    def __init__(self, desired: DesiredBearing, speed: float) -> None:
        self._desired = desired
        self._steady = replace(desired, reverse=math.inf)
        self._speed = positive("speed", speed) / (1.0 if desired.dimension == 2 else np.sqrt(6.0) / 3.0)
        self._time = 0.0
        self._phase = 0.0
        self._pace = 1.0

    @property
    def at_full_pace(self) -> DesiredBearing:
        """The bearing that is slowed down."""
        return self._desired

    @property
    def speed(self) -> float:
        """The speed in m/s over the radius of the circle on the unit sphere."""
        return float(self._speed)

    def pace(self, time: float, distance: float) -> None:
        """From ``time`` in seconds on, turn as fast as a target at the distance in metres allows."""
        self._phase += self._pace * float(self._since(time))
        self._time = time
        asked = self._desired.rate * max(distance, 1e-9)
        self._pace = min(1.0, self._speed / asked) if asked > 0.0 else 1.0

    def __call__(self, times: ArrayLike) -> Array:
        """Desired bearings ``(..., d)`` at the times ``(...)`` in seconds, at the present pace."""
        return self._steady(self._phase + self._pace * self._since(times))

    def _since(self, times: ArrayLike) -> Array:
        """Seconds of turning since the last change of pace; reversals are by the clock."""
        return self._desired.turned(times) - self._desired.turned(self._time)


def largest_speed(load: Callable[[float], float]) -> float | None:
    """Largest speed in m/s at which a load stays within 1; ``None`` if it does so up to :data:`FASTEST`.

    Parameters
    ----------
    load
        Part of the limits that a speed in m/s takes; it grows with the speed.
    """
    slow, fast = 0.0, 1.0
    while load(fast) <= 1.0:
        if fast >= FASTEST:
            return None
        slow, fast = fast, 2.0 * fast
    for _ in range(60):
        middle = 0.5 * (slow + fast)
        slow, fast = (middle, fast) if load(middle) <= 1.0 else (slow, middle)
    return slow


def thrust_of(vehicle: Vehicle) -> Callable[[Array, Array, Array], Array]:
    """Inputs ``(m,)`` of a vehicle in numbers, a function of (z, ż, z̈), each ``(n,)``."""
    point = [ca.SX.sym(name, vehicle.flat_dimension) for name in ("z", "dz", "ddz")]
    function = ca.Function("inputs", point, [vehicle.inputs(*point)])
    return lambda *values: np.asarray(function(*values), dtype=float).ravel()


def steady_speed(vehicle: Vehicle | DrivenBody) -> float | None:
    """Speed in m/s that the vehicle keeps up in the plane: geometric mean over both axes at zero yaw.

    That of a vehicle that is not flat is its speed straight ahead. ``None`` if there is no drag to limit it.
    """
    if isinstance(vehicle, DrivenBody):
        return turning_circle(vehicle, 1.0, 0.0)[0]
    thrust, rest, limits = thrust_of(vehicle), np.zeros(vehicle.flat_dimension), ThrustRange.of(vehicle)
    speeds = []
    for along in np.eye(vehicle.flat_dimension)[:2]:

        def load(speed: float, along: Array = along) -> float:
            return float(np.max(limits.used(thrust(rest, speed * along, rest))))

        speed = largest_speed(load)
        if speed is None:
            return None
        speeds.append(speed)
    return float(np.sqrt(speeds[0] * speeds[1]))


def horizontal_radius(dimension: int, range_: float) -> float:
    """Radius in metres of the circle on which the desired bearings are taken at a range: in space it is √6/3 of it."""
    return range_ if dimension == 2 else math.sqrt(6.0) / 3.0 * range_


def circling_speed(vehicle: Vehicle | DrivenBody, radius: float, share: float = 1.0) -> float:
    """Largest steady speed in m/s on a level circle, bow along the path, within the thrust; at most :data:`FASTEST`.

    Parameters
    ----------
    vehicle
        Gives drag and limits.
    radius
        Of the circle, in metres.
    share
        γ, the part of the limits that may be used.

    Raises
    ------
    ValueError
        If the radius or the share is not above 0.
    """
    positive("radius", radius)
    positive("share", share)
    if isinstance(vehicle, DrivenBody):
        return speed_on_circle(vehicle, radius, share)
    thrust, size, d = thrust_of(vehicle), vehicle.flat_dimension, vehicle.position_dimension
    limits = ThrustRange.of(vehicle)

    def load(speed: float) -> float:
        z, dz, ddz = np.zeros((3, size))
        z[0], dz[1], ddz[0] = radius, speed, -(speed**2) / radius
        if size > d:
            z[d], dz[d] = math.pi / 2.0, speed / radius
        return float(np.max(limits.used(thrust(z, dz, ddz)) / share))

    speed = largest_speed(load)
    return FASTEST if speed is None else speed


def turn_period(radius: float, speed: float) -> float:
    """``2πR/v``: seconds of a turn on a circle of radius R (m) at a speed v (m/s) relative to its centre."""
    return 2.0 * math.pi * radius / speed
