"""Mappings: which message, or column, of a log holds what, in which frame and unit."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationError

from gbt_ocp.experiments.config import yaml_dialect as dialect
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.keys import Section, as_tuples, key
from gbt_ocp.experiments.config.validation import faults_of

Names = Annotated[tuple[str, ...], Field(min_length=1), BeforeValidator(as_tuples)]
Cells = Annotated[tuple[str | int | float, ...], Field(min_length=1), BeforeValidator(as_tuples)]
AngleUnit = Literal["rad", "deg", "cdeg", "degE7"]
LengthUnit = Literal["m", "km", "cm", "mm"]
TimeUnit = Literal["s", "ms", "us", "ns"]


class LogEntry(Section):
    """What every entry of a mapping says."""

    message: str | None = key(
        None, "Type of the message, * and ? stand for any letters; null for the rows of a CSV file."
    )
    topic: str | None = key(None, "Topic, * and ? stand for any letters; null for any.")
    fields: Names = key(..., "Names of the fields, with dots for those within others.", "a list of names of fields")
    when: dict[str, Cells] = key(
        {}, "Values by field: other messages are passed over.", "a mapping of fields to lists of values"
    )
    time: str | None = key(None, "Field of the time stamp; null for the time of the log.")
    time_unit: TimeUnit = key("s", "Unit of the field time.")


class PositionEntry(LogEntry):
    """A position: of the vehicle, or the true one of the target."""

    frame: Literal["enu", "ned", "lat_lon_height", "lat_lon_depth", "lat_lon_height_ned"] = key(
        ...,
        "What the fields are: east, north(, up); north, east(, down); latitude, longitude(, height or depth); or "
        "latitude, longitude, height of a point and north, east, down from there.",
    )
    unit: LengthUnit = key("m", "Unit of lengths.")
    angle_unit: AngleUnit = key("deg", "Unit of latitude and longitude.")


class HeadingEntry(LogEntry):
    """Where the bow points."""

    frame: Literal["north", "x"] = key(..., "north: clockwise from north; x: counter-clockwise from +x (east).")
    unit: Literal["rad", "deg", "cdeg", "degE7", "quaternion"] = key(
        ..., "Unit of the field; quaternion for the fields x, y, z, w."
    )


class MeasurementEntry(LogEntry):
    """What a sensor measured of the target."""

    kind: Literal["azimuth", "azimuth_elevation", "elevation", "range", "size"] = key(..., "What was measured.")
    frame: Literal["north", "x", "bow", "bow_port", "stated"] | None = key(
        None,
        "Of an azimuth: north, clockwise; x, counter-clockwise from +x; bow, clockwise from the bow; bow_port, "
        "counter-clockwise from the bow; stated, what --bearing-from says.",
    )
    elevation: Literal["up", "down"] | None = key(None, "Where an elevation is positive.")
    unit: Literal["rad", "deg", "cdeg", "degE7", "m", "km", "cm", "mm"] = key(..., "Unit of the fields.")
    std: float | None = key(None, "Standard deviation in that unit; null leaves it to the configuration.", gt=0.0)
    std_fields: Annotated[tuple[str, ...], BeforeValidator(as_tuples)] = key(
        (), "Fields of the standard deviation in that unit, one, or one for each of the fields."
    )
    std_units: Annotated[tuple[str, ...], BeforeValidator(as_tuples)] = key(
        (), "Units of the fields of the standard deviation where they are others."
    )
    units: Annotated[tuple[str, ...], BeforeValidator(as_tuples)] = key(
        (), "Units of the single fields where they differ."
    )
    sensor: str | None = key(None, "Name of the sensor; null for that of the topic.")
    sensor_field: str | None = key(None, "Field with the name of the sensor.")

    @property
    def has_azimuth(self) -> bool:
        """Whether one of the fields is an azimuth."""
        return self.kind in ("azimuth", "azimuth_elevation")

    @property
    def has_elevation(self) -> bool:
        """Whether one of the fields is an elevation."""
        return self.kind in ("elevation", "azimuth_elevation")


class LogMapping(Section):
    """Entries by what they hold. Those whose messages a log does not have are passed over."""

    own: Annotated[tuple[PositionEntry, ...], BeforeValidator(as_tuples)] = key((), "The vehicle's position.")
    heading: Annotated[tuple[HeadingEntry, ...], BeforeValidator(as_tuples)] = key((), "Where the bow points.")
    measurements: Annotated[tuple[MeasurementEntry, ...], BeforeValidator(as_tuples)] = key(
        (), "What sensors measured."
    )
    truth: Annotated[tuple[PositionEntry, ...], BeforeValidator(as_tuples)] = key(
        (), "The target's position where it is known, for scoring only."
    )

    @property
    def entries(self) -> dict[tuple[str, int], LogEntry]:
        """All entries by their place."""
        return {
            (name, number): entry
            for name in type(self).model_fields
            for number, entry in enumerate(getattr(self, name))
        }


def ready_mappings() -> list[str]:
    """Names of the mappings that the package has."""
    folder = files("gbt_ocp.experiments.logs") / "mappings"
    return sorted(file.name.removesuffix(".yaml") for file in folder.iterdir() if file.name.endswith(".yaml"))


def load_mapping(source: str | Path) -> LogMapping:
    """The mapping of a name of :func:`ready_mappings`, or of a YAML file.

    Raises
    ------
    ConfigurationError
        If there is none, or it is wrong: one line a fault.
    """
    if str(source) in ready_mappings():
        file = files("gbt_ocp.experiments.logs") / "mappings" / f"{source}.yaml"
        return _checked_mapping(file.read_text(encoding="utf-8"), f"mapping {source}")
    try:
        text = Path(source).expanduser().read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError, RuntimeError, ValueError) as fault:
        allowed = f"{', '.join(ready_mappings())}, or a path to a YAML file"
        raise ConfigurationError([f"mapping: found {source} ({fault}); allowed: {allowed}"]) from fault
    return _checked_mapping(text, str(source))


def _checked_mapping(text: str, label: str) -> LogMapping:
    try:
        value, faults = dialect.parse(text, label)
    except dialect.YamlError as fault:
        raise ConfigurationError([str(fault)]) from fault
    if not isinstance(value, dict):
        allowed = f"a mapping with the keys {', '.join(LogMapping.model_fields)}"
        raise ConfigurationError([f"{label}: found no mapping; allowed: {allowed}"])
    mapping: LogMapping | None = None
    try:
        mapping = LogMapping.model_validate(value)
    except ValidationError as error:
        faults += [fault.line(label) for fault in faults_of(error, value, {}, LogMapping)]
    else:
        for place, entry in mapping.entries.items():
            faults += [f"{label}: {'.'.join(map(str, place))}.{line}" for line in _entry_faults(entry)]
    if faults or mapping is None:
        raise ConfigurationError(faults)
    return mapping


def _entry_faults(entry: LogEntry) -> list[str]:
    """What is wrong between the keys of an entry."""

    def count(name: str, found: Sequence[Any], allowed: Sequence[int]) -> list[str]:
        if len(found) in allowed:
            return []
        return [f"{name}: found {len(found)}; allowed: {' or '.join(map(str, allowed))}"]

    if isinstance(entry, PositionEntry):
        return count("fields", entry.fields, (6,) if entry.frame == "lat_lon_height_ned" else (2, 3))
    if isinstance(entry, HeadingEntry):
        return count("fields", entry.fields, (4,) if entry.unit == "quaternion" else (1,))
    if not isinstance(entry, MeasurementEntry):
        return []
    numbers = 2 if entry.kind == "azimuth_elevation" else 1
    faults = count("fields", entry.fields, (numbers,))
    faults += count("std_fields", entry.std_fields, tuple(dict.fromkeys((0, 1, numbers))))
    if entry.has_azimuth != (entry.frame is not None):
        allowed = "north, x, bow, bow_port, stated" if entry.has_azimuth else f"null for the kind {entry.kind}"
        faults.append(f"frame: found {entry.frame or 'nothing'}; allowed: {allowed}")
    if entry.has_elevation != (entry.elevation is not None):
        allowed = "up, down" if entry.has_elevation else f"null for the kind {entry.kind}"
        faults.append(f"elevation: found {entry.elevation or 'nothing'}; allowed: {allowed}")
    allowed_units = ("m", "km", "cm", "mm") if entry.kind == "range" else ("rad", "deg", "cdeg", "degE7")
    for unit in dict.fromkeys((entry.unit, *entry.units, *entry.std_units)):
        if unit not in allowed_units:
            faults.append(f"unit: found {unit}; allowed: {', '.join(allowed_units)}")
    return faults
