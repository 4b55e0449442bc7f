"""The planner: a compiled problem with its memory."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.ladder import Ladder
from gbt_ocp.ocp.limit_classes import limit_names
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.ocp.plan_forms import cold_guess, plan_form
from gbt_ocp.ocp.problem_data import PosedProblem, ProblemData, ShootingData
from gbt_ocp.ocp.shot import ShotTrajectory
from gbt_ocp.ocp.solvers.base import NO_PLAN, PlannerStep, PlansSteps, ReadsMoments, Solver
from gbt_ocp.ocp.solvers.choice import make_solver
from gbt_ocp.ocp.solvers.compiled import CompiledSolver
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.typing import Array


class AnyPlanner:
    """Solves a problem of either form again and again, each time from the last solution.

    The true limits of every solution are checked on a fine grid. If the piece that will be executed breaks some between
    the nodes, these limits are tightened by what was found and the problem is solved again. Where the limits cannot all
    be kept, thrust is, and the others give by as little as that allows, those on what is only believed of the target
    first: :attr:`~gbt_ocp.ocp.plan.Plan.given_up` names them. A failed solve is answered, in this order, by what the
    solver had when its iterations were spent, or by the rest of the previous plan, if the next piece keeps the limits;
    by a cold solve; by what the solver had and then by that rest, if their first pieces keep the thrust limits or can
    be brought within them; and by a braking plan, which also answers where what no solver finished is no better.

    With the compiled solver all of that is done by the C code that :func:`gbt_ocp.ocp.export.folder.write_c` writes,
    with any other by :class:`gbt_ocp.ocp.ladder.Ladder`, which gives the same answers in the same order.

    Parameters
    ----------
    problem
        What to solve; everything that changes from step to step is a parameter of the solver, which is built once.
    solver
        ``ipopt``, ``compiled``, ``auto`` for the best one that is there, or a solver of one's own.
    options
        For the solver; those in a mapping under the name of a solver are for that solver only.

    Raises
    ------
    ValueError
        If the problem has no objective or the solver is unknown.
    """

    def __init__(
        self, problem: PosedProblem, solver: str | Solver = "auto", options: Mapping[str, Any] | None = None
    ) -> None:
        if not problem.objectives:
            raise ValueError("the problem has no objective; call maximize() first")
        if isinstance(solver, str):
            solver = make_solver(problem, solver, options or {})
        self.problem = problem
        self.solver = solver
        self._steps = solver if isinstance(solver, PlansSteps) else Ladder(problem, solver)
        self._names = limit_names(problem)
        self._reads = self._steps.reads if isinstance(self._steps, ReadsMoments) else None
        self._binding = Binding(problem)
        self._form = plan_form(problem)
        self._previous: FlatTrajectory | ShotTrajectory | None = None
        self._last_step: FlatTrajectory | ShotTrajectory | None = None
        self._acting: Array | None = None

    def reset(self) -> None:
        """Forget the previous plan: the next solve is cold."""
        self._acting = self._inputs_now()
        self._previous = None

    def act(self, inputs: ArrayLike) -> None:
        """Say which inputs act where the next plan begins ``(m,)``.

        Limits on their rates, and what their changes cost, go on from them; by default from those at the end of the
        first piece of the last plan, without one from none. A flat trajectory goes on from an acceleration z̈ ``(n,)``.
        """
        self._acting = np.array(inputs, dtype=float)

    def _inputs_now(self) -> Array | None:
        if self._acting is not None or self._previous is None:
            return self._acting
        found: Array = self._form.acting(self._previous.top[0])
        return found

    def _expected(self) -> Array | None:
        """Where the last plan has led a vehicle that is not flat, if its first piece was followed."""
        return self._previous.states[1] if isinstance(self._previous, ShotTrajectory) else None

    @property
    def previous(self) -> Any:
        """The trajectory of the last step, from which the next solve starts; may be set to repeat a recorded step."""
        return self._previous

    @previous.setter
    def previous(self, trajectory: Any) -> None:
        self._previous = trajectory

    def start(self, state: ArrayLike) -> Array:
        """What a solver takes as the start, of a state as in :meth:`solve`; ``ValueError`` if it does not fit."""
        return np.asarray(self._form.start(state, self._inputs_now(), self._expected()))

    def objective(self, trajectory: FlatTrajectory | ShotTrajectory, parameters: list[Array]) -> float:
        """The objective of any trajectory, without penalty."""
        return float(self._form.objective(trajectory, parameters))

    def solve(
        self, state: ArrayLike, forecast: Any = None, desired: ArrayLike | None = None, **data: Any
    ) -> Plan | ShootingPlan:
        """Plan from a state.

        Parameters
        ----------
        state
            Derivatives of the flat output now, as many as are continuous ``(k+1, n)``; with L = 2 that is z and ż. Of a
            trajectory by integration z and ż, or the state of the vehicle.
        forecast
            Mean and covariance of the target's position at the endpoints, for objectives that need it.
        desired
            Desired bearings at the endpoints ``(>=p, d)``, for objectives that need them.
        data
            Whatever else the objectives and constraints ask for, by name.

        Returns
        -------
        A :class:`~gbt_ocp.ocp.plan.Plan`, or of a trajectory by integration a
        :class:`~gbt_ocp.ocp.plan.ShootingPlan`.

        Raises
        ------
        ValueError
            If the state or the data do not fit, are not finite, or are so large that no plan is.
        """
        return self._planned(perf_counter(), self._steps_from_previous, state, forecast, desired, data)

    def _steps_from_previous(
        self, start: Array, parameters: list[Array], limits: list[Array], given: Mapping[str, Any]
    ) -> PlannerStep:
        return self._steps.plan(start, parameters, limits, self._previous, given)

    def _planned(
        self,
        began: float,
        take: Callable[..., PlannerStep],
        state: ArrayLike,
        forecast: Any,
        desired: ArrayLike | None,
        data: Mapping[str, Any],
    ) -> Plan | ShootingPlan:
        """The plan of a step that is taken in this way."""
        start = self.start(state)
        given = {"forecast": forecast, "desired": desired, **data}
        parameters: list[Array] = []
        limits: list[Array] = []
        if self._reads is None or not self._reads(given):
            parameters = self._binding.objective_parameters(given)
            limits = self._binding.limit_parameters(given)
        step = take(start, parameters, limits, given)
        if step.fallback == NO_PLAN:
            raise ValueError("state or data: found numbers so large that no plan is finite; allowed: smaller ones")
        trajectory = self._form.trajectory(start, step.top)
        self._previous, self._last_step, self._acting = trajectory, trajectory, None
        objective = self.objective(trajectory, parameters) if step.objective is None else step.objective
        rest = {"objective": objective, "solve_time": perf_counter() - began}
        plan: Plan | ShootingPlan = self._form.plan(trajectory, step, self._named, **rest)
        return plan

    def _named(self, amounts: Array) -> dict[str, float]:
        """Those that are not zero, by the names of the limits."""
        return {name: float(amount) for name, amount in zip(self._names, amounts, strict=True) if amount > 0.0}


class Planner(AnyPlanner):
    """The planner of a :class:`~gbt_ocp.ocp.problem.TrajectoryProblem`; see :class:`AnyPlanner`."""

    problem: ProblemData

    def __init__(
        self, problem: ProblemData, solver: str | Solver = "auto", options: Mapping[str, Any] | None = None
    ) -> None:
        super().__init__(problem, solver, options)

    @property
    def previous(self) -> FlatTrajectory | None:
        """The plan of the last step, from which the next solve starts; may be set to repeat a recorded step."""
        assert not isinstance(self._previous, ShotTrajectory), "the plans are flat"
        return self._previous

    @previous.setter
    def previous(self, trajectory: FlatTrajectory | None) -> None:
        self._previous = trajectory

    def cold_guess(self, start: Array) -> Array:
        """Where a cold solve begins: :func:`gbt_ocp.ocp.ladder.cold_guess`."""
        return cold_guess(self.problem, start)

    def solve(self, state: ArrayLike, forecast: Any = None, desired: ArrayLike | None = None, **data: Any) -> Plan:
        """Plan from a state; see :meth:`AnyPlanner.solve`."""
        plan = super().solve(state, forecast, desired, **data)
        assert isinstance(plan, Plan), "the form of the problem"
        return plan


class ShotPlanner(AnyPlanner):
    """The planner of a :class:`~gbt_ocp.ocp.shooting_problem.ShootingProblem`; see :class:`AnyPlanner`."""

    problem: ShootingData

    def __init__(
        self, problem: ShootingData, solver: str | Solver = "auto", options: Mapping[str, Any] | None = None
    ) -> None:
        super().__init__(problem, solver, options)

    def solve(
        self, state: ArrayLike, forecast: Any = None, desired: ArrayLike | None = None, **data: Any
    ) -> ShootingPlan:
        """Plan from a state; see :meth:`AnyPlanner.solve`."""
        plan = super().solve(state, forecast, desired, **data)
        assert isinstance(plan, ShootingPlan), "the form of the problem"
        return plan

    def prepare(self) -> bool:
        """Between two samples: all that the next plan needs and that does not wait for the state.

        The rest of the last plan is taken, its derivatives computed and factorised, for the forecast as it will be if
        it comes true: nearly all of an iteration (the real-time iteration of Diehl, Bock and Schlöder 2005).

        Returns
        -------
        Whether something is prepared; not so without a last plan.

        Raises
        ------
        ValueError
            If the solver is not ``compiled``.
        """
        solver = self._in_parts()
        if self._previous is None or self._previous is not self._last_step:
            return False
        return solver.prepare()

    def feedback(
        self, state: ArrayLike, forecast: Any = None, desired: ArrayLike | None = None, **data: Any
    ) -> ShootingPlan:
        """When the state is there: a Newton step from what :meth:`prepare` did, two iterations more, and the plan.

        A plain :meth:`solve` where nothing is prepared. The plan is taken whether these iterations have converged or
        not; its inputs are cut to what the vehicle has. Where they have not and the plan is no better than braking,
        braking is the answer, and its ``status`` that of the iterations. Arguments and errors are those of
        :meth:`AnyPlanner.solve`.
        """
        solver = self._in_parts()
        if self._previous is None or self._previous is not self._last_step:
            return self.solve(state, forecast, desired, **data)
        plan = self._planned(perf_counter(), solver.feedback, state, forecast, desired, data)
        assert isinstance(plan, ShootingPlan), "the form of the problem"
        return plan

    def _in_parts(self) -> CompiledSolver:
        if not isinstance(self.solver, CompiledSolver):
            raise ValueError(f"solver: found {self.solver.name!r}; allowed: 'compiled', which takes steps in two parts")
        return self.solver

    @property
    def previous(self) -> ShotTrajectory | None:
        """As :attr:`Planner.previous`."""
        assert not isinstance(self._previous, FlatTrajectory), "the plans are not flat"
        return self._previous

    @previous.setter
    def previous(self, trajectory: ShotTrajectory | None) -> None:
        self._previous = trajectory
