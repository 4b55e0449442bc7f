"""MCAP files: messages of ROS 2 and messages in JSON (mcap)."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from gbt_ocp.experiments.logs.records import LoggedMessage
from gbt_ocp.files import optional_module
from gbt_ocp.frames import seconds_of_counts


def mcap_messages(path: Path, asks: Callable[[str, str], bool]) -> Iterator[LoggedMessage]:
    """Messages of a file in the order of the log; those that are neither of ROS 2 nor in JSON are passed over.

    Parameters
    ----------
    path
        The file.
    asks
        Whether messages of a topic and a type are read.

    Raises
    ------
    ValueError
        If mcap is not installed, or the file cannot be read.
    """
    reading = optional_module("mcap.reader", "mcap", "MCAP files")
    ros2 = optional_module("mcap_ros2.decoder", "mcap", "MCAP files with messages of ROS 2")
    factory = ros2.DecoderFactory()
    decoders: dict[int, Callable[[bytes], Any] | None] = {}
    kinds: dict[int, str] = {}
    try:
        with path.open("rb") as stream:
            for schema, channel, message in reading.make_reader(stream).iter_messages():
                number = channel.id
                if number not in decoders:
                    kinds[number] = schema.name if schema is not None else channel.topic
                    decoders[number] = None
                    if asks(channel.topic, kinds[number]):
                        of_json = channel.message_encoding == "json"
                        decoder = factory.decoder_for(channel.message_encoding, schema)
                        decoders[number] = json.loads if of_json else decoder
                decode = decoders[number]
                if decode is not None:
                    time = float(seconds_of_counts(message.log_time, "ns"))
                    yield LoggedMessage(channel.topic, kinds[number], time, decode(message.data))
    except Exception as fault:  # what a damaged file raises is not documented: of mcap, of zstandard, of struct
        reason = " ".join(str(fault).split()) or type(fault).__name__
        raise ValueError(f"found a file that cannot be read ({reason}); allowed: an MCAP file") from fault
