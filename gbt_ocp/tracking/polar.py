"""A measurement of any kind as rows in the direction of the target, its log range and the log of its size.

In these coordinates angles, log ranges and the log of an angular size are linear, whatever the range: a target at
``own + r λ`` of size s has the direction λ, the log range ``log r``, and fills the angle ``2 arctan(s/(2 r))``, so that
``log(2 tan(φ/2)) = log s - log r``. A range known to a few per cent is normal in its logarithm as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_args

import numpy as np

from gbt_ocp.models.bearings import log_map, tangent_basis, unit_bearing
from gbt_ocp.models.measurements import MeasurementKind, Sighting
from gbt_ocp.typing import Array

BEARINGS: tuple[MeasurementKind, ...] = ("azimuth", "azimuth_elevation")
"""Kinds that a tracker of bearings takes: the azimuth in the plane, azimuth and elevation in space."""

WITHOUT_SIZE: tuple[MeasurementKind, ...] = tuple(kind for kind in get_args(MeasurementKind) if kind != "size")
"""Kinds that need no prior of the target's size."""

ALL_KINDS: tuple[MeasurementKind, ...] = get_args(MeasurementKind)

NEAREST_RANGE = 1.0e-2
"""Range in metres below which a predicted position counts as so far away in the direction that it has."""

LEAST_LEVEL = 1.0e-3
"""Share of the line of sight in the horizontal below which an azimuth says nothing."""


@dataclass(frozen=True)
class PolarRows:
    """k rows ``residual = across · δλ + along δ(log r) + size δ(log s) + noise``; leading axes run over predictions.

    Attributes
    ----------
    unit
        Predicted direction λ ``(..., d)``.
    range
        Predicted range ``(...)`` in metres.
    across
        Directions in the tangent plane of λ ``(..., k, d)``, unit vectors; zero where no angle is measured.
    along, size
        Factors of log range and log size ``(k,)``.
    residuals
        Measured less predicted ``(..., k)``: angles in radians, logarithms.
    stds
        Standard deviations of the noise ``(..., k)``.
    """

    unit: Array
    range: Array
    across: Array
    along: Array
    size: Array
    residuals: Array
    stds: Array


def checked_sighting(
    sighting: Sighting,
    takes: tuple[MeasurementKind, ...],
    name: str,
    dimension: int,
    latest: float | None,
) -> None:
    """Refuse a measurement that a tracker cannot take.

    Parameters
    ----------
    sighting
        The measurement.
    takes
        Kinds that the tracker takes.
    name
        Of the tracker.
    dimension
        d.
    latest
        Time of its latest measurement in seconds; an equal time is another sensor's.

    Raises
    ------
    ValueError
        If the kind is not taken, d is another, a number is not finite or a length not above 0, time decreases, or the
        deviation is missing of what is no angle.
    """
    kind = sighting.kind
    if kind not in takes:
        why = "; the size needs a prior" if kind == "size" and "range" in takes else ""
        raise ValueError(f"kind: found '{kind}'; {name} takes {', '.join(takes)}{why}")
    if sighting.position.shape != (dimension,):
        raise ValueError(f"position: found {sighting.position.size} numbers; allowed: {dimension}")
    if kind in ("elevation", "azimuth_elevation") and dimension == 2:
        raise ValueError(f"kind: found '{kind}' in 2 dimensions; allowed: a kind without an elevation")
    values = [sighting.time, *sighting.value, *sighting.position]
    if not np.all(np.isfinite(values)):
        raise ValueError(f"time, value and position: found {values}; allowed: finite numbers")
    if latest is not None and sighting.time < latest:
        raise ValueError(f"time: found {sighting.time} after {latest}; allowed: times that do not decrease")
    if kind in ("range", "size") and not sighting.value[0] > 0.0:
        raise ValueError(f"value: found {sighting.value[0]}; allowed: a {kind} above 0")
    if kind == "size" and not sighting.value[0] < np.pi:
        raise ValueError(f"value: found {sighting.value[0]}; allowed: an angle below π")
    if kind == "position" and np.array_equal(sighting.value, sighting.position):
        raise ValueError("value: found the sensor's own position; allowed: another position")
    if kind in ("range", "size", "position") and not np.all(np.isfinite(sighting.std)):
        raise ValueError(f"std: found none; allowed: a standard deviation with a measurement of kind '{kind}'")


