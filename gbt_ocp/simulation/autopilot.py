"""A model of the autopilot that a vehicle brings along: it takes setpoints and gives thrust."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from gbt_ocp.models.evaluated import Evaluated
from gbt_ocp.models.sizes import positive
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.pilot.setpoint import Setpoint
from gbt_ocp.typing import Array


class Autopilot:
    """First order in course and speed, critically damped in depth and heading, within the limits of the thrust.

    The velocity through the water follows that of the setpoint with the time constant τ, ``v̇ = (v_set - v)/τ``; depth
    and heading obey ``x'' = (x_set - x)/τ² - 2 x'/τ``. Of the place it follows the depth alone: the next
    plan mends what the vehicle is off its path. Thrust comes from the inverse dynamics, each input clipped.

    Parameters
    ----------
    vehicle
        The model. Its flat output is the pose.
    lag
        τ in seconds.

    Raises
    ------
    ValueError
        If the lag is not above 0.
    """

    def __init__(self, vehicle: Vehicle, lag: float) -> None:
        point = [ca.SX.sym(name, vehicle.flat_dimension) for name in ("z", "dz", "ddz")]
        self._inputs = Evaluated("inputs", point, [vehicle.inputs(*point)])
        self._range = ThrustRange.of(vehicle)
        self._dimension = vehicle.position_dimension
        self._lag = positive("lag", lag)

    def thrust(self, setpoint: Setpoint, z: Array, dz: Array) -> Array:
        """The thrust ``(m,)`` to hold, from the flat output and its rate over ground ``(n,)``."""
        d, lag = self._dimension, self._lag
        through, wanted = np.array(dz, dtype=float), setpoint.through_water
        through[:d] -= setpoint.water
        asked = -2.0 * through / lag
        asked[:2] = (wanted[:2] - through[:2]) / lag
        if d == 3:
            asked[2] += (setpoint.pose[2] - z[2]) / lag**2
        if len(z) > d:
            asked[d] += math.remainder(setpoint.heading - z[d], 2.0 * math.pi) / lag**2
        return self._range.clip(self._inputs(z, through, asked))
