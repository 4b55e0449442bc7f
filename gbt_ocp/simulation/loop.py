"""The closed loop: the online loop in a world, and a record of what is needed to repeat or explain it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbt_ocp.guidance.pacing import PacedBearing
from gbt_ocp.guidance.strategy import Guidance, Placement
from gbt_ocp.guidance.water import InWater
from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.models.measurements import Sighting
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.models.targets import Target
from gbt_ocp.ocp.follower import BANDWIDTH
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.pilot.online_loop import OnlineLoop
from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.mover import Mover
from gbt_ocp.simulation.plant import Plant
from gbt_ocp.simulation.recorder import Recorder
from gbt_ocp.simulation.sensing import Sensing
from gbt_ocp.simulation.step import Step
from gbt_ocp.tracking.polar import bearing_of
from gbt_ocp.tracking.protocol import GaussianProcess, PositionTracker, Tracker
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class ClosedLoop:
    """Everything that takes part in a run.

    Attributes
    ----------
    target, sensor, tracker, guidance, vehicle
        The parts.
    desired
        λ*(t), recorded beside what was measured, unless the guidance has its own ``desired``.
    window
        N_c, bearings that the recorded condition number counts.
    forecast
        n, positions predicted ahead.
    forecast_period
        Seconds between them; T in the paper.
    follow
        ``exact``: the vehicle follows the planned flat output; a piece that no thrust within the limits can follow (of
        a braking plan, at worst) is clipped and integrated, and so is the rest of that plan. ``dynamics``: the forward
        dynamics are integrated from where the vehicle is, under the planned thrust, clipped to the limits.
        ``feedback``: the same with a :class:`~gbt_ocp.ocp.follower.Follower` between plans.
    bound_delta
        δ of the recorded error bound.
    rng
        Source of the sensor's draws, and of the noise of the positions that a :class:`PositionTracker` is given.
    plant
        The vehicle that moves, where it is not the model; not with ``exact``.
    follow_bandwidth
        Of the follower, rad/s.
    autopilot
        Time constant in seconds of an autopilot that is given setpoints in place of thrust; ``None`` for thrust.
    lead
        How far ahead on the plan its setpoints are taken, in seconds; by default a period.
    sensors
        Several sensors, which take the place of :attr:`sensor`; its period remains that of the loop.
    input_rate
        Largest rates of the inputs ``(m,)`` that a follower of plans by integration keeps; ``None`` for no limit.
    """

    target: Target
    sensor: BearingSensor
    tracker: Tracker | PositionTracker
    guidance: Guidance
    vehicle: Any
    desired: DesiredBearing | PacedBearing
    window: int
    forecast: int
    forecast_period: float
    follow: Literal["exact", "dynamics", "feedback"]
    bound_delta: float
    rng: np.random.Generator
    plant: Plant | None = None
    follow_bandwidth: float = BANDWIDTH
    autopilot: float | None = None
    lead: float | None = None
    sensors: Sensing | None = None
    input_rate: tuple[float, ...] | None = None

    # isinstance with a protocol takes as long as a step of a cheap tracker, so it is asked once

    @cached_property
    def position_tracker(self) -> PositionTracker | None:
        """The tracker, if it is given positions."""
        return self.tracker if isinstance(self.tracker, PositionTracker) else None

    @cached_property
    def gaussian_process(self) -> GaussianProcess | None:
        """The tracker, if it has hyperparameters and a bound."""
        return self.tracker if isinstance(self.tracker, GaussianProcess) else None

    def online(self) -> OnlineLoop:
        """The part that any world may drive, at its beginning."""
        return OnlineLoop(self.tracker, self.guidance, forecast=self.forecast, forecast_period=self.forecast_period)


@dataclass(frozen=True)
class Recording:
    """The history of a run, and counts of what happened that it does not hold.

    Attributes
    ----------
    history
        All steps.
    tightened
        How often limits were tightened because a piece to be executed broke them between nodes.
    nugget_retries
        How often the tracker had to raise its nugget.
    refused_bearings
        Bearings that the tracker refused: not finite, not of length 1, or out of order.
    held_forecasts
        Steps in which the tracker's forecast was not finite and the guidance was given the one before.
    clipped
        Steps in which a plan asked for more thrust than there is, which was clipped.
    new_tracks
        Times in seconds of the bearings with which the tracker began a new track after a long gap.
    """

    history: History
    tightened: int
    nugget_retries: int
    refused_bearings: int = 0
    held_forecasts: int = 0
    clipped: int = 0
    new_tracks: tuple[float, ...] = ()

    @property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays of the history by name."""
        return dict(vars(self.history))


