"""A CSV file as rows of cells, and its columns as numbers: delimiters, decimal marks, and which line is wrong."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gbt_ocp.experiments.config.consistency import LARGEST
from gbt_ocp.experiments.config.faults import ConfigurationError, shown
from gbt_ocp.experiments.config.yaml_dialect import shortened
from gbt_ocp.experiments.contacts import PLAIN_NUMBER, chosen, same_text
from gbt_ocp.frames import seconds_of_utc
from gbt_ocp.typing import Array

MOST_FAULTS = 5
"""Wrong lines that are named one by one."""

DELIMITERS = (",", ";", "\t")

_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")


@dataclass(frozen=True)
class CsvRows:
    """Rows of a file that are not empty.

    Attributes
    ----------
    path
        The file.
    names
        Of the columns.
    lines
        Number of each row's line in the file ``(N,)``.
    cells
        Of each row, without spaces around them.
    delimiter
        Between the cells.
    """

    path: Path
    names: list[str]
    lines: list[int]
    cells: list[list[str]]
    delimiter: str

    def column(self, name: str) -> list[str]:
        """Cells of a column."""
        number = self.names.index(name)
        return [row[number] for row in self.cells]

    def refuse(self, faults: Sequence[str]) -> None:
        """Raise the faults, the first ones in full."""
        if faults:
            rest = len(faults) - MOST_FAULTS
            more = [f"{self.path}: and {rest} more"] if rest > 0 else []
            raise ConfigurationError([*faults[:MOST_FAULTS], *more])

    def fault(self, row: int, name: str, text: str, allowed: str) -> str:
        """A line about a cell."""
        return f"{self.path}: line {self.lines[row]}: {name}: found {shown(text)}; allowed: {allowed}"

    def where(self, asked: Mapping[str, str | float], is_bearing: Callable[[list[str]], bool]) -> CsvRows:
        """The rows with values by column, and those without a measurement whose cell there is empty.

        Raises
        ------
        ConfigurationError
            If there is no such column, or fewer than two measurements are left.
        """
        if not asked:
            return self
        unknown = [name for name in asked if name not in self.names]
        if unknown:
            allowed = shortened(", ".join(self.names))
            raise ConfigurationError(
                [f"{self.path}: where: found the column {shortened(unknown[0])}; allowed: {allowed}"]
            )
        columns = {self.names.index(name): value for name, value in asked.items()}
        # the same text is meant where there is one; otherwise the same number, however it is written
        exact = {number: same_text(self.column(self.names[number]), value) for number, value in columns.items()}
        kept = [k for k, row in enumerate(self.cells) if chosen(row, columns, is_bearing(row), exact)]
        count = sum(is_bearing(self.cells[k]) for k in kept)
        if count < 2:
            words = shortened(", ".join(f"{name}={value}" for name, value in asked.items()))
            values = {
                name: sorted({row[self.names.index(name)] for row in self.cells if is_bearing(row)}) for name in asked
            }
            allowed = "; ".join(f"{shortened(name)} is {shortened(', '.join(has))}" for name, has in values.items())
            raise ConfigurationError([f"{self.path}: where: found {count} bearings with {words}; allowed: {allowed}"])
        return CsvRows(
            self.path, self.names, [self.lines[k] for k in kept], [self.cells[k] for k in kept], self.delimiter
        )


def is_empty(text: str) -> bool:
    """Whether a cell says that there is no value."""
    return text == "" or text.casefold() == "nan"


def read_rows(path: Path, known: Callable[[Sequence[str]], int]) -> CsvRows:
    """The rows of a file.

    Parameters
    ----------
    path
        UTF-8 text with a header.
    known
        How many of the names of columns are known; the delimiter that gives the most is taken.

    Raises
    ------
    ConfigurationError
        If it cannot be read, a name stands twice, or a row has more or fewer cells than the header.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            first = file.readline()
            file.seek(0)
            heads = {sign: next(csv.reader([first], delimiter=sign), []) for sign in DELIMITERS}
            delimiter = max(DELIMITERS, key=lambda sign: known([name.strip() for name in heads[sign]]))
            reader = csv.reader(file, delimiter=delimiter)
            names = [name.strip() for name in next(reader, [])]
            lines, cells, line = [], [], reader.line_num + 1
            for row in reader:
                if any(row):
                    stripped = [cell.strip() for cell in row]
                    if any(stripped):
                        lines.append(line)
                        cells.append(stripped)
                line = reader.line_num + 1  # where the next row begins: a quote may hold line ends
    except (OSError, UnicodeDecodeError, csv.Error) as fault:
        raise ConfigurationError([f"{path}: found a log that cannot be read ({fault}); allowed: a CSV file"]) from fault
    found = CsvRows(path, names, lines, cells, delimiter)
    twice = sorted({name for name in names if name and names.count(name) > 1})
    if twice:
        raise ConfigurationError([f"{path}: found the column {shortened(twice[0])} twice; allowed: each once"])
    if len(cells) < 2:
        raise ConfigurationError([f"{path}: found {len(cells)} rows below the header; allowed: at least 2"])
    found.refuse([_of_width(found, k) for k, row in enumerate(cells) if len(row) != len(names)])
    return found


