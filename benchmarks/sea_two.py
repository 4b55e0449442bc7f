"""Two vehicles and one target: the first 30 s beside one vehicle, with packets lost or few, seed by seed.

    python benchmarks/sea_two.py --seeds 20 --out runs/sea_two

Runs of ``sea2d_two`` and, with the same random draws, of one vehicle. Errors of the position now are in metres, means
over the vehicles, from 0, 10 and 20 s on for 10 s each; those of the second half in per cent of the range. A vehicle
that has heard nothing knows what one alone knows, and one that missed packets no more than one that missed none. So the
errors with all packets and those of one alone say what is the least with any packet where some are lost: of a vehicle
that is sent one in 10 s with a loss q, a share q^k has heard none of the first k. The runs are written to a file in the
folder, one line of JSON each, and are not repeated. Nothing here is timed.
"""

from __future__ import annotations

import os

# The matrices are small: several BLAS threads a process only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import gbt_ocp as gbt

PARTS = (0.0, 10.0, 20.0)
"""Where the three parts of a run begin, in s."""

DURATION = 30.0


class Row(NamedTuple):
    """What is run, and what its error is compared with: another row, and the largest ratio that is asked."""

    name: str
    configuration: str
    changes: dict[str, Any]
    beside: str = ""
    asked: float = float("nan")


ALONE, SHIPPED, SLOWLY, LOSSY = "one vehicle", "two", "two, a packet in 10 s", "two, a packet in 10 s, half lost"

ROWS = (
    Row(ALONE, "sea2d", {"tracker.kind": "motion_gp"}),
    Row("one vehicle, tracker of sea2d", "sea2d", {}),
    Row(SHIPPED, "sea2d_two", {}, ALONE, 1.0 / 3.0),
    Row("two, half of the packets lost", "sea2d_two", {"link.loss": 0.5}, SHIPPED, 1.5),
    Row(SLOWLY, "sea2d_two", {"link.period_s": 10.0}, ALONE, 1.0 / 3.0),
    Row(LOSSY, "sea2d_two", {"link.period_s": 10.0, "link.loss": 0.5}, SLOWLY, 1.5),
)


def run(row: Row, seed: int) -> dict[str, Any]:
    """One run in numbers, means over its vehicles."""
    keys = {"duration_s": DURATION, **row.changes}
    first = gbt.run(row.configuration, overrides=[f"{key}={json.dumps(keys[key])}" for key in keys], seed=seed)
    all_of_it = [first, *first.others.values()]
    parts = [
        [
            float(one.history.error[(one.history.t >= begin) & (one.history.t < begin + 10.0), 0].mean())
            for begin in PARTS
        ]
        for one in all_of_it
    ]
    summaries = [one.summary for one in all_of_it]
    return {
        "parts": np.mean(parts, axis=0).tolist(),
        **{key: float(np.mean([one[key] for one in summaries])) for key in ("relative_error", "relative_error_10s")},
        "error_start": float(np.mean([one["error_start"] for one in summaries])),
        "distance_min": min(one["distance_min"] for one in summaries),
        "steps_below_standoff": sum(one["steps_below_standoff"] for one in summaries),
        "separation_min": first.summary.get("team", {}).get("separation_min", float("nan")),
    }


def mean(rows: list[dict[str, Any]], key: str) -> Any:
    """Mean of a number, or of several, over the runs."""
    return np.mean([one[key] for one in rows], axis=0)


def least_with_losses(heard: Any, alone: Any, loss: float) -> float:
    """The bound of the module for the first 30 s, in m, from the errors ``(3,)`` with all packets and of one alone."""
    nothing = loss ** np.arange(1, len(PARTS) + 1)
    return float(np.mean(nothing * alone + (1.0 - nothing) * heard))


def line(row: Row, found: dict[str, list[dict[str, Any]]]) -> str:
    """A row of the table."""
    rows = found[row.name]
    starts = [one["error_start"] for one in rows]
    ratio = asked = ""
    if row.beside:
        ratio = f"{mean(rows, 'error_start') / mean(found[row.beside], 'error_start'):.2f}"
        asked = f"{row.asked:.2f}"
    cells = [
        row.name, len(rows), f"{np.mean(starts):.2f} ({np.max(starts):.1f})",
        ", ".join(f"{value:.2f}" for value in mean(rows, "parts")), row.beside, ratio, asked,
        f"{100.0 * mean(rows, 'relative_error'):.2f} / {100.0 * mean(rows, 'relative_error_10s'):.1f}",
        f"{min(one['distance_min'] for one in rows):.1f}", sum(one["steps_below_standoff"] for one in rows),
        f"{min(one['separation_min'] for one in rows):.1f}" if row.configuration == "sea2d_two" else "",
    ]  # fmt: skip
    return "| " + " | ".join(map(str, cells)) + " |"


HEAD = (
    "runs", "seeds", "first 30 s, m: mean (worst)", "0 to 10, 10 to 20, 20 to 30 s", "beside", "ratio", "asked",
    "second half, now / in 10 s, %", "least range, m", "samples below the standoff", "least separation, m",
)  # fmt: skip


def main() -> None:
    """Run what is not known yet, and print the tables as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--seed-from", type=int, default=0)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    file = options.out / "runs.jsonl"
    known: dict[str, dict[str, Any]] = {}
    if file.is_file():
        known = dict(map(json.loads, file.read_text(encoding="utf-8").splitlines()))
    found: dict[str, list[dict[str, Any]]] = {row.name: [] for row in ROWS}
    for seed in range(options.seed_from, options.seed_from + options.seeds):
        for row in ROWS:
            key = json.dumps([row.configuration, row.changes, seed])
            if key not in known:
                known[key] = run(row, seed)
                with file.open("a", encoding="utf-8") as out:
                    out.write(json.dumps([key, known[key]]) + "\n")
                print(f"{row.name}, seed {seed}: {known[key]['error_start']:.2f} m", flush=True)
            found[row.name].append(known[key])
    print("\nTwo vehicles\n\n| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD))
    for row in ROWS:
        print(line(row, found))
    heard, alone = mean(found[SLOWLY], "parts"), mean(found[ALONE], "parts")
    least = least_with_losses(heard, alone, 0.5)
    print("\nBound\n\n| runs | least, m | over that without loss | measured |\n|---|---|---|---|")
    measured = mean(found[LOSSY], "error_start") / mean(found[SLOWLY], "error_start")
    print(f"| {LOSSY} | {least:.2f} | {least / np.mean(heard):.2f} | {measured:.2f} |")


if __name__ == "__main__":
    main()
