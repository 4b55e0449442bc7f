"""What a run takes by itself, and runs a second of a sweep with one worker process and with two.

    python benchmarks/sweep_rate.py --runs 24

First single runs of the paper's cases 2 and 5 as they are, 30 s each, in this process: processor seconds to make their
parts, in which all but the first share the problem, and of their loop of 301 steps.

Then the same sweep (case 2, planner, compiled solver, 30 s a run) with `--jobs 1` and `--jobs 2`, in turns, after both
have been warmed up: starting the workers is not counted. The machine must have two idle cores. The last columns are
what a run took by its own clock: where two workers slow each other down, it shows there.
"""

from __future__ import annotations

import os

# The matrices are small: several BLAS threads a process only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import tempfile
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

import gbt_ocp as gbt
from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.simulation import simulate

SETTINGS = ("planner.formulation=hard", "planner.solver=compiled")


def seconds(folder: Path, jobs: int, runs: int, duration: float) -> tuple[float, float]:
    """Wall seconds of a sweep, and the mean wall seconds of its runs as each of them measured itself."""
    began = perf_counter()
    overrides = [*SETTINGS, f"duration_s={duration}"]
    done = gbt.sweep("case2", runs=runs, overrides=overrides, jobs=jobs, out=folder, histories=False)
    return perf_counter() - began, sum(row["wall_s"] for row in done.rows) / len(done.rows)


def single(case: str, seeds: range, duration: float) -> list[tuple[float, float]]:
    """Processor seconds to make the parts of each run, and of its loop."""
    spent = []
    for seed in seeds:
        began = process_time()
        loop, start = build_loop(gbt.load_config(case, seed=seed))
        made = process_time()
        simulate(loop, start, duration)
        spent.append((made - began, process_time() - made))
    return spent


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=24)
    parser.add_argument("--duration", type=float, default=30.0)
    parser.add_argument("--rounds", type=int, default=2)
    arguments = parser.parse_args()
    print("| case | parts, first run (s) | parts, others (s) | loop, median (s) | loop, least (s) | ms a step |")
    print("|---|---|---|---|---|---|")
    for case in ("case2", "case5"):
        first, *others = single(case, range(300, 301 + arguments.runs // 2), arguments.duration)
        parts, loops = zip(*others, strict=True)
        steps = round(10.0 * arguments.duration) + 1
        print(
            f"| {case} | {first[0]:.3f} | {median(parts):.3f} | {median(loops):.3f} | {min(loops):.3f} "
            f"| {1e3 * median(loops) / steps:.2f} |",
            flush=True,
        )
    print()
    with tempfile.TemporaryDirectory() as folder:
        for jobs in (1, 2):
            seconds(Path(folder, f"warm-{jobs}"), jobs, 4, 1.0)
        print("| round | runs/s, 1 worker | runs/s, 2 workers | ratio | a run, 1 worker (s) | a run, 2 workers (s) |")
        print("|---|---|---|---|---|---|")
        for number in range(arguments.rounds):
            found = [
                seconds(Path(folder, f"{number}-{jobs}"), jobs, arguments.runs, arguments.duration) for jobs in (1, 2)
            ]
            rates = [arguments.runs / wall for wall, _ in found]
            print(
                f"| {number + 1} | {rates[0]:.3f} | {rates[1]:.3f} | {rates[1] / rates[0]:.2f} "
                f"| {found[0][1]:.2f} | {found[1][1]:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
