"""From records and a mapping to positions, headings and measurements in the units and senses of the package."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.experiments.logs.mapping import AngleUnit, HeadingEntry, LogEntry, MeasurementEntry, PositionEntry
from gbt_ocp.experiments.logs.records import Records, stamps
from gbt_ocp.frames import LocalPlane, compass_to_math, in_si, ned_to_enu, yaw_of_quaternion
from gbt_ocp.models.measurements import Frame, MeasurementKind
from gbt_ocp.typing import Array

ANGULAR = ("azimuth", "azimuth_elevation", "elevation", "size")


@dataclass(frozen=True)
class Positions:
    """N positions: either in the plane, or geographic.

    Attributes
    ----------
    times
        ``(N,)`` in seconds.
    values
        East, north(, up) in metres ``(N, 2 or 3)``; or latitude, longitude in radians and height in metres ``(N, 3)``.
    geographic
        Which of the two.
    has_height
        Whether the third coordinate is one of the log.
    """

    times: Array
    values: Array
    geographic: bool
    has_height: bool

    def in_plane(self, plane: LocalPlane | None) -> Array:
        """East, north, up in metres ``(N, 3)``; up is 0 where the log has none."""
        if not self.geographic:
            return self.values if self.has_height else np.column_stack([self.values, np.zeros(len(self.values))])
        assert plane is not None, "made for geographic positions"
        return plane.to_plane(*self.values.T)


@dataclass(frozen=True)
class Measured:
    """N measurements of one entry.

    Attributes
    ----------
    times
        ``(N,)`` in seconds.
    rows
        Numbers of their records ``(N,)``.
    kind, frame
        As of :class:`~gbt_ocp.models.measurements.Measurement`; the frame is that of azimuths.
    values, stds
        ``(N, m)`` in radians or metres, mathematical senses; NaN for a deviation that the log does not say.
    sensors
        Names ``(N,)``.
    """

    times: Array
    rows: NDArray[np.int64]
    kind: MeasurementKind
    frame: Frame
    values: Array
    stds: Array
    sensors: list[str]


def passing(records: Records, entry: LogEntry) -> NDArray[np.bool_]:
    """Records whose fields have the values that an entry asks for ``(N,)``."""
    kept = np.ones(len(records.times), dtype=bool)
    for name, values in entry.when.items():
        asked = {_plain(value) for value in values}
        kept &= np.array([_plain(value) in asked for value in records.columns[name]], dtype=bool)
    return kept


def _plain(value: object) -> object:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, int | float):
        return float(value)
    text = str(value)
    try:
        return float(text)
    except ValueError:
        return text


def positions(records: Records, entry: PositionEntry) -> tuple[Positions, list[int]]:
    """Positions of an entry, and the numbers of their records."""
    kept = np.flatnonzero(passing(records, entry))
    columns = [records.numbers(name)[kept] for name in entry.fields]
    times = stamps(records, entry)[kept]
    geographic = entry.frame.startswith("lat_lon")
    if entry.frame == "lat_lon_height_ned":
        values = _moved(columns, entry.angle_unit, entry.unit)
        return Positions(times, values, True, True), kept.tolist()
    has_height = len(columns) == 3
    if not geographic:
        values = in_si(np.column_stack(columns), entry.unit)
        return Positions(
            times, ned_to_enu(values) if entry.frame == "ned" else values, False, has_height
        ), kept.tolist()
    height = in_si(columns[2], entry.unit) if has_height else np.zeros(len(kept))
    if entry.frame == "lat_lon_depth":
        height = -height
    latitude, longitude = (in_si(column, entry.angle_unit) for column in columns[:2])
    return Positions(times, np.column_stack([latitude, longitude, height]), True, has_height), kept.tolist()


def _moved(columns: Sequence[Array], angle_unit: AngleUnit, unit: str) -> Array:
    """Latitude, longitude, height of points that lie north, east and down of others ``(N, 3)``."""
    references = np.column_stack(
        [in_si(columns[0], angle_unit), in_si(columns[1], angle_unit), in_si(columns[2], unit)]
    )
    away = ned_to_enu(in_si(np.column_stack(columns[3:]), unit))
    found = np.full((len(away), 3), np.nan)
    finite = np.isfinite(references).all(axis=1)
    distinct, which = np.unique(references[finite], axis=0, return_inverse=True)
    for number, reference in enumerate(distinct):  # a vehicle keeps its reference for a long time
        here = np.flatnonzero(finite)[which.ravel() == number]
        found[here] = np.column_stack(LocalPlane(*reference).from_plane(away[here]))
    return found


def headings(records: Records, entry: HeadingEntry) -> tuple[Array, Array]:
    """Times ``(N,)`` and yaw, counter-clockwise from +x, ``(N,)`` in radians, where there is one."""
    kept = passing(records, entry)
    columns = [records.numbers(name)[kept] for name in entry.fields]
    if entry.unit == "quaternion":
        angle = yaw_of_quaternion(np.column_stack(columns))
        angle[np.all(np.column_stack(columns) == 0.0, axis=1)] = np.nan  # no quaternion: one that was not filled in
    else:
        angle = in_si(columns[0], entry.unit)
    yaw = compass_to_math(angle) if entry.frame == "north" else angle
    known = np.isfinite(yaw)
    return stamps(records, entry)[kept][known], yaw[known]


def measured(records: Records, entry: MeasurementEntry, stated: Literal["x", "north", "bow"] | None) -> Measured:
    """Measurements of an entry; records without one are passed over.

    Parameters
    ----------
    records, entry
        The records, and the entry that is about them.
    stated
        What a frame ``stated`` is.
    """
    units = entry.units or (entry.unit,) * len(entry.fields)
    values = np.column_stack(
        [in_si(records.numbers(name), unit) for name, unit in zip(entry.fields, units, strict=True)]
    )
    kept = passing(records, entry) & np.isfinite(values).all(axis=1)
    if entry.kind in ("range", "size"):
        kept &= values[:, 0] > 0.0  # 0 says that there is none (MAVLink)
    frame, count = entry.frame if entry.frame != "stated" else stated, values.shape[1]
    stds = np.full_like(values, np.nan)
    if entry.std is not None:
        stds[:] = in_si([entry.std], entry.unit)
    elif entry.std_fields:
        std_units = entry.std_units or (entry.unit,) * len(entry.std_fields)
        given = [in_si(records.numbers(name), unit) for name, unit in zip(entry.std_fields, std_units, strict=True)]
        stds[:] = np.column_stack(given * count if len(given) == 1 else given)
        stds[~(stds > 0.0)] = np.nan  # 0 says that it is not known
    if entry.has_azimuth and frame in ("north", "bow"):
        values[:, 0] = compass_to_math(values[:, 0]) if frame == "north" else -values[:, 0]
    if entry.elevation == "down":
        values[:, -1] = -values[:, -1]
    rows = np.flatnonzero(kept)
    return Measured(
        stamps(records, entry)[rows],
        rows,
        entry.kind,
        "bow" if frame in ("bow", "bow_port") else "earth",
        values[rows],
        stds[rows],
        _sensors(records, entry, rows),
    )


def _sensors(records: Records, entry: MeasurementEntry, rows: Iterable[int]) -> list[str]:
    if entry.sensor is not None:
        return [entry.sensor for _ in rows]
    if entry.sensor_field is not None:
        names = records.texts(entry.sensor_field)
        return [names[k] or "sensor" for k in rows]
    return [records.name or "sensor" for _ in rows]