Progress = Callable[[int, float, float], None]
"""Called after each step with its number, the mean error in metres, and the solver's time in seconds."""


def step_count(duration: float, period: float) -> int:
    """Steps of a run: the first at t = 0, the last at the last full period within the duration (both in seconds)."""
    # a tenth has no exact binary form: 0.3/0.1 is a little less than 3
    return int(duration / period + 1e-6) + 1


def simulate(
    loop: ClosedLoop,
    start: ArrayLike,
    duration: float,
    progress: Progress | None = None,
    history: type[History] = History,
) -> Recording:
    """Run the closed loop.

    A bearing that the tracker refuses counts as missed. A forecast that is not finite is recorded as it is, but the
    guidance is given the last finite one in its place, a period further on.

    Parameters
    ----------
    loop
        The parts.
    start
        Derivatives 0 … L-1 of the flat output at t = 0 ``(L, n)``.
    duration
        In seconds; see :func:`step_count`.
    progress
        Called after each step.
    history
        The class of the history; a subclass may declare further arrays.
    """
    period, vehicle = loop.sensor.period, loop.vehicle
    mover = Mover(
        vehicle, period, loop.follow, loop.plant, loop.follow_bandwidth, loop.autopilot, loop.lead, loop.input_rate
    )
    flat = np.asarray(start, dtype=float)
    state = vehicle.state(flat[0], flat[1])
    steps = step_count(duration, period)
    recorder = Recorder(history, steps)
    online = loop.online()
    ahead = loop.forecast_period * np.arange(loop.forecast + 1)
    current = loop.guidance.current if isinstance(loop.guidance, InWater) else None
    seen: deque[Array] = deque(maxlen=loop.window)
    tightened = refused = clipped = 0
    underway: deque[tuple[Sighting, Array]] = deque()
    for k in range(steps):
        t = k * period
        truth = loop.target.position(np.asarray(t + ahead, dtype=float))
        own = vehicle.pose(state)[: loop.target.dimension]
        sensed: list[Sighting] = []
        if loop.sensors is None:
            bearing = loop.sensor.measure(k, truth[0], own, loop.rng)
            position = _measured_position(loop, truth[0])
        else:
            # what is recorded is the last direction that was measured
            measured_now = map(bearing_of, loop.sensors.measure(k, t, truth[0], vehicle.pose(state)))
            bearing = next((one for one in reversed([*measured_now]) if one is not None), None)
            sensed = loop.sensors.arrived(t)
        water = mover.water(state)
        if bearing is not None and loop.sensors is None:
            underway.append((_sighting(t, bearing, own, position), bearing))
        for sighting in sensed:
            if not online.take(sighting):
                refused += 1
                continue
            direction = bearing_of(sighting)
            if direction is not None:
                seen.append(direction)
        while underway and underway[0][0].time <= t - loop.sensor.latency + 1e-9:
            sighting, arrived = underway.popleft()
            if online.take(sighting, arrived):
                seen.append(arrived)
            else:
                refused += 1
                bearing = None if sighting.time == t else bearing
        decided = online.decide(t, flat)
        decision = decided.decision
        if isinstance(decision, Plan):
            move = mover.follow(state, decision)
        elif isinstance(decision, Placement):
            move = mover.place(state, decision.position)
        elif isinstance(decision, ShootingPlan):
            move = mover.execute(state, decision)
        else:
            move = mover.hold(state, decision)
        clipped += move.clipped
        step = Step(
            time=t,
            times=decided.times,
            target=truth,
            vehicle=vehicle,
            state=state,
            bearing=bearing,
            desired_bearing=getattr(loop.guidance, "desired", loop.desired)(t),
            window=seen,
            forecast=decided.forecast,
            tracker_time=decided.tracker_time,
            process=loop.gaussian_process,
            bound_delta=loop.bound_delta,
            decision=decision,
            move=move,
            water=water,
            current=current,
        )
        recorder.add(step)
        if step.plan is not None:
            tightened += step.plan.tightened
        if progress is not None:
            progress(k, float(np.mean(step.error)), np.nan if step.plan is None else step.plan.solve_time)
        online.learn(flat[:2], move.flat[:2], move.thrust_mean, period)
        flat, state = move.flat, move.state
    retries = loop.gaussian_process.nugget_retries if loop.gaussian_process is not None else 0
    return Recording(recorder.history(), tightened, retries, refused, online.held, clipped, tuple(online.begun))


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
