"""The compiled solver: generated derivatives and the C kernel, called from Python without copying."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from gbt_ocp.ocp.check import FINE_POINTS
from gbt_ocp.ocp.codegen.library import kernel_files, load_library
from gbt_ocp.ocp.codegen.options import CompiledOptions
from gbt_ocp.ocp.codegen.problem_source import generate_problem
from gbt_ocp.ocp.problem_data import ProblemData
from gbt_ocp.ocp.solvers.base import Solution
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.typing import Array

STATUSES = ("solved", "limit violated", "iteration limit", "input not finite", "numerical failure")
"""What the exit codes of the kernel are called."""


class _Settings(ctypes.Structure):
    """The settings of the kernel, in the order of its struct, which is that of :class:`CompiledOptions`."""

    _fields_ = [
        (option.name, ctypes.c_int if option.type == "int" else ctypes.c_double) for option in fields(CompiledOptions)
    ]


class _Result(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_int) for name in ("status", "iterations", "starts")),
        *((name, ctypes.c_double) for name in ("residual", "violation", "objective")),
    ]


@dataclass(frozen=True)
class CompiledSolution(Solution):
    """A solution with what the kernel reports beside it.

    Attributes
    ----------
    starts
        1, unless the solver had to begin again.
    residual
        Infinity norm of the gradient of the Lagrangian, per scaled unknown.
    violation
        Worst violation at the nodes of the limits as the solver sees them, back-off and tightening included, in units
        of the limits; negative inside.
    objective
        Without penalty.
    """

    starts: int
    residual: float
    violation: float
    objective: float


class CompiledSolver:
    """Interior-point solver in C99, generated for one problem.

    The library is compiled once and kept in the user's cache.

    Parameters
    ----------
    problem
        What to solve.
    options
        See :class:`CompiledOptions`.

    Raises
    ------
    ValueError
        If an option is wrong, or the problem cannot be written as C.
    gbt_ocp.ocp.codegen.library.CompilerError
        If there is no working C compiler.
    """

    name = "compiled"

    def __init__(self, problem: ProblemData, options: Mapping[str, Any]) -> None:
        self._made_from = (problem, dict(options))
        self._settings = _Settings(**asdict(CompiledOptions.checked(options, problem.pieces)))
        kernel = load_library(kernel_files() | generate_problem(problem).files)
        kernel.gbt_workspace_bytes.restype = ctypes.c_size_t
        self._workspace = np.zeros(kernel.gbt_workspace_bytes() // 8 + 1)
        numbers = ctypes.c_void_p
        arrays_before, arrays_after = [numbers] * 3, [numbers] * 3
        kernel.gbt_solve.argtypes = [*arrays_before, ctypes.c_double, ctypes.c_int, *arrays_after]
        self._solve = kernel.gbt_solve
        kernel.gbt_check.argtypes = [numbers, numbers, ctypes.c_int, ctypes.c_int, numbers, numbers]
        self._check = kernel.gbt_check

    def __reduce__(self) -> tuple[Any, ...]:
        # A loaded library does not pickle; it is found again in the cache, or compiled, where the solver arrives.
        return type(self), self._made_from

    @property
    def options(self) -> dict[str, Any]:
        """The options that were given."""
        return dict(self._made_from[1])

    @property
    def workspace_bytes(self) -> int:
        """Size of the kernel's workspace."""
        return self._workspace.nbytes

    def solve(
        self,
        start: Array,
        objectives: Sequence[Array],
        guess: Array,
        *,
        cold: bool,
        tightening: float = 0.0,
        limits: Sequence[Array] = (),
    ) -> CompiledSolution:
        """Solve from a guess; see :meth:`gbt_ocp.ocp.solvers.base.Solver.solve`."""
        begin = np.ascontiguousarray(start, dtype=float)
        parameters = np.concatenate([np.vstack(list(objectives)).T.ravel(), _moving(limits)])
        variables = np.array(guess, dtype=float, order="C")
        result = _Result()
        self._solve(
            ctypes.byref(self._settings),
            begin.ctypes.data,
            parameters.ctypes.data,
            tightening,
            not cold,
            variables.ctypes.data,
            self._workspace.ctypes.data,
            ctypes.byref(result),
        )
        return CompiledSolution(
            variables=variables,
            solved=result.status == 0,
            status=STATUSES[result.status],
            iterations=result.iterations,
            starts=result.starts,
            residual=result.residual,
            violation=result.violation,
            objective=result.objective,
        )

    def check(self, trajectory: FlatTrajectory, limits: Sequence[Array] = ()) -> Array:
        """The same as :class:`gbt_ocp.ocp.check.LimitCheck`, from the compiled limits."""
        start = np.ascontiguousarray(trajectory.start, dtype=float)
        top = np.ascontiguousarray(trajectory.top, dtype=float)
        violation = np.empty(len(top))
        moving = _moving([values[:, : len(top) + 1] for values in limits])
        self._check(
            start.ctypes.data, top.ctypes.data, len(top), FINE_POINTS, moving.ctypes.data, violation.ctypes.data
        )
        return violation


def _moving(limits: Sequence[Array]) -> Array:
    """Parameters of all constraints, knot by knot."""
    return np.ascontiguousarray(np.vstack(limits).T, dtype=float).ravel() if limits else np.zeros(0)
