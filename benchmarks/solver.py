"""Compiled solver against IPOPT: on recorded closed-loop states, on cold random starts, and over the horizon.

    python benchmarks/solver.py [--count 1000] [--steps 30] [--ipopt 100] [--out FILE.md]

Every comparison runs in one process, solver after solver on the same instances, so that ratios hold where
milliseconds do not. Times are processor time of the thread: other work on the machine does not count.
Tables are Markdown on standard output.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import thread_time
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from gbt_ocp.bearings import DesiredBearing
from gbt_ocp.experiments.build import build_loop
from gbt_ocp.experiments.loading import load_config
from gbt_ocp.ocp import BearingSimilarity, RangePull, ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.compiled import CompiledSolver
from gbt_ocp.ocp.ipopt import IpoptSolver
from gbt_ocp.ocp.solvers import Solution, Solver
from gbt_ocp.ocp.transcription import Binding, transcribe
from gbt_ocp.simulation import simulate
from gbt_ocp.vehicles import FALCON_2D, FALCON_3D, FossenVehicle


@dataclass(frozen=True)
class Instance:
    """What one call of a solver gets."""

    start: np.ndarray
    parameters: list[np.ndarray]
    guess: np.ndarray
    cold: bool
    tightening: float = 0.0


@dataclass(frozen=True)
class Row:
    """What one call gave."""

    solved: bool
    iterations: int
    objective: float
    violation: float
    time: float


class Recorder:
    """A solver that keeps what it was asked."""

    name = "recorder"

    def __init__(self, solver: Solver) -> None:
        self._solver = solver
        self.asked: list[Instance] = []

    def solve(self, start: Any, objectives: Any, guess: Any, *, cold: bool, tightening: float) -> Solution:
        """Solve, and remember."""
        self.asked.append(Instance(start.copy(), list(objectives), guess.copy(), cold, tightening))
        return self._solver.solve(start, objectives, guess, cold=cold, tightening=tightening)


def fossen_problem(dimension: int, formulation: str, nodes: int, pieces: int = 5) -> TrajectoryProblem:
    """The paper's problem with the weak pull of the default configuration."""
    vehicle = FossenVehicle(FALCON_2D if dimension == 2 else FALCON_3D, [5000.0] * dimension + [1500.0])
    problem = TrajectoryProblem(vehicle, pieces, 0.1).maximize(BearingSimilarity(dimension))
    problem = problem.maximize(RangePull(dimension))
    limit = ThrustLimit(vehicle, 0.98)
    return (
        problem.subject_to(limit, nodes=nodes)
        if formulation == "hard"
        else problem.subject_to_penalty(limit, nodes=nodes)
    )


def cold_instances(problem: TrajectoryProblem, count: int) -> Iterator[Instance]:
    """Random states, forecasts and desired bearings."""
    rng = np.random.default_rng(0)
    d, p = problem.vehicle.position_dimension, problem.pieces
    desired, binding = DesiredBearing(d, 2.0 * np.pi / (1.0 if d == 2 else 0.4)), Binding(problem)
    for number in range(count):
        start = np.zeros((2, d + 1))
        start[0, :d] = rng.uniform(-5.0, 5.0, d)
        start[1] = rng.normal(size=d + 1) * ([1.0] * d + [0.5])
        mean = rng.normal(size=d) + 0.1 * np.arange(1, p + 1)[:, None] * rng.normal(size=d)
        root = 0.2 * rng.normal(size=(d, d))
        forecast = SimpleNamespace(mean=mean, covariance=np.tile(root @ root.T, (p, 1, 1)))
        data = {"forecast": forecast, "desired": desired(number + 0.1 * np.arange(1, p + 1))}
        yield Instance(start, binding.objective_parameters(data), np.zeros((p, d + 1)), True)


def closed_loop_instances(
    case: str, formulation: str, nodes: int, seed: int, seconds: float
) -> tuple[TrajectoryProblem, list[Instance]]:
    """What the planner's solver was asked in a run of a shipped configuration."""
    overrides = [f"planner.formulation={formulation}", f"planner.nodes={nodes}", "planner.solver=compiled"]
    loop, start = build_loop(load_config(case, overrides=overrides, seed=seed))
    planner = loop.guidance.planner  # type: ignore[attr-defined]  # the configurations plan
    planner.solver = recorder = Recorder(planner.solver)
    simulate(loop, start, seconds)
    return planner.problem, recorder.asked


