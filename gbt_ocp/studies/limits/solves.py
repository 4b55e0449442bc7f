"""Every treatment on exactly the same problems: one solve, judged by the same yardsticks.

The yardsticks belong to no treatment: the objective without penalty, and the true limits at the nodes and on the fine
grid between them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from time import thread_time
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.limit_classes import LimitClass, limit_class
from gbt_ocp.ocp.plan_forms import plan_form
from gbt_ocp.ocp.planner import AnyPlanner
from gbt_ocp.ocp.shooting_problem import ShootingProblem
from gbt_ocp.ocp.shot import ShotTrajectory
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.studies.limits.comparison_tables import Row
from gbt_ocp.studies.limits.integrated import held_half_way
from gbt_ocp.studies.limits.problems import Check, Instance, Problems, unasked
from gbt_ocp.studies.limits.treatments import Pair, kept_planner
from gbt_ocp.typing import Array

COLD, WARM = "cold", "warm"
COLD_AND_WARM = (COLD, WARM)
"""Cold starts from coasting, warm ones from the rest of the plan that was made one step before in the recorded run."""

STARTS = 8
"""Guesses a formulation that the best known solution is looked for from, beside all that is solved anyway."""

KEPT = 1.0e-6
"""Violation of a true limit, in units of it, up to which it counts as kept."""


class Judgement(NamedTuple):
    """Objective without penalty, and largest signed violation of the true limits at the nodes and between them.

    ``classes`` has the latter of each class of limits, where there are others than those on thrust.
    """

    objective: float
    nodes: float
    between: float
    classes: Mapping[LimitClass, float] = MappingProxyType({})


class Judge:
    """Judges trajectories of either form.

    Parameters
    ----------
    planner
        Of any formulation: its problem gives objective, limits and n_c. Limits count however it treats them.
    """

    def __init__(self, planner: AnyPlanner) -> None:
        self._planner, self._check = planner, plan_form(planner.problem).check
        self._classes = np.array([limit_class(planner.problem, c) for c in planner.problem.constraints])

    def __call__(
        self, trajectory: FlatTrajectory | ShotTrajectory, parameters: list[Array], limits: list[Array]
    ) -> Judgement:
        """Judge a trajectory for these parameters of objectives and constraints."""
        if not np.all(np.isfinite(trajectory.top)):
            return Judgement(np.nan, np.nan, np.nan)
        objective = self._planner.objective(trajectory, parameters)
        nodes = self._check.survey(trajectory, limits, nodes=True).max()
        between = self._check.survey(trajectory, limits).max(axis=1)
        present = sorted(set(self._classes.tolist()))
        classes = {LimitClass(one): float(between[self._classes == one].max()) for one in present}
        return Judgement(objective, float(nodes), float(between.max()), classes if len(present) > 1 else {})


def is_possible(instance: Instance, mode: str) -> bool:
    """Whether a problem can be solved in this mode: a warm start needs a previous plan."""
    return mode == COLD or instance.previous is not None


def solve_chunk(
    configuration: Configuration,
    problems: Problems,
    numbers: Sequence[int],
    pair: Pair,
    mode: str,
    *,
    planner: Any = None,
    check: Check = unasked,
    **changes: Any,
) -> list[Row]:
    """Solve some of the problems with a pair, or with a given planner; ``changes`` replace keys of ``planner``.

    ``check`` is called before each.

    Returns
    -------
    One row a problem. ``time_ms`` is processor time of the thread.
    """
    planner = planner or kept_planner(configuration, pair, **changes)
    solve = _Solve(planner)
    possible = [k for k in numbers if is_possible(problems[k], mode)]
    if possible:
        # the first call pays for what is set up late
        solve(problems[possible[0]], mode)
    rows = []
    for k in possible:
        check()
        rows.append(
            {
                "case": configuration.name,
                "origin": str(problems.origin[k]),
                "run": int(problems.run[k]),
                "problem": k,
                "mode": mode,
                "formulation": pair.formulation,
                "solver": pair.solver,
                **solve(problems[k], mode),
            }
        )
    return rows


def _row(solved: bool, status: str, iterations: int, seconds: float, judgement: Judgement) -> Row:
    return {
        "solved": int(solved),
        "status": status,
        "iterations": iterations,
        "time_ms": 1e3 * seconds,
        "objective": judgement.objective,
        "violation_nodes": judgement.nodes,
        "violation_between": judgement.between,
        **{f"violation_{one.name.lower()}": worst for one, worst in judgement.classes.items()},
    }


class _Solve:
    """One call of the solver behind a planner: no check, tightening or fallback helps it."""

    def __init__(self, planner: AnyPlanner) -> None:
        self._planner, self._form = planner, plan_form(planner.problem)
        self._judge, self._binding = Judge(planner), Binding(planner.problem)
        self.shape = planner.problem.pieces, planner.problem.freedoms

    def __call__(self, instance: Instance, mode: str) -> Row:
        if mode == COLD:
            return self.start_from(self._form.coasting(self._start(instance)), instance)
        assert instance.previous is not None
        problem, previous = self._planner.problem, instance.previous
        if isinstance(problem, ShootingProblem):
            previous = self._form.trajectory(
                self._form.start(previous.start[: problem.joined]), held_half_way(previous, problem)
            )
        return self.start_from(self._form.rest(previous, instance.start) / self._form.scale, instance, cold=False)

    def start_from(self, guess: Array, instance: Instance, cold: bool = True) -> Row:
        """Solve from a guess u ``(p, freedoms)``."""
        parameters = self._binding.objective_parameters(instance.data)
        limits, start = self._binding.limit_parameters(instance.data), self._start(instance)
        began = thread_time()
        found = self._planner.solver.solve(start, parameters, guess, cold=cold, tightening=0.0, limits=limits)
        seconds = thread_time() - began
        trajectory = self._form.trajectory(start, found.variables * self._form.scale)
        return _row(found.solved, found.status, found.iterations, seconds, self._judge(trajectory, parameters, limits))

    def _start(self, instance: Instance) -> Array:
        return np.asarray(self._form.start(instance.start[: self._planner.problem.joined]))


def best_chunk(
    configuration: Configuration, problems: Problems, numbers: Sequence[int], pairs: list[Pair], check: Check = unasked
) -> list[Row]:
    """Look for the best solution of some problems from many starts.

    Each pair starts from coasting, from the recorded plan where there is one, and from draws of every scaled unknown
    uniform in [-1, 1], :data:`STARTS` in all.

    Returns
    -------
    One row a problem: the highest objective of the trajectories that keep the true limits on the fine grid (NaN if
    none does), and how many starts led within 1e-3 of it.
    """
    solvers = [_Solve(kept_planner(configuration, pair)) for pair in pairs]
    rows = []
    for k in numbers:
        instance, found = problems[k], []
        rng = np.random.default_rng([configuration.seed, k])
        for solve in solvers:
            modes = [mode for mode in COLD_AND_WARM if is_possible(instance, mode)]
            answers = [solve(instance, mode) for mode in modes]
            check()
            for _ in range(STARTS - len(modes)):
                answers.append(solve.start_from(rng.uniform(-1.0, 1.0, solve.shape), instance))
            found += [one["objective"] for one in answers if one["solved"] and one["violation_between"] <= KEPT]
        best = max(found, default=np.nan)
        rows.append(
            {
                "case": configuration.name,
                "problem": k,
                "best": best,
                "near_best": sum(value >= best - 1e-3 for value in found),
                "starts": STARTS * len(pairs),
            }
        )
    return rows
