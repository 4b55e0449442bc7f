"""Hard limits in the strict sense: a solve in which one of them had to give is a solve that failed.

The solvers impose hard limits by exact l1 weights and say which of them gave. That is the treatment ``soft``; without
it the vehicle is left to what the planner does where a solve fails.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.ocp.check import LimitCheck
from gbt_ocp.ocp.ladder import FEASIBILITY
from gbt_ocp.ocp.limit_classes import LimitClass, limit_class
from gbt_ocp.ocp.problem import TrajectoryProblem
from gbt_ocp.ocp.solvers.base import Solution, Solver
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.ocp.transcription import input_scale
from gbt_ocp.typing import Array

NOT_KEPT = "limits cannot be kept"
"""Status of a solve in which a limit had to give."""


def may_give(problem: TrajectoryProblem) -> bool:
    """Whether some hard limit is not on thrust, which never gives."""
    return any(limit_class(problem, limit.constraint) != LimitClass.THRUST for limit in problem.hard)


class UnyieldingSolver:
    """A solver without the solutions that break a hard limit at its nodes.

    Parameters
    ----------
    problem
        That the solver solves.
    solver
        That imposes hard limits by exact l1 weights.
    """

    def __init__(self, problem: TrajectoryProblem, solver: Solver) -> None:
        self._solver, self._check = solver, LimitCheck(problem)
        self._period, self._scale, self._hard = problem.period, input_scale(problem), len(problem.hard)

    @property
    def name(self) -> str:
        """That of the solver."""
        return self._solver.name

    def solve(
        self,
        start: Array,
        objectives: Sequence[Array],
        guess: Array,
        *,
        cold: bool,
        tightening: ArrayLike = 0.0,
        limits: Sequence[Array] = (),
    ) -> Solution:
        """Solve from a guess; see :meth:`gbt_ocp.ocp.solvers.base.Solver.solve`."""
        found = self._solver.solve(start, objectives, guess, cold=cold, tightening=tightening, limits=limits)
        if not found.solved:
            return found
        trajectory = FlatTrajectory(self._period, start, found.variables * self._scale)
        nodes = self._check.survey(trajectory, limits, nodes=True)[: self._hard]
        return replace(found, solved=False, status=NOT_KEPT) if np.any(nodes > FEASIBILITY) else found
