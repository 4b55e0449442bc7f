"""One judge for every planner: the objective at the ends of the periods and the largest thrust on a fine grid.

A plan is taken at its word about what it commands, never about where that leads: held inputs are integrated afresh by
fifty Runge-Kutta steps a period, a flat trajectory is evaluated exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from gbt_ocp.models.vehicles import acceleration
from gbt_ocp.ocp import TrajectoryProblem
from gbt_ocp.ocp.check import FINE_POINTS
from gbt_ocp.ocp.objective_total import point_symbols
from gbt_ocp.ocp.shooting import ShootingPlanner
from gbt_ocp.ocp.trajectory import FlatTrajectory


class Judge:
    """Objective, to be maximised, and largest ``|τ| / τ_max`` of a plan for one problem."""

    def __init__(self, problem: TrajectoryProblem) -> None:
        self.shooting = ShootingPlanner(problem)
        vehicle, self._pieces, self._period = problem.vehicle, problem.pieces, problem.period
        point = point_symbols(vehicle.flat_dimension)
        share = vehicle.inputs(*point) / ca.DM(vehicle.thrust_max)
        self._linear = self._integrator(vehicle, problem.period)
        self._share = ca.Function("share", [*point], [share]).map(self._pieces * FINE_POINTS)

    @staticmethod
    def _integrator(vehicle: Any, period: float, count: int = 50) -> ca.Function:
        """(z and ż, inputs over their limits at both ends) -> z and ż a period later."""
        n, h = vehicle.flat_dimension, period / count
        x, first, last = (ca.SX.sym(name, size) for name, size in (("x", 2 * n), ("a", n), ("b", n)))
        limit = ca.DM(vehicle.thrust_max)

        def rates(x: Any, share: float) -> Any:
            inputs = (first + share * (last - first)) * limit
            return ca.vertcat(x[n:], acceleration(vehicle, x[:n], x[n:], inputs))

        end = x
        for k in range(count):
            k1 = rates(end, k / count)
            k2 = rates(end + h / 2 * k1, (k + 0.5) / count)
            k3 = rates(end + h / 2 * k2, (k + 0.5) / count)
            k4 = rates(end + h * k3, (k + 1) / count)
            end = end + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return ca.Function("period", [x, first, last], [end])

    def held(self, start: Any, held: Any, parameters: Sequence[Any]) -> tuple[float, float]:
        """Of inputs over their limits ``(p, n)`` held over the periods, from z and ż ``(2, n)``."""
        knots, peaks = self.shooting.rollout(start, held)
        return self.shooting.objective(knots, held, parameters), float(peaks.max())

    def thrust(self, start: Any, held: Any, parameters: Sequence[Any]) -> tuple[float, float]:
        """Of inputs over their limits, held ``(p, n)`` or from one value to another ``(p, 2 n)``, likewise."""
        inputs = np.asarray(held)
        n = start.shape[1]
        ends = np.stack([inputs[:, :n], inputs[:, -n:]], axis=1)
        knots = [np.asarray(start, dtype=float)]
        for first, last in ends:
            knots.append(np.asarray(self._linear(knots[-1].ravel(), first, last)).reshape(2, n))
        objective = self.shooting.objective(np.array(knots), np.zeros((len(inputs), n)), parameters)
        return objective, float(np.abs(ends).max())

    def flat(self, start: Any, top: Any, parameters: Sequence[Any]) -> tuple[float, float]:
        """Of a flat trajectory through z and ż with these free derivatives ``(p, freedoms)``, likewise."""
        trajectory = FlatTrajectory(self._period, start, top)
        columns = [values.reshape(-1, values.shape[-1]).T for values in trajectory.sample(FINE_POINTS)]
        peak = float(np.abs(np.asarray(self._share(*columns))).max())
        # what is held only enters through accelerations, which these objectives do not read
        held = np.zeros((self._pieces, start.shape[1]))
        return self.shooting.objective(trajectory.knots, held, parameters), peak
