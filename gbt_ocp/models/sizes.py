"""Sizes that constructors take: above zero, not below it, whole numbers, vectors; others are refused in one line."""

from __future__ import annotations

import math
from numbers import Integral, Real

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.typing import Array


def positive(name: str, value: float) -> float:
    """The number, if it is finite and above 0.

    Raises
    ------
    ValueError
        If not; the message begins with ``name``.
    """
    if not (_is_finite(value) and value > 0.0):
        raise ValueError(f"{name}: found {value!r}; allowed: a number > 0")
    return value


def not_negative(name: str, value: float) -> float:
    """The number, if it is finite and not below 0.

    Raises
    ------
    ValueError
        As :func:`positive`.
    """
    if not (_is_finite(value) and value >= 0.0):
        raise ValueError(f"{name}: found {value!r}; allowed: a number >= 0")
    return value


def at_least(name: str, value: int, least: int) -> int:
    """The number, if it is an integer and not below ``least``.

    Raises
    ------
    ValueError
        As :func:`positive`.
    """
    if not isinstance(value, Integral) or isinstance(value, bool) or value < least:
        raise ValueError(f"{name}: found {value!r}; allowed: a whole number >= {least}")
    return value


def vector(name: str, values: ArrayLike, size: int, *, above_zero: bool = False) -> Array:
    """The numbers as an array of its own ``(size,)``, if they are finite, and above 0 where that is asked for.

    Raises
    ------
    ValueError
        As :func:`positive`.
    """
    try:
        found = np.array(values, dtype=float)
    except (TypeError, ValueError):
        found = np.full(0, np.nan)
    # of two or three numbers functions of arrays are slower than those of numbers
    is_finite = found.shape == (size,) and all(map(math.isfinite, found.tolist()))
    if not is_finite or (above_zero and not np.all(found > 0.0)):
        raise ValueError(f"{name}: found {values!r}; allowed: {size} finite numbers{' > 0' * above_zero}")
    return found


def _is_finite(value: object) -> bool:
    if type(value) is float:  # most are, and isinstance with an abstract class takes ten times as long
        return math.isfinite(value)
    return isinstance(value, Real) and not isinstance(value, bool) and bool(np.isfinite(float(value)))
