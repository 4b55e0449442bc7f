"""Closed-loop figures of the six cases: the tables of docs/results.md.

    python benchmarks/closed_loop.py --seeds 10 --jobs 2 --out results.md [--only NAME ...]

Every row is the mean over the seeds of the summaries of whole runs, as ``gbt-ocp run`` writes them. Beside ``--out``
are the summaries (``results.json``; what it holds is not run again) and the tables that the page quotes
(``results_tables.md``).
"""

from __future__ import annotations

import os

# The matrices are small: several BLAS threads a process only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MKL_NUM_THREADS", "1")

import argparse
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

import gbt_ocp as gbt

CASES = ("case1", "case2", "case3", "case4", "case5", "case6")
PAPER = dict(zip(CASES, (0.026, 0.059, 0.052, 0.014, 0.053, 0.035), strict=True))
PULLS = (0.0, 0.005, 0.01, 0.02, 0.05)
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
    **{
        f"paper with a pull of {pull:g}, hard, compiled": [
            *("preset=paper", "planner.formulation=hard", "planner.solver=compiled", f"planner.range_pull={pull:g}"),
        ]
        for pull in PULLS
    },
}

ALLOWED = {
    "paper": dict(zip(CASES, (0.040, 0.070, 0.030, 0.045, 0.050, 0.025), strict=True)),
    "default": dict(zip(CASES, (0.002, 0.045, 0.010, 0.002, 0.030, 0.006), strict=True)),
    "whole run": dict(zip(CASES, (0.03, 0.08, 0.05, 0.03, 0.09, 0.05), strict=True)),
}
"""What was asked before anything was measured, in m."""


def one_run(job: tuple[str, list[str], int]) -> dict[str, Any]:
    """Summary of one run."""
    case, overrides, seed = job
    origin = "[0, 0]" if case in CASES[:3] else "[0, 0, 0]"
    written = [text.format(origin=origin) if "{" in text else text for text in overrides]
    return gbt.run(case, overrides=written, seed=seed).summary


Summaries = dict[str, dict[str, list[dict[str, Any]]]]
"""Of each run, by setting and case."""


def numbers(runs: list[dict[str, Any]], key: str) -> np.ndarray:
    """A number of each run."""
    return np.array([np.nan if one[key] is None else one[key] for one in runs], dtype=float)


def answers(runs: list[dict[str, Any]]) -> tuple[int, int, int, int]:
    """Steps whose first solve failed, all steps, fallbacks, and plans that were tightened."""
    steps = numbers(runs, "steps") + 1
    unsolved = round(float(((1.0 - numbers(runs, "solver_success_rate")) * steps).sum()))
    fallbacks = sum(sum(one["fallbacks"].values()) for one in runs)
    return unsolved, int(steps.sum()), fallbacks, sum(one["retries"]["tightened"] for one in runs)


def row(case: str, summaries: list[dict[str, Any]]) -> str:
    """One line of the table."""

    def column(key: str) -> np.ndarray:
        return numbers(summaries, key)

    settled, (unsolved, steps, fallbacks, tightened) = column("error_settled"), answers(summaries)
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


