"""Units of logs: how large one of each is in the unit of the package."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.typing import Array

ANGLE_UNITS = {"rad": 1.0, "deg": np.pi / 180.0, "cdeg": np.pi / 18_000.0, "degE7": np.pi / 1.8e9}
"""Radians in each unit of an angle; ``cdeg`` is a hundredth of a degree, ``degE7`` a ten-millionth (MAVLink)."""

LENGTH_UNITS = {"m": 1.0, "km": 1000.0, "cm": 0.01, "mm": 0.001}
"""Metres in each unit of a length."""

TIME_UNITS = {"s": 1, "ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}
"""Counts a second in each unit of a time."""


def in_si(values: ArrayLike, unit: str) -> Array:
    """Values ``(...)`` of a unit of angle or length in radians or metres.

    Raises
    ------
    ValueError
        If the unit is none of :data:`ANGLE_UNITS` and :data:`LENGTH_UNITS`.
    """
    known = {**ANGLE_UNITS, **LENGTH_UNITS}
    if unit not in known:
        raise ValueError(f"unit: found {unit!r}; allowed: {', '.join(known)}")
    found = np.asarray(values, dtype=float)
    # degrees as numpy turns them, to the last bit
    return np.deg2rad(found) if unit == "deg" else np.asarray(found * known[unit])
