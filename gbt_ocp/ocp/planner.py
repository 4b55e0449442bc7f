"""The planner: a compiled problem with its memory, its checks and its answers to a failed solve."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.braking import BrakingPlanner
from gbt_ocp.ocp.check import LimitCheck
from gbt_ocp.ocp.plan import Plan
from gbt_ocp.ocp.problem_data import ProblemData
from gbt_ocp.ocp.solvers.base import ChecksLimits, Solution, Solver
from gbt_ocp.ocp.solvers.choice import make_solver
from gbt_ocp.ocp.terms import Constraint, is_believed
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.ocp.transcription import constraint_function, first_free_node, input_scale, objective_total
from gbt_ocp.typing import Array

TIGHTENINGS = 4
"""How often the limits may be tightened in one step before the solution counts as failed."""


class _Attempt(NamedTuple):
    """One solve with its tightenings; ``trajectory`` is ``None`` if it must not be executed."""

    status: str
    trajectory: FlatTrajectory | None
    violation: Array
    iterations: int
    tightened: int


def _of_thrust(problem: ProblemData, constraint: Constraint) -> bool:
    """Whether the plan's own unknown moves the constraint from the first moment on, and no belief enters it."""
    return first_free_node(problem, constraint) == 0 and not is_believed(constraint)


