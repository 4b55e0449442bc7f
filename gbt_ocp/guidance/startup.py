"""The first moves: while the range is not known, the vehicle crosses the line of sight, and nothing is planned.

:class:`Crossing` is a state machine of plain numbers; ``kernel/gbt_startup.c`` is the same in C.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.guidance.apart import OwnSide
from gbt_ocp.guidance.helm import Helm, SteeringLimits, helm_of, turning_away
from gbt_ocp.guidance.planned import PlannedMotion
from gbt_ocp.guidance.strategy import Guidance
from gbt_ocp.guidance.swept import DesiredTurn
from gbt_ocp.models.sizes import not_negative, positive, vector
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.ocp.planner import AnyPlanner
from gbt_ocp.ocp.shooting import ShootingPlanner
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array

OBSERVED = 0.25
"""Deviation of the range over it below which what is believed of the range is more than its prior."""

SPREADS = 2.0
"""Deviations by which a believed range has to be above the nearest one, for all of the speed to go across."""

CLEARED = 10.0
"""Time in seconds within which a vehicle that is nearer than that goes to be clear."""

CLEARING = 0.8
"""Most of the speed that leads away from the target; the rest is across the line of sight, for the range's sake."""

STRAIGHT = 1e-9
"""Size of the cross product of axis and line of sight below which they count as parallel."""


@dataclass
class Crossing:
    """When to cross the line of sight, and how fast.

    It begins in the sense in which the desired bearing turns, and reverses after every leg. As seen from the target the
    vehicle moves against the turn of the bearing. It begins again whenever the range is no longer known: plans that are
    to keep a distance which is believed so badly lead away along the line of sight, and nothing more is learnt.

    Attributes
    ----------
    axis
        Of the turn of the desired bearing, a unit vector ``(3,)``; not read in the plane.
    deviation
        Posterior deviation of the range over the range below which it counts as known.
    speed, opening
        Speed, and the part of it that leads away from the target, m/s.
    leg
        Time in seconds after which the vehicle crosses the other way.
    nearest
        Distance in metres to be kept, as far as the range is known; 0 for none.
    known
        Whether the range was known at the last step.
    crossing
        Whether the vehicle crossed at the last step.
    began
        Time in seconds at which it began to, if so.
    """

    axis: Array
    deviation: float
    speed: float
    opening: float
    leg: float
    nearest: float = 0.0
    known: bool = False
    crossing: bool = False
    began: float = 0.0

    def step(self, time: float, own: Array, mean: Array, covariance: Array) -> Array | None:
        """The velocity ``(d,)`` in m/s at which to cross, or ``None`` where the range is known.

        Parameters
        ----------
        time
            In seconds.
        own
            Position of the vehicle ``(d,)``.
        mean, covariance
            Posterior of the target's position now, ``(d,)`` and ``(d, d)``; a covariance of NaN counts as zero.
        """
        d = len(own)
        line = mean - own
        distance = float(np.linalg.norm(line))
        sight = line / distance if distance > 0.0 else np.eye(d)[0]
        spread = float(np.sqrt(max(sight @ np.nan_to_num(covariance, nan=0.0) @ sight, 0.0)))
        self.known = spread < self.deviation * distance
        if self.known:
            self.crossing = False
            return None
        if not self.crossing:
            self.crossing, self.began = True, time
        sense = 1.0 if self._legs(time) % 2 == 0 else -1.0
        turn = np.array([-sight[1], sight[0]]) if d == 2 else np.cross(self.axis, sight)
        size = float(np.linalg.norm(turn))
        turn = turn / size if size > STRAIGHT else np.eye(d)[0]
        opening = self._opening(distance, spread)
        across = float(np.sqrt(self.speed**2 - opening**2))
        return np.asarray(-sense * across * turn - opening * sight)

    def _opening(self, distance: float, spread: float) -> float:
        """The speed away from a target believed at a distance of this deviation: more where that may be too near."""
        if self.nearest == 0.0 or spread >= OBSERVED * distance:
            return self.opening
        missing = self.nearest + SPREADS * spread - distance
        return max(self.opening, min(missing / CLEARED, CLEARING * self.speed))

    def turn_back(self, time: float) -> None:
        """Begin a leg the other way, at a time in seconds."""
        self.began = time - self.leg * (self._legs(time) + 1)

    def _legs(self, time: float) -> int:
        """How many legs are through."""
        return int((time - self.began) / self.leg + 1e-9)


