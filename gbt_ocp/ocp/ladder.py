"""A step of the planner around a solver that does not bring its own: the generated C's (``gbt_plan.c``) in Python."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gbt_ocp.ocp.limit_classes import LimitClass, limit_class
from gbt_ocp.ocp.plan_forms import plan_form
from gbt_ocp.ocp.problem_data import PosedProblem
from gbt_ocp.ocp.shot import ShotTrajectory
from gbt_ocp.ocp.solvers.base import GIVEN_UP, OUT_OF_ITERATIONS, PlannerStep, Solution, Solver
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.typing import Array

TIGHTENINGS = 4
"""How often limits may be tightened in one attempt."""

GAINED = 0.25
"""Share that a round of tightening gains of what it was asked for, at least: more is not made up for."""

UNIT = 1.0
"""Of a limit, by which a plan that gains more than braking may break it more."""

FEASIBILITY = 1.0e-6
"""Limits besides thrust count as kept up to this, in their units."""


class _Given(NamedTuple):
    """What a step is about, and what is broken at its start."""

    start: Array
    objectives: Sequence[Array]
    limits: Sequence[Array]
    broken: Array


class _Attempt(NamedTuple):
    """One solve with its tightenings.

    ``trajectory`` is ``None`` if it must not be executed, ``unfinished`` the last iterate if iterations were spent.
    """

    status: str
    trajectory: Any
    unfinished: Any
    iterations: int
    tightened: int


class Ladder:
    """Attempts of a solver, and the answers where they fail, in the order of the generated C.

    The first attempt starts from the rest of the previous plan. It is answered by what the solver had when its
    iterations were spent, or by that rest, if the first piece keeps the limits or mends what is broken already; by a
    cold solve; by what the solver had and then by that rest, if their first pieces keep the thrust limits or can be
    brought within them; and by a braking plan. What no solver finished must serve better than braking. Any other
    failed solution is never executed and never a warm start. The iterations are bounded by those the solver allows
    itself in each solve.

    Parameters
    ----------
    problem
        What the solver solves.
    solver
        Any.
    """

    def __init__(self, problem: PosedProblem, solver: Solver) -> None:
        self._solver = solver
        self._form = plan_form(problem)
        self._scale, self._check = self._form.scale, self._form.check
        self._thrust = np.array([limit_class(problem, c) == LimitClass.THRUST for c in problem.constraints], dtype=bool)
        self._judged = np.array(problem.judged, dtype=bool)
        self._hard = np.arange(len(self._judged)) < len(problem.hard)

    def plan(
        self,
        start: Array,
        objectives: Sequence[Array],
        limits: Sequence[Array],
        previous: FlatTrajectory | ShotTrajectory | None,
        data: Mapping[str, Any],
    ) -> PlannerStep:
        """See :class:`gbt_ocp.ocp.solvers.base.PlansSteps`."""
        given = _Given(start, objectives, limits, self._check.at_start(start, limits))
        rest = None if previous is None else self._form.rest(previous, start)
        coasting = self._form.coasting(start)
        first = self._attempt(given, coasting if rest is None else rest / self._scale, cold=rest is None)
        fallback, trajectory = "", first.trajectory
        iterations, tightened, unfinished = first.iterations, first.tightened, first.unfinished
        if trajectory is None and unfinished is not None and self._serves(given, unfinished):
            # nearer to a solution than what it started from, and so is the next step that starts from it
            fallback, trajectory = "unfinished", unfinished
        if trajectory is None and rest is not None:
            candidate = self._form.trajectory(start, rest)
            if self._serves(given, candidate):
                fallback, trajectory = "shifted", candidate
        if trajectory is None and rest is not None:
            again = self._attempt(given, coasting, cold=True)
            fallback, trajectory = "cold", again.trajectory
            iterations, tightened = iterations + again.iterations, tightened + again.tightened
            unfinished = unfinished or again.unfinished
        if trajectory is None and unfinished is not None:
            serves = self._serves(given, unfinished, thrust_only=True)
            fallback, trajectory = "unfinished", unfinished if serves else self._mended(given, unfinished)
        if trajectory is None and rest is not None:
            fallback, trajectory = "shifted", self._mended(given, self._form.trajectory(start, rest))
        if trajectory is None:
            fallback, trajectory = "braking", self._form.trajectory(start, self._form.braking(start))
        return self._judge(given, trajectory, first.status, fallback, iterations, tightened)

    def _judge(
        self, given: _Given, trajectory: Any, status: str, fallback: str, iterations: int, tightened: int
    ) -> PlannerStep:
        """What the limits say of the plan, and which of them had to give."""
        fine = self._check.survey(trajectory, given.limits)
        nodes = self._check.survey(trajectory, given.limits, nodes=True)
        gave = (self._excess(given, fine[:, 0]) > 0.0) | (self._hard & (nodes.max(axis=1) > FEASIBILITY))
        given_up = np.where(gave & ~self._thrust, np.maximum(fine.max(axis=1), 0.0), 0.0)
        if status == "solved" and np.any(given_up > 0.0):
            status = GIVEN_UP
        return PlannerStep(
            top=trajectory.top,
            status=status,
            fallback=fallback,
            iterations=iterations,
            tightened=tightened,
            piece_violation=np.max(fine[self._judged], axis=0, initial=0.0),
            given_up=given_up,
            broken_at_start=given.broken,
        )

    def _serves(self, given: _Given, trajectory: Any, *, thrust_only: bool = False) -> bool:
        """Whether the first piece keeps the limits but for what cannot be helped, and the whole is better than braking.

        The limits are those on thrust, or all.
        """
        excess = self._excess(given, self._check.survey(trajectory, given.limits)[:, 0])
        if np.any(excess[self._thrust] > 0.0 if thrust_only else excess > 0.0):
            return False
        return self._beats_braking(given, trajectory)

    def _beats_braking(self, given: _Given, trajectory: Any) -> bool:
        """Not where it is not finite, breaks limits by a whole unit more, or by no less while it gains less."""
        gain, broken = self._worth(given, trajectory)
        if not np.isfinite([gain, broken]).all():
            return False
        braking = self._form.trajectory(given.start, self._form.braking(given.start))
        gain_of_braking, broken_by_braking = self._worth(given, braking)
        if not np.isfinite(gain_of_braking):
            return True
        return broken <= broken_by_braking + UNIT and not (broken >= broken_by_braking and gain < gain_of_braking)

    def _worth(self, given: _Given, trajectory: Any) -> tuple[float, float]:
        """What a plan gains, without penalty, and by how much it breaks the judged limits."""
        if not np.all(np.isfinite(trajectory.knots)):
            return -np.inf, np.inf
        broken = self._check.survey(trajectory, given.limits)[self._judged]
        return float(self._form.objective(trajectory, given.objectives)), float(np.max(broken, initial=0.0))

    def _mended(self, given: _Given, trajectory: Any, *, thrust_only: bool = True) -> Any:
        """With a first piece that is brought within the thrust; ``None`` if that cannot be, or does not serve then."""
        top = self._form.mended(given.start, trajectory.top)
        if top is None:
            return None
        mended = self._form.trajectory(given.start, top)
        return mended if self._serves(given, mended, thrust_only=thrust_only) else None

    def _excess(self, given: _Given, fine: Array) -> Array:
        """How far judged limits are broken in the first piece beyond what cannot be helped ``(count,)``, at least 0.

        That is beyond the start where it has broken them already; besides thrust they count as kept up to
        :data:`FEASIBILITY`.
        """
        allowed = np.maximum(np.where(self._thrust, 0.0, FEASIBILITY), given.broken)
        return np.where(self._judged & (fine > allowed), fine - allowed, 0.0)

    def _attempt(self, given: _Given, guess: Array, *, cold: bool) -> _Attempt:
        """Solve, and while the piece to be executed breaks limits between the nodes, tighten each by what it breaks.

        Thrust must be kept in the end. Where a round has gained little of it, the solution that breaks it least is
        mended, or else this one, if that keeps all limits: to ask for more would move what has nothing to do with it.
        Where neither leads to it, nor to an iterate that keeps all limits, the one that breaks it least is mended.
        Another limit is tightened as long as that helps, and not where it has been given up already.
        """
        count = len(self._judged)
        tightening, before = np.zeros(count), np.full(count, np.inf)
        best: Any = None
        least = np.inf  # by which the thrust of the best one is broken between the nodes
        iterations = tightened = 0
        while True:
            solution = self._answer(given, guess, cold, tightening)
            iterations += solution.iterations
            status = solution.status
            if solution.solved and not np.all(np.isfinite(solution.variables)):
                status = "not finite"
            if not solution.solved or status == "not finite":
                break
            trajectory = self._form.trajectory(given.start, solution.variables * self._scale)
            first = self._form.trajectory(given.start, trajectory.top[:1])
            excess = self._excess(given, self._check.survey(first, given.limits)[:, 0])
            nodes = self._check.survey(first, given.limits, nodes=True)[:, 0]
            again = (excess > 0.0) & (self._thrust | (~(self._hard & (nodes > FEASIBILITY)) & (excess <= 0.5 * before)))
            over = float(np.max(excess[self._thrust], initial=0.0))
            if over > 0.0:
                status = "limits broken between nodes"
            if over < least or over <= 0.0:
                best, least = trajectory, over
            if np.any(self._thrust & (excess > (1.0 - GAINED) * before)):
                for found in (best, trajectory):
                    mended = self._mended(given, found, thrust_only=False)
                    if mended is not None:
                        return _Attempt("solved", mended, None, iterations, tightened)
            if not np.any(again) or tightened == TIGHTENINGS:
                break
            # a little more than was found, over the share that the round before gained of what it was asked for
            more = 1.2 * excess / np.maximum(1.0 - excess / before, GAINED) + 1e-4
            tightening = tightening + np.where(again, more, 0.0)
            before = np.where(again, excess, before)
            guess, cold, tightened = solution.variables, False, tightened + 1
        unfinished = None
        variables = solution.variables
        if status in OUT_OF_ITERATIONS and np.shape(variables) == guess.shape and np.all(np.isfinite(variables)):
            unfinished = self._form.trajectory(given.start, variables * self._scale)
        if least > 0.0 and (best is None or (unfinished is not None and self._serves(given, unfinished))):
            return _Attempt(status, None, unfinished, iterations, tightened)
        usable = best if least <= 0.0 else self._mended(given, best)
        return _Attempt("solved" if usable is not None else status, usable, unfinished, iterations, tightened)

    def _answer(self, given: _Given, guess: Array, cold: bool, tightening: Array) -> Solution:
        """What the solver says; a solver that raises or returns nothing has failed like any other."""
        try:
            found: Solution | None = self._solver.solve(
                given.start, given.objectives, guess, cold=cold, tightening=tightening, limits=given.limits
            )
        except Exception as fault:  # the vehicle needs a plan, whatever a solver of somebody's own does
            warnings.warn(f"solver {self._solver.name!r} raised {fault!r}", RuntimeWarning, stacklevel=6)
            return Solution(guess, False, f"raised {type(fault).__name__}", 0)
        if found is None:
            return Solution(guess, False, "no answer", 0)
        if found.solved and np.shape(found.variables) != guess.shape:
            return Solution(guess, False, "answer of a wrong shape", found.iterations)
        return found
