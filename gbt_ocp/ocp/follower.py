"""The follower: thrust that keeps a vehicle on its plan between two plans."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from gbt_ocp.models.evaluated import Evaluated
from gbt_ocp.models.sizes import not_negative
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.typing import Array

RATE_HZ = 50.0
"""Least rate in Hz at which a follower is sampled; between two samples its thrust is held."""

BANDWIDTH = 2.0
"""ω in rad/s: default of :class:`Follower`."""


class Follower:
    """Computed torque on the flat output.

    The thrust is that of the acceleration ``z̈ + 2 ω (ż - ż_m) + ω² (z - z_m)`` at the measured z_m, ż_m, where z, ż, z̈
    are the plan's. Without model error and within the limits the error e of each output then obeys
    ``ë + 2 ω ė + ω² e = 0`` in continuous time: critically damped, with the bandwidth ω.

    Parameters
    ----------
    vehicle
        The model. Its flat outputs after the first d, the position, are angles: their errors are taken the short way
        round.
    bandwidth
        ω in rad/s; 0 leaves the feed-forward thrust alone.

    Raises
    ------
    ValueError
        If the bandwidth is negative or not finite.

    References
    ----------
    Computed torque: Siciliano et al., Robotics (2009), section 8.5.2.
    """

    def __init__(self, vehicle: Vehicle, bandwidth: float = BANDWIDTH) -> None:
        point = [ca.SX.sym(name, vehicle.flat_dimension) for name in ("z", "dz", "ddz")]
        self._inputs = Evaluated("inputs", point, [vehicle.inputs(*point)])
        self._range = ThrustRange.of(vehicle)
        self._dimension = vehicle.position_dimension
        self.bandwidth = not_negative("bandwidth", bandwidth)

    def thrust(self, plan: FlatPoint, middle: FlatPoint, z: Array, dz: Array) -> Array:
        """The thrust ``(m,)`` until the next sample, each input clipped to its limit.

        It is evaluated for the middle of the time over which it is held: the vehicle is taken to move as planned until
        then.

        Parameters
        ----------
        plan
            The planned flat output and its derivatives now, each ``(n,)``.
        middle
            The same half a sample later.
        z, dz
            The measured flat output and its rate now ``(n,)``.
        """
        error = np.asarray(plan.z - z, dtype=float)
        for axis in range(self._dimension, len(error)):
            error[axis] = math.remainder(error[axis], 2.0 * math.pi)
        wanted = middle.ddz + 2.0 * self.bandwidth * (plan.dz - dz) + self.bandwidth**2 * error
        asked = self._inputs(z + (middle.z - plan.z), dz + (middle.dz - plan.dz), wanted)
        return self._range.clip(asked)


def samples(period: float) -> int:
    """Samples of a follower in a period of so many seconds: as few as :data:`RATE_HZ` allows."""
    return max(1, math.ceil(period * RATE_HZ - 1e-9))
