"""A desired bearing that turns no faster than the vehicle can follow.

The desired bearing of the paper turns once in T m seconds wherever the target is. From a range r that asks for a speed
of ``ω ρ r`` round the target, ρ being the radius of the circle that the bearing runs on the unit sphere. Where the
vehicle cannot reach it, it does best to stay where it is, and bearings from one place say nothing about range: with
noise the track is then lost. Slowed down, the same motion leads round the target at every range.
"""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.typing import Array

FASTEST = 100.0
"""Speed in m/s beyond which a vehicle counts as free of drag."""


class PacedBearing:
    """λ*(t) of a :class:`~gbt_ocp.models.bearings.DesiredBearing`, slowed down where the target is far.

    Parameters
    ----------
    desired
        The bearing at full pace.
    speed
        Speed in m/s that going round the target may ask for.
    """

    def __init__(self, desired: DesiredBearing, speed: float) -> None:
        if not speed > 0.0:
            raise ValueError(f"speed: found {speed}; allowed: a number > 0")
        self._desired = desired
        self._speed = speed / (1.0 if desired.dimension == 2 else np.sqrt(6.0) / 3.0)
        self._time = 0.0
        self._phase = 0.0
        self._pace = 1.0

    def pace(self, time: float, distance: float) -> None:
        """From ``time`` in seconds on, turn as fast as a target at the distance in metres allows."""
        self._phase += self._pace * (time - self._time)
        self._time = time
        asked = self._desired.rate * max(distance, 1e-9)
        self._pace = min(1.0, self._speed / asked) if asked > 0.0 else 1.0

    def __call__(self, times: ArrayLike) -> Array:
        """Desired bearings ``(..., d)`` at the times ``(...)`` in seconds, at the present pace."""
        return self._desired(self._phase + self._pace * (np.asarray(times, dtype=float) - self._time))


def steady_speed(vehicle: Vehicle) -> float | None:
    """Speed in m/s that the vehicle keeps up in the plane: geometric mean over both axes at zero yaw.

    ``None`` if there is no drag to limit it.
    """
    n = vehicle.flat_dimension
    z = [ca.SX.sym(name, n) for name in ("z", "dz", "ddz")]
    thrust = ca.Function("thrust", z, [vehicle.inputs(*z)])
    speeds = []
    for axis in range(2):
        along = np.eye(n)[axis]

        def share(speed: float, along: Array = along) -> float:
            found = np.asarray(thrust(np.zeros(n), speed * along, np.zeros(n))).ravel()
            return float(np.max(np.abs(found) / vehicle.thrust_max))

        if share(FASTEST) < 1.0:
            return None
        low, high = 0.0, FASTEST
        for _ in range(40):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if share(middle) < 1.0 else (low, middle)
        speeds.append(low)
    return float(np.sqrt(speeds[0] * speeds[1]))


FASTEST = 1.0e3
"""Speed in m/s beyond which none is searched."""


def horizontal_radius(dimension: int, range_: float) -> float:
    """Radius in metres of the circle on which the desired bearings are taken at a range: in space it is √6/3 of it."""
    return range_ if dimension == 2 else math.sqrt(6.0) / 3.0 * range_


def circling_speed(vehicle: Vehicle, radius: float, share: float = 1.0) -> float:
    """Largest steady speed in m/s on a level circle, bow along the path, within the thrust there is.

    Parameters
    ----------
    vehicle
        Gives drag and limits.
    radius
        Of the circle, in metres.
    share
        γ, the part of the limits that may be used.
    """
    size, d = vehicle.flat_dimension, vehicle.position_dimension
    point = [ca.SX.sym(name, size) for name in ("z", "dz", "ddz")]
    inputs = ca.Function("inputs", point, [vehicle.inputs(*point)])

    def load(speed: float) -> float:
        z, dz, ddz = np.zeros((3, size))
        z[0], dz[1], ddz[0] = radius, speed, -(speed**2) / radius
        if size > d:
            z[d], dz[d] = math.pi / 2.0, speed / radius
        thrust = np.abs(np.asarray(inputs(z, dz, ddz), dtype=float).ravel())
        return float(np.max(thrust / (share * vehicle.thrust_max)))

    slow, fast = 0.0, 1.0
    while load(fast) <= 1.0 and fast < FASTEST:
        slow, fast = fast, 2.0 * fast
    for _ in range(60):
        middle = 0.5 * (slow + fast)
        slow, fast = (middle, fast) if load(middle) <= 1.0 else (slow, middle)
    return slow


def turn_period(radius: float, speed: float) -> float:
    """``2πR/v``: seconds of a turn on a circle of radius R (m) at a speed v (m/s) relative to its centre."""
    return 2.0 * math.pi * radius / speed
