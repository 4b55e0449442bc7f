"""The report of a benchmark: a table in Markdown and CSV, and all of it in JSON with where it comes from."""

from __future__ import annotations

import csv
import datetime
import importlib.metadata
import json
import os
import platform
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from gbt_ocp.files import whole_file
from gbt_ocp.simulation.summary import installed_versions
from gbt_ocp.studies.scenarios.contestants import CONTESTANTS
from gbt_ocp.studies.scenarios.scenario import PublicScenario

Row: TypeAlias = dict[str, Any]

INTERVAL = (10.0, 90.0)
"""Percentiles over the runs between which the interval of an error lies."""

REPORT, TABLE, ALL_OF_IT = "report.md", "benchmark.csv", "benchmark.json"

EXPLAINED = (
    "A run is scored from the time that its scenario names. Its error is the median distance from the truth over the "
    "true range. The table has the median over the runs and the percentiles 10 and 90, the means of the normalised "
    "squared error (ideally 1) and of the share inside the 95 % region, and the share of runs that lost the target: "
    "more than half of the range off at the end, or a fault. Times are processor time."
)

OVERVIEW = "Error, % of range / inside 95 %, % (* where a run was lost)"

SHOWN = {
    "error": "error, % of range",
    "interval": "10 to 90 % of runs",
    "error_ahead": "ahead, %",
    "rms_m": "rms, m",
    "nees": "NEES / d",
    "inside": "inside 95 %",
    "nees_ahead": "NEES / d ahead",
    "inside_ahead": "inside, ahead",
    "lost": "lost, %",
    "seconds": "s a run",
}