def _of_width(rows: CsvRows, k: int) -> str:
    """The fault of a row with more or fewer cells than the header: its cells may be those of other columns."""
    for name, cell in zip(rows.names, rows.cells[k], strict=False):
        if "\n" in cell or "\r" in cell:
            return f"{rows.path}: line {rows.lines[k]}: {name}: found {shown(cell)}; allowed: one line, quotes closed"
    count = f"found {len(rows.cells[k])} cells; allowed: {len(rows.names)}, as in the header"
    return f"{rows.path}: line {rows.lines[k]}: {count}"


def number_columns(
    rows: CsvRows,
    names: Sequence[str],
    optional: Callable[[str, int], bool],
    largest: Mapping[str, float] | None = None,
) -> dict[str, Array]:
    """Columns as numbers ``(N,)``; NaN where a cell is empty.

    In a file whose cells are separated by semicolons or tabs the decimal mark may be a comma, in all cells or in none.

    Parameters
    ----------
    rows
        Of the file.
    names
        Of the columns.
    optional
        Whether a cell may be empty: its column, and the number of its row.
    largest
        Of columns that may be larger than :data:`LARGEST`.

    Raises
    ------
    ConfigurationError
        If a cell is no finite number of a size up to :data:`LARGEST`: its line and column.
    """
    texts = {name: rows.column(name) for name in names}
    if rows.delimiter != ",":
        texts = _with_points(rows, texts)
    found, faults = {}, []
    for name, cells in texts.items():
        bound = (largest or {}).get(name, LARGEST)
        values = _quickly(cells)
        if values is None or np.any(np.abs(values) > bound) or np.isnan(values).any():
            values = np.empty(len(cells))
            for k, text in enumerate(cells):
                values[k] = float(text) if PLAIN_NUMBER.fullmatch(text) else math.nan
                if abs(values[k]) <= bound or (is_empty(text) and optional(name, k)):
                    continue
                faults.append((k, rows.fault(k, name, text, f"a finite number of a size up to {bound:g}")))
        found[name] = values
    rows.refuse([line for _, line in sorted(faults, key=lambda fault: fault[0])])
    return found


def _quickly(cells: Sequence[str]) -> Array | None:
    """All cells as numbers, or ``None`` if one is none, or is written as Python writes numbers and others do not."""
    joined = "".join(cells)
    if "_" in joined or not joined.isascii():
        return None
    try:
        return np.array(list(map(float, cells)))
    except ValueError:
        return None


def _with_points(rows: CsvRows, texts: dict[str, list[str]]) -> dict[str, list[str]]:
    """The cells with points for decimal commas."""
    commas = {(name, k) for name, cells in texts.items() for k, text in enumerate(cells) if "," in text}
    if not commas:
        return texts
    points = {(name, k) for name, cells in texts.items() for k, text in enumerate(cells) if "." in text}
    wrong = {(name, k) for name, k in commas if not _DECIMAL_COMMA.fullmatch(texts[name][k])}
    if points and not wrong:
        wrong = min((commas, points), key=len)
    if wrong:
        allowed = "a number with one decimal mark, the same in the complete file"
        rows.refuse([rows.fault(k, name, texts[name][k], allowed) for name, k in sorted(wrong, key=lambda at: at[1])])
    return {name: [text.replace(",", ".") for text in cells] for name, cells in texts.items()}


def utc_column(rows: CsvRows, name: str) -> Array:
    """A column of dates with times in ISO 8601 as seconds since the epoch ``(N,)``.

    Raises
    ------
    ConfigurationError
        If a cell is none: its line.
    """
    found, faults = np.empty(len(rows.cells)), []
    for k, text in enumerate(rows.column(name)):
        try:
            found[k] = seconds_of_utc(text)
        except ValueError:
            faults.append(rows.fault(k, name, text, "a date and time as in 2026-11-25T12:00:00.25Z"))
    rows.refuse(faults)
    return found
