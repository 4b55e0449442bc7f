"""Trackers at sea on recorded motions: closed loops over tracks and seeds, under the same guidance.

    python benchmarks/sea_recorded.py FOLDER --seeds 4 --out runs/sea_recorded
    python benchmarks/sea_recorded.py FOLDER --tracks boat_s13_jetboat --trackers shipped imm_ekf --seeds 2 --out DIR

FOLDER holds CSV files with the columns t,x,y (s, m). Each is slowed down in time, so that the mean speed is 1 m/s and
the shape of the path stays what it is, and takes the place of the target of `sea2d_speed`; sensor, guidance, planner
and limits are those of the configuration. Errors are means from 60 s on, in per cent of the range, now and 10 s ahead,
then the share of truth inside the 95 % ellipse at both times, and NEES over d. The last line has the mean errors of the
shipped tracker over the best of the others.
"""

from __future__ import annotations

import os

# The matrices are small: several BLAS threads a process only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from sea_closed_loop import MOTION_IN_VARYING_SPEED, OURS, RIVALS

import gbt_ocp as gbt
from gbt_ocp.typing import Array

CONFIGURATION = "sea2d_speed"

FORECAST_S = 21.0
"""Seconds of a track that the forecast needs after the end of a run."""

TRACKERS: dict[str, dict[str, Any]] = {
    "shipped": {},
    "motion_gp": OURS["motion_gp"] | MOTION_IN_VARYING_SPEED,
    "held_turn": OURS["held_turn"],
    "imm_ekf": {"tracker": RIVALS["imm_ekf"]},
    "ekf": {"tracker": RIVALS["ekf"]},
}  # fmt: skip
"""What is set over the configuration."""

NUMBERS = (
    ("relative_error", 100.0), ("relative_error_10s", 100.0), ("coverage_95", 100.0), ("coverage_95_10s", 100.0),
    ("nees_mean", 0.5), ("nees_mean_10s", 0.5),
)  # fmt: skip
HEAD = ["track", "tracker", "runs", "now, % of range", "+10 s, %", "inside 95 %", "inside 95 %, +10 s",
        "NEES over d", "+10 s", "samples below the standoff", "least range, m", "lost"]  # fmt: skip


def slowing(path: Path) -> tuple[float, float]:
    """Factor on time that makes the mean speed of a track 1 m/s, and how long it lasts then in s."""
    t, x, y = np.loadtxt(path, delimiter=",", skiprows=1, usecols=(0, 1, 2)).T
    speed = float(np.sum(np.hypot(np.diff(x), np.diff(y))) / (t[-1] - t[0]))
    return speed, speed * float(t[-1] - t[0])


def entry(tracker: str, path: Path, longest: float) -> dict[str, Any]:
    """Keys of the runs of a tracker on a track."""
    factor, lasts = slowing(path)
    shipped = gbt.load_config(CONFIGURATION).tracker
    found = {key: dict(value) if isinstance(value, dict) else value for key, value in TRACKERS[tracker].items()}
    if "tracker" in found:
        found["tracker"] |= {"forecast": shipped.forecast, "forecast_period_s": shipped.forecast_period_s}
    target = {"kind": "track", "path": str(path.resolve()), "time_scale": round(factor, 4), "start_m": [0.0, 0.0]}
    return {**found, "target": target, "duration_s": float(np.floor(min(longest, lasts - FORECAST_S)))}


def line(names: list[str], rows: list[dict[str, Any]]) -> str:
    """A row of the table."""
    cells = [*names, str(len(rows))]
    cells += [f"{factor * np.mean([float(row[key]) for row in rows]):.3g}" for key, factor in NUMBERS]
    cells.append(str(sum(int(row["steps_below_standoff"]) for row in rows)))
    cells.append(f"{min(float(row['distance_min']) for row in rows):.1f}")
    cells.append(str(sum(row["lost"] in (True, "True") for row in rows)))
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--tracks", nargs="+", help="names of files, without .csv; by default all")
    parser.add_argument("--trackers", nargs="+", default=list(TRACKERS), choices=list(TRACKERS))
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--seed-from", type=int, default=0)
    parser.add_argument("--duration", type=float, default=150.0, help="longest run in s")
    parser.add_argument("--jobs", type=int)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD), flush=True)
    every: dict[str, list[dict[str, Any]]] = {name: [] for name in arguments.trackers}
    for path in sorted(arguments.folder.glob("*.csv")):
        if arguments.tracks and path.stem not in arguments.tracks:
            continue
        folder = arguments.out / path.stem
        done = gbt.sweep(
            CONFIGURATION, runs=arguments.seeds, seed_from=arguments.seed_from,
            entries=[entry(name, path, arguments.duration) for name in arguments.trackers],
            jobs=arguments.jobs, histories=False, **{"resume" if (folder / "sweep.json").is_file() else "out": folder},
        )  # fmt: skip
        for number, name in enumerate(arguments.trackers):
            rows = [row for row in done.rows[number * arguments.seeds :][: arguments.seeds] if row["status"] == "done"]
            every[name] += rows
            print(line([path.stem, name], rows), flush=True)
    for name, rows in every.items():
        print(line(["all", name], rows))
    means: dict[str, Array] = {
        name: np.array([np.mean([float(row[key]) for row in rows]) for key, _ in NUMBERS[:2]])
        for name, rows in every.items()
    }
    if "shipped" in means and len(means) > 1:
        best = np.min([found for name, found in means.items() if name != "shipped"], axis=0)
        print(f"\nshipped over the best of the others: {means['shipped'][0] / best[0]:.2f} now, ", end="")
        print(f"{means['shipped'][1] / best[1]:.2f} ten seconds ahead")


if __name__ == "__main__":
    main()
