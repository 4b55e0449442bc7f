"""Writes ``docs/data/NAME.json`` from what a command printed: its Markdown tables, with how they were made.

python scripts/write_data.py OUTPUT ... --name NAME --result RESULT.json

OUTPUT are texts with Markdown tables, RESULT.json what ``scripts/everything.py`` leaves of a job (command, commit,
machine, versions). A table has the key of the nearest heading, or text, above it; the findings of a study are the table
``findings``. ``scripts/everything.py --data`` does the same for every job that it runs.
"""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

DATA = Path(__file__).resolve().parents[1] / "docs" / "data"
_FINDING = re.compile(r"- \*\*(.+?)\*\*: (.+?) Seen: (.+)")
_PROGRESS = re.compile(r"\d+%\s*\|")
"""Of a progress bar, which belongs to no table, and is no heading of one."""

_RULE = re.compile(r"\|(?:\s*:?-+:?\s*\|)+")


def tables_in(text: str, *, by_heading: bool = False) -> dict[str, dict[str, Any]]:
    """Markdown tables of a text by key, each with ``columns`` and ``rows`` of texts.

    The key is that of the nearest line above, or with ``by_heading`` of the nearest heading.

    A row that stands by itself belongs to the last table: a progress bar or a warning was printed into it.

    Raises
    ------
    ValueError
        If a row has not as many cells as its table has columns.
    """
    found: dict[str, dict[str, Any]] = {}
    lines = [line for line in text.splitlines() if line.startswith("|") or not _PROGRESS.search(line)]
    above, last = "table", None
    for number, line in enumerate(lines):
        follows = lines[number + 1].strip() if number + 1 < len(lines) else ""
        if line.startswith("|") and _RULE.fullmatch(follows):
            key, copies = slug(above), 1
            while key in found:
                copies += 1
                key = f"{slug(above)}_{copies}"
            last = found[key] = {"columns": cells(line), "rows": []}
        elif line.startswith("|") and not _RULE.fullmatch(line.strip()):
            row = cells(line)
            if last is None or len(row) != len(last["columns"]):
                raise ValueError(f"found a row of {len(row)} cells that belongs to no table: {line[:80]}")
            last["rows"].append(row)
        elif line.strip() and not line.startswith("|") and (line.startswith("#") or not by_heading):
            above = line
    findings = [_FINDING.fullmatch(line.strip()) for line in lines]
    rows = [[part.replace("|", r"\|") for part in one.group(2, 3, 1)] for one in findings if one]
    if rows:
        found["findings"] = {"columns": ["asked", "seen", "verdict"], "rows": rows}
    return found


def cells(line: str) -> list[str]:
    """Cells of a line of a table."""
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip())[1:-1]]


def slug(text: str) -> str:
    """A key from a line of text: at most its first six words, without a number that was measured (``: 11.2 min``)."""
    words = re.findall(r"[a-z0-9]+", re.split(r":\s+\d", text.lower())[0])[:6]
    return "_".join(words) or "table"


def seeds_of(command: Sequence[str]) -> str:
    """What a command says of its seeds."""
    for option in ("--seeds", "--runs"):
        if option in command:
            return f"0 to {int(command[list(command).index(option) + 1]) - 1}"
    return "as the command has them"


def described(tables: Mapping[str, Any], result: Mapping[str, Any]) -> dict[str, Any]:
    """The content of a file, from the tables and the result of a job."""
    machine = dict(result["machine"])
    commit, system, processor = (machine.pop(key, "unknown") for key in ("commit", "system", "processor"))
    return {
        "command": [" ".join(result["command"])],
        "commit": commit,
        "date": datetime.now(UTC).date().isoformat(),
        "machine": f"{processor}, {system}, load {result['load_before']:.1f}",
        "seeds": seeds_of(result["command"]),
        "versions": machine,
        "tables": dict(tables),
    }


def write(path: Path, content: Mapping[str, Any]) -> None:
    """Write a file of data, a row of a table on a line."""
    text = json.dumps(content, indent=1, ensure_ascii=False)
    # a list of texts on one line, as a row is read
    text = re.sub(r"\[\n\s+((?:\"(?:[^\"\\]|\\.)*\",?\s*)+)\]", lambda found: _joined(found[0]), text)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text + "\n", encoding="utf-8")


def _joined(listed: str) -> str:
    return json.dumps(json.loads(listed), ensure_ascii=False)


def main(argv: Sequence[str] | None = None) -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("output", type=Path, nargs="+", help="texts with Markdown tables")
    parser.add_argument("--name", required=True, help="of the file, without .json")
    parser.add_argument("--result", type=Path, required=True, help="result.json of the job")
    parser.add_argument("--by-heading", action="store_true", help="tables are called as the heading above them")
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the file")
    chosen = parser.parse_args(argv)
    text = "\n".join(path.read_text(encoding="utf-8", errors="replace") for path in chosen.output)
    try:
        tables = tables_in(text, by_heading=chosen.by_heading)
    except ValueError as error:
        parser.error(f"{chosen.output[0]}: {error}")
    if not tables:
        parser.error(f"{chosen.output[0]}: found no table; allowed: texts with Markdown tables")
    for name, table in tables.items():
        if not table["rows"]:
            parser.error(f"{chosen.output[0]}: found a table '{name}' without rows; allowed: tables with rows")
    content = described(tables, json.loads(chosen.result.read_text(encoding="utf-8")))
    write(chosen.data / f"{chosen.name}.json", content)


if __name__ == "__main__":
    main()
