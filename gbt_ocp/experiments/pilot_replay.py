"""A record of a pilot repeated: the same calls, and whether the same comes out."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.pilot import Pilot
from gbt_ocp.experiments.pilot_record import (
    command_as_json,
    from_json,
    measurement_from_json,
    read_pilot_record,
)


@dataclass(frozen=True)
class RecordRepeated:
    """A record that was repeated.

    Attributes
    ----------
    navigations, measurements, commands
        Calls of each kind.
    different
        Calls that gave something else than in the record.
    first
        The first of them in one line; empty if there is none.
    """

    navigations: int
    measurements: int
    commands: int
    different: int
    first: str


def repeat_pilot_record(
    path: str | os.PathLike[str],
    *,
    record: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> RecordRepeated:
    """Give a pilot of the same configuration all calls of a record, and compare the answers to the last bit.

    Parameters
    ----------
    path
        What :class:`gbt_ocp.Pilot` wrote. One of a pilot that was loaded names the file that it was loaded from, which
        is loaded again.
    record
        A file for the record of the repetition.
    progress
        Called with the number of calls done, and of all.

    Raises
    ------
    ConfigurationError
        If the record cannot be read or repeated; one line a fault.
    """
    header, *lines = read_pilot_record(path)
    pilot = _pilot_of(header, path, record)
    counts = {"navigate": 0, "measure": 0, "command": 0}
    different, first = 0, ""
    for number, line in enumerate(lines, start=2):
        kind = next((name for name in counts if name in line), None)
        try:
            if kind is None:
                raise ValueError(f"found {', '.join(line)}; allowed: {', '.join(counts)}")
            gave, before = _repeated(pilot, kind, line)
        except (ValueError, TypeError, KeyError, IndexError) as fault:
            raise ConfigurationError([f"{path}: line {number}: {fault}"]) from None
        counts[kind] += 1
        if gave != before:
            different += 1
            first = first or f"line {number}: {_difference(gave, before)}"
        if progress is not None:
            progress(number - 1, len(lines))
    pilot.close()
    return RecordRepeated(counts["navigate"], counts["measure"], counts["command"], different, first)


def _pilot_of(header: Mapping[str, Any], path: str | os.PathLike[str], record: str | os.PathLike[str] | None) -> Pilot:
    """The pilot with which a record begins."""
    saved = header.get("goes_on_from")
    if header.get("configuration") is None:
        raise ConfigurationError([f"{path}: found a pilot made from parts; allowed: one made from a configuration"])
    if saved is None:
        return Pilot(header["configuration"], record=record)
    try:
        digest = hashlib.sha256(Path(saved["path"]).read_bytes()).hexdigest()
    except OSError as fault:
        raise ConfigurationError([f"{path}: goes_on_from: found {saved['path']}: {fault.strerror}"]) from None
    if digest != saved["sha256"]:
        raise ConfigurationError([f"{path}: goes_on_from: found another {saved['path']}; allowed: that of the record"])
    return Pilot.load(saved["path"], record=record)


def _repeated(pilot: Pilot, kind: str, line: Mapping[str, Any]) -> tuple[Any, Any]:
    """What a call gives now, and what it gave."""
    if kind == "navigate":
        time, *states = line["navigate"]
        return pilot.navigate(from_json(time), *(from_json(values) for values in states)), line["answer"]
    if kind == "measure":
        return pilot.measure(measurement_from_json(line["measure"])), line["answer"]
    return command_as_json(pilot.command(line["command"])), line["gives"]


def _difference(gave: Any, before: Any, name: str = "") -> str:
    """The first entry in which two answers differ."""
    if isinstance(gave, dict) and isinstance(before, dict):
        for key in dict.fromkeys([*gave, *before]):
            if gave.get(key) != before.get(key):
                return _difference(gave.get(key), before.get(key), f"{name}.{key}" if name else key)
    return f"{name or 'answer'}: found {str(gave)[:80]}; recorded: {str(before)[:80]}"
