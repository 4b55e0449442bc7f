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
from gbt_ocp.ocp.solvers.base import GIVEN_UP, NO_PLAN, PlannerStep, Solution
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.ocp.transcription import limit_size
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
        self._coordinates = _Coordinates(kernel, problem.vehicle.position_dimension)
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
        origin, begin = self._coordinates.begin(start)
        ends = self._coordinates.placed("ends", origin, _stacked(objectives), self._problem.pieces)
        knots = self._coordinates.placed("knots", origin, _stacked(limits), self._problem.pieces + 1)
        parameters = np.concatenate([ends, knots])
        variables = np.array(guess, dtype=float, order="C")
        inside = np.zeros(self._limits + 1)
        inside[: self._limits] = tightening
        result = _Result()
        self._solve(
            ctypes.byref(self._settings),
            begin.ctypes.data,
            parameters.ctypes.data,
            inside.ctypes.data,
            not cold,
            variables.ctypes.data,
            self._workspace.ctypes.data,
            ctypes.byref(result),
        )
        return CompiledSolution(
            variables=variables,
            solved=STATUSES[result.status] in ("solved", GIVEN_UP),
            status=STATUSES[result.status],
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
            _fields_ = [("settings", _Settings), ("warm", whole), ("previous", number * (p * free))]

        kernel.gbt_planner_bytes.restype = ctypes.c_size_t
        self._memory = np.zeros(kernel.gbt_planner_bytes() // 8 + 1)
        self._state_of_planner = Memory.from_buffer(self._memory.data)
        self._state_of_planner.settings = self._settings
        self._result_of_step = PlanOfStep
        pointer = ctypes.c_void_p
        self._from_moments = from_moments(problem)
        self._plan = kernel.gbt_plan if self._from_moments else kernel.gbt_plan_parameters
        self._plan.argtypes = [pointer] * (6 if self._from_moments else 4)
        if isinstance(problem, ShootingData):
            kernel.gbt_plan_prepare.argtypes = [pointer]
            self._prepare = kernel.gbt_plan_prepare
            self._feedback = kernel.gbt_plan_feedback if self._from_moments else kernel.gbt_plan_feedback_parameters
            self._feedback.argtypes = self._plan.argtypes

    def plan(
        self,
        start: Array,
        objectives: Sequence[Array],
        limits: Sequence[Array],
        previous: Array | None,
        data: Mapping[str, Any],
    ) -> PlannerStep:
        """The step that the generated C takes; see :class:`gbt_ocp.ocp.solvers.base.PlansSteps`."""
        memory = self._state_of_planner
        memory.warm = previous is not None
        if previous is not None:
            memory.previous[:] = np.asarray(previous, dtype=float).ravel().tolist()
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
        result = self._result_of_step()
        if self._from_moments:
            arrays = list(moments_of_step(self._problem, data).values())
        else:
            arrays = [np.concatenate([_stacked(objectives), _stacked(limits)])]
        arrays = [np.ascontiguousarray(values, dtype=float) for values in (start, *arrays)]
        entry(self._memory.ctypes.data, *(values.ctypes.data for values in arrays), ctypes.byref(result))
        return PlannerStep(
            top=np.array(result.top).reshape(self._problem.pieces, self._problem.freedoms),
            status=STATUSES[result.status],
            fallback=ORIGINS[result.origin],
            iterations=result.iterations,
            tightened=result.tightened,
            piece_violation=np.array(result.piece_violation),
            given_up=np.array(result.given_up)[: self._limits],
            broken_at_start=np.array(result.broken_at_start)[: self._limits],
        )

    def check(self, trajectory: FlatTrajectory, limits: Sequence[Array] = ()) -> Array:
        """The same as :class:`gbt_ocp.ocp.check.LimitCheck`, from the compiled limits."""
        origin, start = self._coordinates.begin(trajectory.start)
        top = np.ascontiguousarray(trajectory.top, dtype=float)
        violation = np.empty(len(top))
        stacked = _stacked([values[:, : len(top) + 1] for values in limits])
        moving = self._coordinates.placed("knots", origin, stacked, len(top) + 1)
        self._check(
            start.ctypes.data, top.ctypes.data, len(top), FINE_POINTS, moving.ctypes.data, violation.ctypes.data
        )
        return violation


def moments_of_step(problem: PosedProblem, data: Mapping[str, Any]) -> dict[str, Array]:
    """``mean``, ``covariance`` and ``desired`` as the generated step takes them, from the data of a solve.

    Where limits depend on the target, the present moments come before those at the endpoints. What no objective asks
    for may be missing and is zero.
    """
    p, d = problem.pieces, problem.vehicle.position_dimension
    present = any(limit_size(constraint) for constraint in problem.constraints)
    found = {}
    for name, shape in (("mean", (d,)), ("covariance", (d, d))):
        ahead = np.zeros((p, *shape)) if data.get("forecast") is None else getattr(data["forecast"], name)
        found[name] = np.asarray(ahead, dtype=float)[:p]
        if present:
            found[name] = np.concatenate([np.asarray(getattr(data["present"], name), dtype=float)[None], found[name]])
    desired = data.get("desired")
    found["desired"] = np.zeros((p, d)) if desired is None else np.asarray(desired, dtype=float)[:p]
    # what is needed was found finite when the parameters were bound
    return {name: np.where(np.isfinite(values), values, 0.0) for name, values in found.items()}


def _stacked(parameters: Sequence[Array]) -> Array:
    """Parameters of all terms, one time after the other."""
    return np.ascontiguousarray(np.vstack(list(parameters)).T, dtype=float).ravel() if parameters else np.zeros(0)


class _Coordinates:
    """The kernel's coordinates: relative to where a trajectory begins."""

    def __init__(self, kernel: ctypes.CDLL, dimension: int) -> None:
        self._kernel, self._state = kernel, kernel.gbt_state_size()
        self._base = np.zeros(dimension)
        self._sizes = {name: getattr(kernel, f"gbt_{name}_size")() for name in ("ends", "knots")}

    def begin(self, start: Array) -> tuple[Array, Array]:
        """The origin ``(d,)``, and a start relative to it."""
        state = np.zeros(max(self._state, np.size(start)))  # nothing acts where a start does not say what does
        state[: np.size(start)] = np.ravel(start)
        origin, begin = np.empty_like(self._base), np.empty_like(state)
        self._kernel.gbt_begin(*(ctypes.c_void_p(values.ctypes.data) for values in (self._base, state, origin, begin)))
        return origin, begin

    def placed(self, name: str, origin: Array, parameters: Array, count: int) -> Array:
        """The numbers of so many ``ends`` or ``knots`` from their parameters."""
        numbers = np.empty(self._sizes[name] * count)
        arrays = [ctypes.c_void_p(values.ctypes.data) for values in (origin, parameters, numbers)]
        getattr(self._kernel, f"gbt_place_{name}")(*arrays[:2], count, arrays[2])
        return numbers
