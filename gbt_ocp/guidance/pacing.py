"""A desired bearing that turns no faster than the vehicle can follow.

The desired bearing of the paper turns once in T m seconds wherever the target is. From a range r that asks for a speed
of ``ω ρ r`` round the target, ρ being the radius of the circle that the bearing runs on the unit sphere. Where the
vehicle cannot reach it, it does best to stay where it is, and bearings from one place say nothing about range: with
noise the track is then lost. Slowed down, the same motion leads round the target at every range.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbt_ocp.bearings import DesiredBearing
from gbt_ocp.vehicles import Vehicle

Array = NDArray[np.float64]

FASTEST = 100.0
"""Speed in m/s beyond which a vehicle counts as free of drag."""


class PacedBearing:
    """λ*(t) of a :class:`~gbt_ocp.bearings.DesiredBearing`, slowed down where the target is far.

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
