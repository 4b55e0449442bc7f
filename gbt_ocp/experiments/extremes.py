"""Numbers that no computation survives: squares that overflow, reciprocals that vanish, counts that fill the memory.

Each is right by itself as far as its key can tell, so it would be taken, and fail far from its cause.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from gbt_ocp.experiments.faults import Fault, shown

SMALLEST, LARGEST = 1.0e-30, 1.0e12
"""Sizes between which a number other than 0 must lie: products of a few of them are still ordinary numbers."""

MOST: dict[tuple[str, ...], int] = {
    ("duration_s",): 10_000_000,
    ("tracker", "window"): 10_000,
    ("tracker", "forecast"): 10_000,
    ("tracker", "hypotheses"): 1_000,
    ("tracker", "noise", "window"): 10_000,
    ("planner", "nodes"): 1_000,
    ("limits", "nodes"): 1_000,
}
"""Largest counts, and the longest run in seconds."""

MOST_STEPS = 10_000_000
"""Largest number of sampling periods in a run."""

MOST_BINS = 2_000
"""Largest number of bins in a window; the covariance of the noise is a matrix of that size."""

MOST_DRAWS = 1_000
"""Largest number of random thrusts in a sampling period, of which only the last is applied."""

# A seed is no quantity, and the options are the solver's own.
_FREE = (("seed",), ("planner", "solver_options"))


def is_moderate(value: float) -> bool:
    """Whether a number is 0 or of a size that can be computed with."""
    return value == 0 or SMALLEST <= abs(value) <= LARGEST


def extremes(merged: Mapping[str, Any]) -> Iterator[Fault]:
    """Faults of size, one a number; infinity and NaN are left to the models.

    Parameters
    ----------
    merged
        All layers of the configuration.
    """
    for path, value in _numbers(merged, ()):
        if not is_moderate(value):
            yield Fault(path, shown(value), f"0, or a number of a size from {SMALLEST:g} to {LARGEST:g}")
        elif (most := MOST.get(path)) is not None and value > most:
            yield Fault(path, shown(value), f"at most {most}")


def too_many(value: float, unit: float, most: int) -> bool:
    """Whether a stretch holds more than so many units (both moderate)."""
    return value > most * unit * (1.0 + 1e-9)


def _numbers(node: Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], float]]:
    if path in _FREE:
        return
    if isinstance(node, Mapping):
        for key, value in node.items():
            yield from _numbers(value, (*path, key))
    elif isinstance(node, list):
        # a list of numbers is one key; a list of sections is many
        for k, value in enumerate(node):
            yield from _numbers(value, (*path, str(k)) if isinstance(value, Mapping) else path)
    elif (
        isinstance(node, int | float) and not isinstance(node, bool) and (isinstance(node, int) or math.isfinite(node))
    ):
        yield path, node
