"""The section ``replay``: how a recorded log is read, and with which trackers."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator

from gbt_ocp.experiments.config.keys import NotNegativeNumbers, Section, as_tuples, key


class ReplaySection(Section):
    """Recorded bearings."""

    bearing_from: Literal["x", "north", "bow"] | None = key(
        None,
        "Where bearings are counted from: x is counter-clockwise from +x, north is clockwise from north (+y), bow is "
        "clockwise from the bow, with a heading in the log.",
        "x, north, bow, or null beside --bearing-from or a mapping that says it",
    )
    mapping: str | None = key(
        None, "What the messages or columns of the log hold: a ready mapping (ros, mavlink, imc) or a YAML file."
    )
    topics: Annotated[tuple[str, ...], BeforeValidator(as_tuples)] = key(
        (), "Topics or types of messages that are read; empty for all of the mapping."
    )
    origin_deg: Annotated[tuple[float, float], BeforeValidator(as_tuples)] | None = key(
        None, "Latitude and longitude in degrees of the origin of the plane (null: the first own position)."
    )
    in_plane: bool = key(False, "Leave out heights and elevations: the track is one in the plane.")
    heading_std_deg: float = key(
        0.0, "Standard deviation in degrees of the heading, for bearings from the bow that say their own.", ge=0.0
    )
    latency_s: float = key(0.0, "Time in s by which a logged measurement is older than its time stamp.", ge=0.0)
    range_std_m: float | None = key(
        None, "Standard deviation in m of ranges that do not say their own (null: such are left out).", gt=0.0
    )
    size_std_deg: float | None = key(
        None, "Standard deviation in degrees of angular sizes that do not say their own.", gt=0.0
    )
    export: Annotated[tuple[Literal["csv", "geojson", "gpx", "mcap", "page"], ...], BeforeValidator(as_tuples)] = key(
        (), "Files of the tracks that are written; empty for all that can be."
    )
    ahead_s: float = key(10.0, "Time in s by which a forecast is scored.", ge=0.0)
    score_from_s: float = key(30.0, "Time in s after the first bearing from which is scored.", ge=0.0)
    constant_range_m: NotNegativeNumbers = key((), "Constant ranges in m that are scored beside the trackers.")
    where: dict[str, str | int | float] = key(
        {},
        "Values by column: only rows with them are read, for a log of several contacts.",
        "a mapping of columns of the log to texts or numbers",
    )
    trackers: dict[str, dict[str, Any]] = key(
        {}, "Further trackers by name.", "a mapping of names to mappings as in the section tracker, each with its kind"
    )
