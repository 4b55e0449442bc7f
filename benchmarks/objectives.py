"""The planner's objectives beside each other in closed loop.

    python benchmarks/objectives.py --seeds 2 --duration 12
    python benchmarks/objectives.py --config sea2d --seeds 3 --duration 120 --jobs 2

Each row is the mean over the seeds of whole runs as ``gbt-ocp run`` makes them, hard limits, compiled, so
that iterations and times compare. Runs begin with moves across the line of sight, as at sea: the first estimate is at
the vehicle, where all but the similarity are content. At sea the errors are shares of the range, from 60 s on or over
the second half.
"""

from __future__ import annotations

import argparse
import tempfile

import numpy as np

import gbt_ocp as gbt
from gbt_ocp.guidance.information import CRITERIA

OBJECTIVES = ["similarity", *(name if name == "condition_number" else f"fisher_{name}" for name in CRITERIA)]
OBJECTIVES += ["motion_logdet", "motion_trace", "posterior_variance"]
FIRST_MOVES = "guidance={kind: planner, startup_deviation: 0.25, startup_leg_s: 1}"
"""Of the six cases, which have none; those at sea have their own."""

SOLVER = ("solver_success_rate", "solver_iterations_mean", "solver_time_median_ms")
NEAR = ("similarity_mean_second_half", "error_settled", "distance_median", *SOLVER)
AT_SEA = ("relative_error", "relative_error_10s", "distance_min", "distance_median", "steps_below_standoff", *SOLVER)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--config", default="case3")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--duration", type=float, default=15.0)
    parser.add_argument("--jobs", type=int)
    chosen = parser.parse_args()
    loaded = gbt.load_config(chosen.config)
    columns, first = (AT_SEA, []) if "range" in loaded.limits.hard else (NEAR, [FIRST_MOVES])
    # the process that knows its variance after a planned bearing is the one of exact bearings
    objectives = OBJECTIVES if loaded.tracker.kind == "gp" else OBJECTIVES[:-1]
    change = [*first, f"duration_s={chosen.duration}", "planner.formulation=hard", "planner.solver=compiled"]
    print(f"| objective | {' | '.join(columns)} |\n|{'---|' * (len(columns) + 1)}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for objective in objectives:
            done = gbt.sweep(
                chosen.config, runs=chosen.seeds, overrides=[*change, f"planner.objective={objective}"],
                jobs=chosen.jobs, out=f"{folder}/{objective}", histories=False,
            )  # fmt: skip
            values = [[row[name] for name in columns] for row in done.rows if row["status"] == "done"]
            means = np.mean(np.array(values, dtype=float), axis=0)
            lost = f" ({len(done.failed)} failed)" if done.failed else ""
            print(f"| {objective} | {' | '.join(f'{value:.3g}' for value in means)} |{lost}", flush=True)


if __name__ == "__main__":
    main()
