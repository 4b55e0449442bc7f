"""Compiled solver against IPOPT: on recorded closed-loop states, on cold random starts, and over the horizon.

    OPENBLAS_NUM_THREADS=1 python benchmarks/solver.py --study horizon,loop --figure docs/figures/solver_benchmark.png
    OPENBLAS_NUM_THREADS=1 python benchmarks/solver.py --study cold --ipopt 250

Every comparison runs in one process, solver after solver on the same instances, so that ratios hold where
milliseconds do not. Times are processor time of the thread: other work on the machine does not count.
Tables are Markdown on standard output.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import thread_time
from typing import Any

import casadi as ca
import numpy as np
from solver_instances import (
    Instance,
    closed_loop_instances,
    cold_instances,
    fossen_problem,
    pursuit_instances,
)
from solver_optimality import Optimality

from gbt_ocp.ocp import TrajectoryProblem
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.solvers.base import Solver
from gbt_ocp.ocp.solvers.compiled import CompiledSolver
from gbt_ocp.ocp.solvers.ipopt import IpoptSolver
from gbt_ocp.ocp.transcription import transcribe

HORIZONS = (5, 10, 20, 40, 80)


@dataclass(frozen=True)
class Row:
    """What one call gave."""

    solved: bool
    starts: int
    iterations: int
    objective: float
    violation: float
    time: float
    variables: np.ndarray


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
        rows.append(
            Row(
                found.solved,
                getattr(found, "starts", 1),
                found.iterations,
                value,
                nodes_violation(problem, item, found.variables),
                time,
                found.variables,
            )
        )
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


@dataclass
class Samples:
    """What the figure shows: times in milliseconds."""

    horizon: dict[str, list[np.ndarray]] = field(default_factory=dict)
    loop: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)


Write = Callable[[str], None]


def times_of(rows: Sequence[Row]) -> np.ndarray:
    """Milliseconds."""
    return 1e3 * np.array([row.time for row in rows])


def warmed(solver: Solver, item: Instance) -> Solver:
    """The solver after a first call, which pays for what is set up late."""
    solver.solve(item.start, item.parameters, item.guess, cold=True, tightening=0.0)
    return solver


def horizons(write: Write, samples: Samples, arguments: argparse.Namespace) -> None:
    """Time over the number of pieces, for each dimension, node count and formulation."""
    cold, steps = max(arguments.count // 20, 1), arguments.steps
    sizes = [(int(d), int(nodes)) for d in arguments.dimensions.split(",") for nodes in arguments.nodes.split(",")]
    for (dimension, nodes), formulation in ((size, name) for size in sizes for name in ("hard", "penalty")):
        title = f"{dimension}D, {formulation}, n_c = {nodes}"
        write(f"\nHorizon, {title}: {steps} warm steps with forecasts that come true, then cold\n")
        write(
            "| p | solved | iterations (99 %) | median ms | 99 % ms | µs an iteration and piece | worst violation "
            "| cold: solved | iterations | median ms | IPOPT: solved | iterations | median ms | times compiled "
            "| compiled's objective minus IPOPT's |"
        )
        write("|" + "---|" * 15)
        medians = []
        for pieces in HORIZONS:
            problem = fossen_problem(dimension, formulation, nodes, pieces)
            instances = pursuit_instances(problem, steps)
            solver = warmed(CompiledSolver(problem, {}), instances[0])
            rows = measure(problem, solver, instances)
            times, iterations = times_of(rows), np.array([row.iterations for row in rows])
            if (dimension, nodes) == (2, 4):
                samples.horizon.setdefault(formulation, []).append(times)
            medians.append(np.median(times))
            first = measure(problem, solver, list(cold_instances(problem, cold)))
            peer = "| | | | |"
            # beyond some thousand node constraints IPOPT takes minutes to build and to solve
            if arguments.peer > 0 and nodes * pieces <= 160:
                picked = np.unique(np.linspace(0, steps - 1, arguments.peer).round().astype(int))
                other = measure(problem, IpoptSolver(problem, {}), [instances[k] for k in picked])
                ratio = np.median(times_of(other)) / np.median(times[picked])
                gaps = [rows[k].objective - o.objective for k, o in zip(picked, other, strict=True) if o.solved]
                gap = f"{np.mean(gaps):+.4f}" if gaps else ""
                iterations_there = np.mean([row.iterations for row in other])
                peer = (
                    f"{sum(row.solved for row in other)} of {len(other)} | {iterations_there:.1f} "
                    f"| {np.median(times_of(other)):.1f} | {ratio:.0f} | {gap} |"
                )
            write(
                f"| {pieces} | {sum(row.solved for row in rows)} of {len(rows)} "
                f"| {iterations.mean():.1f} ({np.percentile(iterations, 99):.0f}) | {medians[-1]:.3f} "
                f"| {np.percentile(times, 99):.3f} | {1e3 * times.sum() / iterations.sum() / pieces:.2f} "
                f"| {max(row.violation for row in rows):.1e} "
                f"| {sum(row.solved for row in first)} of {cold} "
                f"| {np.mean([row.iterations for row in first]):.1f} | {np.median(times_of(first)):.3f} | {peer}"
            )
        slope = np.polyfit(np.log(HORIZONS), np.log(medians), 1)[0]
        write(f"\nThe median warm time grows as p^{slope:.2f}.")


def cold_starts(write: Write, count: int, ipopt: int) -> None:
    """Random instances from rest of nothing known: success, optimality, objective."""
    write(f"\nCold: {count} random instances each, every one checked; IPOPT on the first {ipopt} (hard form)\n")
    write(
        "| | solved | starts again | iterations (99 %, most) | KKT residual: median | worst | worst violation "
        "| median ms | 99 % ms | IPOPT solved | objective minus IPOPT's: mean (standard error) |"
    )
    write("|---|---|---|---|---|---|---|---|---|---|---|")
    for dimension in (2, 3):
        for formulation in ("hard", "penalty"):
            for nodes in (4, 20):
                problem = fossen_problem(dimension, formulation, nodes)
                instances = list(cold_instances(problem, count))
                rows = measure(problem, warmed(CompiledSolver(problem, {}), instances[0]), instances)
                optimality = Optimality(problem)
                residuals = np.array(
                    [optimality.residual(item, row.variables) for item, row in zip(instances, rows, strict=True)]
                )
                iterations, times = np.array([row.iterations for row in rows]), times_of(rows)
                against = " | "
                if formulation == "hard" and ipopt:
                    other = measure(problem, IpoptSolver(problem, {}), instances[:ipopt])
                    gap = np.array(
                        [a.objective - b.objective for a, b in zip(rows, other, strict=False) if a.solved and b.solved]
                    )
                    error = gap.std(ddof=1) / np.sqrt(len(gap))
                    against = f"{sum(r.solved for r in other)} of {len(other)} | {gap.mean():+.4f} ({error:.4f})"
                write(
                    f"| {dimension}D, {formulation}, n_c = {nodes} | {sum(row.solved for row in rows)} of {count} "
                    f"| {sum(row.starts > 1 for row in rows)} "
                    f"| {iterations.mean():.1f} ({np.percentile(iterations, 99):.0f}, {iterations.max()}) "
                    f"| {np.median(residuals):.1e} | {residuals.max():.1e} "
                    f"| {max(row.violation for row in rows):.1e} | {np.median(times):.3f} "
                    f"| {np.percentile(times, 99):.3f} | {against} |"
                )


def closed_loops(write: Write, samples: Samples, arguments: argparse.Namespace) -> None:
    """Recorded steps of whole runs; the other solvers on steps spread evenly over them."""
    for pieces in (5, 10):
        for case in arguments.cases.split(","):
            for formulation in ("hard", "penalty"):
                asked: list[Instance] = []
                for seed in range(arguments.seeds):
                    problem, more = closed_loop_instances(case, formulation, 4, seed, arguments.seconds, pieces)
                    asked += more
                title = f"{case}, {formulation}, n_c = 4, p = {pieces}"
                compare(title, problem, asked, arguments, write, samples)


def compare(
    title: str,
    problem: TrajectoryProblem,
    asked: Sequence[Instance],
    arguments: argparse.Namespace,
    write: Write,
    samples: Samples,
) -> None:
    """One table. Ratios are those of the median times on the same steps."""
    solvers: list[tuple[str, Callable[[], Solver], int]] = [
        ("compiled", lambda: CompiledSolver(problem, {}), len(asked)),
        ("IPOPT, elastic penalty" if problem.penalties else "IPOPT", lambda: IpoptSolver(problem, {}), arguments.ipopt),
        ("IPOPT, compiled callbacks", lambda: _with_compiled_callbacks(problem), arguments.jit),
    ]
    if problem.penalties:
        solvers.append(
            ("IPOPT, penalty as printed", lambda: IpoptSolver(problem, {"penalty": "printed"}), arguments.printed)
        )
    results: dict[str, dict[int, Row]] = {}
    for name, make, count in solvers:
        if count > 0:
            picked = np.unique(np.linspace(0, len(asked) - 1, min(count, len(asked))).round().astype(int))
            rows = measure(problem, warmed(make(), asked[0]), [asked[k] for k in picked])
            results[name] = dict(zip(picked.tolist(), rows, strict=True))
    samples.loop[title] = {name: times_of(list(rows.values())) for name, rows in results.items()}
    solved = [{k: row.objective for k, row in rows.items() if row.solved} for rows in results.values()]
    best = {k: max((found[k] for found in solved if k in found), default=np.nan) for k in range(len(asked))}
    mine = results["compiled"]
    write(f"\nClosed loop, {title}\n")
    write(
        "| | solved | iterations (99 %) | objective below the best | worst violation | median ms | 99 % ms "
        "| times compiled |"
    )
    write("|---|---|---|---|---|---|---|---|")
    for name, rows in results.items():
        times, iterations = times_of(list(rows.values())), np.array([row.iterations for row in rows.values()])
        # where no other solver solved, there is nothing to compare with
        shared = [k for k, row in rows.items() if row.solved and sum(k in found for found in solved) > 1]
        below = np.mean([best[k] - rows[k].objective for k in shared]) if shared else np.nan
        worst = max((row.violation for row in rows.values() if row.solved), default=np.nan)
        ratio = np.median(times) / np.median(times_of([mine[k] for k in rows]))
        write(
            f"| {name} | {sum(row.solved for row in rows.values())} of {len(rows)} "
            f"| {iterations.mean():.1f} ({np.percentile(iterations, 99):.0f}) | {below:.4f} | {worst:.1e} "
            f"| {np.median(times):.3f} | {np.percentile(times, 99):.3f} | {ratio:.1f} |"
        )


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


def main() -> None:
    """All tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--study", default="horizon,cold,loop", help="which of horizon, cold, loop")
    parser.add_argument("--steps", type=int, default=100, help="warm steps for each horizon")
    parser.add_argument("--dimensions", default="2,3", help="d of the horizon study")
    parser.add_argument("--nodes", default="4,20", help="n_c of the horizon study")
    parser.add_argument("--peer", type=int, default=5, help="warm steps for IPOPT at each horizon")
    parser.add_argument("--count", type=int, default=1000, help="cold instances for the compiled solver")
    parser.add_argument("--ipopt", type=int, default=100, help="instances for IPOPT")
    parser.add_argument("--printed", type=int, default=30, help="closed-loop steps for IPOPT, penalty as printed")
    parser.add_argument(
        "--jit",
        type=int,
        default=0,
        help="instances for IPOPT with compiled callbacks; each table then takes a minute to compile",
    )
    parser.add_argument("--seconds", type=float, default=30.0, help="length of the closed-loop runs")
    parser.add_argument("--cases", default="case2,case5")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--out", type=Path, help="file for the tables")
    parser.add_argument("--figure", type=Path, help="file for the figure; needs the studies horizon and loop")
    arguments = parser.parse_args()
    lines: list[str] = []

    def write(text: str) -> None:
        print(text, flush=True)
        lines.append(text)

    studies = arguments.study.split(",")
    samples = Samples()
    if "horizon" in studies:
        horizons(write, samples, arguments)
    if "loop" in studies:
        closed_loops(write, samples, arguments)
    if "cold" in studies:
        cold_starts(write, arguments.count, arguments.ipopt)
    if arguments.out is not None:
        arguments.out.write_text("\n".join(lines) + "\n", encoding="utf-8")
    if arguments.figure is not None:
        if not (samples.horizon and samples.loop):
            parser.error("--figure: needs the studies horizon and loop")
        from solver_figure import draw

        draw(HORIZONS, samples.horizon, samples.loop, arguments.figure)


if __name__ == "__main__":
    sys.exit(main())
