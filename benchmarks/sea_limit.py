"""The tracker of closed loops at sea beside particles under the exact law of the target, on the same bearings.

    python benchmarks/sea_limit.py sea2d sea2d_speed sea3d sea3d_speed --seeds 6 --out runs/sea_limit

Each run is closed by the configuration as shipped; then its bearings and own positions go to the particles, which know
the sensor's deviation, the law by which the target turns and changes its speed, and its median speed. With enough
particles no tracker can be better in the mean; where the speed is constant there are never enough, and their error is
only a bound from above on the limit. Both are asked each second from 60 s on, for now and 10 s ahead. Errors are in per
cent of the range. Where the particles lose the target, as they often do in space, a run says nothing of the limit: such
runs are counted and left out. Runs are written to a file in the folder, one line of JSON each, and are not repeated.
"""

from __future__ import annotations

import os

# The matrices are small: several BLAS threads a process only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

import gbt_ocp as gbt
from gbt_ocp.simulation.track_summary import AHEAD_S, TRACK_SETTLING_S
from gbt_ocp.studies.scenarios.at_sea import SEA
from gbt_ocp.studies.scenarios.particles import LawParticleFilter
from gbt_ocp.tracking.priors import LogNormal

LAWS = {scenario.name: scenario.law for scenario in SEA}

BIN_S = 0.5
"""Width in s of bins of bearings that count as one."""

RANGE = LogNormal(50.0, 0.8)
"""What the particles know of the first range in m."""


LOST = 0.2
"""Mean error of the particles over the range above which they have lost the target."""


def run(name: str, seed: int, duration: float, count: int) -> dict[str, Any]:
    """One closed loop, and the particles on its bearings: mean errors now and ahead, over the range."""
    configuration = gbt.load_config(name, [f"duration_s={duration}"], seed=seed)
    history, law = gbt.run(configuration).history, LAWS[name]
    assert law is not None
    d, times = configuration.dimension, history.t
    particles = LawParticleFilter(
        law,
        d,
        count=count,
        bearing_std=math.radians(configuration.sensor.noise_deg),
        range=RANGE,
        bin_width=BIN_S,
        rng=np.random.default_rng([seed, 31]),
    )
    own, target = history.vehicle_pose[:, :d], history.target
    second, ahead = round(1.0 / (times[1] - times[0])), round(AHEAD_S / configuration.tracker.forecast_period_s)
    off: list[list[float]] = []
    for k, time in enumerate(times):
        if history.detected[k]:
            particles.update(float(time), history.bearing[k], own[k])
        later = k + second * round(AHEAD_S)
        if k % second or time < TRACK_SETTLING_S or later >= len(times):
            continue
        said = particles.predict([time, time + AHEAD_S]).mean
        far = np.linalg.norm(target[k] - own[k])
        missed = np.linalg.norm(said - target[[k, later]], axis=1)
        off.append([*(history.error[k, [0, ahead]] / far), *(missed / far)])
    tracker_now, tracker_ahead, limit_now, limit_ahead = np.mean(off, axis=0)
    return {
        "name": name,
        "seed": seed,
        "tracker": [tracker_now, tracker_ahead],
        "limit": [limit_now, limit_ahead],
    }


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("configurations", nargs="+", choices=sorted(LAWS))
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--duration", type=float, default=300.0)
    parser.add_argument("--particles", type=int, default=40_000)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    kept = options.out / f"limit_{options.duration:g}_{options.particles}.jsonl"
    rows = [json.loads(line) for line in kept.read_text().splitlines()] if kept.is_file() else []
    have = {(row["name"], row["seed"]) for row in rows}
    for seed in range(options.seeds):
        for name in options.configurations:
            if (name, seed) not in have:
                rows.append(run(name, seed, options.duration, options.particles))
                with kept.open("a") as file:
                    file.write(json.dumps(rows[-1]) + "\n")
    print("| configuration | runs | left out | tracker, now / +10 s, % | exact law | ratio now | in 10 s |")
    print("|---|---|---|---|---|---|---|")
    for name in options.configurations:
        every = [row for row in rows if row["name"] == name and row["seed"] < options.seeds]
        of = [row for row in every if row["limit"][0] < LOST]
        ours, limit = (100.0 * np.mean([row[key] for row in of], axis=0) for key in ("tracker", "limit"))
        both = (f"{now:.2f} / {later:.2f}" for now, later in (ours, limit))
        cells = [*both, *(f"{ratio:.2f}" for ratio in ours / limit)]
        print(f"| {name} | {len(of)} | {len(every) - len(of)} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
