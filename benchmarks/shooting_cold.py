"""Trajectories by integration from cold random starts: how many are solved, and whether they are optimal.

    OPENBLAS_NUM_THREADS=1 python benchmarks/shooting_cold.py --count 1000 --pieces 5,10,20 --json cold.json

Random states, forecasts and desired bearings (``solver_instances.cold_instances``, seed 0), hard limits on thrust of
0.98 of what there is, every solve from coasting. The solver's own account is not believed: CasADi integrates what it
commands by the benchmark's own Runge-Kutta step and differentiates the objective, and the residual is the largest step
along that slope, of one per unit of a thrust over its limit, cut at the bounds. The largest thrust is that of 101
instants a period.

``--json`` writes a row a dimension, form and number of pieces: dimension, thrust, pieces, count, solved, again (that
needed another start), iterations_mean, iterations_p99, iterations_most, residual_median, residual_p99, residual_worst,
optimal (of the solved, a residual of at most 1e-3), excess_most (thrust over its hard limit, less 1), objective_mean,
call_ms_median, call_ms_p99.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from time import thread_time
from typing import Any, Literal

import casadi as ca
import numpy as np
from peers.statement import Statement
from solver_instances import Instance, cold_instances, fossen_problem

from gbt_ocp.ocp import ShootingProblem, TrajectoryProblem
from gbt_ocp.ocp.plan_forms import plan_form
from gbt_ocp.ocp.solvers.compiled import CompiledSolution, CompiledSolver

OPTIMAL = 1e-3
"""Residual up to which a solution counts as optimal; the solver stops at 1e-4 of its own."""

FINE = np.linspace(0.0, 1.0, 101)
"""Shares of a period at which thrust is held against its limit."""


def _in_earth_axes(x: Any, n: int) -> tuple[Any, Any]:
    """Pose and its rate, of pose and body velocity; the yaw is the last of the pose."""
    c, s = ca.cos(x[n - 1]), ca.sin(x[n - 1])
    ahead, aside = x[n], x[n + 1]
    return x[:n], ca.vertcat(c * ahead - s * aside, s * ahead + c * aside, x[n + 2 :])


def period_of(statement: Statement) -> ca.Function:
    """(pose and body velocity, thrust over its limit at both ends of a period) -> the same a period later.

    The accelerations are those that the inverse dynamics give, turned into body axes.
    """
    n, h = statement.inputs, statement.period
    x, first, last = (ca.SX.sym(name, size) for name, size in zip("xab", (2 * n, n, n), strict=True))

    def rates(x: Any, u: Any) -> Any:
        z, dz = _in_earth_axes(x, n)
        ddz, turn = statement.rates(ca.vertcat(z, dz), u)[n:], dz[n - 1]
        c, s = ca.cos(z[n - 1]), ca.sin(z[n - 1])
        ahead = c * ddz[0] + s * ddz[1] + turn * x[n + 1]
        aside = -s * ddz[0] + c * ddz[1] - turn * x[n]
        return ca.vertcat(dz, ahead, aside, ddz[2:])

    middle = (first + last) / 2
    k1 = rates(x, first)
    k2 = rates(x + h / 2 * k1, middle)
    k3 = rates(x + h / 2 * k2, middle)
    k4 = rates(x + h * k3, last)
    return ca.Function("step", [x, first, last], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])


class Optimality:
    """First-order optimality within the bounds of the thrust, by derivatives of CasADi alone."""

    def __init__(self, problem: TrajectoryProblem, thrust: Literal["held", "linear"]) -> None:
        statement = Statement(problem)
        self._limit, self._ends = statement.limit, 1 if thrust == "held" else 2
        p, n = statement.pieces, statement.inputs
        start, u = ca.MX.sym("x", statement.states), ca.MX.sym("u", self._ends * n * p)
        given = ca.MX.sym("given", statement.parameters, p)
        step, cost = period_of(statement), statement.functions()[1]
        x, total = start, 0.0
        for k, held in enumerate(ca.vertsplit(u, self._ends * n)):
            x = step(x, held[:n], held[-n:])
            total += cost(ca.vertcat(*_in_earth_axes(x, n)), given[:, k])
        self._cost = ca.Function("cost", [start, u, given], [total, ca.gradient(total, u)])

    def judged(self, start: Any, item: Instance, variables: Any) -> tuple[float, float, float]:
        """Objective, residual, and largest thrust over its hard limit less 1, of inputs over their limits ``(p, ·)``,
        from pose and body velocity.
        """
        cost, slope = self._cost(start, variables.ravel(), np.vstack(item.parameters))
        u = variables.ravel()
        way = np.clip(u - np.asarray(slope).ravel(), -self._limit, self._limit) - u
        ends = variables.reshape(len(variables), self._ends, -1)
        thrust = ends[:, :1] + FINE[:, None] * (ends[:, -1:] - ends[:, :1])
        return -float(cost), float(np.abs(way).max()), float(np.abs(thrust).max()) / self._limit - 1.0


def posed(problem: TrajectoryProblem, thrust: Literal["held", "linear"]) -> ShootingProblem:
    """The same problem by integration; the bounds of held and linear inputs hold throughout with one node a piece."""
    found = ShootingProblem(problem.vehicle, problem.pieces, problem.period, thrust=thrust, steps=1)
    for objective in problem.objectives:
        found = found.maximize(objective)
    return found.subject_to(problem.hard[0].constraint, nodes=1)


def measured(dimension: int, thrust: Literal["held", "linear"], pieces: int, count: int) -> dict[str, Any]:
    """A row of the table."""
    problem = fossen_problem(dimension, "hard", 4, pieces)
    by_integration, optimality = posed(problem, thrust), Optimality(problem, thrust)
    solver, form = CompiledSolver(by_integration, {}), plan_form(by_integration)
    coasting = np.zeros((pieces, by_integration.freedoms))
    found: list[CompiledSolution] = []
    times, judged = [], []
    for number, item in enumerate(cold_instances(problem, count)):
        start = form.start(item.start)
        if number == 0:  # the first call pays for what is set up late
            solver.solve(start, item.parameters, coasting, cold=True, tightening=0.0)
        began = thread_time()
        found.append(solver.solve(start, item.parameters, coasting, cold=True, tightening=0.0))
        times.append(1e3 * (thread_time() - began))
        judged.append(optimality.judged(start, item, found[-1].variables))
    solved = np.array([one.solved for one in found])
    iterations = np.array([one.iterations for one in found])
    objective, residual, excess = np.array(judged).T
    return {
        "dimension": dimension,
        "thrust": thrust,
        "pieces": pieces,
        "count": count,
        "solved": int(solved.sum()),
        "again": int(sum(one.starts > 1 for one in found)),
        "iterations_mean": float(iterations.mean()),
        "iterations_p99": float(np.percentile(iterations, 99)),
        "iterations_most": int(iterations.max()),
        "residual_median": float(np.median(residual[solved])),
        "residual_p99": float(np.percentile(residual[solved], 99)),
        "residual_worst": float(residual[solved].max()),
        "optimal": int((residual[solved] <= OPTIMAL).sum()),
        "excess_most": float(excess.max()),
        "objective_mean": float(objective.mean()),
        "call_ms_median": float(np.median(times)),
        "call_ms_p99": float(np.percentile(times, 99)),
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Markdown."""
    lines = [
        "| | solved | optimal | another start | iterations (99 %, most) | residual: median | 99 % | worst "
        "| thrust over its limit, most | objective, mean | median ms | 99 % ms |",
        "|" + "---|" * 12,
    ]
    lines += [
        f"| {row['dimension']}D, {row['thrust']}, p = {row['pieces']} | {row['solved']} of {row['count']} "
        f"| {row['optimal']} | {row['again']} "
        f"| {row['iterations_mean']:.1f} ({row['iterations_p99']:.0f}, {row['iterations_most']}) "
        f"| {row['residual_median']:.1e} | {row['residual_p99']:.1e} | {row['residual_worst']:.1e} "
        f"| {row['excess_most']:+.1e} | {row['objective_mean']:.4f} "
        f"| {row['call_ms_median']:.3f} | {row['call_ms_p99']:.3f} |"
        for row in rows
    ]
    return "\n".join(lines)


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1000, help="instances each")
    parser.add_argument("--pieces", default="5,10,20", help="p, with commas between")
    parser.add_argument("--dimensions", default="2,3")
    parser.add_argument("--thrust", default="held", help="held, linear or both with a comma between")
    parser.add_argument("--json", type=Path, help="where to write a row a dimension, form and number of pieces")
    arguments = parser.parse_args()
    rows = [
        measured(int(dimension), thrust, int(pieces), arguments.count)
        for dimension in arguments.dimensions.split(",")
        for thrust in arguments.thrust.split(",")
        for pieces in arguments.pieces.split(",")
    ]
    print("Cold starts by integration\n")
    print(table(rows))
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
