"""The planner as an observer strategy: trajectory optimisation over the forecast (algorithm 2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.bearings import DesiredBearing
from gbt_ocp.ocp.plan import Plan
from gbt_ocp.ocp.planner import Planner
from gbt_ocp.tracking.protocol import Forecast

Array = NDArray[np.float64]


class PlannedMotion:
    """Solves the trajectory problem at every step, for the forecast and the desired bearings of its endpoints.

    Parameters
    ----------
    planner
        The compiled problem.
    desired
        λ*(t).
    """

    def __init__(self, planner: Planner, desired: DesiredBearing) -> None:
        self.planner = planner
        self._desired = desired

    def decide(self, time: float, flat: Array, forecast: Forecast) -> Plan:
        """The plan from ``time`` on."""
        problem = self.planner.problem
        ends = time + problem.period * np.arange(1, problem.pieces + 1)
        ahead = Forecast(forecast.mean[1:], forecast.covariance[1:])
        return self.planner.solve(flat, ahead, self._desired(ends))