class Planner:
    """Solves a :class:`~gbt_ocp.ocp.problem.TrajectoryProblem` again and again, each time from the last solution.

    After every solve the true limits are checked on a fine grid. If the piece that will be executed breaks them
    between the nodes, the limits are tightened by what was found and the problem is solved again. A failed solve is
    answered, in this order, by the rest of the previous plan if its next piece keeps the limits, by a solve with the
    hard limits on what is only believed as penalties (:attr:`~gbt_ocp.ocp.problem_data.ProblemData.relaxed`; at once
    where such a limit is broken at the start already), by a cold solve, and by a braking plan. A failed solution is
    never executed and never a warm start.

    Parameters
    ----------
    problem
        What to solve; everything that changes from step to step is a parameter of the solver, which is built once.
    solver
        ``ipopt``, ``compiled``, ``auto`` for the best one that is there, or a solver of one's own.
    options
        For the solver; those in a mapping under the name of a solver are for that solver only.
    relaxed
        Solver of :attr:`~gbt_ocp.ocp.problem_data.ProblemData.relaxed` beside a solver of one's own.

    Raises
    ------
    ValueError
        If the problem has no objective or the solver is unknown.
    """

    def __init__(
        self,
        problem: ProblemData,
        solver: str | Solver = "auto",
        options: Mapping[str, Any] | None = None,
        *,
        relaxed: Solver | None = None,
    ) -> None:
        if not problem.objectives:
            raise ValueError("the problem has no objective; call maximize() first")
        nearest = problem.relaxed
        if isinstance(solver, str):
            name, chosen = solver, options or {}
            solver = make_solver(problem, name, chosen)
            relaxed = None if nearest is None else make_solver(nearest, name, chosen)
        self.problem = problem
        self.solver = solver
        self._relaxed = None if relaxed is None or nearest is None else Planner(nearest, relaxed)
        # what the start decides: constraints of place and speed, but not of thrust
        self._given = [
            (number, constraint, constraint_function(problem, constraint))
            for number, constraint in enumerate(problem.constraints)
            if problem.judged[number] and first_free_node(problem, constraint) == 1
        ]
        self._thrust_check = LimitCheck(problem.limited_to(lambda constraint: _of_thrust(problem, constraint)))
        self._scale = input_scale(problem)
        self._binding = Binding(problem)
        self._check = solver.check if isinstance(solver, ChecksLimits) else LimitCheck(problem)
        # what is only believed of the target is no reason to break what the vehicle surely has to keep
        certain = None if self._relaxed is None else LimitCheck(problem.certain)
        self._braking = BrakingPlanner(problem, self._check, certain)
        self._objectives = [objective_total(problem, term) for term in problem.objectives]
        self._previous: FlatTrajectory | None = None

    def reset(self) -> None:
        """Forget the previous plan: the next solve is cold."""
        self._previous = None

    @property
    def previous(self) -> FlatTrajectory | None:
        """The plan of the last step, from which the next solve starts; may be set to repeat a recorded step."""
        return self._previous

    @previous.setter
    def previous(self, trajectory: FlatTrajectory | None) -> None:
        self._previous = trajectory

    def objective(self, trajectory: FlatTrajectory, parameters: list[Array]) -> float:
        """The objective of any trajectory, without penalty."""
        ends = trajectory.sample(2)
        columns = [values[:, -1].T for values in ends]
        return float(sum(float(f(*columns, p)) for f, p in zip(self._objectives, parameters, strict=True)))

    def solve(self, state: ArrayLike, forecast: Any = None, desired: ArrayLike | None = None, **data: Any) -> Plan:
        """Plan from a state.

        Parameters
        ----------
        state
            Derivatives of the flat output now, as many as are continuous ``(k+1, n)``; with L = 2 that is z and ż.
        forecast
            Mean and covariance of the target's position at the endpoints, for objectives that need it.
        desired
            Desired bearings at the endpoints ``(>=p, d)``, for objectives that need them.
        data
            Whatever else the objectives and constraints ask for, by name.

        Raises
        ------
        ValueError
            If the state or the data do not fit or are not finite.
        """
        began = perf_counter()
        start = np.asarray(state, dtype=float)
        expected = (self.problem.joined, self.problem.vehicle.flat_dimension)
        if start.shape != expected or not np.all(np.isfinite(start)):
            raise ValueError(f"state: found shape {start.shape}; allowed: {expected}, all numbers finite")
        given = {"forecast": forecast, "desired": desired, **data}
        parameters = self._binding.objective_parameters(given)
        limits = self._binding.limit_parameters(given)

        shifted = None if self._previous is None else self._previous.shifted()
        guess = self.cold_guess(start) if shifted is None else shifted.top / self._scale
        if self._relaxed is not None and self._broken_at_start(start, limits, believed=True) > 0.0:
            # no plan undoes at once what is already so
            first = _Attempt("limit broken at the start", None, np.zeros(0), 0, 0)
            shifted_first = False
        else:
            first = self._attempt(start, parameters, limits, guess, cold=shifted is None)
            shifted_first = True
        trajectory, pieces = first.trajectory, first.violation
        iterations, tightened = first.iterations, first.tightened
        fallback = ""
        if trajectory is None and shifted is not None and shifted_first:
            # From where the vehicle really is, which is where the previous plan led unless it was pushed.
            candidate = FlatTrajectory(self.problem.period, start, shifted.top)
            broken = self._check(candidate, limits)
            if self._excess(candidate, float(broken[0]), self._broken_at_start(start, limits, believed=False)) <= 0.0:
                fallback, trajectory, pieces = "shifted", candidate, broken
        if trajectory is None and self._relaxed is not None:
            fallback = "relaxed"
            believed = [limits[number] for number in self.problem.relaxed_order]
            nearest = self._relaxed._attempt(start, parameters, believed, guess, cold=shifted is None)
            trajectory = nearest.trajectory
            if trajectory is not None:
                pieces = self._check(trajectory, limits)
            iterations, tightened = iterations + nearest.iterations, tightened + nearest.tightened
        if trajectory is None and shifted is not None:
            fallback = "cold"
            again = self._attempt(start, parameters, limits, self.cold_guess(start), cold=True)
            trajectory, pieces = again.trajectory, again.violation
            iterations, tightened = iterations + again.iterations, tightened + again.tightened
        if trajectory is None:
            fallback, trajectory = "braking", self._braking(start, limits)
            pieces = self._check(trajectory, limits)
        self._previous = trajectory
        return Plan(
            trajectory=trajectory,
            status=first.status,
            objective=self.objective(trajectory, parameters),
            violation=max(float(pieces.max()), 0.0),
            piece_violation=np.maximum(pieces, 0.0),
            iterations=iterations,
            solve_time=perf_counter() - began,
            fallback=fallback,
            tightened=tightened,
        )

    def _excess(self, trajectory: FlatTrajectory, broken: float, allowed: float) -> float:
        """How far the first piece breaks its limits beyond what the start has broken already, thrust never included."""
        if broken <= 0.0 or broken > allowed:
            return broken
        first = FlatTrajectory(trajectory.period, trajectory.start, trajectory.top[:1])
        return float(self._thrust_check(first)[0])

    def _broken_at_start(self, start: Array, limits: list[Array], *, believed: bool) -> float:
        """How far limits are broken where the plan begins, those on what is only believed or the others; at least 0."""
        worst, still = 0.0, np.zeros(start.shape[1])
        for number, constraint, function in self._given:
            if is_believed(constraint) == believed:
                moving = [limits[number][:, 0]] if limits and len(limits[number]) else []
                value = np.asarray(function(start[0], start[1], still, *moving)).ravel()
                over = np.maximum(value - constraint.upper, constraint.lower - value) / constraint.scale
                worst = max(worst, float(over.max()))
        return worst

    def cold_guess(self, start: Array) -> Array:
        """Coasting: constant velocity, any higher derivative brought to zero within the first piece."""
        guess, n = np.zeros((self.problem.pieces, self.problem.freedoms)), start.shape[1]
        if self.problem.joined > 2:
            guess[0, :n] = -start[-1] / self.problem.period / self._scale[:n]
        return guess

    def _attempt(
        self, start: Array, parameters: list[Array], limits: list[Array], guess: Array, *, cold: bool
    ) -> _Attempt:
        """Solve, check the piece to be executed, tighten where needed."""
        nothing = np.zeros(0)
        tightening, iterations = 0.0, 0
        # a speed that is too high already comes down within the piece; that is no reason to refuse it
        allowed = self._broken_at_start(start, limits, believed=False)
        for tightened in range(TIGHTENINGS + 1):
            solution = self._answer(start, parameters, limits, guess, cold=cold, tightening=tightening)
            iterations += solution.iterations
            if not solution.solved:
                return _Attempt(solution.status, None, nothing, iterations, tightened)
            if not np.all(np.isfinite(solution.variables)):
                return _Attempt("not finite", None, nothing, iterations, tightened)
            trajectory = FlatTrajectory(self.problem.period, start, solution.variables * self._scale)
            pieces = self._check(trajectory, limits)
            broken = self._excess(trajectory, float(pieces[0]), allowed)
            if broken <= 0.0:
                return _Attempt(solution.status, trajectory, pieces, iterations, tightened)
            # a little more than was found, so that one round nearly always does it
            tightening += 1.2 * broken + 1e-4
            guess, cold = solution.variables, False
        return _Attempt("limits broken between nodes", None, nothing, iterations, TIGHTENINGS)

    def _answer(
        self, start: Array, parameters: list[Array], limits: list[Array], guess: Array, *, cold: bool, tightening: float
    ) -> Solution:
        """What the solver says; a solver that raises or returns nothing has failed like any other."""
        try:
            found: Solution | None = self.solver.solve(
                start, parameters, guess, cold=cold, tightening=tightening, **({"limits": limits} if limits else {})
            )
        except Exception as fault:  # the vehicle needs a plan, whatever a solver of somebody's own does
            warnings.warn(f"solver {self.solver.name!r} raised {fault!r}", RuntimeWarning, stacklevel=5)
            return Solution(guess, False, f"raised {type(fault).__name__}", 0)
        if found is None:
            return Solution(guess, False, "no answer", 0)
        if found.solved and np.shape(found.variables) != guess.shape:
            return Solution(guess, False, "answer of a wrong shape", found.iterations)
        return found