def table(title: str, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of Markdown."""
    lines = ["", title, "", f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
    return lines + [f"| {' | '.join(cells)} |" for cells in rows]


def by_case(
    found: Summaries, names: Mapping[str, str], key: str, shown: Callable[[np.ndarray], str]
) -> list[list[str]]:
    """A row a case, with a cell for each of these settings."""
    return [[case[-1], *(shown(numbers(found[name][case], key)) for name in names.values())] for case in CASES]


def mean(digits: int) -> Callable[[np.ndarray], str]:
    """Of the seeds."""
    return lambda values: f"{values.mean():.{digits}g}"


def largest(values: np.ndarray) -> str:
    """Of the seeds."""
    return f"{values.max():.2f}"


def least(values: np.ndarray) -> str:
    """Of the seeds."""
    return f"{values.min():.3f}"


def thrust_row(name: str, dimension: int, found: Summaries) -> list[str]:
    """Limits, solver and times of a setting in the plane or in space."""
    runs = [one for case in CASES if (case < "case4") == (dimension == 2) for one in found[name][case]]
    unsolved, steps, fallbacks, tightened = answers(runs)
    cells = [f"{numbers(runs, 'violation_max').max():.2g}", f"{unsolved} of {steps:,}", str(fallbacks), str(tightened)]
    cells.append(f"{numbers(runs, 'solver_iterations_mean').mean():.1f}")
    cells += [f"{np.median(numbers(runs, f'{part}_time_median_ms')):.2f}" for part in ("solver", "tracker")]
    return [name, str(dimension), *cells]


def page_tables(found: Summaries) -> list[str]:
    """The tables that the page quotes."""
    settled, paper, default = "error_settled", "paper, hard, IPOPT", "default, hard, IPOPT"
    free, prior = "paper without a pull, hard, IPOPT", "default with prior, hard"
    rows = []
    for case in CASES:
        cells = [case[-1], f"{PAPER[case]:.3f}", f"{ALLOWED['paper'][case]:.3f}"]
        for name in (paper, free, default):
            if name == default:
                cells.append(f"{ALLOWED['default'][case]:.3f}")
            values = numbers(found[name][case], settled)
            cells += [f"{values.mean():.3g}", f"{values.max():.3g}"]
        rows.append(cells)
    heads = ["case", "the paper", "allowed, `paper`", "`paper`", "worst seed", "`paper` without a pull", "worst seed"]
    lines = table("Settled", [*heads, "allowed, `default`", "`default`", "worst seed"], rows)
    names = {"`default`": default, "`paper`": paper, "without a pull": free}
    names["ten pieces, without a pull"] = "paper with 10 pieces and no pull, hard, IPOPT"
    lines += table("Largest distance", ["case", *names], by_case(found, names, "distance_max_after_10s", largest))
    lines += table("Ten pieces", ["case", *names], by_case(found, names, settled, mean(3)))
    pulls = {f"{pull:g}": f"paper with a pull of {pull:g}, hard, compiled" for pull in PULLS}
    heads = ["`planner.range_pull`", *(f"case {case[-1]}" for case in CASES)]
    shown = by_case(found, pulls, settled, lambda values: f"{values.mean():.4f} ({values.max():.3f})")
    cells_of = list(zip(*(row[1:] for row in shown), strict=True))
    lines += table("Range pull", heads, [[pull, *cells] for pull, cells in zip(pulls, cells_of, strict=True)])
    names = {"with prior, IPOPT": f"{prior}, IPOPT", "with prior, compiled": f"{prior}, compiled"}
    names["without prior, IPOPT"] = default
    whole = by_case(found, names, "error_mean", mean(3))
    rows = [
        [row[0], f"{PAPER[case]:.3f}", f"{ALLOWED['whole run'][case]:.2f}", *row[1:]]
        for case, row in zip(CASES, whole, strict=True)
    ]
    lines += table("Whole run", ["case", "the paper", "allowed", *names], rows)
    shown_settings = [name for name in found if "prior" not in name and "pull of" not in name]
    heads = ["setting", "d", "violation", "unsolved steps", "fallbacks", "tightened", "iterations", "planner (ms)"]
    both = [thrust_row(name, dimension, found) for name in shown_settings for dimension in (2, 3)]
    lines += table("Thrust", [*heads, "tracker (ms)"], both)
    names = {
        f"{form}, {solver}": f"default, {form}, {solver}"
        for form in ("hard", "penalty")
        for solver in ("IPOPT", "compiled")
    }
    lines += table("Settled compiled", ["case", *names], by_case(found, names, settled, mean(3)))
    names = {"5 pieces": "default, hard, compiled", "10 pieces": "default with 10 pieces, hard, compiled"}
    return lines + table("Orbit", ["case", *names], by_case(found, names, "similarity_second_half", least))


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
    kept: Path | None = None if arguments.out is None else arguments.out.with_suffix(".json")
    found: Summaries = {}
    if kept is not None and kept.is_file():
        found = json.loads(kept.read_text(encoding="utf-8"))
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for name in arguments.only:
            lines += ["", f"**{name}** (`{' '.join(SETTINGS[name])}`)", "", HEADER]
            print("\n".join(lines[-4:]), flush=True)
            for case in arguments.cases.split(","):
                known = found.setdefault(name, {}).setdefault(case, [])
                jobs = [(case, SETTINGS[name], seed) for seed in range(len(known), arguments.seeds)]
                known += pool.map(one_run, jobs)
                lines.append(row(case, known[: arguments.seeds]))
                print(lines[-1], flush=True)
                if kept is not None:
                    kept.write_text(json.dumps(found, indent=1), encoding="utf-8")
    if arguments.out is not None:
        arguments.out.write_text("\n".join(lines[1:]) + "\n", encoding="utf-8")
        if found.keys() >= set(SETTINGS):
            tables = arguments.out.with_name(f"{arguments.out.stem}_tables.md")
            tables.write_text("\n".join(page_tables(found)) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
