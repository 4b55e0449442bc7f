"""Multiple shooting: the same problem with the inputs held over each period, as a yardstick outside the flat world.

The flat trajectory holds the acceleration in the earth frame over a piece and lets the thrust follow from it. Most of
the field holds the thrust instead and lets the motion follow by integration (Bock and Plitt 1984). Both have p·n
unknowns that count, the same objectives at the same times and the same limits, so they can be compared:

    planner = ShootingPlanner(problem)                  # the TrajectoryProblem that compile() would take
    plan = planner.solve(state, forecast, desired)      # the call of Planner.solve, a ShootingPlan instead of a Plan
    guidance = PlannedMotion(planner, desired_bearing)  # in a closed loop: the first thrust is held for a period

A :class:`ShootingPlan` has ``status``, ``solved``, ``objective``, ``violation``, ``piece_violation``, ``iterations``,
``solve_time``, ``fallback`` and ``endpoints`` with the meaning they have in a :class:`~gbt_ocp.ocp.plan.Plan`, and
``thrust`` in place of a trajectory. ``reset()`` and ``previous`` are those of the planner, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.sizes import at_least
from gbt_ocp.models.vehicles import acceleration
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.objective_total import objective_function
from gbt_ocp.ocp.plan import ShootingPlan
from gbt_ocp.ocp.problem_data import ProblemData
from gbt_ocp.ocp.solvers.base import Solution
from gbt_ocp.ocp.solvers.ipopt import ipopt_function, solution_of
from gbt_ocp.ocp.terms import AccumulatedObjective, JointObjective
from gbt_ocp.ocp.thrust_limits import ThrustLimit
from gbt_ocp.typing import Array

SUBSTEPS = 4
"""Runge-Kutta steps over the time that an input is held."""

CHECK_SUBSTEPS = 50
"""Steps, and intervals at which the limits are checked, of a finished plan."""


class ShootingPlanner:
    """Solves a trajectory problem by multiple shooting with IPOPT, again and again, each time from the last solution.

    Unknowns are the inputs of each period in units of their limits and the states (z, ż) at its end, tied together by
    classical Runge-Kutta steps. The thrust limits of the problem, however it treats them, become bounds on the inputs,
    γ τ_max; being held, the inputs cannot break them between nodes. A failed solve is answered by a cold one, and that
    by the rest of the last plan, or by coasting where there is none.

    What is held is said by :meth:`motion`; a subclass may hold something else, and more often.

    Parameters
    ----------
    problem
        What to solve; its ``degree`` and the nodes of its limits mean nothing here.
    substeps
        Runge-Kutta steps over the time that an input is held.
    options
        IPOPT's; they replace or join :data:`gbt_ocp.ocp.solvers.ipopt.DEFAULT_OPTIONS`.

    Raises
    ------
    ValueError
        If the problem has no objective, a constraint other than thrust limits, or none, or IPOPT does not know an
        option.
    """

    holds = 1
    """How often the held quantity may change within a period."""

    bounded = True
    """Whether what is held is the inputs over their limits: then bounds suffice. Limits are imposed at the end of
    every Runge-Kutta step otherwise."""

    def __init__(
        self, problem: ProblemData, *, substeps: int = SUBSTEPS, options: Mapping[str, Any] | None = None
    ) -> None:
        if not problem.objectives:
            raise ValueError("the problem has no objective; call maximize() first")
        coupled = JointObjective | AccumulatedObjective
        joint = [type(term).__name__ for term in problem.objectives if isinstance(term, coupled)]
        if joint:
            raise ValueError(f"multiple shooting takes sums over the endpoints as objectives; found: {joint[0]}")
        limits = [limit for limit in problem.constraints if isinstance(limit, ThrustLimit)]
        others = [type(other).__name__ for other in problem.constraints if not isinstance(other, ThrustLimit)]
        if others or not limits:
            found = ", ".join(others) or "none"
            raise ValueError(f"multiple shooting takes thrust limits as its only constraints; found: {found}")
        at_least("substeps", substeps, 1)
        self.problem = problem
        self.gamma = min(limit.gamma for limit in limits)
        n = problem.vehicle.flat_dimension
        state, held = ca.SX.sym("state", 2 * n), ca.SX.sym("held", n)
        self._motion = ca.Function("motion", [state, held], [self.motion(state[:n], state[n:], held)])
        self.step = self._integrator(substeps)
        self._binding = Binding(problem)
        self._pieces = problem.pieces * self.holds
        self._rollout = self.step.mapaccum(self._pieces)
        self._fine = self._integrator(CHECK_SUBSTEPS).mapaccum(self._pieces)
        self._objectives = [
            objective_function(problem, term).map(problem.pieces)
            for term in problem.objectives
            if not isinstance(term, coupled)
        ]
        self._accelerations = self._motion.map(problem.pieces)
        self._solver = ipopt_function(self._program(), options or {})
        self._previous: ShootingPlan | None = None

    def motion(self, z: Any, dz: Any, held: Any) -> Any:
        """z̈ ``(n,)``, a CasADi expression, under what is held ``(n,)``: here the inputs over their limits."""
        return acceleration(self.problem.vehicle, z, dz, held * ca.DM(self.problem.vehicle.thrust_max))

    def _integrator(self, substeps: int) -> ca.Function:
        """(state, held) -> state at the end of the hold, inputs over their limits at both ends of every step.

        The state is (z, ż) ``(2n,)``; the inputs come one time a column ``(m, substeps + 1)``.
        """
        vehicle = self.problem.vehicle
        n = vehicle.flat_dimension
        state, held = ca.SX.sym("state", 2 * n), ca.SX.sym("held", n)

        def rates(x: Any) -> Any:
            return ca.vertcat(x[n:], self._motion(x, held))

        def inputs(x: Any) -> Any:
            return vehicle.inputs(x[:n], x[n:], self._motion(x, held)) / ca.DM(vehicle.thrust_max)

        h = self.problem.period / self.holds / substeps
        end, thrust = state, [inputs(state)]
        for _ in range(substeps):
            k1 = rates(end)
            k2 = rates(end + 0.5 * h * k1)
            k3 = rates(end + 0.5 * h * k2)
            k4 = rates(end + h * k3)
            end = end + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            thrust.append(inputs(end))
        return ca.Function("hold", [state, held], [end, ca.horzcat(*thrust)], ["state", "held"], ["end", "inputs"])

    def _program(self) -> dict[str, ca.MX]:
        """The nonlinear program in CasADi's form; the unknowns are what is held, then the states."""
        problem, pieces = self.problem, self._pieces
        n = problem.vehicle.flat_dimension
        held, ends, start = ca.MX.sym("held", n, pieces), ca.MX.sym("ends", 2 * n, pieces), ca.MX.sym("start", 2 * n)
        reached, inputs = self.step.map(pieces)(ca.horzcat(start, ends[:, :-1]), held)
        last = slice(self.holds - 1, None, self.holds)
        values = [ca.MX.sym("p", function.size1_in(3), problem.pieces) for function in self._objectives]
        limits = [ca.vec(reached - ends)] + ([] if self.bounded else [ca.vec(inputs)])
        return {
            "x": ca.vertcat(ca.vec(held), ca.vec(ends)),
            "p": ca.vertcat(start, *(ca.vec(value) for value in values)),
            "f": -self._sum(ends[:, last], held[:, last], values),
            "g": ca.vertcat(*limits),
        }

    def _sum(self, states: Any, held: Any, parameters: Sequence[Any]) -> Any:
        """The objective of states at the endpoints ``(2n, p)`` and of what was held before them ``(n, p)``."""
        n = self.problem.vehicle.flat_dimension
        point = states[:n, :], states[n:, :], self._accelerations(states, held)
        return sum(ca.sum2(f(*point, p)) for f, p in zip(self._objectives, parameters, strict=True))

    def reset(self) -> None:
        """Forget the previous plan: the next solve is cold."""
        self._previous = None

    @property
    def previous(self) -> ShootingPlan | None:
        """The plan of the last step, from which the next solve starts; may be set to repeat a recorded step."""
        return self._previous

    @previous.setter
    def previous(self, plan: ShootingPlan | None) -> None:
        self._previous = plan

    def rollout(self, start: ArrayLike, held: ArrayLike) -> tuple[Array, Array]:
        """Where what is held leads.

        Parameters
        ----------
        start
            z and ż ``(2, n)``.
        held
            What is held ``(p holds, n)``; inputs in units of their limits.

        Returns
        -------
        z and ż at the start and the end of each period ``(p+1, 2, n)``, and the largest ``|τ| / τ_max`` of each
        period ``(p,)``.
        """
        first = np.asarray(start, dtype=float)
        ends, inputs = self._fine(first.ravel(), np.asarray(held, dtype=float).T)
        knots = np.concatenate([first[None], np.asarray(ends).T.reshape(self._pieces, *first.shape)])
        peaks = np.abs(np.asarray(inputs)).max(axis=0).reshape(self.problem.pieces, -1).max(axis=1)
        return knots[:: self.holds], peaks

    def objective(self, knots: Array, held: Array, parameters: Sequence[Array]) -> float:
        """The objective of what :meth:`rollout` gave, for parameters as in :meth:`attempt`."""
        states = knots[1:].reshape(self.problem.pieces, -1).T
        return float(self._sum(states, held[self.holds - 1 :: self.holds].T, parameters))

    def solve(
        self, state: ArrayLike, forecast: Any = None, desired: ArrayLike | None = None, **data: Any
    ) -> ShootingPlan:
        """Plan from a state.

        Parameters
        ----------
        state
            z and ż now ``(2, n)``; further derivatives are not read.
        forecast
            Mean and covariance of the target's position at the endpoints, for objectives that need it.
        desired
            Desired bearings at the endpoints ``(>=p, d)``, for objectives that need them.
        data
            Whatever else the objectives ask for, by name.

        Raises
        ------
        ValueError
            If the state or the data do not fit or are not finite.
        """
        began = perf_counter()
        start, n = np.asarray(state, dtype=float), self.problem.vehicle.flat_dimension
        if start.ndim != 2 or len(start) < 2 or start.shape[1] != n or not np.all(np.isfinite(start)):
            raise ValueError(f"state: found shape {start.shape}; allowed: (2, {n}), all numbers finite")
        start = start[:2]
        parameters = self._binding.objective_parameters({"forecast": forecast, "desired": desired, **data})
        coasting = np.zeros((self._pieces, n))
        rest = None if self._previous is None else self._previous.rest(self.holds)

        first = self.attempt(start, parameters, coasting if rest is None else rest)
        held, iterations, fallback = first.variables, first.iterations, ""
        if not first.solved and rest is not None:
            again = self.attempt(start, parameters, coasting)
            held, iterations, fallback = again.variables, iterations + again.iterations, "cold"
            if not again.solved:
                held, fallback = rest, "shifted"
        elif not first.solved:
            held, fallback = coasting, "coasting"
        knots, peaks = self.rollout(start, held)
        self._previous = ShootingPlan(
            knots=knots,
            held=held,
            thrust=held[:: self.holds] * self.problem.vehicle.thrust_max,
            status=first.status,
            objective=self.objective(knots, held, parameters),
            violation=max(float(peaks.max()) - 1.0, 0.0),
            piece_violation=np.maximum(peaks - 1.0, 0.0),
            iterations=iterations,
            solve_time=perf_counter() - began,
            fallback=fallback,
        )
        return self._previous

    def attempt(self, start: Array, objectives: Sequence[Array], guess: Array) -> Solution:
        """One call of IPOPT from z and ż ``(2, n)`` and a guess of what is held ``(p holds, n)``.

        ``objectives`` are the parameters of each objective, one endpoint a column ``(size, p)``, as
        :meth:`gbt_ocp.ocp.binding.Binding.objective_parameters` gives them. The states start where the guess
        leads.
        """
        states, _ = self._rollout(start.ravel(), guess.T)
        unknowns, defects = guess.size, 2 * guess.size
        box = np.full(unknowns, self.gamma if self.bounded else np.inf)
        free = np.full(defects, np.inf)
        rows = self._solver.size1_out("g") - defects
        limit = np.full(rows, self.gamma)
        found = self._solver(
            x0=np.concatenate([guess.ravel(), np.asarray(states).T.ravel()]),
            p=np.concatenate([start.ravel(), *(values.T.ravel() for values in objectives)]),
            lbx=np.concatenate([-box, -free]),
            ubx=np.concatenate([box, free]),
            lbg=np.concatenate([np.zeros(defects), -limit]),
            ubg=np.concatenate([np.zeros(defects), limit]),
        )
        solution = solution_of(self._solver, found, guess.shape)
        # IPOPT widens bounds by its tolerance
        return replace(solution, variables=np.clip(solution.variables, -box[0], box[0]))
