"""Plans in single precision beside those in double: what its settings should be, and what it costs.

    OPENBLAS_NUM_THREADS=1 python benchmarks/single_precision.py --seeds 60

For each problem two folders of ``gbt-ocp codegen``, one in each precision, with a prefix each, in one program
(single_precision.c). It follows the plans in double precision along closed loops of random forecasts and makes each
plan a second time in single precision, from the same state and the same previous plan. The problem is not convex:
where two plans are equally good, the last bit decides between them, and they are metres apart. So the objective counts,
not only the distance.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from gbt_ocp.experiments.build.loop import build_problem, build_vehicle
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.ocp import Planner, write_c

PROBLEMS = {
    "case 2, hard": ("case2", ["planner.formulation=hard", "planner.pieces=10"]),
    "case 2, penalty": ("case2", ["planner.pieces=10"]),
    "case 5, hard": ("case5", ["planner.formulation=hard"]),
    "sea2d": ("sea2d", []),
}
SETTINGS = [
    ("none", 0.0),
    ("tolerance", 1e-3),
    ("tolerance", 1e-2),
    ("tolerance", 3e-5),
    ("gap", 1e-4),
    ("feasibility", 1e-5),
]
FLAGS = ("-std=c99", "-O2", "-fno-math-errno", "-ffp-contract=off")


def program(name: str, overrides: list[str], folder: Path) -> Path:
    """The program of a problem with both of its planners."""
    configuration = load_config(name, overrides=overrides)
    problem = build_problem(configuration, build_vehicle(configuration))
    planner = Planner(problem, "compiled")
    sources, includes = [], []
    for precision in ("double", "single"):
        written = write_c(planner, folder / precision, prefix=f"{precision}_")
        sources += sorted(map(str, (written / "src").glob("*.c")))
        includes.append(f"-I{written / 'src'}")
    own = Path(__file__).with_suffix(".c")
    command = ["cc", *FLAGS, "-DSINGLE_GBT_SINGLE", *includes, str(own), *sources, "-lm", "-o", str(folder / "program")]
    subprocess.run(command, check=True)
    return folder / "program"


def row(lines: str) -> list[str]:
    """Shares of plans found, iterations, distances and losses."""
    table = np.array([line.split() for line in lines.splitlines()], dtype=float)
    wanted, found = table[:, :3], table[:, 3:6]
    loss, broken, distance = table[:, 6] - table[:, 7], table[:, 8], table[:, 9]
    return [
        f"{100 * np.mean(wanted[:, 1] == 0):.2f}, {100 * np.mean(found[:, 1] == 0):.2f}",
        f"{wanted[:, 2].mean():.1f}, {found[:, 2].mean():.1f}",
        f"{wanted[:, 2].max():.0f}, {found[:, 2].max():.0f}",
        f"{np.median(distance):.2g}",
        f"{np.quantile(distance, 0.95):.2g}",
        f"{np.quantile(loss, 0.95):.2g}",
        f"{loss.mean():.2g}",
        f"{broken[found[:, 1] == 0].max(initial=0.0):.2g}",
    ]


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=60, help="closed loops")
    parser.add_argument("--steps", type=int, default=60, help="of each")
    arguments = parser.parse_args()
    heads = [
        "problem",
        "setting",
        "% planned at first: double, single",
        "iterations, mean",
        "most",
        "distance of endpoints, median (m)",
        "95 %",
        "loss of objective, 95 %",
        "mean",
        "first piece breaks limits by",
    ]
    print("| " + " | ".join(heads) + " |\n|" + "---|" * len(heads))
    for title, (name, overrides) in PROBLEMS.items():
        with tempfile.TemporaryDirectory() as scratch:
            run = program(name, overrides, Path(scratch))
            for setting, value in SETTINGS:
                command = [str(run), str(arguments.seeds), str(arguments.steps), setting, repr(value)]
                shown = subprocess.run(command, check=True, capture_output=True, text=True).stdout
                chosen = "as generated" if setting == "none" else f"{setting} {value:g}"
                print("| " + " | ".join([title, chosen, *row(shown)]) + " |", flush=True)


if __name__ == "__main__":
    main()
