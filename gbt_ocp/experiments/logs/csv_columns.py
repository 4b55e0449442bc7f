"""What the columns of a CSV log hold, by their names: its mapping (docs/howto/logs.md)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.yaml_dialect import shortened
from gbt_ocp.experiments.logs.mapping import HeadingEntry, LogMapping, MeasurementEntry, PositionEntry

BearingFrom = Literal["x", "north", "bow"]
"""Where the bearings of a log are counted from: counter-clockwise from +x, clockwise from north or from the bow."""

FROM_WHERE = "x (counter-clockwise from +x), north (clockwise from +y), bow (clockwise from the bow)"

CLOCKS = {"t": "s", "t_ms": "ms", "t_us": "us", "t_ns": "ns", "utc": "utc"}
"""Columns of the time, with their units."""

_POSITIONS = {
    "{}x": ("enu", ("{}x", "{}y"), ("{}z",)),
    "{}north": ("ned", ("{}north", "{}east"), ("{}down",)),
    "{}lat_deg": ("lat_lon_height", ("{}lat_deg", "{}lon_deg"), ("{}height_m", "{}depth_m")),
}
"""By the first column of each: the frame, the columns in the plane, and those of the third coordinate."""

_ANGLES = ("deg", "rad")
_DEVIATIONS = {"azimuth": ("std", "sigma", "bearing_std"), "elevation": ("elevation_std",), "range": ("range_std",)}
_DEVIATIONS["size"] = ("size_std",)
_MEASURED = re.compile(
    r"(?:(?P<sensor>.+)\.)?(?:(?:bearing|elevation|size|std|sigma|bearing_std|elevation_std|size_std)_(?:deg|rad)"
    r"|range_m|range_std_m)"
)
_OTHERS = re.compile(
    r"t|t_ms|t_us|t_ns|utc|sensor|(?:own_|true_)(?:x|y|z|north|east|down)|(?:true_)?(?:lat_deg|lon_deg|height_m|depth_m)"
    r"|(?:heading|yaw)_(?:deg|rad)"
)


def known_columns(names: Sequence[str]) -> int:
    """How many names are those of columns that are read."""
    return sum(bool(_MEASURED.fullmatch(name) or _OTHERS.fullmatch(name)) for name in names)


class CsvLayout:
    """Finds what the columns hold.

    Parameters
    ----------
    path
        Of the file, for the faults.
    names
        Of the columns.
    bearing_from
        Where bearings are counted from.

    Attributes
    ----------
    clock
        Column of the time.
    mapping
        What the other columns hold.
    elevations
        Whether the log is one in space.

    Raises
    ------
    ConfigurationError
        If a column is missing, or two say the same thing: one line.
    """

    def __init__(self, path: Path, names: Sequence[str], bearing_from: BearingFrom | None) -> None:
        self._path, self._names, self._from = path, list(names), bearing_from
        self._missing: list[str] = []
        sensors = list(dict.fromkeys(match["sensor"] for name in names if (match := _MEASURED.fullmatch(name))))
        self.elevations = any(self._one_of(self._of(sensor, "elevation")) for sensor in sensors)
        measurements = tuple(entry for sensor in sensors for entry in self._measurements(sensor))
        if not any(entry.kind != "size" for entry in measurements):
            # also where both are there, which _one_of refuses
            raise self._refused("allowed: one of bearing_rad, bearing_deg among them")
        clocks = [name for name in CLOCKS if name in names]
        if len(clocks) > 1:
            raise self._refused(f"allowed: one of {', '.join(clocks)}")
        self.clock = clocks[0] if clocks else "t"
        self._missing += [] if clocks else ["t"]
        own = self._position("own_")
        truth = self._position("true_", given=False)
        heading = self._heading(any(entry.frame == "bow" for entry in measurements))
        if self._missing:
            raise self._refused(f"missing: {', '.join(self._missing)}")
        assert own is not None, "its columns are not missing"
        self.mapping = LogMapping(
            own=(own,), heading=heading, measurements=measurements, truth=(truth,) if truth is not None else ()
        )

    def _refused(self, words: str) -> ConfigurationError:
        return ConfigurationError([f"{self._path}: found the columns {shortened(', '.join(self._names))}; {words}"])

    @staticmethod
    def _of(sensor: str | None, *what: str) -> list[str]:
        dot = f"{sensor}." if sensor else ""
        return [f"{dot}{one}_{unit}" for one in what for unit in _ANGLES]

    def _one_of(self, allowed: Sequence[str]) -> str | None:
        """The one of some columns that is there."""
        found = [name for name in allowed if name in self._names]
        if len(found) > 1:
            raise self._refused(f"allowed: one of {', '.join(sorted(found, reverse=True))} among them")
        return found[0] if found else None

    def _measurements(self, sensor: str | None) -> Iterator[MeasurementEntry]:
        named: dict[str, Any] = (
            {"sensor": sensor} if sensor else {"sensor_field": "sensor"} if "sensor" in self._names else {}
        )
        dot = f"{sensor}." if sensor else ""
        bearing = self._one_of(self._of(sensor, "bearing"))
        elevation = self._one_of(self._of(sensor, "elevation"))
        if bearing:
            fields = [bearing, *([elevation] if elevation else [])]
            deviations = [self._one_of(self._of(sensor, *_DEVIATIONS["azimuth"]))]
            if elevation:
                deviations.append(self._one_of(self._of(sensor, *_DEVIATIONS["elevation"])) or deviations[0])
            stds = tuple(name for name in deviations if name is not None)
            if self._from is None:
                raise ConfigurationError(
                    [f"--bearing-from: found nothing, nor replay.bearing_from; allowed: {FROM_WHERE}"]
                )
            named_azimuth = {**named, "elevation": "up"} if elevation else named
            kind = "azimuth_elevation" if elevation else "azimuth"
            stds = stds if len(stds) == len(fields) else ()
            yield _entry(kind, tuple(fields), stds, {**named_azimuth, "frame": self._from})
        elif elevation:
            self._missing.append(f"{dot}bearing_{elevation[-3:]}")
        if f"{dot}range_m" in self._names:
            deviation = f"{dot}range_std_m"
            stds = (deviation,) if deviation in self._names else ()
            yield MeasurementEntry(kind="range", fields=(f"{dot}range_m",), unit="m", std_fields=stds, **named)
        size = self._one_of(self._of(sensor, "size"))
        if size:
            spread = self._one_of(self._of(sensor, *_DEVIATIONS["size"]))
            yield _entry("size", (size,), (spread,) if spread else (), named)

    def _position(self, prefix: str, given: bool = True) -> PositionEntry | None:
        """The columns of a position; of the own one, which must be there, or of the truth, which need not be."""
        groups = []
        for first, (frame, level, third) in _POSITIONS.items():
            before = "" if prefix == "own_" and "lat" in first else prefix
            plane, up = ([name.format(before) for name in names] for names in (level, third))
            # a depth beside positions in the plane is another column, as it was
            if any(name in self._names for name in (plane if "lat" in first else [*plane, *up])):
                groups.append((frame, plane, up))
        if len(groups) > 1:
            both = " and ".join(", ".join(plane) for _, plane, _ in groups)
            raise self._refused(f"allowed: one of {both}")
        if not groups:
            if given:
                self._missing += ["own_x", "own_y", *(["own_z"] if self.elevations else [])]
            return None
        frame, plane, up = groups[0]
        height = [name for name in up if name in self._names]
        if len(height) > 1:
            raise self._refused(f"allowed: one of {', '.join(height)}")
        wanted = [*plane, *([height[0] if height else up[0]] if self.elevations else [])]
        absent = [name for name in wanted if name not in self._names]
        if absent and given:
            self._missing += absent
            return None
        if absent:
            present = [name for name in wanted if name in self._names]
            found = f"{self._path}: found {', '.join(present)} without {', '.join(absent)}"
            raise ConfigurationError([f"{found}; allowed: all of {', '.join(wanted)}, or none"])
        if frame == "lat_lon_height":
            wanted = [*plane, *height]  # north turns little with the height, but it costs nothing to be exact
            frame = "lat_lon_depth" if height and height[0].endswith("depth_m") else frame
        return PositionEntry(fields=tuple(wanted), frame=frame)  # type: ignore[arg-type]

    def _heading(self, needed: bool) -> tuple[HeadingEntry, ...]:
        found = self._one_of([f"{what}_{unit}" for what in ("heading", "yaw") for unit in _ANGLES])
        if found is None:
            if needed:
                self._missing.append("heading_deg")
            return ()
        frame = "north" if found.startswith("heading") else "x"
        # a column that is not needed is not read: it may hold anything
        return (HeadingEntry(fields=(found,), frame=frame, unit=found[-3:]),) if needed else ()  # type: ignore[arg-type]


def _entry(kind: str, fields: tuple[str, ...], stds: tuple[str, ...], more: dict[str, Any]) -> MeasurementEntry:
    """An entry of angles, whose columns end in their units."""
    units, std_units = (tuple(name[-3:] for name in names) for names in (fields, stds))
    given = {"kind": kind, "fields": fields, "unit": units[0], "units": units, "std_fields": stds}
    return MeasurementEntry.model_validate({**given, "std_units": std_units, **more})
