"""Recorded tracks, scaled to the vehicle: the table of docs/results.md.

    python benchmarks/recorded_tracks.py FOLDER --seeds 3

FOLDER holds CSV files with the columns t,x,y (s, m). Each track is scaled in length so that its top speed is at most
1.5 m/s, and put to start at (3, 0); preset default, hard limits, IPOPT, 30 s.
"""

from __future__ import annotations

import os

# The matrices are small: several BLAS threads a process only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from pathlib import Path

import numpy as np

import gbt_ocp as gbt

TOP_SPEED = 1.5


def length_scale(path: Path) -> float:
    """Factor on length that brings the first 35 s of a track to the top speed; 1 for a slower one."""
    t, x, y = np.loadtxt(path, delimiter=",", skiprows=1, usecols=(0, 1, 2)).T
    used = t <= t[0] + 35.0
    speed = np.hypot(np.gradient(x[used], t[used]), np.gradient(y[used], t[used])).max()
    return min(1.0, float(np.floor(1e4 * TOP_SPEED / speed) / 1e4))


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", type=int, default=3)
    arguments = parser.parse_args()
    print("| track | factor on length | `error_settled`, by seed | `error_mean` | violation | unsolved steps |")
    print("|---|---|---|---|---|---|")
    for path in sorted(arguments.folder.glob("*.csv")):
        scale = length_scale(path)
        target = f"target={{kind: track, path: {path.resolve()}, length_scale: {scale}, start_m: [3.0, 0.0]}}"
        overrides = ["planner.formulation=hard", "planner.solver=ipopt", target]
        runs = [gbt.run("recorded", overrides=overrides, seed=seed) for seed in range(arguments.seeds)]
        settled = ", ".join(f"{run.summary['error_settled']:.4f}" for run in runs)
        mean = np.mean([run.summary["error_mean"] for run in runs])
        worst = max(run.summary["violation_max"] for run in runs)
        unsolved = sum(int(np.sum(run.history.solver_status != "solved")) for run in runs)
        print(f"| {path.stem} | {scale:.4g} | {settled} | {mean:.3f} | {worst:.0f} | {unsolved} |", flush=True)


if __name__ == "__main__":
    main()
