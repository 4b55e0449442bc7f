"""Soft limits with an exact l1 slack: a limit may be broken at a node for a fixed price.

``min -J + ρ Σ s`` over u and ``s >= 0`` subject to ``lower - s <= limit <= upper + s`` at the nodes, with s in units of
the limit. While ρ exceeds every multiplier of the hard problem its solutions are the same; where the limits cannot all
be kept, the plan that breaks them least (in the sum over the nodes) is found instead of none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.codegen.options import CompiledOptions
from gbt_ocp.ocp.problem import TrajectoryProblem
from gbt_ocp.ocp.solvers.base import Solution
from gbt_ocp.ocp.solvers.compiled import CompiledSolver
from gbt_ocp.ocp.solvers.ipopt import ipopt_function, solution_of
from gbt_ocp.ocp.transcription import transcribe
from gbt_ocp.typing import Array

LIMIT_WEIGHT = CompiledOptions.limit_weight
"""ρ: that of the compiled solver, which imposes hard limits in this way."""


class SoftIpoptSolver:
    """The hard limits of a problem with slacks, solved by IPOPT.

    Parameters
    ----------
    problem
        With hard limits only.
    weight
        ρ, price of a slack of one unit of the limit at one node.

    Raises
    ------
    ValueError
        If the problem has a penalty, or no hard limit.
    """

    name = "ipopt"

    def __init__(self, problem: TrajectoryProblem, weight: float = LIMIT_WEIGHT) -> None:
        only_hard(problem)
        self._program = program = transcribe(problem)
        self._binding = Binding(problem)
        slack = ca.MX.sym("s", program.limits.numel())
        scaled = ca.DM(program.scale) * slack
        self._solver = ipopt_function(
            {
                "x": ca.vertcat(program.variables, slack),
                "p": program.parameters,
                "f": -program.objective + weight * ca.sum1(slack),
                "g": ca.vertcat(program.limits - scaled, program.limits + scaled),
            },
            {},
        )
        inputs = [program.variables, program.parameters]
        self._limits = ca.Function("limits", inputs, [program.limits])
        free = np.full(program.variables.numel(), -np.inf)
        self._least = np.concatenate([free, np.zeros(len(program.scale))])

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
        program = self._program
        parameters = self._binding.vector(start, objectives, [], tightening, limits)
        inside = program.inward(tightening)
        upper, lower = program.upper - inside, program.lower + inside
        values = np.asarray(self._limits(guess.ravel(), parameters)).ravel()
        slack = np.maximum(np.maximum(values - upper, lower - values) / program.scale, 0.0)
        none = np.full(len(upper), np.inf)
        found = self._solver(
            x0=np.concatenate([guess.ravel(), slack]),
            p=parameters,
            lbx=self._least,
            lbg=np.concatenate([-none, lower]),
            ubg=np.concatenate([upper, none]),
        )
        return solution_of(self._solver, found, guess.shape)


class SoftCompiledSolver:
    """The compiled solver, whose least violation counts as a solution where the limits cannot all be kept.

    Its hard limits are soft ones of weight ``limit_weight`` already; only a plan that needs its slacks is not passed
    on as solved, which it is here.

    Raises
    ------
    ValueError
        If the problem has a penalty, or no hard limit.
    """

    name = "compiled"

    def __init__(self, problem: TrajectoryProblem, weight: float = LIMIT_WEIGHT) -> None:
        only_hard(problem)
        self._solver = CompiledSolver(problem, {"limit_weight": weight})

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
        return replace(found, solved=True, status="solved") if found.status == "limit violated" else found


def only_hard(problem: TrajectoryProblem) -> None:
    """Refuse a problem that has a penalty, or no hard limit."""
    found: Any = "a penalty" if problem.penalties else "no hard limit" if not problem.hard else None
    if found:
        raise ValueError(f"problem: found {found}; allowed: hard limits only (subject_to)")
