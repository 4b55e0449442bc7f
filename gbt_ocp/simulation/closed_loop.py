"""What takes part in a run, and what it leaves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.guidance.strategy import Guidance
from gbt_ocp.guidance.swept import DesiredTurn
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.models.targets import Target
from gbt_ocp.ocp.follower import BANDWIDTH
from gbt_ocp.pilot.online_loop import OnlineLoop
from gbt_ocp.pilot.teamwork import Exchange
from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.plant import Plant
from gbt_ocp.simulation.sensing import Sensing
from gbt_ocp.tracking.protocol import GaussianProcess, PositionTracker, Tracker


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
    exchange
        What the vehicle says to others and hears of them; ``None`` for one that does not talk.
    thrust_lag
        Time constant in seconds of the thrusters, as of :class:`~gbt_ocp.pilot.plan_follower.PlanFollower`.
    """

    target: Target
    sensor: BearingSensor
    tracker: Tracker | PositionTracker
    guidance: Guidance
    vehicle: Any
    desired: DesiredTurn
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
    exchange: Exchange | None = None
    thrust_lag: float | None = None

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
