"""Records: the messages of one type and topic, or the rows of a file, as columns of their fields."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.yaml_dialect import shortened
from gbt_ocp.experiments.logs.mapping import LogEntry, LogMapping, MeasurementEntry
from gbt_ocp.frames import seconds_of_counts
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class Records:
    """N messages, or rows.

    Attributes
    ----------
    name
        Of the topic or the message; empty for the rows of a file.
    times
        When the log says they came ``(N,)`` in seconds.
    columns
        Fields by name, ``(N,)`` each: numbers with NaN where there is none, or texts.
    place
        Says where a row stands in the log: its number to ``line 12``.
    """

    name: str
    times: Array
    columns: dict[str, Any]
    place: Callable[[int], str]

    def numbers(self, name: str) -> Array:
        """A field as numbers ``(N,)``; NaN where it is none."""
        found = self.columns[name]
        if isinstance(found, np.ndarray) and found.dtype.kind == "f":
            return found
        return np.array([_number(value) for value in found])

    def texts(self, name: str) -> list[str]:
        """A field as texts."""
        return [str(value) for value in self.columns[name]]


def _number(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        return np.nan


class LoggedMessage(NamedTuple):
    """One message: its topic and type, when it came in seconds, and its content."""

    topic: str
    kind: str
    time: float
    content: Any


def matches(entry: LogEntry, topic: str, kind: str) -> bool:
    """Whether an entry of a mapping is about the messages of a topic and type."""
    of_kind = entry.message is not None and fnmatchcase(kind, entry.message)
    return of_kind and (entry.topic is None or fnmatchcase(topic, entry.topic))


def wanted(mapping: LogMapping, topics: Sequence[str]) -> Callable[[str, str], bool]:
    """Whether messages of a topic and a type are read; ``topics`` narrows that down where it is not empty."""

    def asks(topic: str, kind: str) -> bool:
        named = not topics or topic in topics or kind in topics
        return named and any(matches(entry, topic, kind) for entry in mapping.entries.values())

    return asks


@dataclass
class _Collected:
    names: list[str]
    times: list[float] = field(default_factory=list)
    rows: list[list[Any]] = field(default_factory=list)


def gathered(
    path: Path, messages: Iterable[LoggedMessage], mapping: LogMapping, further: Iterable[str] = ()
) -> dict[tuple[str, str], Records]:
    """Records of the messages by topic and type.

    Parameters
    ----------
    path
        Of the log, for the faults.
    messages
        In the order of the log.
    mapping
        Says which fields are read.
    further
        Fields that are read besides, of measurements that have them.

    Raises
    ------
    ConfigurationError
        If a message lacks a field that the mapping names.
    """
    collected: dict[tuple[str, str], _Collected] = {}
    for message in messages:
        source = (message.topic, message.kind)
        one = collected.get(source)
        if one is None:
            one = collected[source] = _Collected(_fields(message, mapping, further))
        one.times.append(message.time)
        try:
            one.rows.append([value_at_path(message.content, name) for name in one.names])
        except (LookupError, AttributeError, TypeError, ValueError) as fault:
            wrong = next(name for name in one.names if not _has(message.content, name))
            has = shortened(", ".join(field_names(message.content)))
            line = f"{path}: mapping: found the field {wrong} for {_called(*source)}; allowed: {has}"
            raise ConfigurationError([line]) from fault
    return {
        source: Records(
            source[0] or source[1],
            np.array(one.times, dtype=float),
            {name: _column(values) for name, values in zip(one.names, zip(*one.rows, strict=True), strict=True)},
            _placed(*source),
        )
        for source, one in collected.items()
    }


def _placed(topic: str, kind: str) -> Callable[[int], str]:
    called = _called(topic, kind)
    return lambda k: f"message {k + 1} of {called}"


def _called(topic: str, kind: str) -> str:
    return kind if topic in ("", kind) else f"{topic} ({kind})"


def _fields(message: LoggedMessage, mapping: LogMapping, further: Iterable[str]) -> list[str]:
    names: dict[str, None] = {}
    for entry in mapping.entries.values():
        if matches(entry, message.topic, message.kind):
            names |= dict.fromkeys(fields_of(entry))
            if isinstance(entry, MeasurementEntry):
                names |= dict.fromkeys(name for name in further if _has(message.content, name))
    return list(names)


def fields_of(entry: LogEntry) -> list[str]:
    """All fields that an entry reads."""
    names = [*entry.fields, *entry.when, *([entry.time] if entry.time else [])]
    if isinstance(entry, MeasurementEntry):
        names += [*entry.std_fields, *([entry.sensor_field] if entry.sensor_field else [])]
    return names


def _column(values: Sequence[Any]) -> Any:
    """Numbers as an array of integers or floats, everything else as a list."""
    if all(isinstance(value, int) and not isinstance(value, bool) for value in values):
        return np.array(values, dtype=object) if max(map(abs, values)) >= 2**63 else np.array(values, dtype=np.int64)
    if all(isinstance(value, int | float | np.number) and not isinstance(value, bool) for value in values):
        return np.array(values, dtype=float)
    return list(values)


def value_at_path(content: Any, name: str) -> Any:
    """The value of a field ``pose.position.x`` or ``covariance.0``; a stamp of ROS as a count of nanoseconds."""
    for part in name.split("."):
        if isinstance(content, Mapping):
            content = content[part]
        elif part.isdigit():
            content = content[int(part)]
        else:
            content = getattr(content, part)
    for second, nano in (("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs")):
        if _has(content, second) and _has(content, nano):
            return int(value_at_path(content, second)) * 10**9 + int(value_at_path(content, nano))
    if isinstance(content, np.generic):
        return content.item()
    return content


def _has(content: Any, name: str) -> bool:
    if isinstance(content, Mapping):
        return name in content or ("." in name and _reaches(content, name))
    return hasattr(content, name) or ("." in name and _reaches(content, name))


def _reaches(content: Any, name: str) -> bool:
    try:
        value_at_path(content, name)
    except (LookupError, AttributeError, TypeError, ValueError):
        return False
    return True


def field_names(content: Any) -> list[str]:
    """Names of the fields of a message, one level deep."""
    if isinstance(content, Mapping):
        return list(map(str, content))
    return [name for name in dir(content) if not name.startswith("_") and not callable(getattr(content, name, None))]


def stamps(records: Records, entry: LogEntry) -> Array:
    """Times of the records as an entry says them ``(N,)`` in seconds.

    Raises
    ------
    ValueError
        If no message has its stamp set.
    """
    if entry.time is None:
        return records.times
    counts = records.columns[entry.time]
    found = seconds_of_counts(records.numbers(entry.time) if isinstance(counts, list) else counts, entry.time_unit)
    if len(found) > 1 and not found.any():
        allowed = "stamps that are set, or a mapping without the key time, for the times of the log"
        raise ValueError(f"{records.name}: {entry.time}: found 0 in all messages; allowed: {allowed}")
    return found
