"""Clocks: UTC as text, and counts of an epoch, as seconds since 1970-01-01T00:00:00Z without leap seconds."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.frames.units import TIME_UNITS
from gbt_ocp.typing import Array

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def seconds_of_utc(text: str) -> float:
    """Seconds since the epoch of a date and time in ISO 8601, ``2026-11-25T12:00:00.25Z``.

    A text without an offset is UTC. What stands behind the sixth decimal of a second is passed over.

    Raises
    ------
    ValueError
        If the text is no date with a time.
    """
    try:
        found = datetime.fromisoformat(text)
    except ValueError:
        found = None
    if found is None or not re.match(r"\d{4}-?\d\d-?\d\d[Tt ]\d\d", text):
        raise ValueError(f"found {text!r}; allowed: a date and time as in 2026-11-25T12:00:00.25Z")
    since = (found if found.tzinfo else found.replace(tzinfo=UTC)) - _EPOCH
    # the two parts are exact, and so is their sum as far as a number of this size can be
    return since.days * 86_400 + since.seconds + since.microseconds / 1e6


def utc_of_seconds(seconds: float) -> str:
    """Date and time in ISO 8601 with microseconds: undoes :func:`seconds_of_utc`.

    Raises
    ------
    ValueError
        If the number is not finite, or the year is not one of 1 to 9999.
    """
    try:
        found = _EPOCH + timedelta(microseconds=round(1e6 * seconds))
    except (OverflowError, ValueError):
        raise ValueError(f"seconds: found {seconds!r}; allowed: those of the years 1 to 9999") from None
    return found.isoformat(timespec="microseconds").replace("+00:00", "Z")


def seconds_of_counts(counts: ArrayLike, unit: str) -> Array:
    """Seconds of counts ``(...)`` in a unit of :data:`~gbt_ocp.frames.units.TIME_UNITS`.

    Integers of any size are divided exactly before they are rounded to a floating-point number.

    Raises
    ------
    ValueError
        If the unit is unknown.
    """
    if unit not in TIME_UNITS:
        raise ValueError(f"unit: found {unit!r}; allowed: {', '.join(TIME_UNITS)}")
    found = np.asarray(counts)
    if not np.issubdtype(found.dtype, np.integer):
        return np.asarray(found.astype(float) / TIME_UNITS[unit])
    rest = np.fmod(found, TIME_UNITS[unit])  # of the sign of the count, so that small counts stay exact
    return np.asarray(((found - rest) // TIME_UNITS[unit]).astype(float) + rest.astype(float) / TIME_UNITS[unit])
