"""First-order optimality of a solution, judged by CasADi's derivatives of the problem as transcribed for IPOPT."""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy import sparse
from scipy.optimize import linprog
from solver_instances import Instance

from gbt_ocp.ocp import TrajectoryProblem
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.transcription import transcribe

BRACKETS = (1e-4, 1e-3)
"""Residuals up to which the bounds of the multipliers are interpolated; the first that suffices is taken."""
HARD_WEIGHT = 1e3
"""Bound of the multipliers of a hard limit."""


def largest_multipliers(excess: np.ndarray, soft: np.ndarray, weight: np.ndarray, slack: float) -> np.ndarray:
    """Largest λ in [0, weight] with ``λ (soft λ - excess) <= slack``: complementary but for the slack."""
    smooth = soft > 0.0
    divisor = np.where(smooth, 2.0 * soft, 1.0)
    curved = (excess + np.sqrt(excess**2 + 4.0 * soft * slack)) / divisor
    sharp = np.where(excess < 0.0, slack / np.maximum(-excess, 1e-300), np.inf)
    return np.minimum(np.where(smooth, curved, sharp), weight)


class Optimality:
    """KKT residual of the solutions of one problem with one limit.

    The solver's own multipliers are not believed: a linear program finds those with the least residual.
    """

    def __init__(self, problem: TrajectoryProblem) -> None:
        self._problem, self._binding = problem, Binding(problem)
        program = transcribe(problem)
        slope = ca.gradient(-program.objective, program.variables)
        self._slope = ca.Function("slope", [program.variables, program.parameters], [slope])
        (limit,) = (*problem.hard, *problem.penalties)
        bare = TrajectoryProblem(problem.vehicle, problem.pieces, problem.period).maximize(problem.objectives[0])
        self._limits = transcribe(bare.subject_to(limit.constraint, nodes=limit.nodes))
        both = [self._limits.limits, ca.jacobian(self._limits.limits, self._limits.variables)]
        self._values = ca.Function("limits", [self._limits.variables, self._limits.parameters], both)
        self._bare = Binding(bare)
        self._width = getattr(limit, "width", 0.0)
        self._weights = np.full(self._limits.limits.numel(), HARD_WEIGHT)
        if self._width:
            trapezoid = np.ones(limit.nodes + 1)
            trapezoid[[0, -1]] = 0.5
            nodes = np.tile(np.repeat(trapezoid, len(limit.constraint.upper)), problem.pieces)
            self._weights = limit.weight * problem.period / limit.nodes * nodes

    def residual(self, item: Instance, variables: np.ndarray) -> float:
        """Least r such that some multipliers leave no gradient of the Lagrangian (per scaled unknown) and no
        complementarity product larger than r, hard limits broken by no more than r; an upper bound of it, and
        infinite where it exceeds the last bracket.
        """
        unknowns = variables.ravel()
        soft = [(penalty.width, 0.0) for penalty in self._problem.penalties]
        slope = self._slope(unknowns, self._binding.vector(item.start, item.parameters, soft, item.tightening))
        values, jacobian = self._values(unknowns, self._bare.vector(item.start, item.parameters[:1], [], 0.0))
        values, rows, free = np.asarray(values).ravel(), np.asarray(jacobian), np.asarray(slope).ravel()
        inside = item.tightening * self._limits.scale
        excess = np.concatenate([values - self._limits.upper, self._limits.lower - values]) + np.tile(inside, 2)
        columns = np.vstack([rows, -rows]).T
        violation = 0.0 if self._width else float(np.max(excess))
        for bracket in BRACKETS:
            found = self._least(columns, free, excess, bracket)
            if found <= bracket:
                return max(found, violation)
        return np.inf

    def _least(self, columns: np.ndarray, free: np.ndarray, excess: np.ndarray, bracket: float) -> float:
        """The residual with the bounds of the multipliers interpolated between no slack and the bracket.

        The upper bound is a concave function of the slack and the lower one convex, so the interpolation is safe.
        """
        weights = np.tile(self._weights, 2)
        stiff = 2.0 * self._width / weights
        high, low = (
            [largest_multipliers(sign * excess + self._width, stiff, weights, slack) for slack in (0.0, bracket)]
            for sign in (1.0, -1.0)
        )
        least = [np.maximum(weights - value, 0.0) if self._width else np.zeros_like(value) for value in low]
        count, one = len(excess), sparse.identity(len(excess), format="csr")
        ones = np.ones((len(free), 1))
        system = sparse.vstack(
            [
                np.hstack([columns, -ones]),
                np.hstack([-columns, -ones]),
                sparse.hstack([one, -((high[1] - high[0]) / bracket)[:, None]]),
                sparse.hstack([-one, ((least[1] - least[0]) / bracket)[:, None]]),
            ],
            format="csr",
        )
        found = linprog(
            np.append(np.zeros(count), 1.0),
            A_ub=system,
            b_ub=np.concatenate([-free, free, high[0], -least[0]]),
            bounds=(0.0, None),
            method="highs",
        )
        return float(found.fun) if found.status == 0 else np.inf
