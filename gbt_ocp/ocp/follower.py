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

TURN_SHARE = 0.7
"""Share of its limits that an input may take to turn before the vehicle is slowed down for it."""

PROBE = 0.1
"""Half a difference of velocities in m/s from which slopes are taken: exact where thrust is quadratic in them."""


def turn_bandwidth(bandwidth: float) -> float:
    """ω in rad/s of the angles beside that of the position."""
    return max(bandwidth, min(TURN_FACTOR * bandwidth, TURN_BANDWIDTH))


class Follower:
    """Computed torque on the flat output.

    The thrust is that of the acceleration ``z̈ + 2 ω (ż - ż_m) + ω² (z - z_m)`` at the measured z_m, ż_m, where z, ż, z̈
    are the plan's. Without model error and within the limits the error e of each output then obeys
    ``ë + 2 ω ė + ω² e = 0`` in continuous time: critically damped, with the bandwidth ω of the position and that of
    :func:`turn_bandwidth` of the angles.

    Where turning takes more than :data:`TURN_SHARE` of an input, and more than planned, the vehicle is slowed down for
    it: a vehicle that is heavier than its model, or whose thrusters lag, slips broadside, where its Munk moment, which
    goes with the square of the speed, is more than it can turn against, and stays there.

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
        self._turn_bandwidth = turn_bandwidth(self.bandwidth)
        self._bandwidths[self._dimension :] = self._turn_bandwidth

    def thrust(self, plan: FlatPoint, middle: FlatPoint, z: Array, dz: Array, beyond: Array | None = None) -> Array:
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
        beyond
            Thrust that is added for what the vehicle needs beyond its model ``(m,)``; none by default.
        """
        error = np.asarray(plan.z - z, dtype=float)
        for axis in range(self._dimension, len(error)):
            error[axis] = math.remainder(error[axis], 2.0 * math.pi)
        wanted = middle.ddz + 2.0 * self._bandwidths * (plan.dz - dz) + self._bandwidths**2 * error
        at, rate = z + (middle.z - plan.z), dz + (middle.dz - plan.dz)
        more = 0.0 if beyond is None else beyond
        asked = self._inputs(at, rate, wanted) + more
        excess = self._excess(asked, middle)
        if np.any(excess):
            asked = self._inputs(at, rate, wanted + self._relief(excess, at, rate, wanted)) + more
        return self._range.clip(asked)

    def _excess(self, asked: Array, middle: FlatPoint) -> Array:
        """What the inputs that turn are asked beyond their share and beyond the plan ``(m,)``; 0 of the others."""
        excess, turn = np.zeros_like(asked), slice(self._dimension, None)
        if len(asked) == len(middle.z) and np.any((self._range.clip(asked, TURN_SHARE) != asked)[turn]):
            planned = self._inputs(*middle)
            least = np.minimum(TURN_SHARE * self._range.lower, planned)
            most = np.maximum(TURN_SHARE * self._range.upper, planned)
            excess[turn] = (asked - np.clip(asked, least, most))[turn]
        return excess

    def _relief(self, excess: Array, z: Array, dz: Array, ddz: Array) -> Array:
        """The acceleration ``(n,)`` that takes off the velocity of which turning needs so much, at most all of it."""
        d = self._dimension
        relief = np.zeros(len(z))
        speed = math.sqrt(float(dz[:d] @ dz[:d]))
        slopes = np.zeros((len(z), d))
        for axis in range(d):
            probe = np.zeros(len(z))
            probe[axis] = PROBE
            slopes[:, axis] = (self._inputs(z, dz + probe, ddz) - self._inputs(z, dz - probe, ddz)) / (2.0 * PROBE)
        for i in np.flatnonzero(excess):
            size = math.sqrt(float(slopes[i] @ slopes[i]))
            if size > 0.0:
                change = min(abs(float(excess[i])) / size, speed)
                relief[:d] -= self._turn_bandwidth * math.copysign(change, excess[i]) * slopes[i] / size
        return relief


def samples(period: float) -> int:
    """Samples of a follower in a period of so many seconds: as few as :data:`RATE_HZ` allows."""
    return max(1, math.ceil(period * RATE_HZ - 1e-9))
