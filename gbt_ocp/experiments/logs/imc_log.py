"""IMC: logs of the LSTS toolchain (.lsf), whose messages imcpy decodes."""

from __future__ import annotations

import gzip
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

from gbt_ocp.experiments.logs.records import LoggedMessage
from gbt_ocp.files import PACKED, UNPACKED, optional_module

MESSAGE_HEADER = struct.Struct("<HHHdHBHB")
"""Synchronisation, number of the message, size, time, source and destination with their entities."""

CHECKSUM = 2
"""Bytes of the checksum behind the fields."""

_SIGNS = {0xFE54: "<", 0x54FE: ">"}


def imc_messages(path: Path, asks: Callable[[str, str], bool]) -> Iterator[LoggedMessage]:
    """Messages of a log in its order.

    The frames of the messages are found here and not by the reader of imcpy: that one loads an index which lies beside
    the log as a pickle, and a pickle can execute anything.

    Parameters
    ----------
    path
        A file that ends in ``.lsf`` or ``.lsf.gz``.
    asks
        Whether messages of a type are read; the topic is the type.

    Raises
    ------
    ValueError
        If imcpy is not installed, or the file cannot be read.
    """
    imcpy = optional_module("imcpy", "imc", "logs of IMC")
    try:
        data = _unpacked(path) if path.suffix == ".gz" else path.read_bytes()
        place = 0
        names: dict[int, str] = {}
        while place + MESSAGE_HEADER.size <= len(data):
            order = _SIGNS.get(int.from_bytes(data[place : place + 2], "little"))
            if order is None:
                raise ValueError(f"no message begins at byte {place}")
            _, number, size, time, *_ = struct.unpack_from(order + MESSAGE_HEADER.format[1:], data, place)
            end = place + MESSAGE_HEADER.size + size + CHECKSUM
            if number not in names:
                names[number] = _name(imcpy, number)
            if end <= len(data) and asks(names[number], names[number]):
                message = imcpy.Packet.deserialize(data[place:end])
                yield LoggedMessage(names[number], names[number], float(time), message)
            place = end
    except Exception as fault:  # what a damaged log raises is not documented
        reason = " ".join(str(fault).split()) or type(fault).__name__
        raise ValueError(f"found a log that cannot be read ({reason}); allowed: a log of IMC") from fault


def _unpacked(path: Path) -> bytes:
    """What a file holds, if that is not far more than its size."""
    most = max(UNPACKED, PACKED * path.stat().st_size)
    with gzip.open(path) as stream:
        data = stream.read(most + 1)
    if len(data) > most:
        raise ValueError(f"more than {most} bytes when it is unpacked")
    return data


def _name(imcpy: object, number: int) -> str:
    """The name of a type of messages; its number if the library does not know it."""
    try:
        return str(imcpy.Factory.abbrev_from_id(number))  # type: ignore[attr-defined]
    except Exception:  # a message of a newer definition
        return str(number)
