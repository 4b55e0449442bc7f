"""Following a plan from where the vehicle is, in still or moving water."""

from __future__ import annotations

from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.ocp.follower import BANDWIDTH, Follower
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.typing import Array

ON_PLAN = 1.0e-6
"""Distance from a plan (m, rad, and per second) that counts as on it."""


class PlanFollower:
    """A :class:`~gbt_ocp.ocp.follower.Follower` on plans that are given over ground.

    The thrust follows from the motion through the water, so that plan and vehicle are compared in a frame that moves
    with it.

    Parameters
    ----------
    vehicle
        The model.
    bandwidth
        ω in rad/s; 0 leaves the feed-forward thrust alone.
    """

    def __init__(self, vehicle: Vehicle, bandwidth: float = BANDWIDTH) -> None:
        self._follower = Follower(vehicle, bandwidth)

    def thrust(self, through: FlatTrajectory, now: float, middle: float, water: Array, z: Array, dz: Array) -> Array:
        """The thrust ``(m,)`` to hold, each input within its limit.

        Parameters
        ----------
        through
            The plan, in the frame of the water.
        now, middle
            Seconds since it began, now and half the time later over which the thrust is held.
        water
            Velocity of the water over ground ``(d,)`` in m/s.
        z, dz
            The measured flat output and its rate over ground ``(n,)``.
        """
        d = len(water)
        z, dz = z.copy(), dz.copy()
        z[:d] -= now * water
        dz[:d] -= water
        return self._follower.thrust(through.point(now), through.point(middle), z, dz)
