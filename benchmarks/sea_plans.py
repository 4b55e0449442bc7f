"""Closed loops at sea over seeds: what the planner answered and how fast, what it cost, and how good the track is.

    python benchmarks/sea_plans.py sea2d sea3d sea2d_speed sea3d_speed --seeds 20 --duration 120 --out runs/sea_plans
    python benchmarks/sea_plans.py sea2d sea3d --effort 0 0.1 0.3 --seeds 20 --duration 120 --out runs/effort

One sweep a configuration, resumed where it stopped. Errors are means over the settled part of a run (from 60 s on in
two minutes) and over the seeds, in per cent of the range, now and 10 s ahead. A first solve is answered if it is solved
or gives up a limit by name; what is not is followed by a fallback. Times are those of the planner, of all plans of all
seeds; they mean something on a machine that has nothing else to do, with ``--jobs 1``.
"""

from __future__ import annotations

import os

# The matrices are small: several BLAS threads a process only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import gbt_ocp as gbt
from gbt_ocp.experiments.config.yaml_dialect import parse

TRACK = [
    "configuration", "runs", "now, % of range: mean (worst)", "in 10 s, %", "NEES over d", "inside 95 %",
    "NEES over d in 10 s", "inside 95 % in 10 s", "least range, m", "samples below the standoff", "lost",
]  # fmt: skip
PLANS = [
    "configuration", "plans", "first solve answered, %", "of these a limit given up", "fallbacks: shifted, cold, "
    "unfinished, braking", "iterations: mean (median, 99 %)", "median ms", "99 % ms", "most ms",
]  # fmt: skip
EFFORT = ["configuration", "power, W", "thrust reversals a minute"]


def mean(rows: Sequence[dict[str, Any]], key: str) -> float:
    """Mean of a column over the runs."""
    return float(np.mean([float(row[key]) for row in rows]))


def track_line(name: str, rows: Sequence[dict[str, Any]], dimension: int) -> list[str]:
    """A row of the first table."""
    now = 100.0 * np.array([float(row["relative_error"]) for row in rows])
    return [
        name, str(len(rows)), f"{now.mean():.2f} ({now.max():.1f})", f"{100.0 * mean(rows, 'relative_error_10s'):.2f}",
        f"{mean(rows, 'nees_mean') / dimension:.2f}", f"{100.0 * mean(rows, 'coverage_95'):.1f}",
        f"{mean(rows, 'nees_mean_10s') / dimension:.2f}", f"{100.0 * mean(rows, 'coverage_95_10s'):.1f}",
        f"{min(float(row['distance_min']) for row in rows):.1f}",
        str(sum(int(row["steps_below_standoff"]) for row in rows)), str(sum(bool(row["lost"]) for row in rows)),
    ]  # fmt: skip


def plans_line(name: str, done: gbt.Sweep, rows: Sequence[dict[str, Any]]) -> list[str]:
    """A row of the second table."""
    status = np.concatenate([np.asarray(done.arrays([row], "solver_status")[0], dtype=str) for row in rows])
    times = np.concatenate([done.arrays([row], "solver_time")[0] for row in rows])
    spent = np.concatenate([done.arrays([row], "solver_iterations")[0] for row in rows])
    planned = status != ""
    solved, gave = (int((status == word).sum()) for word in ("solved", "given up"))
    fallbacks = [str(sum(int(row[f"fallbacks.{word}"]) for row in rows)) for word in FALLBACKS]
    took = 1e3 * times[planned]
    answered = f"{100.0 * (solved + gave) / planned.sum():.2f}"
    spread = [f"{value:.1f}" for value in (np.median(took), np.percentile(took, 99), took.max())]
    middle, late = np.percentile(spent[planned], [50, 99])
    iterations = f"{spent[planned].mean():.1f} ({middle:.0f}, {late:.0f})"
    return [name, str(int(planned.sum())), answered, str(gave), ", ".join(fallbacks), iterations, *spread]


FALLBACKS = ("shifted", "cold", "unfinished", "braking")


def main() -> None:
    """Print the tables as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("configurations", nargs="+")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--seed-from", type=int, default=0)
    parser.add_argument("--duration", type=float, default=120.0)
    parser.add_argument("--effort", type=float, nargs="+", help="values of planner.effort; by default the shipped one")
    parser.add_argument("--jobs", type=int)
    parser.add_argument("--set", dest="overrides", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    own: dict[str, Any] = {"duration_s": options.duration}
    for override in options.overrides:
        key, _, text = override.partition("=")
        own[key] = parse(text, override)[0]
    lines: dict[str, list[list[str]]] = {"Track": [], "Plans": [], "Effort": []}
    for configuration in options.configurations:
        entries = [{**own, "planner.effort": value} for value in options.effort or ()] or [own]
        folder = options.out / configuration
        known = (folder / "sweep.json").is_file()
        done = gbt.sweep(
            configuration, runs=options.seeds, seed_from=options.seed_from, entries=entries, jobs=options.jobs,
            progress=True, **{"resume" if known else "out": folder},
        )  # fmt: skip
        dimension = gbt.load_config(configuration).dimension
        for number, entry in enumerate(entries):
            rows = [row for row in done.rows[number * options.seeds :][: options.seeds] if row["status"] == "done"]
            name = configuration + (f", effort {entry['planner.effort']:g}" if options.effort else "")
            lines["Track"].append(track_line(name, rows, dimension))
            lines["Plans"].append(plans_line(name, done, rows))
            reversals = f"{mean(rows, 'thrust_reversals_per_min'):.0f}"
            lines["Effort"].append([name, f"{mean(rows, 'power_mean_w'):.0f}", reversals])
    for title, head in (("Track", TRACK), ("Plans", PLANS), ("Effort", EFFORT)):
        print(f"\n{title}\n\n| " + " | ".join(head) + " |\n|" + "---|" * len(head))
        for cells in lines[title]:
            print("| " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
