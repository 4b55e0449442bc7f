"""Closed-loop figures of the six cases: the tables of docs/results.md.

    python benchmarks/closed_loop.py --seeds 10 --jobs 2 --out results.md [--only NAME ...]

Every row is the mean over the seeds of the summaries of whole runs, as ``gbt-ocp run`` writes them.
"""

from __future__ import annotations

import os

# The matrices are small: several BLAS threads a process only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MKL_NUM_THREADS", "1")

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

import gbt_ocp as gbt

CASES = ("case1", "case2", "case3", "case4", "case5", "case6")
PAPER = dict(zip(CASES, (0.026, 0.059, 0.052, 0.014, 0.053, 0.035), strict=True))
PRIOR = "tracker.prior={{position: {origin}, std: 3.0}}"

SETTINGS: dict[str, list[str]] = {
    "paper, hard, IPOPT": ["preset=paper", "planner.formulation=hard", "planner.solver=ipopt"],
    "paper without a pull, hard, IPOPT": [
        "preset=paper",
        "planner.formulation=hard",
        "planner.solver=ipopt",
        "planner.range_pull=0",
    ],
    "paper with 10 pieces and no pull, hard, IPOPT": [
        "preset=paper",
        "planner.formulation=hard",
        "planner.solver=ipopt",
        "planner.pieces=10",
        "planner.range_pull=0",
    ],
    "default, hard, IPOPT": ["planner.formulation=hard", "planner.solver=ipopt"],
    "default, penalty, IPOPT": ["planner.formulation=penalty", "planner.solver=ipopt"],
    "default with prior, hard, IPOPT": ["planner.formulation=hard", "planner.solver=ipopt", PRIOR],
    "default with prior, hard, compiled": ["planner.formulation=hard", "planner.solver=compiled", PRIOR],
    "default, hard, compiled": ["planner.formulation=hard", "planner.solver=compiled"],
    "default, penalty, compiled": ["planner.formulation=penalty", "planner.solver=compiled"],
    "default with 10 pieces, hard, compiled": [
        "planner.formulation=hard",
        "planner.solver=compiled",
        "planner.pieces=10",
    ],
}


def one_run(job: tuple[str, list[str], int]) -> dict[str, object]:
    """Summary of one run."""
    case, overrides, seed = job
    origin = "[0, 0]" if case in CASES[:3] else "[0, 0, 0]"
    written = [text.format(origin=origin) if "{" in text else text for text in overrides]
    return gbt.run(case, overrides=written, seed=seed).summary


def row(case: str, summaries: list[dict[str, object]]) -> str:
    """One line of the table."""

    def column(key: str) -> np.ndarray:
        return np.array([np.nan if s[key] is None else s[key] for s in summaries], dtype=float)

    settled, steps = column("error_settled"), int(column("steps").sum()) + len(summaries)
    fallbacks = sum(sum(s["fallbacks"].values()) for s in summaries)  # type: ignore[attr-defined]
    tightened = sum(s["retries"]["tightened"] for s in summaries)  # type: ignore[index]
    unsolved = round(float(((1.0 - column("solver_success_rate")) * (steps / len(summaries))).sum()))
    cells = [
        case[-1],
        f"{settled.mean():.5f}",
        f"{np.median(settled):.5f}",
        f"{settled.max():.5f}",
        f"{column('error_mean').mean():.4f}",
        f"{PAPER[case]:.3f}",
        f"{column('distance_max_after_10s').max():.2f}",
        f"{column('distance_median').mean():.2f}",
        f"{column('similarity_second_half').min():.3f}",
        f"{column('violation_max').max():.0e}",
        f"{unsolved}/{steps}",
        f"{fallbacks}",
        f"{tightened}",
        f"{column('solver_iterations_mean').mean():.1f}",
        f"{np.median(column('solver_time_median_ms')):.2f}",
        f"{np.median(column('tracker_time_median_ms')):.2f}",
    ]
    return "| " + " | ".join(cells) + " |"


COLUMNS = (
    "case",
    "settled mean (m)",
    "median seed",
    "worst seed",
    "whole run (m)",
    "paper (m)",
    "largest distance after 10 s (m)",
    "median distance (m)",
    "least similarity, 2nd half",
    "violation",
    "unsolved steps",
    "fallbacks",
    "tightened",
    "iterations",
    "planner (ms)",
    "tracker (ms)",
)
HEADER = f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}"


def main() -> None:
    """Run the table and print it as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--cases", default=",".join(CASES))
    parser.add_argument("--only", nargs="+", choices=SETTINGS, default=list(SETTINGS))
    parser.add_argument("--out", type=Path, help="write the table and, beside it, all summaries as JSON")
    arguments = parser.parse_args()
    lines: list[str] = []
    everything: dict[str, dict[str, list[dict[str, object]]]] = {}
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for name in arguments.only:
            lines += ["", f"**{name}** (`{' '.join(SETTINGS[name])}`)", "", HEADER]
            print("\n".join(lines[-4:]), flush=True)
            for case in arguments.cases.split(","):
                jobs = [(case, SETTINGS[name], seed) for seed in range(arguments.seeds)]
                summaries = list(pool.map(one_run, jobs))
                everything.setdefault(name, {})[case] = summaries
                lines.append(row(case, summaries))
                print(lines[-1], flush=True)
    if arguments.out is not None:
        arguments.out.write_text("\n".join(lines[1:]) + "\n", encoding="utf-8")
        arguments.out.with_suffix(".json").write_text(json.dumps(everything, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
