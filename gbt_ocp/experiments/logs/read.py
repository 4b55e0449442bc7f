"""Read a log of any format: own positions and measurements, and the truth where it is known (docs/howto/logs.md)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.yaml_dialect import shortened
from gbt_ocp.experiments.contacts import contact_warning, is_value, same_text, told_apart
from gbt_ocp.experiments.logs.assembly import RawLog, assembled
from gbt_ocp.experiments.logs.conversion import Measured, Positions, headings, measured, positions
from gbt_ocp.experiments.logs.csv_columns import FROM_WHERE, BearingFrom
from gbt_ocp.experiments.logs.csv_log import CsvLog
from gbt_ocp.experiments.logs.mapping import LogEntry, LogMapping, load_mapping
from gbt_ocp.experiments.logs.records import LoggedMessage, Records, gathered, matches, wanted
from gbt_ocp.frames import LocalPlane
from gbt_ocp.simulation.replayed_track import BearingLog
from gbt_ocp.typing import Array

Reader = Callable[[Path, Callable[[str, str], bool]], Iterator[LoggedMessage]]
"""From a file, and whether messages of a topic and a type are read, to those messages."""


def _ros(path: Path, asks: Callable[[str, str], bool]) -> Iterator[LoggedMessage]:
    from gbt_ocp.experiments.logs.ros_bags import ros_messages

    return ros_messages(path, asks)


def _mcap(path: Path, asks: Callable[[str, str], bool]) -> Iterator[LoggedMessage]:
    from gbt_ocp.experiments.logs.mcap_file import mcap_messages

    return mcap_messages(path, asks)


def _mavlink(path: Path, asks: Callable[[str, str], bool]) -> Iterator[LoggedMessage]:
    from gbt_ocp.experiments.logs.mavlink_log import mavlink_messages

    return mavlink_messages(path, asks)


def _imc(path: Path, asks: Callable[[str, str], bool]) -> Iterator[LoggedMessage]:
    from gbt_ocp.experiments.logs.imc_log import imc_messages

    return imc_messages(path, asks)


LAST_DATE = 253_402_300_800.0
"""Seconds since the epoch at the end of the year 9999."""

FORMATS: dict[str, tuple[Reader, str]] = {
    ".bag": (_ros, "ros"),
    ".db3": (_ros, "ros"),
    ".mcap": (_mcap, "ros"),
    ".tlog": (_mavlink, "mavlink"),
    ".bin": (_mavlink, "mavlink"),
    ".lsf": (_imc, "imc"),
    ".gz": (_imc, "imc"),
}
"""Readers by the ending of a file, each with its ready mapping. A folder is a bag of ROS 2, any other file a CSV."""


def read_log(
    path: Path,
    bearing_from: BearingFrom | None = None,
    latency: float = 0.0,
    where: Mapping[str, str | float] | None = None,
    *,
    mapping: str | Path | None = None,
    topics: Sequence[str] = (),
    origin_deg: Sequence[float] | None = None,
    in_plane: bool = False,
    heading_std: float = 0.0,
    stds: Mapping[str, float | None] | None = None,
) -> BearingLog:
    """Read a log.

    Parameters
    ----------
    path
        CSV file with a header, folder of a bag of ROS 2 (or its ``.db3``), or file that ends in ``.bag``, ``.mcap``,
        ``.tlog``, ``.bin``, ``.lsf`` or ``.lsf.gz``.
    bearing_from
        ``x``: bearings are counter-clockwise from +x. ``north``: clockwise from north. ``bow``: clockwise from the bow,
        with a heading in the log. A mapping may say it instead.
    latency
        Time in seconds by which a measurement is older than its stamp. The own position is that of the earlier time,
        interpolated between all rows.
    where
        Values by column, or by field of the messages with measurements: only those with them are read, and rows
        without a measurement whose cell there is empty.
    mapping
        What the messages or columns hold: a ready mapping by name, or a YAML file. By default the names of the columns
        say it, and the ready mapping of the format.
    topics
        Topics, or types of messages, that are read; by default all that the mapping is about.
    origin_deg
        Latitude and longitude in degrees of the origin of the plane; by default the first own position.
    in_plane
        Leave out heights and elevations.
    heading_std
        Standard deviation of the heading in radians; bearings from the bow that say their own have it besides.
    stds
        Standard deviations by kind in radians or metres, of measurements that do not say their own.

    Raises
    ------
    ConfigurationError
        If the file cannot be read as that, with one line a fault.
    """
    origin = _origin(origin_deg)
    given = None if mapping is None else load_mapping(mapping)
    placing: dict[str, Any] = {"latency": latency, "origin": origin, "in_plane": in_plane}
    placing |= {"heading_std": heading_std, "stds": stds or {}}
    form = "" if path.is_dir() else path.suffix.casefold()
    try:
        if path.is_dir() or form in FORMATS:
            reader, ready = FORMATS.get(form, FORMATS[".db3"])
            raw, doubts = _read_messages(path, reader, given or load_mapping(ready), bearing_from, where or {}, topics)
            log, _ = assembled(raw, **placing)
            return replace(log, warnings=(*doubts, *log.warnings), since_epoch=_are_dates(log.times))
        file = CsvLog(path, bearing_from, where or {}, given)
        log, rows = assembled(file.raw(), **placing)
    except ValueError as fault:
        if isinstance(fault, ConfigurationError):
            raise
        raise ConfigurationError([f"{path}: {fault}"]) from fault
    seen = np.isfinite(log.bearings[:, 0])
    lines = file.contact_warnings(rows[seen].tolist(), log.bearings[seen])
    return replace(log, warnings=(*log.warnings, *lines), since_epoch=file.in_utc)


def _are_dates(times: Array) -> bool:
    """Whether times of a log that counts from the epoch lie in the years that a date can have."""
    return bool(times[0] >= 0.0 and times[-1] < LAST_DATE)


def _origin(origin_deg: Sequence[float] | None) -> LocalPlane | None:
    if origin_deg is None:
        return None
    if len(origin_deg) != 2 or not abs(origin_deg[0]) <= 90.0:
        found = ", ".join(map(str, origin_deg))
        raise ConfigurationError([f"--origin: found {found}; allowed: latitude from -90 to 90, longitude, in degrees"])
    return LocalPlane(*map(math.radians, origin_deg))


CONTACTS = ("target", "target_num", "source_id", "source_name", "beacon", "id", "track_id", "contact")
"""Fields of messages that may tell contacts apart."""


def _read_messages(
    path: Path,
    reader: Reader,
    mapping: LogMapping,
    stated: BearingFrom | None,
    where: Mapping[str, str | float],
    topics: Sequence[str],
) -> tuple[RawLog, list[str]]:
    """What a log of messages holds, and lines about what is suspicious in it."""
    present: dict[str, None] = {}
    asks = wanted(mapping, topics)

    def noting(topic: str, kind: str) -> bool:
        present.setdefault(kind)
        return asks(topic, kind)

    records = gathered(path, reader(path, noting), mapping, (*where, *CONTACTS))
    log = _Messages(path, mapping, records, shortened(", ".join(present) or "nothing"))
    own = log.positions("own")
    if own is None or not len(own.times):
        raise log.lacks("own", "no own position")
    found, doubts = [], []
    for entry, one in log.of(mapping.measurements):
        if entry.frame == "stated" and stated is None:
            line = f"--bearing-from: found nothing, which {entry.message} ({one.name}) needs; allowed: {FROM_WHERE}"
            raise ConfigurationError([line])
        kept = _where(path, one, where)
        found.append(measured(kept, entry, stated))
        doubts += _contact_warnings(path, kept, found[-1], where)
    if stated is not None and not any(entry.frame == "stated" for entry, _ in log.of(mapping.measurements)):
        doubts.append(f"{path}: bearings from {stated} are not asked for: the mapping says where they are counted from")
    found = [one for one in found if len(one.times)]
    if not found:
        raise log.lacks("measurements", "no measurement")
    yaw = (np.zeros(0), np.zeros(0))
    if any(one.frame == "bow" and "azimuth" in one.kind for one in found):
        source = log.single("heading", mapping.heading)
        yaw = headings(source[1], source[0]) if source else yaw
        if not len(yaw[0]):
            raise log.lacks("heading", "bearings from the bow and no heading")
        order = np.argsort(yaw[0], kind="stable")
        yaw = (yaw[0][order], yaw[1][order])
    return RawLog(path, own, yaw, found, log.positions("truth")), doubts


Entry = TypeVar("Entry", bound=LogEntry)


@dataclass(frozen=True)
class _Messages:
    """Records of a log by topic and type."""

    path: Path
    mapping: LogMapping
    records: dict[tuple[str, str], Records]
    kinds: str

    def of(self, entries: Sequence[Entry]) -> list[tuple[Entry, Records]]:
        """Entries with the records that they are about."""
        return [(entry, one) for entry in entries for source, one in self.records.items() if matches(entry, *source)]

    def single(self, name: str, entries: Sequence[Entry]) -> tuple[Entry, Records] | None:
        """The one entry that has records."""
        found = self.of(entries)
        if len(found) > 1:
            sources = [
                one.name if one.name == entry.message else f"{entry.message} ({one.name})" for entry, one in found
            ]
            allowed = "one of them; --topics chooses what is read, or a mapping says it"
            raise ConfigurationError([f"{self.path}: {name}: found {', '.join(sources)}; allowed: {allowed}"])
        return found[0] if found else None

    def positions(self, name: str) -> Positions | None:
        """Positions in the order of time."""
        source = self.single(name, getattr(self.mapping, name))
        return _ordered(positions(source[1], source[0])[0]) if source else None

    def lacks(self, name: str, what: str) -> ConfigurationError:
        """That a log has nothing that the mapping asks for."""
        asked = dict.fromkeys(str(entry.message) for entry in getattr(self.mapping, name))
        allowed = f"{', '.join(asked) or f'entries under {name}'}, or another mapping"
        return ConfigurationError([f"{self.path}: found messages {self.kinds}, {what}; allowed: {allowed}"])


def _contact_warnings(path: Path, records: Records, found: Measured, where: Mapping[str, str | float]) -> list[str]:
    """Lines about fields that seem to tell several contacts apart."""
    lines = []
    for name in CONTACTS if "azimuth" in found.kind else ():
        if name not in records.columns or name in where:
            continue
        texts = records.texts(name)
        values = [texts[k] for k in found.rows.tolist()]
        angles = told_apart(values, np.column_stack([np.cos(found.values[:, 0]), np.sin(found.values[:, 0])]))
        if angles is not None:
            lines.append(contact_warning(path, name, values, angles))
    return lines


def _ordered(found: Positions) -> Positions:
    """Positions in the order of time, those that are not known left out; a height alone may be unknown in the plane."""
    values, has_height = found.values.copy(), found.has_height
    if values.shape[1] == 3 and not np.isfinite(values[:, 2]).any():
        values[:, 2], has_height = 0.0, False
    kept = np.isfinite(values).all(axis=1) & np.isfinite(found.times)
    order = np.flatnonzero(kept)[np.argsort(found.times[kept], kind="stable")]
    values = values[order] if has_height or found.geographic else values[order, :2]
    return Positions(found.times[order], values, found.geographic, has_height)


def _where(path: Path, records: Records, where: Mapping[str, str | float]) -> Records:
    """The records with values by field; of messages that lack a field, none."""
    if not where:
        return records
    missing = [name for name in where if name not in records.columns]
    kept = np.zeros(len(records.times), dtype=bool)
    if not missing:
        kept = np.ones(len(records.times), dtype=bool)
        for name, value in where.items():
            texts = records.texts(name)
            exact = same_text(texts, value)
            kept &= np.array([is_value(text, value, exact) for text in texts])
    if not kept.any():
        asked = shortened(", ".join(f"{name}={value}" for name, value in where.items()))
        has = "; ".join(
            f"{name} is {shortened(', '.join(sorted(set(records.texts(name)))))}"
            for name in where
            if name not in missing
        )
        allowed = has or f"fields of {records.name} among those with measurements"
        raise ConfigurationError([f"{path}: where: found no measurement with {asked}; allowed: {allowed}"])
    rows = np.flatnonzero(kept)
    columns = {
        name: values[rows] if isinstance(values, np.ndarray) else [values[k] for k in rows]
        for name, values in records.columns.items()
    }
    return Records(records.name, records.times[rows], columns, records.place)
