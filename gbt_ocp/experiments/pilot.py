"""The pilot: the online loop that any simulator, vehicle or log can drive."""

from __future__ import annotations

import hashlib
import json
import os
import pickle
import warnings
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.experiments.build.pilot import build_pilot
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.experiments.pilot_record import PilotRecord, as_json, command_as_json, measurement_as_json
from gbt_ocp.files import whole_file
from gbt_ocp.models.measurements import Measurement
from gbt_ocp.ocp.codegen.library import CompilerError
from gbt_ocp.pilot.own_track import Received
from gbt_ocp.pilot.pilot_command import PilotCommand
from gbt_ocp.pilot.pilot_parts import PilotParts
from gbt_ocp.pilot.piloting import Piloting
from gbt_ocp.simulation.summary import installed_versions

SAVED_HEADER, SAVED_MEMORY = "header.json", "memory.pickle"
"""Files in the archive of a saved pilot."""


class Pilot:
    """Tracker, guidance, planner and follower, for a world that is not simulated here.

    Navigations and measurements go in, a command comes out, in any order and at any rate. All times are seconds of one
    clock that does not step back. A measurement is given to the tracker at the next command, in the order of the times
    at which things were measured, at the own pose of that time.

    Parameters
    ----------
    configuration
        A configuration, the name of a shipped one, a path, a mapping with its keys, or
        :class:`~gbt_ocp.pilot.PilotParts`. Its sections ``target`` and ``plant`` do not count, nor does the start.
    overrides
        ``key.path=value`` strings; only for a configuration that is not loaded yet.
    record
        File in which all that goes in and out is written, a JSON object a line; ``gbt-ocp replay`` repeats it.

    Attributes
    ----------
    configuration
        The resolved configuration; ``None`` for a pilot that was made from parts.

    Raises
    ------
    ConfigurationError
        If the configuration is wrong; one line a fault.
    FileExistsError
        If the record exists.
    """

    def __init__(
        self,
        configuration: Configuration | PilotParts | str | Path | Mapping[str, Any],
        *,
        overrides: Iterable[str] = (),
        record: str | os.PathLike[str] | None = None,
    ) -> None:
        self.configuration: Configuration | None = None
        changes = list(overrides)
        if isinstance(configuration, Configuration | PilotParts) and changes:
            raise ValueError("overrides belong to load_config; this configuration is loaded already")
        if isinstance(configuration, PilotParts):
            parts = configuration
        else:
            loaded = isinstance(configuration, Configuration)
            self.configuration = configuration if loaded else load_config(configuration, changes)  # type: ignore[assignment,arg-type]
            assert self.configuration is not None
            try:
                parts = build_pilot(self.configuration)
            except (ValueError, CompilerError) as fault:
                raise ConfigurationError([f"{self.configuration.name}: {fault}"]) from fault
        self._piloting = Piloting(parts)
        self._record: PilotRecord | None = None
        if record is not None:
            self._begin_record(record, None)

    # ---- inputs and commands ----------------------------------------------------------------------------------------

    def navigate(
        self, time: float, pose: ArrayLike, velocity: ArrayLike, covariance: ArrayLike | None = None
    ) -> Received:
        """Take in where the vehicle is.

        Parameters
        ----------
        time
            In seconds.
        pose
            Position and yaw ``(d+1,)``, earth frame: x, y(, z up) in metres, yaw in radians counter-clockwise from +x.
        velocity
            Over ground in the body frame, and yaw rate ``(d+1,)``: ahead, to port(, up) in m/s, rad/s.
        covariance
            Of the pose ``(d+1, d+1)``; the variance of the yaw is added to that of azimuths from the bow.

        Returns
        -------
        ``taken``; ``late`` if it was sorted in before another; ``duplicate`` of a time that was navigated; ``too old``,
        by more than ``pilot.late_s``; ``ahead`` of all else by more than ``pilot.navigation_gap_s``, so that it waits
        for another one that confirms the step; ``not finite``, or beyond 1e12 in size. The last four change nothing.

        Raises
        ------
        ValueError
            If a shape is another one.
        """
        answer = self._piloting.navigate(time, pose, velocity, covariance)
        if self._record is not None:
            given = [float(time), *(_plain(values) for values in (pose, velocity, covariance))]
            self._record.add({"navigate": as_json(given), "answer": answer})
        return answer

    def measure(self, measurement: Measurement) -> Received:
        """Take in a measurement.

        Parameters
        ----------
        measurement
            Of a kind that the tracker takes; its time is when it was measured, not when it arrived.

        Returns
        -------
        ``taken``; ``late`` if the tracker has taken one that is newer, and is set back for it; ``waiting`` for a
        navigation that is not older; ``duplicate`` of one of the same sensor, kind and time; ``too old``, by more than
        ``pilot.late_s``; ``ahead`` of all else by more than ``pilot.late_s`` and ``pilot.navigation_gap_s``; ``no
        navigation`` at its time, before the first one or in a gap. The last four change nothing. What the tracker
        refuses at the next command is counted under ``refused`` in ``health.received``.

        Raises
        ------
        ValueError
            If its mounting does not fit the dimension.
        """
        answer = self._piloting.measure(measurement)
        if self._record is not None:
            self._record.add({"measure": measurement_as_json(measurement), "answer": answer})
        return answer

    def command(self, time: float) -> PilotCommand:
        """What the vehicle is to do from a time on.

        The guidance decides once a sampling period, at the command nearest to the time when it is due. In between the
        plan is followed on: the thrust leads back to it from where the vehicle is.

        Parameters
        ----------
        time
            In seconds. At the time of the last command that one is given again; so it is at an earlier time, with the
            note ``time stepped back``.

        Raises
        ------
        ValueError
            If the time is not finite.
        """
        command = self._piloting.command(time)
        if self._record is not None:
            self._record.add({"command": float(time), "gives": command_as_json(command)})
        return command

    # ---- saving and recording ---------------------------------------------------------------------------------------

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write all that the pilot remembers to a file, completely or not at all; it replaces one that is there.

        Raises
        ------
        ValueError
            If one of its parts remembers what cannot be written.
        """
        piloting, configuration = self._piloting, self.configuration
        header = {
            "configuration": None if configuration is None else configuration.to_mapping(),
            "began_at": None if piloting.began_at is None else piloting.began_at.tolist(),
            "versions": installed_versions(),
        }
        try:
            memory = piloting.skeleton.taken()
        except (TypeError, AttributeError, pickle.PicklingError) as fault:
            raise ValueError(f"save: found a part that remembers what cannot be written: {fault}") from fault
        with whole_file(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(SAVED_HEADER, json.dumps(header))
            archive.writestr(SAVED_MEMORY, memory)
        return Path(path)

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        parts: PilotParts | None = None,
        *,
        record: str | os.PathLike[str] | None = None,
    ) -> Self:
        """A pilot that goes on from what was saved, bit by bit with the same versions on the same machine.

        The file is read with :mod:`pickle`, which runs what it is given: load only what you trust.

        Parameters
        ----------
        path
            What :meth:`save` wrote.
        parts
            Of a pilot that was made from parts: the same, that have seen nothing yet.
        record
            As for the class.

        Raises
        ------
        FileNotFoundError
            If there is no such file.
        ValueError
            If it is none of a pilot, or one of other parts.

        Warns
        -----
        RuntimeWarning
            If it was saved with other versions.
        """
        try:
            with zipfile.ZipFile(path) as archive:
                header = json.loads(archive.read(SAVED_HEADER))
                memory = archive.read(SAVED_MEMORY)
        except (zipfile.BadZipFile, KeyError, ValueError) as fault:
            raise ValueError(f"{os.fspath(path)}: found no saved pilot: {fault}") from None
        made_from = header["configuration"] if parts is None else parts
        if made_from is None or (parts is not None and header["configuration"] is not None):
            allowed = "parts, for it was made from parts" if parts is None else "none, for it has a configuration"
            raise ValueError(f"{os.fspath(path)}: parts: found {type(parts).__name__}; allowed: {allowed}")
        if header["versions"] != installed_versions():
            warnings.warn(f"{os.fspath(path)}: saved with other versions than these", RuntimeWarning, stacklevel=2)
        pilot = cls(made_from)
        if header["began_at"] is not None:
            pilot._piloting.begin(header["began_at"])
            pilot._piloting.skeleton.put_back(memory)
        if record is not None:
            digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
            pilot._begin_record(record, {"path": str(Path(path).resolve()), "sha256": digest})
        return pilot

    def close(self) -> None:
        """Close the record, if there is one; nothing is recorded afterwards."""
        if self._record is not None:
            self._record.close()
            self._record = None

    def _begin_record(self, path: str | os.PathLike[str], saved: Mapping[str, str] | None) -> None:
        configuration = None if self.configuration is None else self.configuration.to_mapping()
        header = {"configuration": configuration, "goes_on_from": saved, "versions": installed_versions()}
        self._record = PilotRecord(path, header)


def _plain(values: ArrayLike | None) -> Any:
    """Numbers as lists, as they were given."""
    return None if values is None else np.asarray(values, dtype=float)
