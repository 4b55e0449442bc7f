"""The first moves: while the range is not known, the vehicle crosses the line of sight, and nothing is planned."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.guidance.inverse_dynamics import InverseDynamics
from gbt_ocp.guidance.pacing import PacedBearing
from gbt_ocp.guidance.planned import PlannedMotion
from gbt_ocp.guidance.protocol import Guidance
from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.models.sizes import not_negative, positive, vector
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.ocp.planner import Planner
from gbt_ocp.ocp.shooting import ShootingPlanner
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array

LOST = 1.6
"""Factor on the deviation at which a vehicle that planned already crosses again."""


class CrossFirst:
    """Crosses the line of sight until the range is observable, then plans.

    One bearing says nothing about range, and a first forecast is little more than its prior; a plan that circles it, or
    keeps a distance from it, would take that for knowledge. Crossing needs no range: it turns the line of sight fastest
    at any. It begins in the sense in which the desired bearing turns, and reverses after every leg: from a straight
    course the range of a target on another one does not show, however long it is. A part of the speed leads away, so
    that a target that approaches no faster than that does not come nearer. Only the thrust's own limits are kept
    meanwhile.

    Parameters
    ----------
    planned
        What follows.
    vehicle
        Its thrust limits are obeyed.
    period
        T in seconds, over which a velocity is brought about.
    axis
        About which the desired bearing turns, in space.
    deviation
        Posterior deviation of the range over the range below which it counts as known.
    speed
        In m/s.
    opening
        Part of the speed that leads away from the target, in m/s.
    leg
        Time in seconds after which the vehicle crosses the other way.

    Raises
    ------
    ValueError
        If deviation, speed or leg are not above 0, ``opening`` is below 0 or not below the speed, or the axis is zero.
    """

    def __init__(
        self,
        planned: PlannedMotion,
        vehicle: Vehicle,
        period: float,
        *,
        axis: ArrayLike = (0.0, 0.0, 1.0),
        deviation: float,
        speed: float,
        opening: float,
        leg: float,
    ) -> None:
        positive("deviation", deviation)
        positive("speed", speed)
        positive("leg", leg)
        if not not_negative("opening", opening) < speed:
            raise ValueError(f"guidance.startup_opening: found {opening}; allowed: a number < startup_speed = {speed}")
        self.planned = planned
        self._dynamics = InverseDynamics(vehicle, period)
        self._axis = vector("axis", axis, 3)
        self._axis /= positive("length of axis", float(np.linalg.norm(self._axis)))
        self._deviation = deviation
        self._opening = opening
        self._across = float(np.sqrt(speed**2 - opening**2))
        self._leg = leg
        self._began: float | None = None
        self._known = False

    @property
    def desired(self) -> DesiredBearing | PacedBearing:
        """λ* of what follows."""
        return self.planned.desired

    def see(self, bearing: Array | None) -> None:
        """Take note of the bearing ``(d,)`` measured now."""
        self.planned.see(bearing)

    def decide(self, time: float, flat: Array, forecast: Forecast) -> Plan | ShootingPlan | Array:
        """The thrust that crosses, or the plan."""
        d = forecast.mean.shape[1]
        line = forecast.mean[0] - flat[0, :d]
        distance = float(np.linalg.norm(line))
        sight = line / distance if distance > 0.0 else np.eye(d)[0]
        spread = float(np.sqrt(max(sight @ np.nan_to_num(forecast.covariance[0], nan=0.0) @ sight, 0.0)))
        known = spread < (LOST if self._known else 1.0) * self._deviation * distance
        if known and not self._known:
            self.planned.restart()
        self._known = known
        if known:
            self._began = None
            return self.planned.decide(time, flat, forecast)
        self.planned.remember(time, flat, forecast)
        if self._began is None:
            self._began = time
        sense = 1.0 if int((time - self._began) / self._leg + 1e-9) % 2 == 0 else -1.0
        # the vehicle moves against the turn of the bearing, as seen from the target
        turn = np.array([-sight[1], sight[0]]) if d == 2 else np.cross(self._axis, sight)
        size = float(np.linalg.norm(turn))
        turn = turn / size if size > 1e-9 else np.eye(d)[0]
        return self._dynamics.reach_velocity(flat, -sense * self._across * turn - self._opening * sight)


def planner_of(guidance: Guidance) -> Planner | ShootingPlanner | None:
    """The planner of an observer strategy that plans, sooner or later."""
    if isinstance(guidance, CrossFirst):
        return guidance.planned.planner
    return guidance.planner if isinstance(guidance, PlannedMotion) else None
