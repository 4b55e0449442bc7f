"""Residuals of a replayed track by sensor: each measurement less what the track predicted before it was known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gbt_ocp.frames import wrapped
from gbt_ocp.models.measurements import Sighting
from gbt_ocp.simulation.replayed_track import BearingLog, ReplayedTrack
from gbt_ocp.typing import Array

ANGULAR = ("azimuth", "azimuth_elevation", "elevation", "size")
"""Kinds of measurements whose residuals are angles; the others are in metres."""


def residual_of(sighting: Sighting, position: Array) -> Array:
    """A measurement less its value for a target at a position: ``(m,)`` in radians or metres.

    NaN for an angular size, since the true size is not one of the track, and at the sensor itself.

    Parameters
    ----------
    sighting
        The measurement.
    position
        Of the target ``(d,)`` in metres.
    """
    line = np.asarray(position, dtype=float) - sighting.position
    level = float(np.hypot(line[0], line[1]))
    if sighting.kind == "position":
        return np.asarray(sighting.value - position)
    if sighting.kind == "range":
        return np.asarray(sighting.value - np.linalg.norm(line))
    if sighting.kind == "size" or not np.linalg.norm(line) > 0.0:
        return np.full(sighting.value.size, np.nan)
    azimuth, elevation = np.arctan2(line[1], line[0]), np.arctan2(line[2] if line.size == 3 else 0.0, level)
    expected = {"azimuth": [azimuth], "elevation": [elevation]}.get(sighting.kind, [azimuth, elevation])
    return wrapped(sighting.value - np.array(expected))


def track_residuals(track: ReplayedTrack, log: BearingLog) -> list[Array]:
    """Residuals of all measurements of a log, each ``(m,)``; NaN where nothing was predicted."""
    found = [np.full(one.value.size, np.nan) for one in log.sightings]
    for k, (one, mean) in enumerate(zip(log.sightings, track.before.mean, strict=True)):
        if np.isfinite(mean).all():
            found[k] = residual_of(one, mean)
    return found


def by_sensor(track: ReplayedTrack, log: BearingLog, score_from: float) -> list[dict[str, Any]]:
    """Count, mean and standard deviation of the residuals of each sensor and kind.

    Parameters
    ----------
    track, log
        The track and its log.
    score_from
        Time in seconds after the first measurement from which residuals count.

    Returns
    -------
    Mappings with ``sensor``, ``kind``, ``count``, and per component ``mean``, ``std``, ``rms`` with the ``unit``
    (``deg`` or ``m``); ``None`` where nothing is known.
    """
    groups: dict[tuple[str, str], list[Array]] = {}
    for one, residual in zip(log.sightings, track_residuals(track, log), strict=True):
        rows = groups.setdefault((one.sensor, one.kind), [])
        if one.time >= log.times[0] + score_from:
            rows.append(residual)
    return [
        {"sensor": sensor, "kind": kind, "count": len(rows), **_moments(rows, kind)}
        for (sensor, kind), rows in sorted(groups.items())
    ]


def _moments(rows: Sequence[Array], kind: str) -> dict[str, Any]:
    scale, unit = (180.0 / np.pi, "deg") if kind in ANGULAR else (1.0, "m")
    values = scale * np.array(rows) if rows else np.zeros((0, 1))
    values = values[np.isfinite(values).all(axis=1)]
    if not len(values):
        return {"mean": None, "std": None, "rms": None, "unit": unit}
    return {
        "mean": values.mean(axis=0).tolist(),
        "std": values.std(axis=0).tolist(),
        "rms": np.sqrt(np.mean(values**2, axis=0)).tolist(),
        "unit": unit,
    }
