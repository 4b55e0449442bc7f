"""Writes ``docs/glossary.md`` from `gbt_ocp.reporting.glossary`.

python docs/write_glossary.py
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from gbt_ocp.reporting import glossary

PAGE = Path(__file__).resolve().parent / "glossary.md"


def _numbers(found: Mapping[str, tuple[str, str]]) -> list[str]:
    lines = ["| key | unit | meaning |", "|---|---|---|"]
    return [*lines, *(f"| `{key}` | {unit} | {meaning} |" for key, (unit, meaning) in found.items()), ""]


def _columns(found: Mapping[str, str]) -> list[str]:
    return ["| column | meaning |", "|---|---|", *(f"| {name} | {meaning} |" for name, meaning in found.items()), ""]


def page() -> str:
    """The page."""
    lines = [
        "# Glossary",
        "",
        "What every number of a run folder and of a replay is. A number that does not exist is null, or left out: a",
        "run without a solver has no solver times, a log without a truth no errors. Arrays of `history.npz` are listed",
        "with [the closed loop](api/simulation.md#arrays-of-a-run).",
        "",
        "## summary.json of a run",
        "",
        *_numbers(glossary.RUN_NUMBERS),
        "### Below fallbacks",
        "",
        *_numbers(glossary.FALLBACK_NUMBERS),
        "### Below retries",
        "",
        *_numbers(glossary.RETRY_NUMBERS),
        "### Below team",
        "",
        *_numbers(glossary.TEAM_NUMBERS),
        "## summary.json of a replay",
        "",
        *_numbers(glossary.REPLAY_NUMBERS),
        "### Below trackers",
        "",
        *_numbers(glossary.SCORE_NUMBERS),
        "## scores.md",
        "",
        "Residuals by sensor stand in a table of their own.",
        "",
        *_columns(glossary.SCORE_COLUMNS),
        *_columns(glossary.SENSOR_COLUMNS),
    ]
    return "\n".join(lines).rstrip() + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
