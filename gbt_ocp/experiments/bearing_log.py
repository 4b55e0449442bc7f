"""A log of bearings as CSV: own positions and bearings, and the truth where it is known (docs/howto/replay.md)."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.experiments.config.consistency import LARGEST
from gbt_ocp.experiments.config.faults import ConfigurationError, shown
from gbt_ocp.experiments.config.yaml_dialect import shortened
from gbt_ocp.experiments.contacts import chosen, told_apart
from gbt_ocp.simulation.replayed_track import BearingLog
from gbt_ocp.typing import Array

MOST_FAULTS = 5
"""Wrong lines that are named one by one."""

SAME_TIME = 1.0e-6
"""Seconds by which a row that shares its time with the one before it is put later: two sensors, one clock."""


@dataclass(frozen=True)
class _Row:
    """A line below the header: its number in the file, and its cells without spaces around them."""

    line: int
    cells: list[str]


@dataclass(frozen=True)
class _Layout:
    """Which columns of a log are read."""

    names: list[str]
    axes: str
    bearing: str
    elevation: str | None
    has_truth: bool

    @property
    def position(self) -> list[str]:
        return ["t", *(f"own_{axis}" for axis in self.axes)]

    @property
    def angles(self) -> list[str]:
        return [self.bearing, *([self.elevation] if self.elevation else [])]

    @property
    def truth(self) -> list[str]:
        return [f"true_{axis}" for axis in self.axes] if self.has_truth else []

    @property
    def all(self) -> list[str]:
        return [*self.position, *self.angles, *self.truth]

    def at(self, name: str) -> int:
        return self.names.index(name)


def read_log(
    path: Path,
    bearing_from: Literal["x", "north"],
    latency: float = 0.0,
    where: Mapping[str, str | float] | None = None,
) -> BearingLog:
    """Read a log.

    Parameters
    ----------
    path
        CSV file with a header. Columns, in any order: ``t`` (s); ``own_x``, ``own_y`` and in space ``own_z`` (m);
        ``bearing_rad`` or ``bearing_deg``; in space ``elevation_rad`` or ``elevation_deg`` above the horizontal. A row
        without a bearing, its cells empty or ``nan``, is one of own position. The truth, for scoring only, is
        ``true_x``, ``true_y`` and in space ``true_z`` (m), whose cells may be empty. Other columns are passed over.
    bearing_from
        ``x``: bearings are counter-clockwise from +x. ``north``: clockwise from +y.
    latency
        Time in seconds by which a bearing is older than its stamp. The own position is that of the earlier time,
        interpolated between all rows.
    where
        Values by column: only rows with them are read, and rows without a bearing whose cell there is empty.

    Raises
    ------
    ConfigurationError
        If the file cannot be read as that, with one line a fault.
    """
    names, rows = _cells(path)
    layout = _layout(path, names)
    rows = _chosen(path, layout, rows, where or {})
    table = _numbers(path, layout, rows)
    d = len(layout.axes)
    stamps, own = table[:, 0], table[:, 1 : 1 + d]
    angles, truth = table[:, 1 + d : 1 + d + len(layout.angles)], table[:, 1 + d + len(layout.angles) :]
    seen = np.isfinite(angles[:, 0])
    stamps = _increasing(path, layout, rows, stamps, seen)
    bearings = _unit_vectors(layout, bearing_from, angles[seen])
    times = stamps[seen] - latency
    inside = times >= stamps[0]
    if np.sum(inside) < 2:
        late = f" after a latency of {latency:g} s" if latency else ""
        raise ConfigurationError([f"{path}: found {np.sum(inside)} bearings{late}; allowed: at least 2"])
    if latency > 0.0:
        known = seen | np.isfinite(truth).all(axis=1)  # a bearing whose truth is not known interrupts the truth
        own_then = _between(times, stamps, own)
        truth_then = _between(times, stamps[known], truth[known])
    else:
        own_then, truth_then = own[seen], truth[seen]
    return BearingLog(
        times[inside],
        own_then[inside],
        bearings[inside],
        truth_then[inside] if layout.has_truth else None,
        own_rows=int(np.sum(~seen)),
        warnings=_warnings(
            path, layout, [row for row, is_bearing in zip(rows, seen, strict=True) if is_bearing], bearings
        ),
    )


def _cells(path: Path) -> tuple[list[str], list[_Row]]:
    """Header, and the rows below it that are not empty."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            header = next(reader, [])
            rows, line = [], reader.line_num + 1
            for row in reader:
                cells = [cell.strip() for cell in row]
                if any(cells):
                    rows.append(_Row(line, cells))
                line = reader.line_num + 1  # where the next row begins: a quote may hold line ends
    except (OSError, UnicodeDecodeError, csv.Error) as fault:
        raise ConfigurationError([f"{path}: found a log that cannot be read ({fault}); allowed: a CSV file"]) from fault
    names = [name.strip() for name in header]
    twice = sorted({name for name in names if name and names.count(name) > 1})
    if twice:
        raise ConfigurationError([f"{path}: found the column {shortened(twice[0])} twice; allowed: each once"])
    if len(rows) < 2:
        raise ConfigurationError([f"{path}: found {len(rows)} rows below the header; allowed: at least 2"])
    _refuse(path, [fault for row in rows if len(row.cells) != len(names) for fault in [_of_width(path, names, row)]])
    return names, rows


