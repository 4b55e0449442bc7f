"""Angles and axes: compass and mathematical, from the bow and from the earth, north-east-down and east-north-up."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.typing import Array

QUARTER = 0.5 * np.pi


def wrapped(angle: ArrayLike) -> Array:
    """The same directions as angles above -π and up to π, ``(...)`` in radians."""
    return np.asarray(np.pi - np.mod(np.pi - np.asarray(angle, dtype=float), 2.0 * np.pi))


def compass_to_math(angle: ArrayLike) -> Array:
    """Angles clockwise from north, ``(...)`` in radians, as angles counter-clockwise from east (+x)."""
    return np.asarray(QUARTER - np.asarray(angle, dtype=float))


def math_to_compass(angle: ArrayLike) -> Array:
    """Angles counter-clockwise from east (+x), ``(...)`` in radians, as angles clockwise from north in [0, 2π)."""
    return np.mod(QUARTER - np.asarray(angle, dtype=float), 2.0 * np.pi)


def bow_to_earth(angle: ArrayLike, yaw: ArrayLike) -> Array:
    """Angles counter-clockwise from the bow as angles counter-clockwise from +x.

    Parameters
    ----------
    angle
        From the bow towards port ``(...)`` in radians.
    yaw
        Of the bow, counter-clockwise from +x ``(...)`` in radians.
    """
    return np.asarray(np.asarray(angle, dtype=float) + np.asarray(yaw, dtype=float))


def earth_to_bow(angle: ArrayLike, yaw: ArrayLike) -> Array:
    """Angles counter-clockwise from +x as angles counter-clockwise from the bow: undoes :func:`bow_to_earth`."""
    return np.asarray(np.asarray(angle, dtype=float) - np.asarray(yaw, dtype=float))


def ned_to_enu(vectors: ArrayLike) -> Array:
    """Vectors north, east(, down) as vectors east, north(, up): ``(..., 2)`` or ``(..., 3)`` in any unit.

    Raises
    ------
    ValueError
        If the last axis has another length.
    """
    found = np.asarray(vectors, dtype=float)
    if found.ndim == 0 or found.shape[-1] not in (2, 3):
        raise ValueError(f"vectors: found the shape {found.shape}; allowed: (..., 2) or (..., 3)")
    turned = found.copy()
    turned[..., :2] = found[..., 1::-1]
    turned[..., 2:] = -found[..., 2:]
    return turned


def enu_to_ned(vectors: ArrayLike) -> Array:
    """Vectors east, north(, up) as vectors north, east(, down): undoes :func:`ned_to_enu`."""
    return ned_to_enu(vectors)  # exchanging two axes and turning the third over undoes itself


def yaw_of_quaternion(quaternions: ArrayLike) -> Array:
    """Angle about the vertical of quaternions x, y, z, w, ``(..., 4)``: ``(...)`` in radians.

    From a frame with axes forward, left, up to one with axes east, north, up (ROS, REP 103) it is the yaw,
    counter-clockwise from +x. From forward, right, down to north, east, down (MAVLink) it is the heading, clockwise
    from north.

    Raises
    ------
    ValueError
        If the last axis has not four entries.
    """
    found = np.asarray(quaternions, dtype=float)
    if found.ndim == 0 or found.shape[-1] != 4:
        raise ValueError(f"quaternions: found the shape {found.shape}; allowed: (..., 4)")
    x, y, z, w = np.moveaxis(found, -1, 0)
    return np.asarray(np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z))
