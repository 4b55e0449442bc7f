"""The planner as an observer strategy: trajectory optimisation over the forecast (algorithm 2)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.bearings import DesiredBearing
from gbt_ocp.guidance.pacing import PacedBearing
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.ocp.planner import Planner
from gbt_ocp.ocp.shooting import ShootingPlanner
from gbt_ocp.tracking.protocol import Forecast

Array = NDArray[np.float64]


class PlannedMotion:
    """Solves the trajectory problem whenever a piece is through, for the forecast and the desired bearings at its ends.

    With pieces of one sampling period that is at every step, as in the paper; with longer ones the plan is followed on
    in between.

    Parameters
    ----------
    planner
        The compiled problem, or multiple shooting of it.
    desired
        λ*(t).
    steps
        Sampling periods that a piece lasts.
    stride
        Predicted positions that a piece lasts; by default as many as ``steps``.
    begin_at_sight
        Whether each plan turns its desired bearing on from the present line of sight, instead of from where the turn
        would be by the clock: a vehicle that falls behind need not catch up.
    """

    def __init__(
        self,
        planner: Planner | ShootingPlanner,
        desired: DesiredBearing | PacedBearing,
        steps: int = 1,
        *,
        stride: int | None = None,
        begin_at_sight: bool = False,
    ) -> None:
        self.planner = planner
        self.desired = desired
        self._steps = steps
        self._stride = stride or steps
        self._begin_at_sight = begin_at_sight
        self._plan: Plan | None = None
        self._followed = 0

    def restart(self) -> None:
        """Begin as at the first plan: what was planned is no longer where the vehicle is."""
        self._plan = None
        self.planner.reset()

    def decide(self, time: float, flat: Array, forecast: Forecast) -> Plan | ShootingPlan:
        """The plan from ``time`` on."""
        problem = self.planner.problem
        self._followed += 1
        if self._plan is not None and self._followed < self._steps:
            return replace(
                self._plan,
                elapsed=self._followed * problem.period / self._steps,
                status="",
                fallback="",
                iterations=0,
                solve_time=0.0,
                tightened=0,
            )
        line = forecast.mean[0] - flat[0, : forecast.mean.shape[1]]
        if isinstance(self.desired, PacedBearing):
            self.desired.pace(time, float(np.linalg.norm(line)))
        elif self._begin_at_sight:
            self.desired = self.desired.beginning_at(time, line)
        ends = time + problem.period * np.arange(1, problem.pieces + 1)
        # an estimator without a covariance is taken at its word
        covariance = np.nan_to_num(forecast.covariance, nan=0.0)
        ahead = Forecast(forecast.mean[self._stride :: self._stride], covariance[self._stride :: self._stride])
        present = Forecast(forecast.mean[0], covariance[0])
        plan = self.planner.solve(flat, ahead, self.desired(ends), present=present)
        self._plan, self._followed = plan if isinstance(plan, Plan) else None, 0
        return plan
