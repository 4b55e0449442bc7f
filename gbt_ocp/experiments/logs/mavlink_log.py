"""MAVLink: telemetry logs (.tlog) and logs of autopilots (.bin), read by pymavlink."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from gbt_ocp.experiments.logs.records import LoggedMessage
from gbt_ocp.files import optional_module


def mavlink_messages(path: Path, asks: Callable[[str, str], bool]) -> Iterator[LoggedMessage]:
    """Messages of a log in its order, with the times that pymavlink gives them.

    Parameters
    ----------
    path
        The file.
    asks
        Whether messages of a type are read; the topic is the type.

    Raises
    ------
    ValueError
        If pymavlink is not installed, or the file cannot be read.
    """
    mavutil = optional_module("pymavlink.mavutil", "mavlink", "logs of MAVLink")
    dataflash = optional_module("pymavlink.DFReader", "mavlink", "logs of MAVLink")
    mavutil.set_dialect("ardupilotmega")
    try:
        # by their classes: mavlink_connection takes some names of files for those of a connection
        of_autopilot = path.suffix.casefold() == ".bin"
        log: Any = dataflash.DFReader_binary(str(path)) if of_autopilot else mavutil.mavlogfile(str(path))
        try:
            while True:
                message = log.recv_msg()
                if message is None:
                    break
                kind = message.get_type()
                if kind != "BAD_DATA" and asks(kind, kind):
                    time = float(message._timestamp)  # the name under which pymavlink has it
                    yield LoggedMessage(kind, kind, time, message.to_dict())
        finally:
            log.close()
    except Exception as fault:  # what a damaged log raises is not documented: of struct, of the dialect
        reason = " ".join(str(fault).split()) or type(fault).__name__
        raise ValueError(f"found a log that cannot be read ({reason}); allowed: a log of MAVLink") from fault
