"""How fast a vehicle can go round a target at a distance, and so how long a turn of the bearing takes."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from gbt_ocp.vehicles import Vehicle

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
