"""Own positions, headings and measurements of a log, put together: the measurements placed in the earth frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.logs.conversion import Measured, Positions
from gbt_ocp.frames import LocalPlane
from gbt_ocp.models.measurements import MeasurementKind, Sighting
from gbt_ocp.simulation.replayed_track import BearingLog
from gbt_ocp.typing import Array

SAME_TIME = 1.0e-6
"""Seconds by which a row that shares its time with the one before it is put later: two sensors, one clock."""

FAR_BETWEEN = 10.0
"""Own positions so many times farther apart than usual around a measurement are warned of."""


@dataclass(frozen=True)
class RawLog:
    """What was read of a log.

    Attributes
    ----------
    path
        Of the log.
    own
        Positions of the vehicle, times not decreasing.
    headings
        Times ``(H,)`` and yaw ``(H,)`` in radians, times not decreasing.
    measured
        By entry.
    truth
        Positions of the target; NaN where they are not known.
    by_row
        Whether own positions, measurements and truth are columns of the same rows.
    """

    path: Path
    own: Positions
    headings: tuple[Array, Array]
    measured: list[Measured]
    truth: Positions | None = None
    by_row: bool = False


@dataclass
class _Columns:
    """Measurements of all entries, one below the other."""

    times: Array
    rows: NDArray[np.int64]
    kinds: NDArray[np.str_]
    from_bow: NDArray[np.bool_]
    values: Array  # (K, 2)
    stds: Array
    sensors: NDArray[np.str_]
    left_out: list[str] = field(default_factory=list)

    def keep(self, kept: NDArray[np.bool_], why: str) -> None:
        """Leave out the others, and say so."""
        if not kept.all():
            count = int(np.sum(~kept))
            self.left_out.append(f"{count} measurement{'s were' if count > 1 else ' was'} left out: {why}")
            self.reorder(np.flatnonzero(kept))

    def reorder(self, order: NDArray[np.int64]) -> None:
        for name in ("times", "rows", "kinds", "from_bow", "values", "stds", "sensors"):
            setattr(self, name, getattr(self, name)[order])


def apart(times: Array) -> Array:
    """Times that do not decrease, those of rows that share one told apart ``(K,)``."""
    starts = np.flatnonzero(np.concatenate([[True], np.diff(times) > 0.0]))
    repeats = np.arange(len(times)) - np.repeat(starts, np.diff([*starts, len(times)]))
    return np.asarray(times + SAME_TIME * repeats)


def assembled(
    raw: RawLog,
    *,
    latency: float = 0.0,
    origin: LocalPlane | None = None,
    in_plane: bool = False,
    heading_std: float = 0.0,
    stds: Mapping[str, float | None] | None = None,
) -> tuple[BearingLog, NDArray[np.int64]]:
    """The log in the order of time.

    Parameters
    ----------
    raw
        What was read.
    latency
        Time in seconds by which a measurement is older than its stamp.
    origin
        Of the plane; by default the first own position, at height 0, where positions are geographic.
    in_plane
        Leave out heights and elevations.
    heading_std
        Standard deviation of the heading in radians, which bearings from the bow have besides their own.
    stds
        Standard deviations by kind in radians or metres, of measurements that do not say their own.

    Returns
    -------
    The log, and the number of the record of each of its measurements.

    Raises
    ------
    ConfigurationError
        If fewer than two measurements are left.
    """
    found = _stacked(raw.measured)
    for kind, std in (stds or {}).items():
        silent = (found.kinds == kind) & np.isnan(found.stds[:, 0])
        found.stds[silent, 0] = np.nan if std is None else std
    if raw.own.geographic and origin is None:
        origin = LocalPlane(*map(float, raw.own.values[0, :2]))
    space = raw.own.has_height and not in_plane and any("elevation" in kind for kind in found.kinds)
    dimension = 3 if space else 2
    own_times = apart(raw.own.times)
    if np.any(np.diff(own_times) <= 0.0):
        raise ConfigurationError([f"{raw.path}: t: found more bearings at one time than can be told apart"])
    own = raw.own.in_plane(origin)[:, :dimension]
    if raw.by_row:
        found.times = own_times[found.rows]
    found.times = found.times - latency
    if not space:
        found.keep(found.kinds != "elevation", "elevations, since the track is one in the plane")
        found.kinds[found.kinds == "azimuth_elevation"] = "azimuth"
    late = f" after a latency of {latency:g} s" if latency else ""
    if raw.by_row:
        found.reorder(np.flatnonzero(found.times >= own_times[0]))
    else:
        inside = (found.times >= own_times[0]) & (found.times <= own_times[-1])
        found.keep(inside, f"no own position before or after them{late}")
    yaw = np.zeros(len(found.times))
    if found.from_bow.any():
        known = (found.times >= raw.headings[0][0]) & (found.times <= raw.headings[0][-1])
        found.keep(known | ~found.from_bow, "bearings from the bow without a heading before or after them")
        yaw = np.interp(found.times, raw.headings[0], np.unwrap(raw.headings[1]))
    if len(found.times) < 2:
        raise ConfigurationError([f"{raw.path}: found {len(found.times)} bearings{late}; allowed: at least 2"])
    direct = raw.by_row and latency == 0.0
    there = own[found.rows] if direct else between(found.times, own_times, own)
    found.values[found.from_bow, 0] += yaw[found.from_bow]
    found.stds[found.from_bow, 0] = np.hypot(found.stds[found.from_bow, 0], heading_std)
    if raw.own.geographic and origin is not None:
        _turn(found, there, origin)
    truth = _truth(raw, found, own_times, origin, dimension, direct)
    times = found.times
    order = np.argsort(times, kind="stable")
    found.reorder(order)
    there, times = there[order], apart(times[order])
    if np.any(np.diff(times) <= 0.0):
        raise ConfigurationError([f"{raw.path}: t: found more bearings at one time than can be told apart"])
    lines = [f"{raw.path}: {line}" for line in (*found.left_out, *([] if raw.by_row else _sparse(times, own_times)))]
    own_only = len(own_times) - (len(np.unique(found.rows)) if raw.by_row else 0)
    bearings, sightings = _sighted(found, times, there, dimension)
    log = BearingLog(
        times,
        there,
        bearings,
        truth[order] if truth is not None else None,
        own_rows=own_only,
        warnings=tuple(lines),
        sightings=sightings,
        plane=origin,
    )
    return log, found.rows


def _stacked(measured: Sequence[Measured]) -> _Columns:
    def padded(values: Array) -> Array:
        return np.column_stack([values, np.full((len(values), 2 - values.shape[1]), np.nan)])

    counts = [len(one.times) for one in measured]
    return _Columns(
        np.concatenate([one.times for one in measured]),
        np.concatenate([one.rows for one in measured]),
        np.repeat([one.kind for one in measured], counts).astype("<U17"),
        # a heading is needed for azimuths alone
        np.repeat([one.frame == "bow" and "azimuth" in one.kind for one in measured], counts),
        np.concatenate([padded(one.values) for one in measured]),
        np.concatenate([padded(one.stds) for one in measured]),
        np.array([name for one in measured for name in one.sensors], dtype=np.str_),
    )


def between(times: Array, stamps: Array, positions: Array) -> Array:
    """Positions at times between the stamps ``(K, d)``."""
    return np.stack([np.interp(times, stamps, values) for values in positions.T], axis=-1)


def _turn(found: _Columns, there: Array, plane: LocalPlane) -> None:
    """Azimuths from the north of where they were measured, in the axes of the plane."""
    seen = np.isin(found.kinds, ["azimuth", "azimuth_elevation"])
    azimuth, elevation = found.values[seen].T
    elevation = np.where(found.kinds[seen] == "azimuth_elevation", elevation, 0.0)
    level = np.cos(elevation)
    local = np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    latitude, longitude, _ = plane.from_plane(there[seen])
    turned = plane.turned(local, latitude, longitude)
    found.values[seen, 0] = np.arctan2(turned[:, 1], turned[:, 0])
    high = np.arctan2(turned[:, 2], np.hypot(turned[:, 0], turned[:, 1]))
    found.values[seen, 1] = np.where(found.kinds[seen] == "azimuth_elevation", high, found.values[seen, 1])


def _truth(
    raw: RawLog, found: _Columns, own_times: Array, plane: LocalPlane | None, dimension: int, direct: bool
) -> Array | None:
    """The target's position at the measurements ``(K, d)``; NaN where it is not known."""
    if raw.truth is None:
        return None
    if raw.truth.geographic and plane is None:
        line = "found true positions in latitude and longitude beside own positions in a plane"
        raise ConfigurationError([f"{raw.path}: {line}; allowed: --origin says where on the earth the plane is"])
    values = raw.truth.in_plane(plane)[:, :dimension]
    if direct:
        return values[found.rows]
    times = own_times if raw.by_row else apart(raw.truth.times)
    known: NDArray[np.bool_] = np.asarray(np.isfinite(values).all(axis=1))
    if raw.by_row:  # a measurement whose truth is not known interrupts the truth
        known[np.concatenate([one.rows for one in raw.measured])] = True
    if not known.any():
        return np.full((len(found.times), dimension), np.nan)
    truth = between(found.times, times[known], values[known])
    truth[(found.times < times[known][0]) | (found.times > times[known][-1])] = np.nan
    return truth