def _of_width(path: Path, names: list[str], row: _Row) -> str:
    """The fault of a row with more or fewer cells than the header: its cells may be those of other columns."""
    for name, cell in zip(names, row.cells, strict=False):
        if "\n" in cell or "\r" in cell:
            return f"{path}: line {row.line}: {name}: found {shown(cell)}; allowed: one line, quotes closed"
    return f"{path}: line {row.line}: found {len(row.cells)} cells; allowed: {len(names)}, as in the header"


def _refuse(path: Path, faults: list[str]) -> None:
    if faults:
        rest = len(faults) - MOST_FAULTS
        raise ConfigurationError([*faults[:MOST_FAULTS], *([f"{path}: and {rest} more"] if rest > 0 else [])])


def _layout(path: Path, names: list[str]) -> _Layout:
    found = f"{path}: found the columns {shortened(', '.join(names))}"
    bearing, elevation = (
        [name for name in (f"{what}_rad", f"{what}_deg") if name in names] for what in ("bearing", "elevation")
    )
    if len(bearing) != 1:
        raise ConfigurationError([f"{found}; allowed: one of bearing_rad, bearing_deg among them"])
    if len(elevation) > 1:
        raise ConfigurationError([f"{found}; allowed: one of elevation_rad, elevation_deg among them"])
    axes = "xyz" if elevation else "xy"
    truths = [f"true_{axis}" for axis in axes]
    present = [name for name in truths if name in names]
    layout = _Layout(names, axes, bearing[0], elevation[0] if elevation else None, present == truths)
    missing = [name for name in layout.all if name not in names]
    if missing:
        raise ConfigurationError([f"{found}; missing: {', '.join(missing)}"])
    if present and present != truths:
        absent = [name for name in truths if name not in names]
        found = f"{path}: found {', '.join(present)} without {', '.join(absent)}"
        raise ConfigurationError([f"{found}; allowed: all of {', '.join(truths)}, or none"])
    return layout


def _chosen(path: Path, layout: _Layout, rows: list[_Row], where: Mapping[str, str | float]) -> list[_Row]:
    """Rows of the contact that is asked for."""
    unknown = [name for name in where if name not in layout.names]
    if unknown:
        allowed = shortened(", ".join(layout.names))
        raise ConfigurationError([f"{path}: where: found the column {shortened(unknown[0])}; allowed: {allowed}"])
    columns = {layout.at(name): value for name, value in where.items()}

    def is_bearing(row: _Row) -> bool:
        return not _is_empty(row.cells[layout.at(layout.bearing)])

    found = [row for row in rows if chosen(row.cells, columns, is_bearing(row))]
    count = sum(map(is_bearing, found))
    if where and count < 2:
        asked = shortened(", ".join(f"{name}={value}" for name, value in where.items()))
        values = {name: sorted({row.cells[layout.at(name)] for row in rows if is_bearing(row)}) for name in where}
        allowed = "; ".join(f"{shortened(name)} is {shortened(', '.join(has))}" for name, has in values.items())
        raise ConfigurationError([f"{path}: where: found {count} bearings with {asked}; allowed: {allowed}"])
    return found