def polar_rows(sighting: Sighting, position: Array, bearing_std: float, log_size: Array | float = 0.0) -> PolarRows:
    """The rows of a measurement at predicted positions.

    Parameters
    ----------
    sighting
        The measurement.
    position
        Predicted positions ``(..., d)`` in metres.
    bearing_std
        Standard deviation in radians of an angle that did not say it.
    log_size
        Predicted logarithm of the size ``(...)``.
    """
    d = position.shape[-1]
    line = position - sighting.position
    distance = np.linalg.norm(line, axis=-1)
    near = distance < NEAREST_RANGE
    safe = np.where(near, 1.0, distance)
    ahead = np.eye(d)[0] if sighting.kind in ("range", "size", "elevation") else _direction(sighting, d)
    unit = np.where((distance > 0.0)[..., None], line / np.where(distance > 0.0, distance, 1.0)[..., None], ahead)
    distance = np.where(near, NEAREST_RANGE, safe)
    if sighting.kind in ("range", "size"):
        return _lengths(sighting, unit, distance, log_size)
    if sighting.kind == "position":
        return _place(sighting, unit, distance)
    basis, std = tangent_basis(unit), np.where(np.isnan(sighting.std), bearing_std, sighting.std)
    if d == 2:
        angle = log_map(unit, _direction(sighting, d), basis)
        return _angles(unit, distance, np.swapaxes(basis, -1, -2), angle, np.broadcast_to(std, angle.shape))
    return _in_space(sighting, unit, distance, std)


def bearing_of(sighting: Sighting) -> Array | None:
    """The unit vector ``(d,)`` to the target, where the measurement gives one."""
    if sighting.kind == "position":
        return unit_bearing(sighting.value, sighting.position)
    return sighting.bearing if is_bearing(sighting) else None


def is_bearing(sighting: Sighting) -> bool:
    """Whether the measurement is a direction and nothing else."""
    return (sighting.kind, sighting.position.size) in (("azimuth", 2), ("azimuth_elevation", 3))


def _direction(sighting: Sighting, dimension: int) -> Array:
    """The measured direction; that of an azimuth in space is level."""
    found = bearing_of(sighting)
    if found is not None:
        return found
    return np.array([np.cos(sighting.value[0]), np.sin(sighting.value[0]), 0.0])[:dimension]


def _angles(unit: Array, distance: Array, across: Array, residuals: Array, stds: Array) -> PolarRows:
    nothing = np.zeros(across.shape[-2])
    return PolarRows(unit, distance, across, nothing, nothing, residuals, stds)


def _in_space(sighting: Sighting, unit: Array, distance: Array, std: Array) -> PolarRows:
    """Azimuth, elevation, or both. An azimuth is an angle across the line times the cosine of the elevation."""
    level = np.maximum(np.hypot(unit[..., 0], unit[..., 1]), LEAST_LEVEL)
    nothing = np.zeros_like(level)
    east, north, up = unit[..., 0] / level, unit[..., 1] / level, unit[..., 2]
    sideways = np.stack([-north, east, nothing], axis=-1)
    upwards = np.stack([-up * east, -up * north, level], axis=-1)
    axes, off, deviations = [], [], []
    both = sighting.kind == "azimuth_elevation"
    if both:
        turned = log_map(unit, sighting.bearing, np.stack([sideways, upwards], axis=-1))
    if sighting.kind != "elevation":
        turn = sighting.value[0] - np.arctan2(unit[..., 1], unit[..., 0])
        axes.append(sideways)
        off.append(turned[..., 0] if both else level * np.angle(np.exp(1j * turn)))
        # the deviation of an azimuth is that of the angle about the vertical
        deviations.append(std[0] * (max(np.cos(sighting.value[1]), LEAST_LEVEL) + nothing if both else level))
    if sighting.kind != "azimuth":
        axes.append(upwards)
        off.append(turned[..., 1] if both else sighting.value[0] - np.arctan2(up, level))
        deviations.append(std[-1] + nothing)
    return _angles(unit, distance, np.stack(axes, axis=-2), np.stack(off, axis=-1), np.stack(deviations, axis=-1))


def _lengths(sighting: Sighting, unit: Array, distance: Array, log_size: Array | float) -> PolarRows:
    """A range, or an angular size."""
    value, std = sighting.value[0], sighting.std[0]
    if sighting.kind == "range":
        along, size, residual, deviation = 1.0, 0.0, np.log(value) - np.log(distance), std / value
    else:
        along, size = -1.0, 1.0
        residual = np.log(2.0 * np.tan(0.5 * value)) - (log_size - np.log(distance))
        deviation = std / np.sin(value)  # d log tan(φ/2) = dφ / sin φ
    across = np.zeros((*unit.shape[:-1], 1, unit.shape[-1]))
    stds = np.full((*distance.shape, 1), deviation)
    return PolarRows(unit, distance, across, np.array([along]), np.array([size]), residual[..., None], stds)


def _place(sighting: Sighting, unit: Array, distance: Array) -> PolarRows:
    """A position as its direction and the logarithm of its range; its deviations are taken along these."""
    seen, far = unit_bearing(sighting.value, sighting.position), np.linalg.norm(sighting.value - sighting.position)
    basis = tangent_basis(unit)
    across = np.swapaxes(basis, -1, -2)
    axes = np.concatenate([across, unit[..., None, :]], axis=-2)
    stds = np.sqrt(axes**2 @ sighting.std**2) / far
    residuals = np.concatenate([log_map(unit, seen, basis), (np.log(far) - np.log(distance))[..., None]], axis=-1)
    across = np.concatenate([across, np.zeros_like(unit)[..., None, :]], axis=-2)
    along = np.eye(unit.shape[-1])[-1]
    return PolarRows(unit, distance, across, along, np.zeros(unit.shape[-1]), residuals, stds)
