"""Measured numbers as data: ``docs/data/NAME.json``, and the pages that are rendered from them.

A page writes ``{{ data.NAME.KEY }}`` for a table or a value, ``{{ data.NAME.KEY[ROW, COLUMN] }}`` for a cell of a table
by the first cell of its row (or the first ones, with a slash between) and the head of its column, either of which may
have commas, and ``{{ ages }}`` for the list of all files with their age.
MkDocs calls the functions ``on_…``; ``scripts/write_data.py`` writes the files.
"""

from __future__ import annotations

import json
import re
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
DATA = DOCS / "data"
ABOUT = ("command", "commit", "date", "machine", "seeds", "versions")
"""What every file says of itself besides its tables and values."""

PLACEHOLDER = re.compile(r"\{\{\s*data\.(\w+)\.(\w+)(?:\[([^\]]+)\])?\s*\}\}")
AGES = "{{ ages }}"


class MissingError(KeyError):
    """A page quotes a number that there is not."""


@cache
def read(name: str) -> dict[str, Any]:
    """The file ``NAME.json``.

    Raises
    ------
    MissingError
        If there is none.
    """
    path = DATA / f"{name}.json"
    if not path.is_file():
        raise MissingError(f"data.{name}: found no docs/data/{name}.json; allowed: {', '.join(names())}")
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def names() -> list[str]:
    """All files, sorted."""
    return sorted(path.stem for path in DATA.glob("*.json"))


def rendered(text: str) -> str:
    """A page with its numbers in place of the placeholders.

    Raises
    ------
    MissingError
        If a file, a key, a row or a column is not there.
    """
    text = PLACEHOLDER.sub(lambda found: _placed(_value(*found.groups()), text, *found.span()), text)
    return text.replace(AGES, ages()) if AGES in text else text


def _placed(value: str, text: str, start: int, end: int) -> str:
    """A value as it has to be written there.

    Lines of a table are as far in as the first, so that it stays in a part of the page that folds. A number that begins
    a line and ends a sentence would begin a list.
    """
    before = text[text.rfind("\n", 0, start) + 1 : start]
    if before.strip():
        return value
    return value.replace("\n", f"\n{before}") + ("\\" if value.isdigit() and text[end : end + 1] == "." else "")


def _value(name: str, key: str, cell: str | None) -> str:
    found = read(name)
    values = found["tables"] | found.get("values", {}) | {about: found[about] for about in ABOUT}
    if key not in values:
        raise MissingError(f"data.{name}.{key}: found no such key; allowed: {', '.join(values)}")
    value = values[key]
    if key not in found["tables"]:
        return "; ".join(f"`{line}`" for line in value) if key == "command" else str(value)
    return markdown(value) if cell is None else _cell(f"data.{name}.{key}", value, " ".join(cell.split()))


def _cell(where: str, table: dict[str, Any], cell: str) -> str:
    """The cell of ``ROW, COLUMN``, split at the comma that leaves a row and a column of the table."""
    heads = [head.strip("* ") for head in table["columns"]]
    parts = cell.split(",")
    found = []
    for comma in range(1, len(parts)):
        row, column = (",".join(side).strip() for side in (parts[:comma], parts[comma:]))
        first = [part.strip() for part in row.split(" / ")]
        rows = [line for line in table["rows"] if [one.strip("* ") for one in line[: len(first)]] == first]
        found.append((len(rows), heads.count(column), rows, column))
    found.sort(key=lambda one: (one[0] > 0) + (one[1] > 0), reverse=True)
    counts = [one[:2] for one in found]
    if counts.count((1, 1)) != 1 or counts[0] != (1, 1):
        of_rows, of_columns = counts[0] if counts else (0, 0)
        raise MissingError(
            f"{where}[{cell}]: found {of_rows} rows and {of_columns} columns; "
            f"allowed: one of each, of the rows {', '.join(line[0] for line in table['rows'])}, "
            f"of the columns {', '.join(heads)}"
        )
    return str(found[0][2][0][heads.index(found[0][3])]).strip("* ")


def markdown(table: dict[str, Any]) -> str:
    """A table in Markdown."""
    lines = [f"| {' | '.join(table['columns'])} |", f"|{'---|' * len(table['columns'])}"]
    return "\n".join([*lines, *(f"| {' | '.join(map(str, row))} |" for row in table["rows"])])


FUNCTIONAL = ("gbt_ocp", "problems", "configs")
"""What a result follows from: the package and what it ships; the rest is documentation, tests and measuring."""


def age(commit: str) -> str:
    """Commits since the one with which numbers were made, and how many of them changed the package, in words."""
    try:
        every, functional = commits_since(commit), commits_since(commit, *FUNCTIONAL)
    except (OSError, subprocess.CalledProcessError):
        return f"{commit[:9]}, which this copy does not have"
    return f"{every} commits ({commit[:9]}), {functional or 'none'} of the package"


def commits_since(commit: str, *paths: str) -> int:
    """Commits after one, of all files or of these."""
    command = ["git", "-C", str(DOCS.parent), "rev-list", "--count", f"{commit}..HEAD", "--", *paths]
    return int(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def ages() -> str:
    """The table of all results: what measured them, when, and how many commits ago."""
    lines = ["| result | age | made | seeds | machine | command |", "|---|---|---|---|---|---|"]
    for name in names():
        found = read(name)
        commands = "<br>".join(f"`{line}`" for line in found["command"])
        cells = [f"`{name}`", age(found["commit"]), found["date"], found["seeds"], found["machine"], commands]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the numbers into a page."""
    return rendered(markdown)


def on_serve(server: Any, **_: Any) -> Any:
    """Build again when a number changes."""
    read.cache_clear()
    server.watch(str(DATA))
    return server
