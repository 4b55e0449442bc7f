"""The files of a run folder.

The folder is filled under a temporary name in the same parent and renamed at the end: a rename within one file system
is atomic, so a folder under its final name is complete, also after a kill or a full disk. Its JSON is strict.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

CONFIGURATION = "config.yaml"
HISTORY = "history.npz"
SUMMARY = "summary.json"
FIGURES = "figures"
VEHICLES = "vehicles"
PARTS = (CONFIGURATION, HISTORY, SUMMARY)
"""The files that every run folder has. Of several vehicles they are the first one's; those of each other are in a run
folder of its own, ``vehicles/NAME``."""

NUMERIC = frozenset(
    (
        "error_mean", "error_settled", "error_final", "error_rms", "error_median", "error_settled_max", "settling_s",
        "distance_min", "distance_median", "violation_max", "objective_mean", "solver_success_rate",
        "solver_iterations_mean", "solver_time_median_ms", "solver_time_max_ms", "tracker_time_median_ms", "steps",
        "wall_s", "seed",
    )
)  # fmt: skip
COUNTS = frozenset(("fallbacks", "retries"))
LISTS = frozenset(("warnings", "thrust_max", "thrust_min", "inputs"))
"""Keys of the summary that are read again, by the kind of their values."""

# Most builds of PyYAML have the fast loader; a sweep reads as many files as it has runs.
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def others_in(folder: Path) -> list[Path]:
    """Run folders of all but the first of several vehicles, sorted; none of one vehicle."""
    return sorted(path.parent for path in (folder / VEHICLES).glob(f"*/{CONFIGURATION}"))


def strict(value: Any) -> Any:
    """Copy of nested mappings, sequences and numbers for strict JSON: NaN and infinity become None."""
    if isinstance(value, Mapping):
        return {str(key): strict(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [strict(entry) for entry in value]
    if hasattr(value, "tolist"):  # numpy scalars and arrays
        return strict(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def write_summary(folder: Path, summary: Mapping[str, Any]) -> None:
    """Write ``summary.json``; NaN and infinity are written as null.

    Raises
    ------
    TypeError
        If a value is neither a number, a text, a boolean, None nor a nest of these.
    """
    text = json.dumps(strict(summary), indent=2, ensure_ascii=False, allow_nan=False)
    (folder / SUMMARY).write_text(text + "\n", encoding="utf-8")


def read_summary(folder: Path) -> dict[str, Any]:
    """Read ``summary.json`` of a run folder.

    Raises
    ------
    FileNotFoundError
        If the folder has no summary.
    ValueError
        If the file is not a JSON object, or a value has another kind than it should.
    """
    path = folder / SUMMARY
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:  # text that is not UTF-8 is a ValueError too
        raise ValueError(f"{path}: not valid JSON: {error}") from None
    if not isinstance(summary, dict):
        raise ValueError(f"{path}: found {type(summary).__name__}; allowed: a JSON object")
    # An older version may not have written a key.
    for key, value in summary.items():
        if key in NUMERIC and value is not None and not _is_number(value):
            raise ValueError(f"{path}: {key}: found {value!r:.60}; allowed: a number or null")
        if key in COUNTS and not (isinstance(value, dict) and all(map(_is_number, value.values()))):
            raise ValueError(f"{path}: {key}: found {value!r:.60}; allowed: a mapping to numbers")
        if key == "versions" and not isinstance(value, dict):
            raise ValueError(f"{path}: {key}: found {value!r:.60}; allowed: a mapping")
        if key in LISTS and value is not None and not isinstance(value, list):
            raise ValueError(f"{path}: {key}: found {value!r:.60}; allowed: a list")
    return summary


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def read_configuration(folder: Path) -> tuple[str, dict[str, Any]]:
    """Text and mapping of ``config.yaml`` of a run folder; its keys are not checked.

    Raises
    ------
    FileNotFoundError
        If the folder has none.
    ValueError
        If the file is not a mapping in YAML.
    """
    path = folder / CONFIGURATION
    try:
        text = path.read_text(encoding="utf-8")
        # nested aliases stand for more values than a computer holds
        if "*" in text and any(isinstance(event, yaml.AliasEvent) for event in yaml.parse(text, _LOADER)):
            raise ValueError("found an alias; allowed: values, as gbt-ocp run writes them")
        mapping = yaml.load(text, _LOADER)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ValueError(f"{path}: not valid YAML: {' '.join(str(error).split())}") from None
    if not isinstance(mapping, dict):
        raise ValueError(f"{path}: found {type(mapping).__name__}; allowed: a mapping, as gbt-ocp run wrote it")
    return text, mapping