def _is_empty(text: str) -> bool:
    return text.casefold() in ("", "nan")


def _numbers(path: Path, layout: _Layout, rows: list[_Row]) -> Array:
    """The columns that are read ``(rows, columns)``; NaN where a bearing or the truth is not known."""
    table = np.full((len(rows), len(layout.all)), np.nan)
    faults = []
    for k, row in enumerate(rows):
        texts = {name: row.cells[layout.at(name)] for name in layout.all}
        optional = set(layout.truth)
        if all(_is_empty(texts[name]) for name in layout.angles):
            optional |= set(layout.angles)
        for i, (name, text) in enumerate(texts.items()):
            if name in optional and _is_empty(text):
                continue
            try:
                table[k, i] = float(text)
            except ValueError:
                table[k, i] = math.nan
            if not abs(table[k, i]) <= LARGEST:  # NaN is not
                allowed = f"a finite number of a size up to {LARGEST:g}"
                faults.append(f"{path}: line {row.line}: {name}: found {shown(text)}; allowed: {allowed}")
    _refuse(path, faults)
    return table


def _increasing(path: Path, layout: _Layout, rows: list[_Row], stamps: Array, seen: NDArray[np.bool_]) -> Array:
    """The stamps, those of rows that share one told apart."""
    falling = np.flatnonzero(np.diff(stamps) < 0.0)
    if len(falling):
        before, after = (rows[k].cells[layout.at("t")] for k in (falling[0], falling[0] + 1))
        line = rows[falling[0] + 1].line
        raise ConfigurationError([f"{path}: line {line}: t: found {after} after {before}; allowed: increasing times"])
    apart = stamps + SAME_TIME * _repeats(stamps)
    if np.any(np.diff(apart[seen]) <= 0.0):
        raise ConfigurationError([f"{path}: t: found more bearings at one time than can be told apart"])
    return apart


def _repeats(stamps: Array) -> Array:
    """How many of the rows before share each one's time ``(K,)``."""
    starts = np.flatnonzero(np.concatenate([[True], np.diff(stamps) > 0.0]))
    return np.asarray(np.arange(len(stamps)) - np.repeat(starts, np.diff([*starts, len(stamps)])), dtype=float)


def _unit_vectors(layout: _Layout, bearing_from: Literal["x", "north"], angles: Array) -> Array:
    """Bearings ``(K, d)`` of the angles as they stand in the log ``(K, d-1)``."""
    radians = np.column_stack(
        [
            np.deg2rad(column) if name.endswith("_deg") else column
            for name, column in zip(layout.angles, angles.T, strict=True)
        ]
    )
    azimuth = radians[:, 0] if bearing_from == "x" else 0.5 * np.pi - radians[:, 0]
    bearings = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)
    if layout.elevation is None:
        return bearings
    height = radians[:, 1]
    return np.column_stack([np.cos(height)[:, None] * bearings, np.sin(height)])


def _between(times: Array, stamps: Array, positions: Array) -> Array:
    """Positions at times between the stamps ``(K, d)``."""
    columns = [np.interp(times, stamps, values) for values in positions.T]
    return np.stack(columns, axis=-1) if columns else np.zeros((len(times), 0))


def _warnings(path: Path, layout: _Layout, rows: Sequence[_Row], bearings: Array) -> tuple[str, ...]:
    """Lines about columns that seem to tell several contacts apart."""
    lines = []
    for name in layout.names:
        if not name or name in layout.all:
            continue
        values = [row.cells[layout.at(name)] for row in rows]
        apart = told_apart(values, bearings)
        if apart is not None:
            between, within = np.rad2deg(apart)
            column, ids = shortened(name), shortened(", ".join(sorted(set(values))))
            lines.append(
                f"{path}: bearings with another {column} ({ids}) lie {between:.3g} degrees apart, those with the same "
                f"{within:.3g}: the log seems to hold several contacts; --where {column}=VALUE chooses one"
            )
    return tuple(lines)
