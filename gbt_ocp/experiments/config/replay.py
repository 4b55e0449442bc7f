"""The section ``replay``: how a recorded log is read, and with which trackers."""

from __future__ import annotations

from typing import Any, Literal

from gbt_ocp.experiments.config.keys import NotNegativeNumbers, Section, key


class ReplaySection(Section):
    """Recorded bearings."""

    bearing_from: Literal["x", "north"] | None = key(
        None,
        "Where bearings are counted from: x is counter-clockwise from +x, north is clockwise from +y.",
        "x, north, or null beside --bearing-from",
    )
    latency_s: float = key(0.0, "Time in s by which a logged bearing is older than its time stamp.", ge=0.0)
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
