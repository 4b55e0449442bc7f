"""Tables of a comparison: lists of rows, kept as CSV files."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

Row = dict[str, Any]

Tables = Mapping[str, Sequence[Row]]
"""Rows by the name of their table."""


WORDS = frozenset(
    (
        "case", "formulation", "solver", "mode", "origin", "status", "swept", "pair", "against", "work", "meaning",
    )
)  # fmt: skip
"""Columns that hold words, whatever they look like: the name of an experiment may be a number."""

CAPTIONS = {
    "success": "Share of the problems that each pair solved, with 95 % intervals.",
    "objective": "Gap to the best known objective, problem by problem, in order of size.",
    "violation": "Violation of the true limits between the nodes.",
    "time": "Processor time of a solve.",
    "iterations": "Iterations of a solve.",
    "closed_loop": "Settled tracking error in closed loop, seed by seed.",
    "sensitivity": "The penalty's settings: success and iterations of IPOPT over the stiffness of the kink.",
    "nodes": "Hard limits, exchange and penalty over γ and n_c: objective, and violation between the nodes.",
}
"""Figures by file name, in the order of the report, with their captions."""


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Write rows; a cell without a value is empty. A column exists if any row has it."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def read_rows(path: Path) -> list[Row]:
    """Read rows back: whole numbers, other numbers, words, and ``None`` for an empty cell."""
    with path.open(newline="", encoding="utf-8") as stream:
        return [{key: _value(key, text) for key, text in row.items()} for row in csv.DictReader(stream)]


def _value(key: str, text: str) -> Any:
    if text == "":
        return None
    for kind in () if key in WORDS else (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def grouped(rows: Iterable[Row], *keys: str) -> dict[tuple[Any, ...], list[Row]]:
    """Rows by the values of some columns, in the order in which these first occur."""
    found: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        found.setdefault(tuple(row[key] for key in keys), []).append(row)
    return found


def column(rows: Iterable[Row], key: str, convert: Callable[[Any], float] = float) -> list[float]:
    """Numbers of a column; NaN for an empty cell."""
    return [float("nan") if row.get(key) is None else convert(row[key]) for row in rows]
