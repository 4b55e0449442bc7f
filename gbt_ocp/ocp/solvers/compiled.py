"""The compiled solver: generated derivatives and the C kernel, called from Python without copying."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.ocp.check import FINE_POINTS
from gbt_ocp.ocp.codegen.library import kernel_files, load_library
from gbt_ocp.ocp.codegen.options import CompiledOptions
from gbt_ocp.ocp.codegen.problem_source import from_moments, generate_problem
from gbt_ocp.ocp.problem_data import PosedProblem, ShootingData
from gbt_ocp.ocp.shot import ShotTrajectory
from gbt_ocp.ocp.solvers.base import GIVEN_UP, NO_PLAN, PlannerStep, Solution
from gbt_ocp.ocp.solvers.kernel_arrays import KernelCoordinates, MomentsOfStep, SolveArrays, stacked_parameters
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.typing import Array

STATUSES = (
    "solved",
    "limit violated",
    "iteration limit",
    "input not finite",
    "numerical failure",
    "limits broken between nodes",
    GIVEN_UP,
)
"""What the exit codes of the kernel are called."""

ORIGINS = ("", "shifted", "cold", "braking", NO_PLAN, "unfinished")
"""What the origins of a plan are called."""

PROFILE = 5
"""Points of the thrust profile of every piece in a result."""

FOUND = ("top", "piece_violation", "given_up", "broken_at_start")
"""Arrays of a result that are read."""


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

    def __init__(self, problem: PosedProblem, options: Mapping[str, Any]) -> None:
        self._made_from = (problem, dict(options))
        shooting = isinstance(problem, ShootingData)
        self._settings = _Settings(**asdict(CompiledOptions.checked(options, problem.pieces, shooting=shooting)))
        kernel = load_library(kernel_files(shooting=shooting) | generate_problem(problem).files)
        kernel.gbt_workspace_bytes.restype = ctypes.c_size_t
        self._workspace = np.zeros(kernel.gbt_workspace_bytes() // 8 + 1)
        numbers = ctypes.c_void_p
        arrays_before, arrays_after = [numbers] * 3, [numbers] * 3
        kernel.gbt_solve.argtypes = [*arrays_before, numbers, ctypes.c_int, *arrays_after]
        self._solve = kernel.gbt_solve
        kernel.gbt_check.argtypes = [numbers, numbers, ctypes.c_int, ctypes.c_int, numbers, numbers]
        self._check = kernel.gbt_check
        self._coordinates = KernelCoordinates(kernel, problem.vehicle.position_dimension)
        self._call, self._result = SolveArrays(kernel, problem), _Result()
        at = {name: values.ctypes.data for name, values in self._call.arrays.items()}
        self._given = (ctypes.addressof(self._settings), at["begin"], at["numbers"], at["inside"])
        self._taken = (at["variables"], self._workspace.ctypes.data, ctypes.addressof(self._result))
        self._problem = problem
        self._limits = len(problem.constraints)
        self._prepare_steps(kernel)

    def __reduce__(self) -> tuple[Any, ...]:
        # A loaded library does not pickle; it is found again in the cache, or compiled, where the solver arrives.
        return type(self), self._made_from

    @property
    def options(self) -> dict[str, Any]:
        """The options that were given."""
        return dict(self._made_from[1])

    def solve(
        self,
        start: Array,
        objectives: Sequence[Array],
        guess: Array,
        *,
        cold: bool,
        tightening: ArrayLike = 0.0,
        limits: Sequence[Array] = (),
    ) -> CompiledSolution:
        """Solve from a guess; see :meth:`gbt_ocp.ocp.solvers.base.Solver.solve`."""
        call, result = self._call, self._result
        call.fill(start, objectives, limits)
        call.arrays["inside"][: self._limits] = tightening
        call.arrays["variables"][:] = guess
        self._solve(*self._given, not cold, *self._taken)
        status = STATUSES[result.status]
        return CompiledSolution(
            variables=call.arrays["variables"].copy(),
            solved=status in ("solved", GIVEN_UP),
            status=status,
            iterations=result.iterations,
            starts=result.starts,
            residual=result.residual,
            violation=result.violation,
            objective=result.objective,
        )

    def _prepare_steps(self, kernel: ctypes.CDLL) -> None:
        """The planner around the solver: its memory, its result and its two entries."""
        problem, n = self._problem, self._problem.vehicle.flat_dimension
        p, free, inputs = problem.pieces, problem.freedoms, len(problem.vehicle.thrust_max)
        number, whole = ctypes.c_double, ctypes.c_int

        class PlanOfStep(ctypes.Structure):
            _fields_ = [
                *((name, whole) for name in ("status", "origin", "iterations", "tightened")),
                *((name, number) for name in ("objective", "violation")),
                ("piece_violation", number * p),
                *((name, number * (self._limits + 1)) for name in ("given_up", "broken_at_start")),
                ("top", number * (p * free)),
                *((name, number * (p * n)) for name in ("endpoints", "rates")),
                ("thrust", number * (p * PROFILE * inputs)),
            ]

        class Memory(ctypes.Structure):
            _fields_ = [
                *(("settings", _Settings), ("warm", whole), ("previous", number * (p * free))),
                *(("begin", number * kernel.gbt_state_size()), ("place", number * problem.vehicle.position_dimension)),
            ]

        kernel.gbt_planner_bytes.restype = ctypes.c_size_t
        self._memory = np.zeros(kernel.gbt_planner_bytes() // 8 + 1)
        memory = self._state_of_planner = Memory.from_buffer(self._memory.data)
        memory.settings = self._settings
        # what these show is that of the structs: to read an array out of one takes longer than many a plan
        self._remembered = [np.frombuffer(one) for one in (memory.previous, memory.place, memory.begin)]
        plan = self._result_of_step = PlanOfStep()
        self._found = {name: np.frombuffer(getattr(plan, name)) for name in FOUND}
        pointer = ctypes.c_void_p
        self._moments = MomentsOfStep(problem) if from_moments(problem) else None
        self._plan = kernel.gbt_plan_parameters if self._moments is None else kernel.gbt_plan
        self._plan.argtypes = [pointer] * (4 if self._moments is None else 6)
        state = self._start = np.zeros(kernel.gbt_state_size())
        self._addresses = [one.ctypes.data for one in (self._memory, state)]
        self._addresses_of_moments = [] if self._moments is None else self._moments.addresses
        self._address_of_plan = ctypes.addressof(plan)
        if isinstance(problem, ShootingData):
            kernel.gbt_plan_prepare.argtypes = [pointer]
            self._prepare = kernel.gbt_plan_prepare
            self._feedback = kernel.gbt_plan_feedback if self._moments else kernel.gbt_plan_feedback_parameters
            self._feedback.argtypes = self._plan.argtypes

    def plan(
        self,
        start: Array,
        objectives: Sequence[Array],
        limits: Sequence[Array],
        previous: FlatTrajectory | ShotTrajectory | None,
        data: Mapping[str, Any],
    ) -> PlannerStep:
        """The step that the generated C takes; see :class:`gbt_ocp.ocp.solvers.base.PlansSteps`."""
        memory = self._state_of_planner
        memory.warm = previous is not None
        if previous is not None:
            top, place, begin = self._remembered
            top[:] = previous.top.ravel()
            place[:], begin[:] = self._coordinates.begin(previous.start)
        return self._step(self._plan, start, objectives, limits, data)

    def prepare(self) -> bool:
        """The first part of a step of a trajectory by integration, from the last one; whether that could be done."""
        return bool(self._prepare(self._memory.ctypes.data) == 0)

    def feedback(
        self, start: Array, objectives: Sequence[Array], limits: Sequence[Array], data: Mapping[str, Any]
    ) -> PlannerStep:
        """The second part, for the start as it is; a plain step where nothing is prepared."""
        return self._step(self._feedback, start, objectives, limits, data)

    def _step(
        self,
        entry: Any,
        start: Array,
        objectives: Sequence[Array],
        limits: Sequence[Array],
        data: Mapping[str, Any],
    ) -> PlannerStep:
        """A call of one of the planner's entries."""
        result, found = self._result_of_step, self._found
        given = self._addresses_of_moments
        if self._moments is None:
            parameters = np.concatenate([stacked_parameters(objectives), stacked_parameters(limits)])
            given = [parameters.ctypes.data]
        elif self._moments.read is not data:
            self._moments.take(data)
        self._start[:] = 0.0
        self._start[: start.size] = start.ravel()
        entry(*self._addresses, *given, self._address_of_plan)
        if self._moments is not None:
            self._moments.read = None
        return PlannerStep(
            top=found["top"].reshape(self._problem.pieces, self._problem.freedoms).copy(),
            status=STATUSES[result.status],
            fallback=ORIGINS[result.origin],
            iterations=result.iterations,
            tightened=result.tightened,
            piece_violation=found["piece_violation"].copy(),
            given_up=found["given_up"][: self._limits].copy(),
            broken_at_start=found["broken_at_start"][: self._limits].copy(),
            objective=result.objective,
        )

    def reads(self, data: Mapping[str, Any]) -> bool:
        """See :class:`gbt_ocp.ocp.solvers.base.ReadsMoments`."""
        return self._moments is not None and self._moments.take(data)

    def check(self, trajectory: FlatTrajectory, limits: Sequence[Array] = ()) -> Array:
        """The same as :class:`gbt_ocp.ocp.check.LimitCheck`, from the compiled limits."""
        origin, start = self._coordinates.begin(trajectory.start)
        top = np.ascontiguousarray(trajectory.top, dtype=float)
        violation = np.empty(len(top))
        stacked = stacked_parameters([values[:, : len(top) + 1] for values in limits])
        moving = self._coordinates.placed("knots", origin, stacked, len(top) + 1)
        self._check(
            start.ctypes.data, top.ctypes.data, len(top), FINE_POINTS, moving.ctypes.data, violation.ctypes.data
        )
        return violation