def measure(problem: TrajectoryProblem, solver: Solver, instances: Sequence[Instance]) -> list[Row]:
    """Solve all, judge each by CasADi's own objective and limits."""
    program = transcribe(problem)
    binding = Binding(problem)
    settings = [(soft.width, soft.weight) for soft in problem.penalties]
    judge = ca.Function("judge", [program.variables, program.parameters], [program.objective - program.penalty])
    rows = []
    for item in instances:
        began = thread_time()
        found = solver.solve(item.start, item.parameters, item.guess, cold=item.cold, tightening=item.tightening)
        time = thread_time() - began
        vector = binding.vector(item.start, item.parameters, settings, item.tightening)
        value = float(judge(found.variables.ravel(), vector)) if np.all(np.isfinite(found.variables)) else np.nan
        rows.append(Row(found.solved, found.iterations, value, nodes_violation(problem, item, found.variables), time))
    return rows


_LIMITS: dict[int, tuple[Any, ...]] = {}


def nodes_violation(problem: TrajectoryProblem, item: Instance, variables: np.ndarray) -> float:
    """Worst value of a constraint beyond its back-off, at the nodes, in units of the limit."""
    if id(problem) not in _LIMITS:
        bare = TrajectoryProblem(problem.vehicle, problem.pieces, problem.period).maximize(problem.objectives[0])
        for limit in (*problem.hard, *problem.penalties):
            bare = bare.subject_to(limit.constraint, nodes=limit.nodes)
        program = transcribe(bare)
        # the problem is kept so that its id stays its own
        _LIMITS[id(problem)] = (
            problem, bare, program, ca.Function("g", [program.variables, program.parameters], [program.limits]),
        )  # fmt: skip
    _, bare, program, function = _LIMITS[id(problem)]
    vector = Binding(bare).vector(item.start, item.parameters[:1], [], 0.0)
    values = np.asarray(function(variables.ravel(), vector)).ravel()
    return float(np.max(np.maximum(values - program.upper, program.lower - values) / program.scale))


def line(name: str, rows: Sequence[Row], best: np.ndarray, reference: float | None) -> str:
    """One row of a table; the ratio is that of median times."""
    times = 1e3 * np.array([row.time for row in rows])
    iterations = np.array([row.iterations for row in rows])
    gap = np.array([row.objective for row in rows]) - best[: len(rows)]
    ratio = "" if reference is None else f"{np.median(times) / reference:.1f}"
    solved = sum(row.solved for row in rows)
    worst = max((row.violation for row in rows if row.solved), default=np.nan)
    return (
        f"| {name} | {solved} of {len(rows)} | {iterations.mean():.1f} | {np.percentile(iterations, 99):.0f} "
        f"| {np.nanmean(gap):+.4f} | {worst:.1e} | {np.median(times):.3f} | {np.percentile(times, 99):.3f} | {ratio} |"
    )


HEAD = (
    "| | solved | iterations | 99 % | objective over the best | worst violation | median ms | 99 % ms | time ratio |\n"
    "|---|---|---|---|---|---|---|---|---|"
)


def compare(
    title: str,
    problem: TrajectoryProblem,
    instances: Sequence[Instance],
    solvers: Mapping[str, tuple[Callable[[], Solver], int]],
    write: Callable[[str], None],
) -> None:
    """One table: every solver on the first so many instances."""
    found = {}
    for name, (make, count) in solvers.items():
        if count > 0:
            solver = make()
            solver.solve(  # the first call pays for what is set up late
                instances[0].start, instances[0].parameters, instances[0].guess, cold=True, tightening=0.0
            )
            found[name] = measure(problem, solver, instances[:count])
    values = np.full((len(found), len(instances)), -np.inf)
    for rank, rows in enumerate(found.values()):
        values[rank, : len(rows)] = [row.objective if row.solved else -np.inf for row in rows]
    best = values.max(axis=0)
    best = np.where(np.isfinite(best), best, np.nan)
    write(f"\n{title}\n\n{HEAD}")
    first = 1e3 * float(np.median([row.time for row in next(iter(found.values()))]))
    for rank, (name, rows) in enumerate(found.items()):
        write(line(name, rows, best, None if rank == 0 else first))


