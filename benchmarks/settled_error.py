"""What decides the settled error of a closed loop without noise: the forecast's far end, rounding, and excitation.

    OPENBLAS_NUM_THREADS=1 python benchmarks/settled_error.py --seeds 3

Cases 2 and 5 as shipped but compiled with hard limits, 30 s, scored from 2 s on; errors in m. Beside the tracker, the
same Gaussian process is given the exact positions of the target in its window, with the tracker's length scale and
nuggets that stand for rounding. Then the desired bearing is swung a little, which the smooth process does not expect.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from typing import Any

import numpy as np

import gbt_ocp as gbt
from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.simulation.loop import simulate

SETTLING, SECONDS, PERIOD = 2.0, 30.0, 0.1
NUGGETS = (1e-9, 1e-11, 1e-14)
SWING_S = 0.3
SWINGS = (0.0, 0.02, 0.05)
"""Amplitudes in rad, and the period in s, of the swing about the vertical."""


class Swung:
    """A desired bearing that is swung about the vertical."""

    def __init__(self, desired: Any, amplitude: float) -> None:
        self._desired, self._amplitude = desired, amplitude

    def __getattr__(self, name: str) -> Any:
        return getattr(self._desired, name)

    def __call__(self, times: Any, *rest: Any, **more: Any) -> Any:
        """The bearings, turned."""
        found = np.array(self._desired(times, *rest, **more))
        angle = self._amplitude * np.sin(2.0 * np.pi * np.asarray(times, dtype=float) / SWING_S)
        x, y = found[..., 0].copy(), found[..., 1].copy()
        found[..., 0] = np.cos(angle) * x - np.sin(angle) * y
        found[..., 1] = np.sin(angle) * x + np.cos(angle) * y
        return found


def run(case: str, seed: int, swing: float) -> tuple[dict[str, Any], Any]:
    """Arrays of a closed loop, and its target."""
    loop, start = build_loop(gbt.load_config(case, ["planner.solver=compiled", "planner.formulation=hard"], seed=seed))
    guidance: Any = loop.guidance
    if swing > 0.0:
        guidance.desired = Swung(guidance.desired, swing)
    return simulate(loop, start, SECONDS).arrays, loop.target


def with_positions(arrays: dict[str, Any], target: Any, window: int, nugget: float) -> Any:
    """Errors ``(K, n)`` of the process that is given exact positions, at the times of the tracker's forecasts."""
    times, places, ahead = arrays["t"], arrays["target"], PERIOD * np.arange(arrays["error"].shape[1])
    found = []
    for k in np.flatnonzero(times >= SETTLING):
        known, scale = slice(k - window + 1, k + 1), arrays["length_scale"][k]
        asked = times[k] + ahead

        def kernel(a: Any, b: Any, scale: float = scale) -> Any:
            return np.exp(-0.5 * ((a[:, None] - b) / scale) ** 2)

        gram = kernel(times[known], times[known]) + nugget * np.eye(window)
        shift = np.linalg.solve(gram, places[known] - places[k])
        mean = places[k] + kernel(asked, times[known]) @ shift
        found.append(np.linalg.norm(mean - np.array([target.position(time) for time in asked]), axis=1))
    return np.array(found)


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    seeds = range(parser.parse_args().seeds)
    print("| case | what the process is given | all steps, m | now, m | last step, m |\n|---|---|---|---|---|")
    for case in ("case2", "case5"):
        window = gbt.load_config(case).tracker.window
        rows: dict[str, list[Any]] = {}
        for seed in seeds:
            for swing in SWINGS:
                arrays, target = run(case, seed, swing)
                swung = f", desired bearing swung by {swing} rad" if swing else ""
                errors = arrays["error"][arrays["t"] >= SETTLING]
                rows.setdefault(f"bearings{swung}", []).append(errors.mean(axis=0))
                for nugget in NUGGETS if not swing else ():
                    errors = with_positions(arrays, target, window, nugget)
                    rows.setdefault(f"exact positions, nugget {nugget:.0e}", []).append(errors.mean(axis=0))
        for name, each in rows.items():
            steps = np.mean(each, axis=0)
            print(f"| {case} | {name} | {steps.mean():.4f} | {steps[0]:.5f} | {steps[-1]:.4f} |", flush=True)


if __name__ == "__main__":
    main()
