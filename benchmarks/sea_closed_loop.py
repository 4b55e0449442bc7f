"""The trackers of noisy bearings under the same guidance at sea: closed loops over seeds.

    python benchmarks/sea_closed_loop.py sea2d sea3d sea2d_speed sea3d_speed --seeds 20 --out runs/sea
    python benchmarks/sea_closed_loop.py sea2d --trackers mixture --starts 10 30 100 --seeds 20 --out runs/starts

One sweep a configuration, kept in the folder and resumed where it stopped; then a table of means over the seeds,
from 60 s on, and of the worst seed. The recursive filters are given the same as the motion GP: a range of 50 m give or
take as much, a speed of about 1 m/s, the bearing's true deviation. Their process noise was searched on seeds that the
table does not use (`--search`).
"""

from __future__ import annotations

import os

# The matrices are small: several BLAS threads a process only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from pathlib import Path
from typing import Any

import numpy as np

import gbt_ocp as gbt

_TOLD = {"initial_range_m": 50.0, "bearing_std_deg": 1.0}
_RANGE = {"initial_range_std_m": 50.0, "initial_speed_std": 1.0}
RIVALS: dict[str, dict[str, Any]] = {
    "ekf": {"kind": "ekf", **_TOLD, **_RANGE, "process_noise": 1.0e-2},
    # a mode lasts ten seconds on the average, at ten bearings a second
    "imm_ekf": {
        "kind": "imm_ekf", **_TOLD, **_RANGE, "process_noise": 1.0e-5, "jerk_noise": 1.0e-4,
        "stay_probability": 0.99, "turn_rate_max": 0.1,
    },
    "plkf, compensated": {
        "kind": "plkf", **_TOLD, "initial_variance": 1.0, "process_noise": 1.0e-3, "bias_compensated": True,
    },
}  # fmt: skip
"""Trackers beside the one that the configuration names."""

SEARCHED = {
    "ekf": {"process_noise": [1e-3, 3e-3, 1e-2, 3e-2]},
    "imm_ekf": {"process_noise": [1e-5, 1e-4, 1e-3], "jerk_noise": [1e-5, 1e-4, 1e-3]},
    "plkf, compensated": {"process_noise": [3e-4, 1e-3, 3e-3]},
}

OURS: dict[str, dict[str, Any]] = {
    "mixture": {},
    "motion_gp": {"tracker.kind": "motion_gp"},
    "held_turn": {"tracker.kind": "held_turn", "tracker.noise.std_deg": 1.15},
}
"""The tracker that the configurations name, and two others with the same priors."""

MOTION_IN_VARYING_SPEED = {"tracker.noise.std_deg": 1.5, "tracker.speed_change_std": [0.1, 0.2, 0.4]}
"""Of motion_gp where the speed varies: more noise than measured, since its model is the larger error."""

NUMBERS = {
    "relative_error": ("now, % of range", 100.0),
    "relative_error_10s": ("+10 s, %", 100.0),
    "nees_mean": ("NEES", 1.0),
    "coverage_95": ("inside 95 %", 100.0),
    "nees_mean_10s": ("NEES, +10 s", 1.0),
    "coverage_95_10s": ("inside 95 %, +10 s", 100.0),
    "solver_time_median_ms": ("planner ms", 1.0),
}
WORST = {"relative_error": max, "relative_error_10s": max, "coverage_95": min, "coverage_95_10s": min}


def overrides(configuration: str, tracker: str, **changes: Any) -> dict[str, Any]:
    """Keys of a run: the tracker as shipped, or a rival with the same forecast."""
    if tracker in OURS:
        varying = tracker == "motion_gp" and configuration.endswith("_speed")
        return OURS[tracker] | (MOTION_IN_VARYING_SPEED if varying else {})
    shipped = gbt.load_config(configuration).tracker
    same = {"forecast": shipped.forecast, "forecast_period_s": shipped.forecast_period_s}
    return {"tracker": {**RIVALS[tracker], **same, **changes}}


def line(name: list[str], rows: list[dict[str, Any]]) -> str:
    """A row of the table."""
    cells = [*name, str(len(rows))]
    for key, (_, factor) in NUMBERS.items():
        # a covariance that overflowed has no number: such a run counts as it is, not as nothing
        values = [factor * float(row[key]) if row.get(key) not in (None, "") else np.inf for row in rows]
        cells.append(f"{np.mean(values):.3g}" + (f" ({WORST[key](values):.3g})" if key in WORST else ""))
    cells.append(str(sum(row["lost"] in (True, "True") for row in rows)))
    cells.append(str(sum(int(row["steps_below_standoff"]) for row in rows)))
    cells.append(f"{min(float(row['distance_min']) for row in rows):.1f}")
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("configurations", nargs="+")
    parser.add_argument("--trackers", nargs="+", default=["mixture", "motion_gp", *RIVALS], choices=[*OURS, *RIVALS])
    parser.add_argument("--starts", nargs="+", type=float, help="ranges in m to start from")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--duration", type=float)
    parser.add_argument("--jobs", type=int)
    parser.add_argument("--search", action="store_true", help="the filters' noise, on seeds from 100 on")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    head = ["configuration", "tracker", "runs", *(text for text, _ in NUMBERS.values()), "lost", "steps below standoff"]
    print("| " + " | ".join([*head, "least range, m"]) + " |\n|" + "---|" * (len(head) + 1))
    for configuration in arguments.configurations:
        entries, names = [], []
        for tracker in arguments.trackers:
            grid: list[dict[str, float]] = [{}]
            if arguments.search:
                for key, values in SEARCHED.get(tracker, {}).items():
                    grid = [{**point, key: value} for point in grid for value in values]
            for point in grid:
                for start in arguments.starts or [None]:
                    entry = overrides(configuration, tracker, **point)
                    if start is not None:
                        entry["vehicle.start.range_m"] = start
                    if arguments.duration is not None:
                        entry["duration_s"] = arguments.duration
                    entries.append(entry)
                    notes = [*(f"{key} {value:g}" for key, value in point.items())]
                    names.append([configuration + (f", {start:g} m" if start else ""), ", ".join([tracker, *notes])])
        folder = arguments.out / configuration
        known = (folder / "sweep.json").is_file()
        done = gbt.sweep(
            configuration, runs=arguments.seeds, seed_from=100 if arguments.search else 0, entries=entries,
            jobs=arguments.jobs, histories=False, progress=True, **{"resume" if known else "out": folder},
        )  # fmt: skip
        for number, name in enumerate(names):
            rows = done.rows[number * arguments.seeds : (number + 1) * arguments.seeds]
            failed = sum(row["status"] == "failed" for row in rows)
            whole = [row for row in rows if row["status"] == "done"]
            print(line(name, whole) + (f" {failed} failed" if failed else ""), flush=True)


if __name__ == "__main__":
    main()
