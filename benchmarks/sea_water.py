"""Water that moves, other vehicles, and setpoints at sea: each beside what it is compared with, seed by seed.

    python benchmarks/sea_water.py current vehicles setpoints --seeds 20 --duration 120 --out runs/sea_water

``current``: an unknown current of 0.5 m/s in a direction that the seed draws, beside still water. ``vehicles``: each
vehicle beside the Falcon after a boat of the same speed, in the plane and in space, and beside one that is no faster.
``setpoints``: an autopilot with a lag of 1 s beside thrust. The runs are written to a file in the folder, one line of
JSON each, and are not repeated. Errors are in per cent of the range from 60 s on. ``--jobs`` runs at a time; nothing
here is timed.
"""

from __future__ import annotations

import os

# The matrices are small: several BLAS threads a process only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import math
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import gbt_ocp as gbt

CURRENT, ESTIMATED = 0.5, 0.05
"""Speed of the water in m/s, and how near its estimate has to come."""

FROM_S = 60.0
"""From when on the current is to be known, in s."""

SLOW = {"target.speed": 0.3, "limits.range.target_speed_max": 0.6}
"""A boat that a BlueROV2, 0.91 m/s fast, can circle."""

HALF = {"target.speed": 0.5, "limits.range.target_speed_max": 1.0}
"""The boat of the shipped torpedoes."""

LAUV = {**HALF, "desired_bearing.target_speed": 0.5}
"""Of a torpedo. Slow vehicles turn by the clock, for which the speed of the boat counts."""

CAPPED = {**SLOW, "limits.speed": 0.7, "desired_bearing.target_speed": 0.3}
AS_TORPEDO = {**LAUV, "limits.speed": 1.95}
AS_VESSEL = {"limits.speed": 3.0}
"""The most that a Falcon may do so that it is no faster than another vehicle: it shows what is the speed's part."""

ROV = {"vehicle.parameters": "bluerov2_heavy", **CAPPED}

AUTOPILOT = {"command": "setpoint", "plant.autopilot_s": 1.0}


NO_FASTER = ", beside a Falcon no faster"


class Pair(NamedTuple):
    """A row: what is run, what it is compared with, and the largest ratio of errors that is asked."""

    name: str
    configuration: str
    changes: dict[str, Any]
    beside: dict[str, Any]
    asked: float
    drifts: bool = False


PAIRS = {
    "current": [Pair("sea2d, unknown current", "sea2d", {"vehicle.follow": "feedback"}, {}, 1.1, True)],
    "vehicles": [
        Pair("sea2d, BlueROV2", "sea2d", ROV, SLOW, 1.3),
        Pair("sea2d, BlueROV2" + NO_FASTER, "sea2d", ROV, CAPPED, 1.3),
        Pair("sea2d, torpedo", "sea2d", {"vehicle.model": "torpedo2d", **LAUV}, HALF, 1.3),
        Pair("sea2d, torpedo" + NO_FASTER, "sea2d", {"vehicle.model": "torpedo2d", **LAUV}, AS_TORPEDO, 1.3),
        Pair("sea2d, vessel", "sea2d", {"vehicle.model": "vessel"}, {}, 1.3),
        Pair("sea2d, vessel" + NO_FASTER, "sea2d", {"vehicle.model": "vessel"}, AS_VESSEL, 1.3),
        Pair("sea3d, BlueROV2", "sea3d", ROV, SLOW, 1.3),
        Pair("sea3d, BlueROV2" + NO_FASTER, "sea3d", ROV, CAPPED, 1.3),
        Pair("sea3d, torpedo", "sea3d", {"vehicle.model": "torpedo3d", **LAUV}, HALF, 1.3),
        Pair("sea3d, torpedo" + NO_FASTER, "sea3d", {"vehicle.model": "torpedo3d", **LAUV}, AS_TORPEDO, 1.3),
    ],
    "setpoints": [
        Pair("sea2d, Falcon, autopilot", "sea2d", AUTOPILOT, {}, 1.5),
        Pair("sea2d, BlueROV2, autopilot", "sea2d", {**ROV, **AUTOPILOT}, SLOW, 1.5),
        Pair("sea3d, Falcon, autopilot", "sea3d", AUTOPILOT, {}, 1.5),
        Pair("sea3d, BlueROV2, autopilot", "sea3d", {**ROV, **AUTOPILOT}, SLOW, 1.5),
    ],
}  # fmt: skip


def overrides(pair: Pair, seed: int, duration: float, *, beside: bool) -> dict[str, Any]:
    """Keys of a run."""
    keys = {"duration_s": duration, **(pair.beside if beside else pair.changes)}
    if pair.drifts:
        direction = np.random.default_rng([seed, 20]).uniform(-math.pi, math.pi)
        water = [CURRENT * math.cos(direction), CURRENT * math.sin(direction)]
        keys |= {"vehicle.follow": "feedback"}
        keys |= {} if beside else {"plant.current": water, "vehicle.current": "unknown"}
    return keys


def run(pair: Pair, seed: int, duration: float, beside: bool) -> dict[str, Any]:
    """One run in numbers."""
    keys = overrides(pair, seed, duration, beside=beside)
    result = gbt.run(pair.configuration, overrides=[f"{key}={json.dumps(keys[key])}" for key in keys], seed=seed)
    history, summary = result.history, result.summary
    names = (
        "relative_error", "relative_error_10s", "distance_min", "steps_below_standoff", "lost", "violation_max",
        "speed_ahead_min", "turn_radius_min_m", "power_mean_w", "thrust_reversals_per_min", "wall_s",
    )  # fmt: skip
    found = {key: summary.get(key) for key in names}
    body = history.vehicle_velocity[:, : history.dimension]
    found["speed_max"] = float(np.linalg.norm(body, axis=1).max())
    if pair.drifts and not beside:
        wrong = np.linalg.norm(history.current_estimate - history.current, axis=1)
        far = history.t[wrong > ESTIMATED]
        found["current_known_from_s"] = float(far[-1]) if far.size else 0.0
        found["current_error_late"] = float(wrong[history.t >= FROM_S].max(initial=0.0))
    return found


