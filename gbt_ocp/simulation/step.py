"""One step of the closed loop, as the history reads it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gbt_ocp.guidance.current import Current
from gbt_ocp.guidance.strategy import Placement
from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.simulation.mover import Move
from gbt_ocp.tracking.protocol import Forecast, GaussianProcess
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class Step:
    """What is known after step k of the loop, when the vehicle has not moved yet.

    Attributes
    ----------
    time
        t_k in seconds.
    times
        T_k = {t_k, …, t_{k+n}} in seconds ``(n+1,)``.
    target
        True positions at T_k ``(n+1, d)`` in metres.
    vehicle, state
        The vehicle and its state at t_k.
    bearing
        Measured at t_k ``(d,)``; ``None`` if it was missed or refused.
    desired_bearing
        At t_k ``(d,)``.
    window
        The latest bearings that the tracker has taken, at most N_c.
    forecast
        Posterior at T_k.
    tracker_time
        Time that update and prediction took, in seconds.
    process
        The tracker, if it has hyperparameters and a bound.
    bound_delta
        δ of that bound.
    decision
        What the guidance answered.
    move
        What the vehicle does until t_{k+1}.
    water
        True velocity of the water at the vehicle over ground ``(d,)``; ``None`` where it stands still.
    current
        What the guidance knows of it; ``None`` where it plans for still water.
    heard
        Packets of other vehicles since the last step, and bearings of theirs that the tracker was given.
    """

    time: float
    times: Array
    target: Array
    vehicle: Vehicle | DrivenBody
    state: Array
    bearing: Array | None
    desired_bearing: Array
    window: Sequence[Array]
    forecast: Forecast
    tracker_time: float
    process: GaussianProcess | None
    bound_delta: float
    decision: Plan | ShootingPlan | Placement | Array
    move: Move
    water: Array | None = None
    current: Current | None = None
    heard: tuple[int, int] = (0, 0)

    @cached_property
    def plan(self) -> Plan | ShootingPlan | None:
        """The plan, if the guidance made one."""
        return self.decision if isinstance(self.decision, Plan | ShootingPlan) else None

    @cached_property
    def error(self) -> Array:
        """Tracking error at T_k ``(n+1,)`` in metres."""
        off = self.forecast.mean - self.target
        return np.asarray(np.sqrt(np.add.reduce(off * off, axis=1)))
