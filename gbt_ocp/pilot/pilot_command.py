"""What a pilot answers when it is asked for a command."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gbt_ocp.guidance.strategy import Placement
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.pilot.online_loop import Decided
from gbt_ocp.pilot.pilot_health import PilotHealth, PilotState
from gbt_ocp.pilot.setpoint import Setpoint, setpoint_of
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array

SAME_PIECE = 1.0e-9
"""Rounding of a time, in pieces: one at a boundary belongs to the later piece."""


@dataclass(frozen=True)
class PilotCommand:
    """What the vehicle is to do from a time on, and what is known of the target.

    Attributes
    ----------
    time
        In seconds.
    thrust
        Inputs in the body frame to hold until the next command, within their limits ``(m,)``: forces in N, moment in
        N m. ``None`` where the guidance asks for a place and not for thrust.
    range_known
        Whether the deviation of the range is below a quarter of the range.
    state
        What :attr:`health` follows from.
    decided
        The last step of the online loop; ``None`` before the first navigation.
    vehicle
        The model.
    lead
        How far ahead on the plan the setpoint is taken, in seconds.
    """

    time: float
    thrust: Array | None
    range_known: bool
    state: PilotState
    decided: Decided | None
    vehicle: Vehicle
    lead: float

    @cached_property
    def health(self) -> PilotHealth:
        """How the pilot is at :attr:`time`."""
        return self.state.health()

    @property
    def plan(self) -> Plan | ShootingPlan | None:
        """The plan that is followed; ``None`` where the guidance made none."""
        return None if self.decided is None else self.decided.plan

    @property
    def forecast(self) -> Forecast | None:
        """Posterior of the target's position ``(n+1, d)`` and ``(n+1, d, d)`` at :attr:`times`."""
        return None if self.decided is None else self.decided.forecast

    @property
    def times(self) -> Array:
        """Times of the forecast in seconds ``(n+1,)``; the first is that of the last decision."""
        return np.zeros(0) if self.decided is None else self.decided.times

    @cached_property
    def setpoint(self) -> Setpoint | None:
        """Where the vehicle should be :attr:`lead` after :attr:`time`; ``None`` where only thrust is asked for."""
        if self.decided is None:
            return None
        decision, end = self.decided.decision, self.time + self.lead
        if isinstance(decision, Placement):
            pose = np.append(decision.position, 0.0)
            return Setpoint(end, pose, np.zeros_like(pose))
        if not isinstance(decision, Plan):
            return None
        since = decision.elapsed + (self.time - self.decided.time) + self.lead
        return setpoint_of(decision, self.vehicle, since, end)

    @cached_property
    def waypoints(self) -> tuple[Setpoint, ...]:
        """Where the vehicle should be at the ends of the pieces that lie ahead, and how it should move there.

        Each has its time; there is none where no flat plan is followed.
        """
        if self.decided is None or not isinstance(self.decided.decision, Plan):
            return ()
        plan, began = self.decided.decision, self.decided.time - self.decided.decision.elapsed
        period, pieces = plan.trajectory.period, plan.trajectory.pieces
        passed = math.floor((self.time - began) / period + SAME_PIECE)
        ends = [number * period for number in range(passed + 1, pieces + 1)]
        return tuple(setpoint_of(plan, self.vehicle, end, began + end) for end in ends)
