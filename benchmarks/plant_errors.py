"""Closed loops of a vehicle that is not its model: mass, drag, thrust, lag and a force differ from what plans assume.

    python benchmarks/plant_errors.py sea2d --seeds 20 --out runs/plant
    python benchmarks/plant_errors.py case2 case5 --seeds 20 --duration 10 --out runs/plant_cases

One sweep a configuration, resumed where it stopped. Errors are means over the second half of a run, at sea from 60 s on
as in the other tables. At sea each factor on mass, added mass and drag comes with
thrust 10 % weak, a lag of 0.3 s that the follower knows of, and a force of the drag of 0.3 m/s of water (30 N in surge,
56 N in sway). A case has the factor 1.2 alone.
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
from gbt_ocp.experiments.config.yaml_dialect import parse

LAG = 0.3
"""Time constant in s of the thrusters, which the follower knows."""

FORCE = 40.0
"""Force in N on each horizontal axis, earth frame."""


def plants(configuration: str) -> dict[str, dict[str, Any]]:
    """Overrides by the name of a plant; the model itself comes first."""
    at_sea = configuration.startswith("sea")
    dimension = gbt.load_config(configuration).dimension
    force = [FORCE, FORCE, 0.0][:dimension]
    weak = {"plant.thrust": 0.9, "plant.lag_s": LAG, "plant.force": force, "vehicle.thrust_lag_s": LAG}
    more: dict[str, Any] = weak if at_sea else {}
    found: dict[str, dict[str, Any]] = {"model": {}}
    for factor in (1.05, 1.2, 1.5) if at_sea else (1.2,):
        scaled = {f"plant.{name}": factor for name in ("mass", "added_mass", "drag")}
        found[f"{factor:g}" + (", weak, lag, force" if at_sea else "")] = {**scaled, **more}
    return found


def line(name: list[str], rows: list[dict[str, Any]], exact: list[dict[str, Any]], error: str) -> str:
    """A row of the table; ``exact`` are the runs of the model with the same seeds."""
    found, known = (np.array([float(row[error]) for row in some]) for some in (rows, exact))
    cells = [*name, str(len(rows)), f"{found.mean():.3g} ({found.max():.3g})"]
    cells += [f"{found.mean() / known.mean():.2f}", f"{np.median(found) / np.median(known):.2f}"]
    cells.append(f"{np.median([float(row['off_plan_median']) for row in rows]):.2g}")
    cells.append(f"{max(float(row['off_plan_max']) for row in rows):.2g}")
    cells.append(f"{min(float(row['distance_min']) for row in rows):.2f}")
    cells.append(str(sum(int(row.get("steps_below_standoff") or 0) for row in rows)))
    cells.append(str(sum(row.get("lost") in (True, "True") for row in rows)))
    cells.append(f"{np.mean([float(row['solver_success_rate']) for row in rows]):.3f}")
    return "| " + " | ".join(cells) + " |"


HEAD = [
    "configuration", "plant", "runs", "error (worst)", "ratio of means", "of medians", "off plan, m: median", "max",
    "least range, m", "steps below standoff", "lost", "solved at first",
]  # fmt: skip


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("configurations", nargs="+")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--seed-from", type=int, default=0)
    parser.add_argument("--duration", type=float, default=120.0)
    parser.add_argument("--jobs", type=int)
    parser.add_argument("--set", dest="overrides", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    own: dict[str, Any] = {"vehicle.follow": "feedback", "duration_s": options.duration}
    for override in options.overrides:
        key, _, text = override.partition("=")
        own[key] = parse(text, override)[0]
    table = ["| " + " | ".join(HEAD) + " |", "|" + "---|" * len(HEAD)]
    for configuration in options.configurations:
        chosen, folder = plants(configuration), options.out / configuration
        known = (folder / "sweep.json").is_file()
        done = gbt.sweep(
            configuration, runs=options.seeds, seed_from=options.seed_from,
            entries=[{**own, **plant} for plant in chosen.values()], jobs=options.jobs,
            histories=False, progress=True, **{"resume" if known else "out": folder},
        )  # fmt: skip
        error = "relative_error" if configuration.startswith("sea") else "error_settled"
        groups = [done.rows[k * options.seeds : (k + 1) * options.seeds] for k in range(len(chosen))]
        for name, rows in zip(chosen, groups, strict=True):
            table.append(line([configuration, name], rows, groups[0], error))
    print("\n".join(table))


if __name__ == "__main__":
    main()
