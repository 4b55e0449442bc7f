"""What the filters' errors depend on that the paper does not give: the noise of their motion models.

    python benchmarks/filter_noise.py --seeds 2

Every row is one density q, given as `tracker.process_noise` in m²/s³ and, with interacting models, as
`tracker.jerk_noise` in m²/s⁵ too; everything else as in tables 2 and 3 (`gbt-ocp reproduce table2`), 30 s. A cell is
the mean whole-run error in metres, with the paper's beside the name.
"""

from __future__ import annotations

import os

# The matrices are small: several BLAS threads a process only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse

import numpy as np

import gbt_ocp as gbt
from gbt_ocp.studies.paper.grid_search import method_variant, shipped
from gbt_ocp.studies.paper.methods import FULL_POSITIONS, PAPER, PLANE, SPACE, methods

FILTERS = ("PLKF", "IMM-PLKF", FULL_POSITIONS)
DENSITIES = (1.0e-8, 1.0e-6, 1.0e-4, 1.0e-2, 1.0)


def error(name: str, case: str, density: float, seeds: int, turns: bool) -> float:
    """Mean whole-run error over the seeds in metres, with the parameters that are shipped but for the noise."""
    method = next(method for method in methods(2 if case in PLANE else 3) if method.name == name)
    noise = {"tracker.process_noise": density}
    if name != "PLKF":
        noise["tracker.jerk_noise"] = density
        if not turns:
            noise["tracker.turn_rate_max"] = 1.0e-3
    made = method_variant(method, case, {**shipped()[name, case], **noise}).configuration
    runs = [gbt.run(made.model_copy(update={"seed": seed})) for seed in range(seeds)]
    return float(np.mean([run.summary["error_mean"] for run in runs]))


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--cases", default=",".join([*PLANE, *SPACE]))
    parser.add_argument("--without-turns", action="store_true", help="interacting models that cannot turn")
    arguments = parser.parse_args()
    print(f"| case | filter | the paper | {' | '.join(f'{density:.0e}' for density in DENSITIES)} |")
    print(f"|---|---|---{'|---' * len(DENSITIES)}|")
    for case in arguments.cases.split(","):
        for name in FILTERS:
            errors = [error(name, case, q, arguments.seeds, not arguments.without_turns) for q in DENSITIES]
            found = [f"{value:.3f}" for value in errors]
            print(f"| {case} | {name} | {PAPER[name][case][0]:.3f} | {' | '.join(found)} |", flush=True)


if __name__ == "__main__":
    main()
