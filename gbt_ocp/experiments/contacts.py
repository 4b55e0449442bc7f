"""Several contacts in one log: rows of one of them, and columns that seem to tell them apart."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from gbt_ocp.experiments.config.yaml_dialect import shortened
from gbt_ocp.typing import Array

FEWEST_ROWS = 3
"""Rows of a value, and changes from one value to another, below which nothing is concluded from a column."""

MOST_CONTACTS = 50
"""A column with more values is a measurement or a counter, and no name of a contact."""

FARTHER = 4.0
"""Bearings of different contacts lie so many times farther apart than successive ones of the same contact."""

SENSORS_AGREE = np.deg2rad(10.0)
"""Two sensors that see one contact differ by less: by their biases, which may be many times their noise."""


PLAIN_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
"""A number as any program writes it: digits of ASCII, a point, an exponent."""


def is_value(cell: str, value: str | float, exact: bool = False) -> bool:
    """Whether a cell holds a value: the same text or, unless ``exact``, the same number however it is written."""
    if cell == str(value):
        return True
    if exact or not (PLAIN_NUMBER.fullmatch(cell) and PLAIN_NUMBER.fullmatch(str(value))):
        return False
    return float(cell) == float(value)


def same_text(cells: Iterable[str], value: str | float) -> bool:
    """Whether one of the cells is the text of a value: then cells with the same number are others, 7 beside 007."""
    return isinstance(value, str) and value in cells


def chosen(row: Sequence[str], columns: Mapping[int, str | float], is_bearing: bool, exact: Mapping[int, bool]) -> bool:
    """Whether a row belongs to what was asked for.

    Parameters
    ----------
    row
        Its cells.
    columns
        Values by the number of the column.
    is_bearing
        Whether the row has a bearing. One without is a row of own position, which need not name a contact.
    exact
        Whether only the same text counts, by the number of the column.
    """
    return all(
        is_value(row[number], value, exact[number]) or (not is_bearing and row[number] == "")
        for number, value in columns.items()
    )


def told_apart(values: Sequence[str], bearings: Array) -> tuple[float, float] | None:
    """Whether the values of a column seem to be those of several contacts.

    Parameters
    ----------
    values
        Of the column, at the K bearings in the order of time.
    bearings
        Unit vectors ``(K, d)``.

    Returns
    -------
    Median angles in radians between successive bearings of different values and of the same, if the first is far
    larger; otherwise ``None``.
    """
    counts = Counter(values)
    frequent = [name for name, count in counts.items() if count >= FEWEST_ROWS]
    if len(frequent) < 2 or len(counts) > MOST_CONTACTS:
        return None
    names = np.asarray(values)
    changes = np.flatnonzero(names[1:] != names[:-1])
    if len(changes) < FEWEST_ROWS:
        return None
    between = float(np.median(_angles(bearings[changes], bearings[changes + 1])))
    own = [bearings[names == name] for name in frequent]
    within = float(np.median(np.concatenate([_angles(one[:-1], one[1:]) for one in own])))
    return (between, within) if between > max(FARTHER * within, SENSORS_AGREE) else None


def contact_warning(path: Path, name: str, values: Sequence[str], angles: tuple[float, float]) -> str:
    """A line about a column, or field, that seems to tell contacts apart by the ``angles`` of :func:`told_apart`."""
    between, within = np.rad2deg(angles)
    head, ids = shortened(name), shortened(", ".join(sorted(set(values))))
    return (
        f"{path}: bearings with another {head} ({ids}) lie {between:.3g} degrees apart, those with the same "
        f"{within:.3g}: the log seems to hold several contacts; --where {head}=VALUE chooses one"
    )


def _angles(first: Array, second: Array) -> Array:
    """Angles between unit vectors ``(K, d)``: ``(K,)`` in radians."""
    return np.asarray(2.0 * np.arctan2(np.linalg.norm(first - second, axis=1), np.linalg.norm(first + second, axis=1)))
