"""The table of a sweep: one row a run, tidy, in the order of the runs."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from gbt_ocp.experiments.sweep.execution import FAILURE
from gbt_ocp.experiments.sweep.plan import PlannedRun
from gbt_ocp.files import whole_file
from gbt_ocp.simulation import run_folder

TABLE = "runs.csv"
PARQUET = "runs.parquet"

WALL_CLOCK_COLUMNS = (
    "solver_time_median_ms",
    "solver_time_max_ms",
    "tracker_time_median_ms",
    "step_time_median_ms",
    "steps_over_period",
    "wall_s",
)
"""Columns measured by a clock: all others depend neither on the engine nor on the order of the runs."""

Row = dict[str, Any]


def flattened(mapping: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Entries of nested mappings, their keys joined by dots."""
    for key, value in mapping.items():
        if isinstance(value, Mapping):
            yield from flattened(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def row_of(run: PlannedRun, folder: Path, varied: Iterable[str]) -> Row:
    """Row of a finished run: its number, status, error and seed, what varies, and every key of its summary.

    Parameters
    ----------
    run
        The run.
    folder
        Where the folders of all runs lie.
    varied
        Keys that any variant of the sweep replaces; ``None`` where this run's variant leaves one as it is.

    Raises
    ------
    ValueError
        If the run folder is damaged.
    """
    row: Row = {"run": run.number, "status": "done", "error": None, "seed": run.seed}
    row |= {key: run.variant.overrides.get(key) for key in varied}
    own = folder / run.identifier
    failure = own / FAILURE
    if failure.is_file():
        row["status"], row["error"] = "failed", _error_of(failure)
        return row
    # A column of an override says what was asked; a key of the summary never takes its place.
    summary = flattened(run_folder.read_summary(own))
    return row | {key: value for key, value in summary if key not in row}


def _error_of(path: Path) -> str:
    try:
        error = json.loads(path.read_text(encoding="utf-8"))["error"]
    except (ValueError, KeyError, TypeError, RecursionError) as fault:
        raise ValueError(f"{path}: found no error ({type(fault).__name__}: {fault})") from None
    if not isinstance(error, str):
        raise ValueError(f"{path}: error: found {error!r:.60}; allowed: a text")
    return error


def write_table(folder: Path, rows: Sequence[Row]) -> None:
    """Write ``runs.csv``, and ``runs.parquet`` where pyarrow is installed.

    A column exists if any run has it; a cell without a value is empty, and a list is written as JSON.
    """
    columns = list(dict.fromkeys(key for row in rows for key in row))
    with whole_file(folder / TABLE) as path, path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([_cell(row.get(key)) for key in columns] for row in rows)
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        return
    arrays = {key: _column([row.get(key) for row in rows]) for key in columns}
    with whole_file(folder / PARQUET) as path:
        pyarrow.parquet.write_table(pyarrow.table(arrays), path)


def _cell(value: Any) -> Any:
    return json.dumps(value, ensure_ascii=False) if isinstance(value, list | dict) else value


def _column(values: list[Any]) -> list[Any]:
    """Values of one type, as a column of Parquet must have them: text where an override mixes words and numbers."""
    cells = [_cell(value) for value in values]
    kinds = {type(cell) for cell in cells if cell is not None}
    if kinds <= {int, float} or len(kinds) <= 1:
        return [float(cell) if kinds == {int, float} and cell is not None else cell for cell in cells]
    return [cell if cell is None or isinstance(cell, str) else json.dumps(cell) for cell in cells]