def _sparse(times: Array, own_times: Array) -> list[str]:
    """A line if measurements lie in gaps of the own positions."""
    if len(own_times) < 3:
        return []
    gaps = np.diff(own_times)
    usual = float(np.median(gaps))
    after = np.clip(np.searchsorted(own_times, times), 1, len(own_times) - 1)
    count = int(np.sum((gaps[after - 1] > FAR_BETWEEN * usual) & (times < own_times[after]) & (gaps[after - 1] > 1.0)))
    if not count:
        return []
    longest = float(np.max(gaps[after - 1]))
    return [
        f"{count} measurement{'s lie' if count > 1 else ' lies'} between own positions up to {longest:.3g} s apart, "
        f"usual are {usual:.3g} s: the own position there is interpolated"
    ]


def _sighted(found: _Columns, times: Array, own: Array, dimension: int) -> tuple[Array, tuple[Sighting, ...]]:
    """Bearings ``(K, d)``, NaN for other kinds, and the measurements."""
    azimuth, elevation = found.values.T
    level = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    if dimension == 2:
        bearings = np.where((found.kinds == "azimuth")[:, None], level, np.nan)
    else:
        high = np.column_stack([np.cos(elevation)[:, None] * level, np.sin(elevation)])
        bearings = np.where((found.kinds == "azimuth_elevation")[:, None], high, np.nan)
    kinds: list[MeasurementKind] = found.kinds.tolist()
    names = found.sensors.tolist()
    sightings = []
    for k, (time, kind) in enumerate(zip(times.tolist(), kinds, strict=True)):
        count = 2 if kind == "azimuth_elevation" else 1
        sightings.append(Sighting(time, kind, found.values[k, :count], found.stds[k, :count], own[k], names[k]))
    return bearings, tuple(sightings)