def solvers_of(
    problem: TrajectoryProblem, count: int, ipopt: int, jit: int
) -> dict[str, tuple[Callable[[], Solver], int]]:
    """The solvers and on how many instances each runs."""
    printed = {"IPOPT, penalty as printed": (lambda: IpoptSolver(problem, {"penalty": "printed"}), ipopt)}
    return {
        "compiled": (lambda: CompiledSolver(problem, {}), count),
        "IPOPT, expanded": (lambda: IpoptSolver(problem, {}), ipopt),
        "IPOPT, compiled callbacks": (lambda: _with_compiled_callbacks(problem), jit),
        **(printed if problem.penalties else {}),
    }


def _with_compiled_callbacks(problem: TrajectoryProblem) -> IpoptSolver:
    jit = {"jit": True, "compiler": "shell", "jit_options": {"flags": ["-O1"], "verbose": False}}
    original = ca.nlpsol

    def compiled(name: str, plugin: str, statement: Any, options: dict[str, Any]) -> ca.Function:
        return original(name, plugin, statement, {**options, "expand": False, **jit})

    ca.nlpsol = compiled
    try:
        return IpoptSolver(problem, {})
    finally:
        ca.nlpsol = original


def horizons(write: Callable[[str], None], count: int) -> None:
    """Time over the number of pieces."""
    write("\nHorizon (cold, 2D, hard, n_c = 4)\n\n| p | solved | iterations | median ms | µs an iteration and piece |")
    write("|---|---|---|---|---|")
    for pieces in (5, 10, 20, 40, 80):
        problem = fossen_problem(2, "hard", 4, pieces)
        rows = measure(problem, CompiledSolver(problem, {}), list(cold_instances(problem, count)))
        times, iterations = np.array([row.time for row in rows]), np.array([row.iterations for row in rows])
        share = 1e6 * times.sum() / iterations.sum() / pieces
        solved = sum(row.solved for row in rows)
        write(
            f"| {pieces} | {solved} of {count} | {iterations.mean():.1f} | {1e3 * np.median(times):.3f} | {share:.2f} |"
        )


def main() -> None:
    """All tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1000, help="cold instances for the compiled solver")
    parser.add_argument("--ipopt", type=int, default=100, help="instances for IPOPT")
    parser.add_argument(
        "--jit",
        type=int,
        default=0,
        help="instances for IPOPT with compiled callbacks; each table then takes a minute to compile",
    )
    parser.add_argument("--seconds", type=float, default=30.0, help="length of the closed-loop runs")
    parser.add_argument("--cases", default="case1,case2,case3,case4,case5,case6")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    lines: list[str] = []

    def write(text: str) -> None:
        print(text, flush=True)
        lines.append(text)

    for formulation in ("hard", "penalty"):
        for case in arguments.cases.split(",") if arguments.cases else []:
            asked: list[Instance] = []
            for seed in range(arguments.seeds):
                problem, more = closed_loop_instances(case, formulation, 4, seed, arguments.seconds)
                asked += more
            solvers = solvers_of(problem, len(asked), arguments.ipopt, arguments.jit)
            compare(f"Closed loop, {case}, {formulation}, n_c = 4", problem, asked, solvers, write)
    for dimension in (2, 3):
        for formulation in ("hard", "penalty"):
            for nodes in (4, 20):
                problem = fossen_problem(dimension, formulation, nodes)
                instances = list(cold_instances(problem, arguments.count))
                title = f"Cold, {dimension}D, {formulation}, n_c = {nodes}"
                solvers = solvers_of(problem, arguments.count, arguments.ipopt, arguments.jit)
                compare(title, problem, instances, solvers, write)
    horizons(write, max(arguments.count // 20, 1))
    if arguments.out is not None:
        arguments.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
