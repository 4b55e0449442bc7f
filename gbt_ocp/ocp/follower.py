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

TURN_FACTOR, TURN_BANDWIDTH = 4.0, 8.0
"""Of an angle the bandwidth is so many times that of the position, up to so many rad/s.

What a model with errors leaves of the Munk moment turns the vehicle out of its motion. At a speed u that moment grows
at the rate ``u sqrt((m_v - m_u)/m_r)``, 13 a second at 4 m/s of the Falcon. Where the vehicle is a fifth heavier than
its model a sixth is left over, a stiffness of -28 /s²: more than ω² of the position can hold."""


def turn_bandwidth(bandwidth: float) -> float:
    """ω in rad/s of the angles beside that of the position."""
    return max(bandwidth, min(TURN_FACTOR * bandwidth, TURN_BANDWIDTH))


class Follower:
    """Computed torque on the flat output.

    The thrust is that of the acceleration ``z̈ + 2 ω (ż - ż_m) + ω² (z - z_m)`` at the measured z_m, ż_m, where z, ż, z̈
    are the plan's. Without model error and within the limits the error e of each output then obeys
    ``ë + 2 ω ė + ω² e = 0`` in continuous time: critically damped, with the bandwidth ω of the position and that of
    :func:`turn_bandwidth` of the angles.

    Parameters
    ----------
    vehicle
        The model. Its flat outputs after the first d, the position, are angles: their errors are taken the short way
        round.
    bandwidth
        ω of the position in rad/s; 0 leaves the feed-forward thrust alone.

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
        self._bandwidths = np.full(vehicle.flat_dimension, self.bandwidth)
        self._bandwidths[self._dimension :] = turn_bandwidth(self.bandwidth)

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
        wanted = middle.ddz + 2.0 * self._bandwidths * (plan.dz - dz) + self._bandwidths**2 * error
        asked = self._inputs(z + (middle.z - plan.z), dz + (middle.dz - plan.dz), wanted)
        return self._range.clip(asked)


def samples(period: float) -> int:
    """Samples of a follower in a period of so many seconds: as few as :data:`RATE_HZ` allows."""
    return max(1, math.ceil(period * RATE_HZ - 1e-9))
