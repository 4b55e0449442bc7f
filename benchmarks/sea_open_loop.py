"""Trackers of noisy bearings at sea in open loop: the observer circles the true target, whatever the tracker says.

    python benchmarks/sea_open_loop.py sea2d sea2d_speed sea3d sea3d_speed --trackers mixture ekf --out FILE
    python benchmarks/sea_open_loop.py sea2d --trackers shipped --set tracker.window_s=90 --seeds 10

Target, noise and missed bearings are those of the configuration; the observer goes round the target with 0.1 rad/s at
30 m, in space on the cone of the desired bearings. Scored every 4 s from 60 s on, now and 10 s ahead: error in per cent
of the range, normalised squared error (NEES, ideally d), and the share of truth inside the 95 % ellipse (ellipsoid in
space); then the worst mean of a run. Times are the processor time of a bearing with which the tracker estimates again,
forecast of 20 s included. Runs that stand in the file of `--out` are not repeated.
"""

from __future__ import annotations

import os

# The matrices are small: several BLAS threads a process only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from scipy.stats import chi2
from sea_closed_loop import OURS, RIVALS

from gbt_ocp.experiments.build.loop import Streams, build_sensor, build_target
from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.config.schema import Configuration

RANGE, TURN = 30.0, 0.1
SETTLED, EVERY, AHEAD = 60.0, 4.0, 10.0

TRACKERS: dict[str, list[str]] = {
    "shipped": [],
    "no memory": ["tracker.memory=null"],
    "gp": [
        "tracker={kind: gp, noise: {bin_s: 1.5, kernel: velocity_matern32, scale: {median: 1.0},"
        " length_scale: {median_s: 20.0}, range: {median_m: 50.0}}}"
    ],
    **{name: [f"{key}={value}" for key, value in keys.items()] for name, keys in OURS.items()},
    **{name: [f"tracker={json.dumps(keys)}"] for name, keys in RIVALS.items()},
}
"""What is set over the configuration; `gp` is the process on velocity."""

CLUTTER = ["sensor.outlier_deg=20", "sensor.outlier_every_s=2"]
"""One bearing in twenty is off by 20 degrees."""


def observer(target: Any, times: Any, seed: int) -> Any:
    """Own positions ``(K, d)`` around the target's in metres."""
    rng = np.random.default_rng([seed, 1])
    phase = rng.uniform(-np.pi, np.pi) + rng.choice([-1.0, 1.0]) * TURN * times
    circle = np.stack([np.cos(phase), np.sin(phase)], axis=-1)
    if target.shape[1] == 3:
        circle = np.column_stack([np.sqrt(2.0 / 3.0) * circle, np.full(len(times), np.sqrt(1.0 / 3.0))])
    return target - RANGE * circle


def run(setting: Configuration) -> dict[str, Any]:
    """Errors over range ``(K, 2)``, NEES ``(K, 2)``, and seconds of the estimates of one run."""
    seed = setting.seed
    target, sensor, rng = build_target(setting), build_sensor(setting), Streams.of(seed).sensor
    times = sensor.period * np.arange(round(setting.duration_s / sensor.period) + 1)
    truth = target.position(
        np.append(times, times[-1] + sensor.period * np.arange(1, round(AHEAD / sensor.period) + 1))
    )
    own = observer(truth[: len(times)], times, seed)
    tracker = build_tracker(setting.tracker, own[0], build_sensor(setting))
    step, lead = round(EVERY / sensor.period), round(AHEAD / sensor.period)
    errors, squares, spent = [], [], []
    for k, time in enumerate(times):
        bearing = sensor.measure(k, truth[k], own[k], rng)
        began = process_time()
        if bearing is not None:
            tracker.update(float(time), bearing, own[k])
        tracker.predict(time + np.arange(1.0, 21.0))
        spent.append(process_time() - began)
        if time < SETTLED - 1e-9 or k % step:
            continue
        said = tracker.predict([time, time + AHEAD])
        off = said.mean - truth[[k, k + lead]]
        # how far it is then from where the observer would be, which keeps its distance
        errors.append((np.linalg.norm(off, axis=1) / RANGE).tolist())
        squares.append([float(e @ np.linalg.solve(c, e)) for e, c in zip(off, said.covariance, strict=True)])
    spent = spent[round(SETTLED / sensor.period) :]
    costly = [one for one in spent if one > 0.25 * max(np.quantile(spent, 0.99), 1e-9)]
    return {"errors": errors, "squares": squares, "estimates_s": costly, "all_s": float(np.sum(spent)),
            "bearings": len(spent), "resets": getattr(tracker, "restarts", 0)}  # fmt: skip


def row(configuration: str, name: str, found: list[dict[str, Any]], dimension: int) -> str:
    """A row of the table."""
    errors = 100.0 * np.concatenate([one["errors"] for one in found])
    squares = np.concatenate([one["squares"] for one in found])
    inside = 100.0 * np.mean(squares < chi2.ppf(0.95, dimension), axis=0)
    runs = 100.0 * np.array([np.mean(one["errors"], axis=0) for one in found])
    estimate = 1e3 * np.median(np.concatenate([one["estimates_s"] for one in found]))
    each = 1e3 * sum(one["all_s"] for one in found) / sum(one["bearings"] for one in found)
    cells = [configuration, name, str(len(found))]
    for at in (0, 1):
        cells += [f"{errors[:, at].mean():.1f} ({runs[:, at].max():.1f})", f"{squares[:, at].mean():.2f}"]
        cells.append(f"{inside[at]:.1f}")
    cells += [f"{estimate:.1f}", f"{each:.1f}", str(sum(one["resets"] for one in found))]
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("configurations", nargs="+")
    parser.add_argument("--trackers", nargs="+", default=["shipped"], choices=list(TRACKERS))
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="over every tracker")
    parser.add_argument("--clutter", action="store_true", help="one bearing in twenty is off by 20 degrees")
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--seed-from", type=int, default=0)
    parser.add_argument("--duration", type=float, default=300.0)
    parser.add_argument("--out", type=Path, help="file of the finished runs")
    arguments = parser.parse_args()
    done: dict[str, Any] = {}
    if arguments.out is not None and arguments.out.is_file():
        done = {one["key"]: one["found"] for one in map(json.loads, arguments.out.read_text().splitlines())}
    head = ["configuration", "tracker", "runs", "now, % of range (worst run)", "NEES", "inside 95 %"]
    head += ["+10 s, % (worst)", "NEES, +10 s", "inside 95 %, +10 s", "ms an estimate", "ms a bearing", "resets"]
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head), flush=True)
    for configuration in arguments.configurations:
        dimension = load_config(configuration).dimension
        for name in arguments.trackers:
            over = [*TRACKERS[name], *(CLUTTER if arguments.clutter else []), *arguments.set]
            found = []
            for seed in range(arguments.seed_from, arguments.seed_from + arguments.seeds):
                ahead = ["tracker.forecast=20", "tracker.forecast_period_s=1.0", f"duration_s={arguments.duration}"]
                setting = load_config(configuration, [*over, *ahead], seed=seed)
                means = setting.to_mapping()
                key = json.dumps([means[part] for part in ("target", "sensor", "tracker", "seed", "duration_s")])
                if key not in done:
                    done[key] = run(setting)
                    if arguments.out is not None:
                        with arguments.out.open("a") as file:
                            file.write(json.dumps({"key": key, "found": done[key]}) + "\n")
                found.append(done[key])
            said = ", ".join([name, *arguments.set, *(["outliers"] if arguments.clutter else [])])
            print(row(configuration, said, found, dimension), flush=True)


if __name__ == "__main__":
    main()
