"""Whether the files that a comparison is made of are what their tasks leave; what is not is made again."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.simulation.summary import FALLBACKS
from gbt_ocp.studies.limits.comparison_tables import Row, read_rows
from gbt_ocp.studies.limits.problems import RANDOM, RECORDED, Problems
from gbt_ocp.studies.limits.sensitivity import sample
from gbt_ocp.studies.limits.solves import COLD_AND_WARM, is_possible
from gbt_ocp.studies.limits.tasks import ComparisonPlan, Task

_SOLVE = ("run", "problem", "solved", "iterations", "time_ms", "objective", "violation_nodes", "violation_between")
_LATER = ("fallbacks_unfinished",)
"""Columns that folders of earlier versions do not have."""

_COUNTS = tuple(f"fallbacks_{word}" for word in (*FALLBACKS, "other"))
_LOOP_COUNTS = ("run", "steps", "tightened", "clipped", *(name for name in _COUNTS if name not in _LATER))
NUMBERS = {
    "solve": _SOLVE,
    "sweep": _SOLVE,
    "best": ("problem", "best", "near_best", "starts"),
    "loop": _LOOP_COUNTS,
}
"""Columns that hold a number in every row (it may be NaN), by the kind of the task."""

OPTIONAL = {
    "solve": (),
    "sweep": ("kink_mm", "stiffness"),
    "best": (),
    "loop": ("error_settled", "error_mean", "violation_max", "distance_median", "condition_median", "wall_s"),
}
"""Columns that hold a number or nothing."""


def check_rows(path: Path, task: Task, plan: ComparisonPlan, problems: Problems) -> None:
    """Read the rows that a task has left.

    Raises
    ------
    ValueError
        If they are not this task's, not all of them, or not numbers where numbers should be.
    """
    if not path.read_bytes().endswith(b"\n"):
        raise ValueError("found no end of the last line")
    try:
        rows = read_rows(path)
    except (ValueError, csv.Error, AttributeError, TypeError) as fault:  # lines with too few or too many cells
        raise ValueError(f"found no table ({fault})") from None
    keys = _keys(task, plan, problems)
    if len(rows) != len(keys):
        raise ValueError(f"found {len(rows)} rows; allowed: {len(keys)}")
    for number, (row, key) in enumerate(zip(rows, keys, strict=True), start=1):
        _check_row(row, key, task.kind, number)


def _check_row(row: Row, key: Row, kind: str, number: int) -> None:
    for name, value in key.items():
        found = row.get(name)
        if name == "value" and isinstance(found, int | float):
            found = f"{found:g}"
        if str(found) != str(value):  # a name may look like a number
            raise ValueError(f"row {number}: {name}: found {found!r:.40}; allowed: {value!r}")
    for name in (*NUMBERS[kind], *OPTIONAL[kind]):
        found = row.get(name, "no such column")
        if not (isinstance(found, int | float) or (found is None and name in OPTIONAL[kind])):
            raise ValueError(f"row {number}: {name}: found {found!r:.40}; allowed: a number")


def _keys(task: Task, plan: ComparisonPlan, problems: Problems) -> list[Row]:
    """What identifies each row of a task."""
    case: Row = {"case": plan.configurations[task.case].name}
    if task.kind == "best":
        return [{**case, "problem": k} for k in task.argument]
    assert task.pair is not None
    case |= {"formulation": task.pair.formulation, "solver": task.pair.solver}
    if task.kind == "loop":
        return [{**case, "run": task.argument}]
    if task.kind == "solve":
        mode, chunk = task.argument
        return _asked(case, problems, chunk, mode)
    some = sample(problems, task.pair)
    return [
        {"swept": task.argument.swept, "value": value, **row}
        for value, _ in task.argument.points
        for mode in COLD_AND_WARM
        for row in _asked(case, some, range(len(some)), mode)
    ]


def _asked(case: Row, problems: Problems, numbers: Sequence[int], mode: str) -> list[Row]:
    return [{**case, "mode": mode, "problem": k} for k in numbers if is_possible(problems[k], mode)]


def check_problems(problems: Problems, configuration: Configuration, recorded: Sequence[int], random: int) -> None:
    """Check that problems are those of an experiment: recorded in these runs, and so many random ones.

    Raises
    ------
    ValueError
        If they are not.
    """
    found: dict[str, Any] = {
        "coordinates": problems.mean.shape[2],
        "runs": sorted(set(problems.run[problems.origin == RECORDED].tolist())),
        "random problems": int(np.sum(problems.origin == RANDOM)),
    }
    allowed = {"coordinates": configuration.dimension, "runs": list(recorded), "random problems": random}
    for name, value in found.items():
        if value != allowed[name]:
            raise ValueError(f"{name}: found {value}; allowed: {allowed[name]}")
