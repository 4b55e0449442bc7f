"""Recorded bearings with the truth beside them: every tracker that `replay` knows, log by log and all together.

    OPENBLAS_NUM_THREADS=1 python benchmarks/recorded_logs.py FOLDER

FOLDER has CSV files as `gbt-ocp replay` reads them, bearings from +x, with the true positions. Configuration `replay`
as shipped, scored from the same time on and beside the same constant ranges. A cell is the distance between track and
truth in per cent of the true range, median / RMS, and the share of the truth inside the 95 % ellipse in per cent.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from pathlib import Path
from typing import Any

import numpy as np

import gbt_ocp as gbt
from gbt_ocp.simulation.calibration import squared_errors, within


def cell(shares: Any, inside: Any = None) -> str:
    """Median, root mean square and coverage, in per cent."""
    known = shares[np.isfinite(shares)]
    numbers = [100.0 * float(np.median(known)), 100.0 * float(np.sqrt(np.mean(known**2)))]
    if inside is not None:
        numbers.append(100.0 * float(np.mean(inside)))
    return " / ".join("many" if number >= 1e4 else f"{number:.3g}" for number in numbers)


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    logs = sorted(parser.parse_args().folder.glob("*.csv"))
    if not logs:
        parser.error("folder: found no CSV file; allowed: a folder of logs")
    shares: dict[str, list[Any]] = {}
    inside: dict[str, list[Any]] = {}
    times: dict[str, list[Any]] = {}
    for path in logs:
        found = gbt.replay(path, trackers=["all"], bearing_from="x")
        log, settings = found.log, found.configuration.replay
        scored = log.times >= log.times[0] + settings.score_from_s
        true_range = np.linalg.norm(log.truth - log.own, axis=1)
        for track in found.tracks:
            offset = track.mean - log.truth
            shares.setdefault(track.name, []).append((np.linalg.norm(offset, axis=1) / true_range)[scored])
            inside.setdefault(track.name, []).append(
                within(squared_errors(offset, track.covariance), offset.shape[1])[scored]
            )
            times.setdefault(track.name, []).append(track.seconds)
        for reach in settings.constant_range_m:
            offset = log.own + reach * log.bearings - log.truth
            name = f"{reach:g} m along the bearing"
            shares.setdefault(name, []).append((np.linalg.norm(offset, axis=1) / true_range)[scored])
    heads = ["tracker", *(path.stem for path in logs), "all", "ms a bearing"]
    print(f"Logs\n\n| {' | '.join(heads)} |\n{'|---' * len(heads)}|")
    for name, each in shares.items():
        counts = inside.get(name, [None] * len(each))
        cells = [cell(share, count) for share, count in zip(each, counts, strict=True)]
        whole = np.concatenate(counts) if name in inside else None
        spent = f"{1e3 * float(np.nanmean(np.concatenate(times[name]))):.2g}" if name in times else ""
        print(f"| {name} | {' | '.join([*cells, cell(np.concatenate(each), whole), spent])} |")


if __name__ == "__main__":
    main()
