"""Steady motions of vehicles that are not flat: what speed and what turn given inputs end in."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.typing import Array

BEGIN = 0.5
"""Speed ahead in m/s from which a steady motion is searched."""

SEARCH = 40.0
"""Time in s that a vehicle is given to come near its steady motion before it is solved for."""


def steady_velocity(vehicle: DrivenBody, inputs: ArrayLike) -> Array:
    """ν ``(n,)`` that the inputs ``(m,)`` end in, from slow ahead and level; at level trim in space.

    Raises
    ------
    ValueError
        If the motion does not become steady.
    """
    from scipy.integrate import solve_ivp  # takes half a second to import, which most runs do not need
    from scipy.optimize import root

    n, given = vehicle.flat_dimension, np.asarray(inputs, dtype=float)
    start = np.zeros(2 * n)
    start[n] = BEGIN

    def change(nu: Array) -> Array:
        return np.asarray(vehicle.rates(np.concatenate([np.zeros(n), nu]), given)[n:])

    near = solve_ivp(lambda t, nu: change(nu), (0.0, SEARCH), start[n:], rtol=1e-4, atol=1e-6, method="LSODA")
    found = root(change, near.y[:, -1], tol=1e-10)
    if not found.success:
        raise ValueError(f"inputs: found {given.tolist()}; allowed: those that end in a steady motion")
    return np.asarray(found.x)


def push_for(vehicle: DrivenBody, speed: float) -> float:
    """Share of the push in [0, 1] that keeps a speed in m/s straight ahead, as near as that is possible."""
    n = vehicle.flat_dimension
    state = np.zeros(2 * n)
    state[n] = speed

    def gain(push: float) -> float:
        return float(vehicle.rates(state, vehicle.steering(push, 0.0))[n])

    low, high = 0.0, 1.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if gain(middle) < 0.0 else (low, middle)
    return high


def turning_circle(vehicle: DrivenBody, push: float, turn: float) -> tuple[float, float]:
    """Speed in m/s and radius in m of the circle that shares of push and turn end in; infinite straight ahead."""
    nu = steady_velocity(vehicle, vehicle.steering(push, turn))
    speed, rate = float(np.hypot(nu[0], nu[1])), abs(float(nu[vehicle.position_dimension]))
    return speed, speed / rate if rate > 1e-9 else np.inf


def speed_on_circle(vehicle: DrivenBody, radius: float, push: float) -> float:
    """Speed in m/s on a circle of a radius in m, at a share of the push; on the tightest one if that is wider."""
    return turning_circle(vehicle, push, turn_for(vehicle, radius, push))[0]


def turn_for(vehicle: DrivenBody, radius: float, push: float) -> float:
    """Largest share of the turn in [0, 1] whose circle, at a share of the push, has at least a radius in m."""
    easy, hard = 0.0, 1.0
    if turning_circle(vehicle, push, hard)[1] >= radius:
        return hard
    for _ in range(16):
        turn = 0.5 * (easy + hard)
        easy, hard = (easy, turn) if turning_circle(vehicle, push, turn)[1] < radius else (turn, hard)
    return easy