class CrossFirst:
    """Crosses the line of sight until the range is observable, then plans.

    One bearing says nothing about range, and a first forecast is little more than its prior; a plan that circles it, or
    keeps a distance from it, would take that for knowledge. Crossing needs no range: it turns the line of sight fastest
    at any. The reversals matter: from a straight course the range of a target on another one does not show, however
    long it is. A part of the speed leads away, so that a target that approaches no faster than that does not come
    nearer. Only the thrust's own limits are kept meanwhile.

    Parameters
    ----------
    planned
        What follows.
    vehicle
        Its thrust limits are obeyed.
    period
        T in seconds, within which a desired velocity is reached.
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
    nearest
        Distance in metres to be kept, as far as the range is known; 0 for none.
    limits
        Those of the steering of a vehicle that is not flat.
    side
        The own side of the target, beside other vehicles: a leg that leads off it ends.

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
        nearest: float = 0.0,
        limits: SteeringLimits | None = None,
        side: OwnSide | None = None,
    ) -> None:
        positive("deviation", deviation)
        positive("speed", speed)
        positive("leg", leg)
        if not not_negative("opening", opening) < speed:
            raise ValueError(f"guidance.startup_opening: found {opening}; allowed: a number < startup_speed = {speed}")
        self.planned = planned
        self.helm = helm_of(vehicle, period, limits)
        unit = vector("axis", axis, 3)
        unit /= positive("length of axis", float(np.linalg.norm(unit)))
        self._side = side
        self._crossing = Crossing(unit, deviation, float(speed), opening, leg, not_negative("nearest", nearest))

    @property
    def crossing(self) -> Crossing:
        """When to cross, and how fast."""
        return self._crossing

    @property
    def desired(self) -> DesiredTurn:
        """λ* of what follows."""
        return self.planned.desired

    def see(self, bearing: Array | None) -> None:
        """Take note of the bearing ``(d,)`` measured now."""
        self.planned.see(bearing)

    def decide(self, time: float, flat: Array, forecast: Forecast) -> Plan | ShootingPlan | Array:
        """The thrust that crosses, or the plan."""
        known = self._crossing.known
        own = flat[0, : forecast.mean.shape[1]]
        begins, mean, covariance = not self._crossing.crossing, forecast.mean[0], forecast.covariance[0]
        velocity = self._crossing.step(time, own, mean, covariance)
        if velocity is not None and self._side is not None and self._side.asks_back(own, velocity, mean, begins):
            self._crossing.turn_back(time)
            velocity = self._crossing.step(time, own, mean, covariance)
        if velocity is None:
            if not known:
                self.planned.restart()
            return self.planned.decide(time, flat, forecast)
        self.planned.remember(time, flat, forecast)
        if isinstance(self.helm, Helm):
            velocity = turning_away(velocity, flat[0, len(own)], mean - own)
        thrust = self.helm.reach_velocity(flat, velocity)
        planner = planner_of(self.planned)
        if isinstance(planner, AnyPlanner):
            planner.act(thrust)
        return thrust


def planned_of(guidance: Guidance) -> PlannedMotion | None:
    """The part of an observer strategy that plans, sooner or later."""
    planned = getattr(guidance, "planned", guidance)  # of a strategy that does something else first, or around it
    return planned if isinstance(planned, PlannedMotion) else None


def planner_of(guidance: Guidance) -> AnyPlanner | ShootingPlanner | None:
    """The planner of an observer strategy that plans, sooner or later."""
    planned = planned_of(guidance)
    return None if planned is None else planned.planner
