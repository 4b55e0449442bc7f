"""Following a plan from where the vehicle is, in still or moving water."""

from __future__ import annotations

from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.ocp.disturbance import DisturbanceObserver
from gbt_ocp.ocp.follower import BANDWIDTH, Follower
from gbt_ocp.ocp.thrusters import LaggingThrusters
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
    lag
        Time constant in s of the thrusters, 0 for none. It is made up for, and what else the vehicle needs beyond its
        model is estimated and added to the thrust. ``None`` where it is not known: an estimate that takes a lag for a
        disturbance leads further off the plan than none.
    """

    def __init__(self, vehicle: Vehicle, bandwidth: float = BANDWIDTH, lag: float | None = None) -> None:
        self._follower = Follower(vehicle, bandwidth)
        self._thrusters = LaggingThrusters(vehicle, lag or 0.0)
        self._observer = None if lag is None else DisturbanceObserver(vehicle)

    def ask(self, wanted: Array, passed: float, hold: float) -> Array:
        """The thrust to ask for a wanted one: see :meth:`~gbt_ocp.ocp.thrusters.LaggingThrusters.ask`."""
        if self._observer is not None:
            self._observer.forget()
        return self._thrusters.ask(wanted, passed, hold)

    def thrust(
        self,
        through: FlatTrajectory,
        now: float,
        middle: float,
        water: Array,
        z: Array,
        dz: Array,
        passed: float = 0.0,
    ) -> Array:
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
        passed
            Seconds since the last thrust was given; 0 for the first one.
        """
        d, hold = len(water), 2.0 * (middle - now)
        rate = dz.copy()
        rate[:d] -= water
        at = z.copy()
        at[:d] -= now * water
        beyond = None
        if self._observer is not None:
            beyond = self._observer.observe(z, rate, self._thrusters.acted(passed), passed)
        wanted = self._follower.thrust(through.point(now), through.point(middle), at, rate, beyond)
        return self._thrusters.ask(wanted, passed, hold)