def tasks(groups: list[str], seeds: list[int]) -> Iterator[tuple[str, Pair, int, bool]]:
    """Each with a key of its own; what several rows are compared with is run once."""
    done = set()
    for group in groups:
        for pair in PAIRS[group]:
            for seed in seeds:
                for beside in (True, False):
                    key = json.dumps([pair.configuration, overrides(pair, seed, 0.0, beside=beside), seed])
                    if key not in done:
                        done.add(key)
                        yield key, pair, seed, beside


def line(pair: Pair, rows: list[dict[str, Any]], others: list[dict[str, Any]], columns: int) -> str:
    """A row of the table, with so many columns."""
    errors = 100.0 * np.array([[row["relative_error"], row["relative_error_10s"]] for row in rows], dtype=float)
    still = 100.0 * np.array([[row["relative_error"], row["relative_error_10s"]] for row in others], dtype=float)
    ratios = [np.mean(errors, 0) / np.mean(still, 0), np.median(errors, 0) / np.median(still, 0)]
    cells = [
        pair.name, len(rows),
        *(f"{mean:.2f} ({worst:.1f})" for mean, worst in zip(errors.mean(0), errors.max(0), strict=True)),
        *(f"{value:.2f}" for value in still.mean(0)), " / ".join(f"{ratio:.2f}" for ratio in ratios[0]),
        " / ".join(f"{ratio:.2f}" for ratio in ratios[1]), f"{pair.asked:g}",
        f"{min(row['distance_min'] for row in rows):.1f}", sum(row["steps_below_standoff"] for row in rows),
        sum(bool(row["lost"]) for row in rows), f"{max(row['violation_max'] or 0.0 for row in rows):.2g}",
        f"{max(row['speed_max'] for row in rows):.2f}",
        f"{np.mean([row['power_mean_w'] or np.nan for row in rows]):.0f}",
    ]  # fmt: skip
    if pair.drifts:
        late = max(row["current_error_late"] for row in rows)
        known = max(row["current_known_from_s"] for row in rows)
        cells.append(f"{late:.3f}; to {ESTIMATED:g} from {known:.0f} s at the latest")
    elif "torpedo" in pair.changes.get("vehicle.model", ""):
        slow = [row["speed_ahead_min"] for row in rows if row["speed_ahead_min"] is not None]
        tight = [row["turn_radius_min_m"] for row in rows if row["turn_radius_min_m"] is not None]
        cells.append(f"{min(slow, default=math.nan):.2f} m/s, {min(tight, default=math.nan):.2f} m")
    cells += [""] * (columns - len(cells))
    return "| " + " | ".join(map(str, cells)) + " |"


HEAD = (
    "runs", "seeds", "now, %: mean (worst)", "in 10 s, %", "beside it, now", "in 10 s", "ratio of means", "of medians",
    "asked", "least range, m", "samples below the standoff", "lost", "thrust beyond its limit",
    "most speed, m/s", "power, W",
)  # fmt: skip
LAST = {"current": ["error of the current, m/s"], "vehicles": ["least speed, radius"]}
"""A column of some tables: the error is that from 60 s on, speed ahead and radius of turns those of a torpedo."""


def main() -> None:
    """Run what is not known yet, and print the tables as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("groups", nargs="+", choices=[*PAIRS])
    parser.add_argument("--only", default="", help="rows whose name has this in it")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--seed-from", type=int, default=0)
    parser.add_argument("--duration", type=float, default=120.0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    for group, pairs in PAIRS.items():
        PAIRS[group] = [pair for pair in pairs if options.only in pair.name]
    seeds = list(range(options.seed_from, options.seed_from + options.seeds))
    options.out.mkdir(parents=True, exist_ok=True)
    file = options.out / f"runs_{options.duration:g}s.jsonl"
    known = {}
    if file.is_file():
        known = dict(map(json.loads, file.read_text(encoding="utf-8").splitlines()))
    wanted = list(tasks(options.groups, seeds))
    with ProcessPoolExecutor(options.jobs) as pool:
        running = {
            pool.submit(run, pair, seed, options.duration, beside): key
            for key, pair, seed, beside in wanted if key not in known
        }  # fmt: skip
        try:
            for number, finished in enumerate(as_completed(running), start=1):
                key = running[finished]
                known[key] = finished.result()
                with file.open("a", encoding="utf-8") as out:
                    out.write(json.dumps([key, known[key]]) + "\n")
                print(f"{number} of {len(running)}: {known[key]['wall_s']:.0f} s", flush=True)
        except BaseException:
            pool.shutdown(cancel_futures=True)  # otherwise hundreds of runs are made before an error is seen
            raise
    for group in options.groups:
        head = [*HEAD, *LAST.get(group, [])]
        print(f"\n{group}\n\n| " + " | ".join(head) + " |\n|" + "---|" * len(head))
        for pair in PAIRS[group]:
            rows, others = (
                [
                    known[json.dumps([pair.configuration, overrides(pair, seed, 0.0, beside=beside), seed])]
                    for seed in seeds
                ]
                for beside in (False, True)
            )
            print(line(pair, rows, others, len(head)))


if __name__ == "__main__":
    main()
