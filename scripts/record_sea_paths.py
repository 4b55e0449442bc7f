"""Record the own paths and targets of the scenarios at sea of ``gbt-ocp benchmark``.

    python scripts/record_sea_paths.py --out gbt_ocp/studies/scenarios/sea_paths.npz --runs 4

Closed loops of the configurations as they are shipped, with seeds that no table uses. Positions are kept each second in
whole millimetres, so that a later change of the guidance changes no scenario.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import gbt_ocp
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.files import whole_file

CONFIGURATIONS = ("sea2d", "sea2d_speed", "sea3d", "sea3d_speed")
FIRST_SEED = 7000
EVERY_S = 1.0


def main() -> None:
    """Record what is missing; the file is written after each run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--runs", type=int, default=4)
    given = parser.parse_args()
    found: dict[str, np.ndarray] = {}
    if given.out.is_file():
        with np.load(given.out) as there:
            found = {name: there[name] for name in there.files}
    for run in range(given.runs):
        for name in CONFIGURATIONS:
            if len(found.get(f"{name}_own", ())) > run:
                continue
            history = gbt_ocp.run(load_config(name, seed=FIRST_SEED + run)).history
            step = round(EVERY_S / (history.t[1] - history.t[0]))
            paths = {"own": history.vehicle_pose[:, : history.dimension], "target": history.target}
            for kind, path in paths.items():
                whole = np.rint(1000.0 * path[::step]).astype(np.int32)[None]
                key = f"{name}_{kind}"
                found[key] = np.concatenate([found[key], whole]) if key in found else whole
            with whole_file(given.out) as temporary, temporary.open("wb") as file:
                np.savez_compressed(file, **found)
            print(name, FIRST_SEED + run, flush=True)


if __name__ == "__main__":
    main()
