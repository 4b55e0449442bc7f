"""One vehicle in the closed loop, from step to step."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.guidance.strategy import Placement
from gbt_ocp.guidance.water import InWater
from gbt_ocp.models.measurements import Sighting
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.pilot.online_loop import Decided
from gbt_ocp.simulation.closed_loop import ClosedLoop, Recording
from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.mover import Mover
from gbt_ocp.simulation.recorder import Recorder
from gbt_ocp.simulation.step import Step
from gbt_ocp.tracking.polar import bearing_of
from gbt_ocp.typing import Array


class VehicleRun:
    """A vehicle in the loop.

    Parameters
    ----------
    loop
        Its parts.
    start
        Derivatives 0 … L-1 of the flat output at t = 0 ``(L, n)``.
    steps
        Of the run.
    history
        The class of its history.
    """

    def __init__(self, loop: ClosedLoop, start: ArrayLike, steps: int, history: type[History]) -> None:
        self._loop, vehicle = loop, loop.vehicle
        self._mover = Mover(
            vehicle,
            loop.sensor.period,
            loop.follow,
            loop.plant,
            loop.follow_bandwidth,
            loop.autopilot,
            loop.lead,
            loop.input_rate,
            loop.thrust_lag,
        )
        self._flat = np.asarray(start, dtype=float)
        self._state = vehicle.state(self._flat[0], self._flat[1])
        self._recorder = Recorder(history, steps)
        self._online = loop.online()
        self._intake = None if loop.exchange is None else loop.exchange.intake(self._online)
        self._ahead = loop.forecast_period * np.arange(loop.forecast + 1)
        self._current = loop.guidance.current if isinstance(loop.guidance, InWater) else None
        self._seen: deque[Array] = deque(maxlen=loop.window)
        self._tightened = self._refused = self._clipped = 0
        self._underway: deque[tuple[Sighting, Array]] = deque()
        self._decided: Decided | None = None
        self._heard = (0, 0)

    def measure(self, k: int, t: float) -> None:
        """Measure, and give the tracker what has arrived."""
        loop = self._loop
        self._truth = truth = loop.target.position(np.asarray(t + self._ahead, dtype=float))
        own = loop.vehicle.pose(self._state)[: loop.target.dimension]
        sensed: list[Sighting] = []
        if loop.sensors is None:
            bearing = loop.sensor.measure(k, truth[0], own, loop.rng)
            position = _measured_position(loop, truth[0])
        else:
            # what is recorded is the last direction that was measured
            measured_now = map(bearing_of, loop.sensors.measure(k, t, truth[0], loop.vehicle.pose(self._state)))
            bearing = next((one for one in reversed([*measured_now]) if one is not None), None)
            sensed = loop.sensors.arrived(t)
        self._water = self._mover.water(self._state)
        if bearing is not None and loop.sensors is None:
            self._underway.append((_sighting(t, bearing, own, position), bearing))
        for sighting in sensed:
            self._take(sighting, bearing_of(sighting))
        while self._underway and self._underway[0][0].time <= t - loop.sensor.latency + 1e-9:
            sighting, arrived = self._underway.popleft()
            if not self._take(sighting, arrived):
                bearing = None if sighting.time == t else bearing
        self._bearing = bearing

    def _take(self, sighting: Sighting, direction: Array | None) -> bool:
        """Give the tracker a measurement, which is seen in a direction; returns whether it took it."""
        if self._intake is not None:
            taken = not self._intake.settle([sighting])
        else:
            taken = self._online.take(sighting, direction)
        if not taken:
            self._refused += 1
            return False
        if direction is not None:
            self._seen.append(direction)
        if self._loop.exchange is not None:
            self._loop.exchange.note(sighting)
        return True

    def packet(self, t: float) -> bytes:
        """What the vehicle says at a time in seconds."""
        assert self._loop.exchange is not None, "only vehicles that talk are asked"
        return self._loop.exchange.compose(t, self._flat, self._decided)

    def hear(self, packets: Sequence[bytes]) -> None:
        """Take in what other vehicles have said."""
        if self._loop.exchange is None or self._intake is None or not packets:
            return
        found = self._loop.exchange.hear(packets)
        refused = self._intake.settle(found)
        self._refused += len(refused)
        self._heard = (len(packets), len(found) - len(refused))

    def move(self, t: float) -> Step:
        """Decide, record the step, and move until the next one."""
        loop, state = self._loop, self._state
        self._decided = decided = self._online.decide(t, self._flat)
        decision = decided.decision
        if isinstance(decision, Plan):
            move = self._mover.follow(state, decision)
        elif isinstance(decision, Placement):
            move = self._mover.place(state, decision.position)
        elif isinstance(decision, ShootingPlan):
            move = self._mover.execute(state, decision)
        else:
            move = self._mover.hold(state, decision)
        self._clipped += move.clipped
        step = Step(
            time=t,
            times=decided.times,
            target=self._truth,
            vehicle=loop.vehicle,
            state=state,
            bearing=self._bearing,
            desired_bearing=getattr(loop.guidance, "desired", loop.desired)(t),
            window=self._seen,
            forecast=decided.forecast,
            tracker_time=decided.tracker_time,
            process=loop.gaussian_process,
            bound_delta=loop.bound_delta,
            decision=decision,
            move=move,
            water=self._water,
            current=self._current,
            heard=self._heard,
        )
        self._recorder.add(step)
        if step.plan is not None:
            self._tightened += step.plan.tightened
        self._online.learn(self._flat[:2], move.flat[:2], move.thrust_mean, loop.sensor.period)
        self._flat, self._state, self._heard = move.flat, move.state, (0, 0)
        return step

    def recording(self) -> Recording:
        """What was recorded."""
        process = self._loop.gaussian_process
        retries = process.nugget_retries if process is not None else 0
        begun = tuple(self._online.begun)
        history = self._recorder.history()
        return Recording(history, self._tightened, retries, self._refused, self._online.held, self._clipped, begun)


def _sighting(time: float, bearing: Array, own: Array, position: Array | None) -> Sighting:
    """What the tracker is given of a step: the bearing, or the position if it takes positions."""
    if position is None:
        return Sighting.of_bearing(time, bearing, own)
    return Sighting(time, "position", position, np.full(position.shape, np.nan), own, "sensor")


def _measured_position(loop: ClosedLoop, target: Array) -> Array | None:
    """What a tracker of positions is given ``(d,)``, drawn whether or not it is missed; others see no position."""
    tracker = loop.position_tracker
    if tracker is None:
        return None
    return np.asarray(target + tracker.position_std * loop.rng.standard_normal(target.shape))