def summarised(trials: Sequence[tuple[str, str, dict[str, Any] | None]]) -> list[Row]:
    """A row for each scenario and contestant, from the runs' numbers; those that do not take part have none."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for scenario, contestant, numbers in trials:
        if numbers is not None:
            groups.setdefault((scenario, contestant), []).append(numbers)
    return [_row(*key, runs) for key, runs in groups.items()]


def _row(scenario: str, contestant: str, runs: list[dict[str, Any]]) -> Row:
    def values(name: str) -> Any:
        return np.array([one[name] for one in runs if one.get(name) is not None], dtype=float)

    def of(statistic: Any, name: str) -> float | None:
        found = values(name)
        return float(statistic(found)) if len(found) else None

    errors = values("error")
    interval = [float(one) for one in np.percentile(errors, INTERVAL)] if len(errors) else [None, None]
    faults = [str(one["fault"]) for one in runs if one["fault"]]
    return {
        "scenario": scenario,
        "tracker": contestant,
        "runs": len(runs),
        "error": of(np.median, "error"),
        "error_low": interval[0],
        "error_high": interval[1],
        "error_ahead": of(np.median, "error_ahead"),
        "rms_m": of(np.median, "rms_m"),
        "nees": of(np.mean, "nees"),
        "inside": of(np.mean, "inside"),
        "nees_ahead": of(np.mean, "nees_ahead"),
        "inside_ahead": of(np.mean, "inside_ahead"),
        "lost": float(np.mean([bool(one["lost"]) for one in runs])),
        "seconds": of(np.median, "seconds"),
        "faults": len(faults),
        "first_fault": faults[0] if faults else "",
    }


def provenance(command: str) -> dict[str, Any]:
    """Commit, versions, machine, load, date and command of what was measured."""
    versions = dict(installed_versions())
    for package in ("stonesoup", "filterpy"):
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            versions[package] = "not installed"
    return {
        "command": command,
        "commit": _commit(),
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "versions": versions,
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
    }


def _commit() -> str:
    """Commit of the checkout that runs, with ``+`` where files differ from it."""
    git = ["git", "-C", str(Path(__file__).parent)]
    try:
        head = subprocess.run([*git, "rev-parse", "HEAD"], capture_output=True, text=True, check=True).stdout.strip()
        changed = subprocess.run(
            [*git, "status", "--porcelain", "--untracked-files=no"], capture_output=True, text=True, check=True
        ).stdout
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return head + ("+" if changed.strip() else "")


def write_benchmark(
    folder: Path,
    scenarios: Sequence[PublicScenario],
    runs: dict[str, int],
    rows: list[Row],
    notes: list[str],
    command: str,
) -> None:
    """Write ``report.md``, ``benchmark.csv`` and ``benchmark.json``."""
    whence = provenance(command)
    described = [
        {
            "name": one.name,
            "title": one.title,
            "source": one.source,
            "differs": one.differs,
            "dimension": one.dimension,
            "seeds": list(range(runs[one.name])),
            "scored_from_s": one.scored_from,
            "ahead_s": one.ahead,
        }
        for one in scenarios
    ]
    with whole_file(folder / ALL_OF_IT) as temporary:
        content = {**whence, "scenarios": described, "rows": rows, "notes": notes}
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    with whole_file(folder / TABLE) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, list(rows[0]) if rows else ["scenario", "tracker"])
        table.writeheader()
        table.writerows(rows)
    with whole_file(folder / REPORT) as temporary:
        temporary.write_text(markdown(scenarios, runs, rows, notes, whence), encoding="utf-8")


def markdown(
    scenarios: Sequence[PublicScenario], runs: dict[str, int], rows: list[Row], notes: list[str], whence: dict[str, Any]
) -> str:
    """The report as Markdown."""
    versions = ", ".join(f"{name} {version}" for name, version in whence["versions"].items())
    lines = [
        "# Public scenarios",
        "",
        f"    {whence['command']}",
        "",
        f"Commit {whence['commit']}, {whence['date']}, {versions}; {whence['machine']}"
        + ("" if whence["load"] is None else f", load {whence['load']:.1f}")
        + ".",
        "",
        EXPLAINED,
        "",
        *(f"- {note}" for note in notes),
        "",
        OVERVIEW,
        "",
        overview(rows),
        "",
    ]
    for one in scenarios:
        found = [row for row in rows if row["scenario"] == one.name]
        lines += [f"## {one.name}", "", f"{one.title[0].upper()}{one.title[1:]}. Source: {one.source}."]
        if one.differs:
            lines.append(f"It differs: {one.differs}.")
        lines += [
            f"{runs[one.name]} runs (seeds 0 to {runs[one.name] - 1}), scored from {one.scored_from:.6g} s, "
            f"{one.ahead:.6g} s ahead.",
            "",
            "| tracker | " + " | ".join(SHOWN.values()) + " |",
            "|---|" + "---|" * len(SHOWN),
            *(_line(row) for row in found),
            "",
        ]
        faults = [row for row in found if row["faults"]]
        lines += [f"- {row['tracker']}: {row['faults']} faults, the first: {row['first_fault']}" for row in faults]
        lines += [""] if faults else []
    lines += ["## Trackers", "", *(f"- `{name}`: {one.says}" for name, one in CONTESTANTS.items()), ""]
    return "\n".join(lines)


def overview(rows: Sequence[Row]) -> str:
    """A Markdown table with a row for each scenario: error and share inside of each tracker; * where a run was lost."""
    trackers = list(dict.fromkeys(row["tracker"] for row in rows))
    lines = ["| scenario (runs) | " + " | ".join(trackers) + " |", "|---|" + "---|" * len(trackers)]
    for name in dict.fromkeys(row["scenario"] for row in rows):
        found = {row["tracker"]: row for row in rows if row["scenario"] == name}
        count = next(iter(found.values()))["runs"]
        cells = [_error_and_share(found.get(tracker)) for tracker in trackers]
        lines.append(f"| {name} ({count}) | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _error_and_share(row: Row | None) -> str:
    if row is None:
        return ""
    if row["error"] is None:
        return "*"
    error = row["error"]
    shown = f"{error:.2f}" if error < 1.0 else f"{error:.1f}" if error < 100.0 else f"{error:.0f}"
    return f"{shown} / {100.0 * (row['inside'] or 0.0):.0f}" + (" *" if row["lost"] else "")


def _line(row: Row) -> str:
    def shown(value: float | None, factor: float = 1.0) -> str:
        return "" if value is None else f"{factor * value:.3g}"

    cells = [
        row["tracker"],
        shown(row["error"]),
        f"{shown(row['error_low'])} to {shown(row['error_high'])}",
        shown(row["error_ahead"]),
        shown(row["rms_m"]),
        shown(row["nees"]),
        shown(row["inside"], 100.0),
        shown(row["nees_ahead"]),
        shown(row["inside_ahead"], 100.0),
        shown(row["lost"], 100.0),
        shown(row["seconds"]),
    ]
    return "| " + " | ".join(cells) + " |"
