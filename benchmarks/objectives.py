"""The planner's objectives beside each other in closed loop: python benchmarks/objectives.py [--seeds 3].

Each row is the mean over the seeds of whole runs as ``gbt-ocp run`` makes them, hard limits, IPOPT for all, so that
iterations and times compare.
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np

from gbt_ocp.experiments.run import run
from gbt_ocp.ocp.information import CRITERIA

OBJECTIVES = ["similarity", *(name if name == "condition_number" else f"fisher_{name}" for name in CRITERIA)]
OBJECTIVES.append("posterior_variance")
COLUMNS = (
    "similarity_mean_second_half",
    "error_settled",
    "distance_median",
    "solver_success_rate",
    "solver_iterations_mean",
    "solver_time_median_ms",
)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--config", default="case3")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--duration", type=float, default=15.0)
    chosen = parser.parse_args()
    warnings.simplefilter("ignore", RuntimeWarning)
    print(f"| objective | {' | '.join(COLUMNS)} |\n|{'---|' * (len(COLUMNS) + 1)}", flush=True)
    for objective in OBJECTIVES:
        rows = []
        for seed in range(chosen.seeds):
            change = [f"duration_s={chosen.duration}", "planner.formulation=hard", "planner.solver=ipopt"]
            result = run(chosen.config, overrides=[*change, f"planner.objective={objective}"], seed=seed)
            rows.append([result.summary[name] for name in COLUMNS])
        means = np.mean(np.array(rows, dtype=float), axis=0)
        print(f"| {objective} | {' | '.join(f'{value:.3g}' for value in means)} |", flush=True)


if __name__ == "__main__":
    main()
