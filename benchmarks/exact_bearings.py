"""What settings of the tracker of exact bearings do in closed loop: nugget, corners of the target, stray bearings.

    OPENBLAS_NUM_THREADS=1 python benchmarks/exact_bearings.py --seeds 3

Preset ``default``, hard limits, compiled solver. The nugget: settled errors of 30 s, also with noise in the bearings.
Corners: the vehicle of case 2 behind targets whose velocity jumps, 30 s, the worst sample of all seeds from 2.5 s on,
and of those more than 0.8 s after a corner. Strays: noise of 1 degree and a bearing off by 20 degrees every 4 s, 16 s.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from dataclasses import replace
from functools import partial

import numpy as np

import gbt_ocp as gbt
from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.models.targets import MotionTarget
from gbt_ocp.simulation.loop import simulate
from gbt_ocp.typing import Array

HARD = ("planner.solver=compiled", "planner.formulation=hard")
NUGGETS = {
    "1e-10": "tracker.nugget=1e-10",
    "1e-13": "tracker.nugget=1e-13",
    "tuned": "tracker.nugget=tuned",
}
NOISY = "tracker.noise=null"
ROWS = {
    "case 1": ("case1",),
    "case 2": ("case2",),
    "case 3": ("case3",),
    "case 5": ("case5",),
    "case 6": ("case6",),
    "case 2, bearing noise 1e-6°": ("case2", "sensor.noise_deg=1e-6", NOISY),
    "case 2, bearing noise 0.01°": ("case2", "sensor.noise_deg=0.01", NOISY),
}
SETTLING, DURATION, PAST = 2.5, 30.0, 0.8
STRAYS = ("sensor.noise_deg=1", "sensor.outlier_deg=20", "sensor.outlier_every_s=4", "duration_s=16")
TAILS = {"Gaussian (the default)": (), "`tracker.noise.tails=4`": ("tracker.noise.tails=4",)}


def settled(name: str, *overrides: str, seeds: int) -> list[float]:
    """Settled error in m of each seed."""
    runs = (gbt.run(name, overrides=[*HARD, *overrides], seed=seed) for seed in range(seeds))
    return [run.summary["error_settled"] for run in runs]


def legs(headings: Array, lasting: float) -> tuple[MotionTarget, Array]:
    """A target that moves with each velocity in turn for so many seconds, and the times at which it changes."""
    times = lasting * np.arange(1 + int(np.ceil((DURATION + 2.0) / lasting)))
    moves = [lasting * headings[k % len(headings)] for k in range(len(times) - 1)]
    places = np.vstack([np.zeros(2), np.cumsum(moves, axis=0)])
    return MotionTarget(tuple(partial(np.interp, xp=times, fp=axis) for axis in places.T)), times[1:]


TARGETS = {
    "square of 90° corners every 4 m, 0.8 m/s": (0.8 * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]]), 5.0),
    "stop and go, 0.8 m/s, 4 s each": (np.array([[0.64, 0.48], [0.0, 0.0]]), 4.0),
    "sprint of 1.6 m/s and drift of 0.2 m/s, 3 s each": (np.array([[1.6, 0.0], [0.2, 0.0]]), 3.0),
}


def cornered(headings: Array, lasting: float, seeds: int) -> tuple[float, float]:
    """The largest error of the present position in m after it has settled, and of samples well past a corner."""
    target, corners = legs(headings, lasting)
    worst, past = 0.0, 0.0
    for seed in range(seeds):
        loop, start = build_loop(gbt.load_config("case2", [*HARD, f"duration_s={DURATION}"], seed=seed))
        arrays = simulate(replace(loop, target=target), start, DURATION).arrays
        error, times = arrays["error"][:, 0], arrays["t"]
        before = np.append(-np.inf, corners)
        since = times - before[np.searchsorted(corners, times + 1e-9)]
        counts = times > SETTLING
        worst = max(worst, float(error[counts].max()))
        past = max(past, float(error[counts & (since > PAST)].max()))
    return worst, past


def main() -> None:
    """Print the tables as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    seeds = parser.parse_args().seeds
    print(f"Nugget\n\n| settled error, m | {' | '.join(NUGGETS)} |\n|---{'|---' * len(NUGGETS)}|", flush=True)
    for title, (name, *overrides) in ROWS.items():
        found = [settled(name, *overrides, nugget, seeds=seeds) for nugget in NUGGETS.values()]
        print(f"| {title} | {' | '.join(f'{np.mean(each):.2g}' for each in found)} |", flush=True)
    print("\nCorners\n\n| target | largest error, m | later than 0.8 s after a corner, m |\n|---|---|---|", flush=True)
    for title, (headings, lasting) in TARGETS.items():
        worst, past = cornered(headings, lasting, seeds)
        print(f"| {title} | {worst:.2g} | {past:.2g} |", flush=True)
    print("\nStrays\n\n| settled error, m: mean (worst) | case 3 | case 6 |\n|---|---|---|", flush=True)
    for title, overrides in TAILS.items():
        found = [settled(name, *STRAYS, *overrides, seeds=seeds) for name in ("case3", "case6")]
        print(f"| {title} | {' | '.join(f'{np.mean(each):.2g} ({max(each):.2g})' for each in found)} |", flush=True)


if __name__ == "__main__":
    main()
