"""The online loop for inputs that come in any order, at any rate, late or twice."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import replace
from operator import add
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.guidance.planned import ON_SCHEDULE
from gbt_ocp.guidance.startup import planner_of
from gbt_ocp.guidance.strategy import Placement
from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.measurements import Measurement, Sighting
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.ocp.problem_data import ShootingData
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.pilot.late_measurements import OrderedIntake
from gbt_ocp.pilot.online_loop import Decided, OnlineLoop
from gbt_ocp.pilot.own_track import OwnState, OwnTrack, Received, checked_numbers, earth_rates
from gbt_ocp.pilot.pilot_command import PilotCommand
from gbt_ocp.pilot.pilot_health import PilotState, TrackWatch
from gbt_ocp.pilot.pilot_parts import PilotParts
from gbt_ocp.pilot.plan_follower import ON_PLAN, PlanFollower
from gbt_ocp.pilot.shot_follower import ShotFollower
from gbt_ocp.pilot.skeleton import Skeleton
from gbt_ocp.typing import Array

LARGEST = 1.0e12
"""Sum of the sizes of a pose and its velocity above which their squares may be no numbers, in single precision."""

MOST_KNOWN = 512
"""Measurements that are remembered to find duplicates, before those that are too old are forgotten."""


class Piloting:
    """Navigations and measurements in, commands out: :class:`gbt_ocp.Pilot` without configuration and record.

    Parameters
    ----------
    parts
        What it is made of.
    """

    def __init__(self, parts: PilotParts) -> None:
        self.parts = parts
        self.began_at: Array | None = None
        self.skeleton = Skeleton()
        self._online = OnlineLoop(
            parts.tracker, parts.guidance, forecast=parts.forecast, forecast_period=parts.forecast_period
        )
        self._lead = parts.period if parts.lead is None else parts.lead
        vehicle: Any = parts.vehicle
        self._follower = None
        if not isinstance(vehicle, DrivenBody):
            self._follower = PlanFollower(vehicle, parts.follow_bandwidth, parts.thrust_lag)
        planner = planner_of(parts.guidance)
        # from the beginning: what it remembers is part of what a pilot does
        self._shot_follower: ShotFollower | None = None
        if planner is not None and isinstance(planner.problem, ShootingData):
            self._shot_follower = ShotFollower(vehicle, parts.follow_bandwidth, parts.input_rate)
        self._joined = 2 if planner is None else planner.problem.joined
        self._dimension = vehicle.position_dimension
        self._still = np.zeros(self._dimension)
        self._flat_size: int = vehicle.flat_dimension
        self._size = max(vehicle.flat_dimension if isinstance(vehicle, DrivenBody) else 0, self._dimension + 1)
        self._own = OwnTrack(parts.late, parts.navigation_gap, self._dimension)
        self._watch = TrackWatch(parts.bearing_std)
        self._intake: OrderedIntake | None = None
        self._known: dict[tuple[str, str, float], None] = {}
        self._waiting: list[Measurement] = []
        self._arrived: list[Sighting] = []
        self._received: Mapping[Received, int] = {}
        self._now = -math.inf
        self._last: PilotCommand | None = None
        self._decided: Decided | None = None
        self._through: FlatTrajectory | None = None
        self._said: dict[str, Any] = {}
        self._thrusts: deque[tuple[float, Array]] = deque()
        self._learnt: OwnState | None = None

    def begin(self, own: ArrayLike) -> None:
        """Make the tracker at the vehicle's first position ``(d,)`` in metres."""
        self.began_at = np.array(own, dtype=float)
        if self.parts.tracker_at is not None:
            made, tracker = self.parts.tracker_at(self.began_at), self._online.tracker
            if hasattr(tracker, "__dict__"):  # in place, for the guidance may hold it
                vars(tracker).clear()
                vars(tracker).update(vars(made))
            else:
                self._online.tracker = made
        self._intake = OrderedIntake(self._online, self.parts.late)
        self.skeleton.explore(self)

    # ---- inputs -----------------------------------------------------------------------------------------------------

    def navigate(
        self, time: float, pose: ArrayLike, velocity: ArrayLike, covariance: ArrayLike | None = None
    ) -> Received:
        """Take in the own pose and velocity; see :meth:`gbt_ocp.Pilot.navigate`."""
        size = self._size
        p, v = checked_numbers("pose", pose, (size,)), checked_numbers("velocity", velocity, (size,))
        variance = 0.0
        if covariance is not None:
            variance = float(checked_numbers("covariance", covariance, (size, size))[self._dimension, self._dimension])
        numbers, rates = p.tolist(), v.tolist()
        together = sum(map(abs, numbers)) + sum(map(abs, rates))
        if not (together <= LARGEST and math.isfinite(time + variance) and variance >= 0.0):
            return self._answered("not finite")
        if self.began_at is None:
            self.begin(p[: self._dimension])
        state = OwnState(float(time), p, earth_rates(numbers, rates, self._dimension), math.sqrt(variance))
        return self._answered(self._own.add(state, self._now))

    def measure(self, measurement: Measurement) -> Received:
        """Take in a measurement; see :meth:`gbt_ocp.Pilot.measure`."""
        time, latest = measurement.time, self._own.latest
        now = self._now if latest is None else max(self._now, latest.time)
        if time < now - self.parts.late:
            return self._answered("too old")
        if time > now + max(self.parts.late, self.parts.navigation_gap) and now > -math.inf:
            return self._answered("ahead")
        known = (measurement.sensor, measurement.kind, time)
        if known in self._known:
            return self._answered("duplicate")
        self._known[known] = None
        if len(self._known) > MOST_KNOWN:
            self._known = {one: None for one in self._known if one[2] >= now - self.parts.late}
        if not self._own.covers(time):
            self._waiting.append(measurement)
            return self._answered("waiting")
        return self._answered(self._placed(measurement))

    def _placed(self, measurement: Measurement) -> Received:
        """Give a measurement its place in the earth frame, where the own state is known."""
        own = self._own.at(measurement.time)
        if own is None or self._intake is None:
            return "no navigation"
        heading_std = own.heading_std
        sensor = self.parts.sensors.get(measurement.sensor)
        if sensor is not None:
            measurement = sensor.completed(measurement)
            heading_std = max(heading_std, sensor.heading_std)
        sighting = measurement.placed(own.pose[: self._dimension + 1], heading_std)
        self._watch.see(sighting)
        self._arrived.append(sighting)
        return "late" if sighting.time < self._intake.latest else "taken"

    def _answered(self, word: Received) -> Received:
        if word != "taken":
            # a new one, since those of earlier commands stay as they were
            self._received = {**self._received, word: self._received.get(word, 0) + 1}
        return word

    # ---- commands ---------------------------------------------------------------------------------------------------

    def command(self, time: float) -> PilotCommand:
        """What the vehicle is to do from a time on; see :meth:`gbt_ocp.Pilot.command`."""
        t = float(time)
        if not math.isfinite(t):
            raise ValueError(f"time: found {time!r}; allowed: a finite number of seconds")
        last = self._last
        if last is not None and t <= last.time:
            if t == last.time:
                return last
            return replace(last, state=last.state._replace(stepped_back=True))
        carried = self._carried_on(t)
        if carried is None or self._intake is None:
            nothing = np.zeros(len(self.parts.vehicle.thrust_max))
            return PilotCommand(t, nothing, False, self._state(t), None, self.parts.vehicle, self._lead)
        self._settle(t, self._intake)
        period = self.parts.period
        hold = period if last is None else min(t - last.time, period)
        z, dz = carried
        # at the command nearest to the time at which the next decision is due
        if self._decided is None or t + 0.5 * hold >= self._decided.time + period:
            self._decide(t, z, dz)
        decided = self._decided
        assert decided is not None, "it was decided before"
        thrust = self._thrust(decided, t, hold, z, dz, 0.0 if last is None else t - last.time)
        if thrust is not None and self._online.learns:
            self._thrusts.append((t, thrust))
        self._now = t
        self._last = PilotCommand(
            t, thrust, self._watch.range_known, self._state(t), decided, self.parts.vehicle, self._lead
        )
        return self._last

    def _settle(self, time: float, intake: OrderedIntake) -> None:
        """Give the tracker all measurements whose place is known."""
        if self._waiting:
            still = []
            for measurement in self._waiting:
                if self._own.covers(measurement.time):
                    if self._placed(measurement) == "no navigation":
                        self._answered("no navigation")
                elif measurement.time < time - self.parts.late:
                    self._answered("no navigation")
                else:
                    still.append(measurement)
            self._waiting = still
        if self._arrived:
            for _ in intake.settle(self._arrived):
                self._answered("refused")
            self._arrived = []

    def _decide(self, time: float, z: Array, dz: Array) -> None:
        self._learn()
        decided = self._online.decide(time, self._flat(time, z, dz))
        self._watch.forecast(decided.times, decided.forecast, z[: self._dimension])
        plan = decided.plan
        if plan is not None and plan.status:
            self._said = _said_by(plan)
        self._decided, self._through = decided, None

    def _flat(self, time: float, z: Array, dz: Array) -> Array:
        """Derivatives of the flat output now: the plan's own on a step on time where the vehicle is on its plan.

        Otherwise those above the rate are the plan's.
        """
        measured = np.array([z, dz, *(np.zeros_like(z) for _ in range(self._joined - 2))])
        before = self._decided
        if before is None or not isinstance(before.decision, Plan):
            return measured
        trajectory, elapsed, since = before.decision.trajectory, before.decision.elapsed, time - before.time
        if abs(since - self.parts.period) <= ON_SCHEDULE:
            planned = trajectory.after(elapsed, self.parts.period)
            if np.abs(planned[:2] - measured[:2]).max() <= ON_PLAN:
                return planned
        for order in range(2, self._joined):
            measured[order] = trajectory(elapsed + since, order)
        return measured

    def _carried_on(self, time: float) -> tuple[Array, Array] | None:
        """Flat output and rate ``(n,)`` now: since the last navigation as planned, where a plan is followed.

        ``None`` before the first navigation.
        """
        n, latest, decided = self._flat_size, self._own.latest, self._decided
        if latest is not None and decided is not None and isinstance(decided.decision, Plan):
            since = latest.time - decided.time + decided.decision.elapsed
            if latest.time < time <= latest.time + self.parts.navigation_gap and since >= 0.0:
                on, faster = decided.decision.trajectory.step(since, since + time - latest.time)
                # of as many numbers as the plan has
                z, dz = map(add, latest.pose.tolist(), on), map(add, latest.rates.tolist(), faster)
                return np.array(list(z)), np.array(list(dz))
        own = self._own.at(time, bridging=True)
        return None if own is None else (own.pose[:n], own.rates[:n])

    def _learn(self) -> None:
        """Have the guidance learn the current from the last navigations and the thrust between them."""
        latest, before = self._own.latest, self._learnt
        assert latest is not None, "there is a navigation"
        if not self._online.learns or (before is not None and latest.time - before.time < 0.5 * self.parts.period):
            return
        self._learnt = latest
        if before is not None and self._thrusts and self._thrusts[0][0] <= before.time:
            n = self._flat_size
            first, then = (np.array([one.pose[:n], one.rates[:n]]) for one in (before, latest))
            mean = self._mean_thrust(before.time, latest.time)
            self._online.learn(first, then, mean, latest.time - before.time)
        while len(self._thrusts) > 1 and self._thrusts[1][0] <= latest.time:
            self._thrusts.popleft()

    def _mean_thrust(self, begin: float, end: float) -> Array:
        """Mean of the thrusts that were held from ``begin`` to ``end``."""
        times = [time for time, _ in self._thrusts][1:]
        held = zip(self._thrusts, [*times, math.inf], strict=True)
        parts = [max(0.0, min(until, end) - max(since, begin)) * thrust for (since, thrust), until in held]
        return np.asarray(sum(parts) / (end - begin))

    def _thrust(self, decided: Decided, time: float, hold: float, z: Array, dz: Array, passed: float) -> Array | None:
        decision, since = decided.decision, time - decided.time
        if isinstance(decision, Placement):
            return None
        if isinstance(decision, ShootingPlan):
            assert self._shot_follower is not None, "plans of this kind are of problems by integration"
            return self._shot_follower.thrust(decision, self.parts.period, decision.elapsed + since, z, dz)
        if not isinstance(decision, Plan):
            return decision if self._follower is None else self._follower.ask(decision, passed, hold)
        assert self._follower is not None, "plans of this kind are of flat vehicles"
        if self._through is None:
            self._through = decision.through_water
        water = self._still if decision.current is None else decision.current
        now = decision.elapsed + since
        return self._follower.thrust(self._through, now, now + 0.5 * hold, water, z, dz, passed)

    def _state(self, time: float) -> PilotState:
        latest, decided = self._own.latest, self._decided
        return PilotState(
            time,
            -math.inf if latest is None else latest.time,
            -math.inf if self._intake is None else self._intake.latest,
            self.parts.navigation_gap,
            decided is not None,
            decided is not None and decided.held,
            self._said,
            self._watch.lost,
            len(self._waiting),
            self._received,
            len(self._online.begun),
        )


def _said_by(plan: Plan | ShootingPlan) -> dict[str, Any]:
    """What a plan says in the health, by the name of the attribute."""
    said: dict[str, Any] = {"planner": plan.status, "fallback": plan.fallback}
    return said | {"given_up": plan.given_up, "broken_at_start": plan.broken_at_start}
