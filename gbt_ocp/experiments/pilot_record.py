"""The record of a pilot: all that went in and came out, one JSON object a line.

The first line says what the pilot was made of, each further one is a call with its answer. Numbers are written in full,
so that they read back as the same; those that are not finite are the texts ``nan``, ``inf`` and ``-inf``.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.models.measurements import Measurement, Mounting
from gbt_ocp.pilot.pilot_command import PilotCommand

PILOT_RECORD = "gbt_ocp pilot"
"""What the first line of a record has under ``record``."""

RECORD_VERSION = 1
"""Version of the lines of a record."""


def as_json(value: Any) -> Any:
    """A value as JSON holds it: arrays and tuples as lists, numbers that are not finite as texts."""
    if isinstance(value, Mapping):
        return {str(name): as_json(item) for name, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [as_json(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0.0 else "-inf"
    return value


def from_json(value: Any) -> Any:
    """Numbers, or lists of them, as :func:`as_json` wrote them."""
    if isinstance(value, list):
        return [from_json(item) for item in value]
    return float(value) if isinstance(value, str) else value


def measurement_as_json(measurement: Measurement) -> dict[str, Any]:
    """A measurement by the names of its attributes."""
    mounting = measurement.mounting
    return {
        "time": as_json(float(measurement.time)),
        "kind": measurement.kind,
        "value": as_json(np.asarray(measurement.value, dtype=float)),
        "std": None if measurement.std is None else as_json(np.asarray(measurement.std, dtype=float)),
        "sensor": measurement.sensor,
        "frame": measurement.frame,
        "mounting": None if mounting is None else as_json(asdict(mounting)),
        "direction": None if measurement.direction is None else as_json(np.asarray(measurement.direction)),
    }


def measurement_from_json(given: Mapping[str, Any]) -> Measurement:
    """The measurement that was written.

    Raises
    ------
    ValueError, TypeError, KeyError
        If it is none.
    """
    mounting = given["mounting"]
    if mounting is not None:
        mounting = Mounting(tuple(mounting["position"]), mounting["yaw"])
    return Measurement(
        from_json(given["time"]),
        given["kind"],
        from_json(given["value"]),
        from_json(given["std"]),
        given["sensor"],
        given["frame"],
        mounting,
        from_json(given["direction"]),
    )


def command_as_json(command: PilotCommand) -> dict[str, Any]:
    """What a command gives; the forecast and the plan where they were made at its time."""
    health, setpoint, decided = command.health, command.setpoint, command.decided
    found: dict[str, Any] = {
        "thrust": command.thrust,
        "setpoint": None if setpoint is None else asdict(setpoint),
        "range_known": command.range_known,
        "health": asdict(health),
    }
    if decided is not None and decided.time == command.time:
        found["times"], found["mean"], found["covariance"] = decided.times, *decided.forecast
        found["plan"] = None if decided.plan is None else decided.plan.endpoints
    written: dict[str, Any] = as_json(found)
    return written


class PilotRecord:
    """Writes a record, line by line.

    Parameters
    ----------
    path
        A file that does not exist.
    header
        What the pilot was made of.

    Raises
    ------
    FileExistsError
        If the file exists.
    """

    def __init__(self, path: str | os.PathLike[str], header: Mapping[str, Any]) -> None:
        self._stream = Path(path).open("x", encoding="utf-8", buffering=1)  # noqa: SIM115  # open until close()
        self.add({"record": PILOT_RECORD, "record_version": RECORD_VERSION, **header})

    def add(self, line: Mapping[str, Any]) -> None:
        """Write a line; it is in the file when the call returns."""
        self._stream.write(json.dumps(line, allow_nan=False) + "\n")

    def close(self) -> None:
        """Close the file."""
        self._stream.close()


def is_pilot_record(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins as a record does."""
    try:
        with Path(path).open("rb") as stream:
            return stream.read(len(PILOT_RECORD) + 13) == f'{{"record": "{PILOT_RECORD}"'.encode()
    except OSError:
        return False


def read_pilot_record(path: str | os.PathLike[str]) -> list[dict[str, Any]]:
    """The lines of a record. A last line that was cut off is left out.

    Raises
    ------
    ConfigurationError
        If the file cannot be read, or a line is none of a record; with the number of the line.
    """
    try:
        written = Path(path).read_text(encoding="utf-8").split("\n")
    except (OSError, UnicodeDecodeError) as fault:
        raise ConfigurationError(
            [f"{path}: found what cannot be read: {fault}; allowed: a record of a pilot"]
        ) from None
    lines = []
    for number, text in enumerate(written[:-1], start=1):  # what follows the last line break was cut off
        try:
            line = json.loads(text)
        except ValueError:
            line = None
        if not isinstance(line, dict):
            raise ConfigurationError([f"{path}: line {number}: found {text[:60]!r}; allowed: a JSON object"])
        lines.append(line)
    if not lines or lines[0].get("record") != PILOT_RECORD or lines[0].get("record_version") != RECORD_VERSION:
        allowed = f'"record": "{PILOT_RECORD}", "record_version": {RECORD_VERSION}'
        raise ConfigurationError([f"{path}: line 1: found {written[0][:60]!r}; allowed: an object with {allowed}"])
    return lines
