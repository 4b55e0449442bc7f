"""A log of bearings as CSV: own positions and bearings, and the truth where it is known (docs/sea.md)."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Literal

import numpy as np

from gbt_ocp.experiments.config.consistency import LARGEST
from gbt_ocp.experiments.config.faults import ConfigurationError, shown
from gbt_ocp.experiments.config.yaml_dialect import shortened
from gbt_ocp.simulation.replay import BearingLog
from gbt_ocp.typing import Array

MOST_FAULTS = 5
"""Wrong lines that are named one by one."""

SAME_TIME = 1.0e-6
"""Seconds by which a bearing that shares its time with the one before it is put later: two sensors, one clock."""


def read_log(path: Path, bearing_from: Literal["x", "north"], latency: float = 0.0) -> BearingLog:
    """Read a log.

    Parameters
    ----------
    path
        CSV file with a header. Columns, in any order: ``t`` (s); ``own_x``, ``own_y`` and in space ``own_z`` (m);
        ``bearing_rad`` or ``bearing_deg``; in space ``elevation_rad`` or ``elevation_deg`` above the horizontal. The
        truth, for scoring only, is ``true_x``, ``true_y`` and in space ``true_z`` (m), whose cells may be empty. Other
        columns are passed over.
    bearing_from
        ``x``: bearings are counter-clockwise from +x. ``north``: clockwise from +y.
    latency
        Time in seconds by which a bearing is older than its stamp; the own position is that of the earlier time.

    Raises
    ------
    ConfigurationError
        If the file cannot be read as that, with one line a fault.
    """
    names, rows = _cells(path)
    angle = _angle(path, names, "bearing")
    elevation = next((name for name in ("elevation_rad", "elevation_deg") if name in names), None)
    space = elevation is not None
    axes = ("x", "y", "z") if space else ("x", "y")
    wanted = ["t", *(f"own_{axis}" for axis in axes), angle, *([elevation] if elevation else [])]
    missing = [name for name in wanted if name not in names]
    if missing:
        raise ConfigurationError(
            [f"{path}: found the columns {shortened(', '.join(names))}; missing: {', '.join(missing)}"]
        )
    truths = [f"true_{axis}" for axis in axes]
    known = all(name in names for name in truths)
    table = _numbers(path, names, rows, wanted, truths if known else [])

    stamps = table[:, 0]
    falling = np.flatnonzero(np.diff(stamps) < 0.0)
    if len(falling):
        line, before, after = rows[falling[0] + 1][0], stamps[falling[0]], stamps[falling[0] + 1]
        raise ConfigurationError(
            [f"{path}: line {line}: t: found {after:g} after {before:g}; allowed: increasing times"]
        )
    stamps = stamps + SAME_TIME * _repeats(stamps)
    if np.any(np.diff(stamps) <= 0.0):
        raise ConfigurationError([f"{path}: t: found more bearings at one time than can be told apart"])
    d = len(axes)
    own, column = table[:, 1 : 1 + d], table[:, 1 + d]
    radians = np.deg2rad(column) if angle.endswith("_deg") else column
    azimuth = radians if bearing_from == "x" else 0.5 * np.pi - radians
    bearings = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)
    if elevation is not None:
        height = np.deg2rad(table[:, 2 + d]) if elevation.endswith("_deg") else table[:, 2 + d]
        bearings = np.column_stack([np.cos(height)[:, None] * bearings, np.sin(height)])
    truth = table[:, len(wanted) :] if known else None
    times = stamps - latency
    inside = times >= stamps[0]
    if np.sum(inside) < 2:
        raise ConfigurationError(
            [f"{path}: found {np.sum(inside)} bearings after a latency of {latency:g} s; allowed: 2"]
        )

    def earlier(positions: Array) -> Array:
        return np.stack([np.interp(times[inside], stamps, values) for values in positions.T], axis=-1)

    if latency > 0.0:
        own, truth = earlier(own), None if truth is None else earlier(truth)
    return BearingLog(times[inside], own[-int(np.sum(inside)) :], bearings[inside], truth)


def _cells(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Header, and the rows with their line numbers."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            header = next(reader, [])
            rows, line = [], reader.line_num + 1
            for row in reader:
                if any(cell.strip() for cell in row):
                    rows.append((line, row))
                line = reader.line_num + 1  # where the next row begins: a quote may hold line ends
    except (OSError, UnicodeDecodeError, csv.Error) as fault:
        raise ConfigurationError([f"{path}: found a log that cannot be read ({fault}); allowed: a CSV file"]) from fault
    names = [name.strip() for name in header]
    twice = sorted({name for name in names if name and names.count(name) > 1})
    if twice:
        raise ConfigurationError([f"{path}: found the column {shortened(twice[0])} twice; allowed: each once"])
    if len(rows) < 2:
        raise ConfigurationError([f"{path}: found {len(rows)} rows below the header; allowed: at least 2"])
    return names, rows


def _angle(path: Path, names: list[str], what: str) -> str:
    found = [name for name in (f"{what}_rad", f"{what}_deg") if name in names]
    if len(found) != 1:
        raise ConfigurationError(
            [
                f"{path}: found the columns {shortened(', '.join(names))}; "
                f"allowed: one of {what}_rad, {what}_deg among them"
            ]
        )
    return found[0]


def _numbers(
    path: Path, names: list[str], rows: list[tuple[int, list[str]]], wanted: list[str], optional: list[str]
) -> Array:
    columns = [names.index(name) for name in (*wanted, *optional)]
    table = np.full((len(rows), len(columns)), np.nan)
    faults = []
    for k, (line, row) in enumerate(rows):
        for i, column in enumerate(columns):
            text = row[column].strip() if column < len(row) else ""
            may_miss = i >= len(wanted)
            if may_miss and text in ("", "nan", "NaN"):
                continue
            try:
                table[k, i] = float(text)
            except ValueError:
                table[k, i] = math.nan
            if not abs(table[k, i]) <= LARGEST:  # NaN is not
                allowed = f"a finite number of a size up to {LARGEST:g}"
                faults.append(f"{path}: line {line}: {names[column]}: found {shown(text)}; allowed: {allowed}")
    if faults:
        rest = len(faults) - MOST_FAULTS
        raise ConfigurationError([*faults[:MOST_FAULTS], *([f"{path}: and {rest} more"] if rest > 0 else [])])
    return table


def _repeats(stamps: Array) -> Array:
    """How many of the samples before share each one's time ``(K,)``."""
    starts = np.flatnonzero(np.concatenate([[True], np.diff(stamps) > 0.0]))
    return np.asarray(np.arange(len(stamps)) - np.repeat(starts, np.diff([*starts, len(stamps)])), dtype=float)
