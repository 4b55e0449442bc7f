"""IPOPT through CasADi: the reference solver of both formulations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gbt_ocp.ocp.penalty import continuation
from gbt_ocp.ocp.problem import TrajectoryProblem
from gbt_ocp.ocp.solvers import Solution
from gbt_ocp.ocp.transcription import Binding, transcribe

Array = NDArray[np.float64]

DEFAULT_OPTIONS: dict[str, Any] = {
    "print_level": 0,
    "sb": "yes",
    "tol": 1e-6,
    "acceptable_tol": 1e-4,
    "max_iter": 300,
}


class IpoptSolver:
    """The nonlinear program solved by IPOPT with exact derivatives.

    A penalty is solved directly from a warm start. Cold, or where that fails, it is reached through the stages of
    :func:`gbt_ocp.ocp.penalty.continuation`, each from the solution of the one before.

    Parameters
    ----------
    problem
        What to solve.
    options
        IPOPT options that replace or join :data:`DEFAULT_OPTIONS`.
    """

    name = "ipopt"

    def __init__(self, problem: TrajectoryProblem, options: Mapping[str, Any]) -> None:
        self._problem = problem
        self._program = transcribe(problem)
        self._binding = Binding(problem)
        settings = {"expand": True, "print_time": False, "error_on_fail": False}
        self._solver = ca.nlpsol("planner", "ipopt", self._program.nlp, settings | {"ipopt": DEFAULT_OPTIONS | dict(options)})

    def _solve_once(
        self, start: Array, objectives: list[Array], guess: Array, stage: list[tuple[float, float]], tightening: float
    ) -> Solution:
        program = self._program
        inside = tightening * program.scale
        if np.any(program.lower + inside > program.upper - inside):
            return Solution(guess, False, "limits tightened away", 0)
        found = self._solver(
            x0=guess.ravel(),
            p=self._binding.vector(start, objectives, stage, tightening),
            lbg=program.lower + inside,
            ubg=program.upper - inside,
        )
        stats = self._solver.stats()
        variables = np.asarray(found["x"]).reshape(guess.shape)
        solved = bool(stats["success"]) and bool(np.all(np.isfinite(variables)))
        status = "solved" if solved else str(stats["return_status"])
        return Solution(variables, solved, status, int(stats["iter_count"]))

    def solve(
        self, start: Array, objectives: Sequence[Array], guess: Array, *, cold: bool, tightening: float = 0.0
    ) -> Solution:
        """Solve from a guess; see :meth:`gbt_ocp.ocp.solvers.Solver.solve`."""
        penalties = self._problem.penalties
        final = [(soft.width, soft.weight) for soft in penalties]
        iterations = 0
        if not penalties or not cold:
            solution = self._solve_once(start, list(objectives), guess, final, tightening)
            if solution.solved or not penalties:
                return solution
            iterations = solution.iterations
        stages = [continuation(width, weight) for width, weight in final]
        for stage in zip(*stages, strict=True):
            solution = self._solve_once(start, list(objectives), guess, list(stage), tightening)
            iterations += solution.iterations
            # A stage that stopped early is still a better start for the next one than the guess before it.
            if np.all(np.isfinite(solution.variables)):
                guess = solution.variables
        return Solution(solution.variables, solution.solved, solution.status, iterations)
