"""Bags of ROS 1 and ROS 2, read without ROS (rosbags)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from gbt_ocp.experiments.logs.records import LoggedMessage
from gbt_ocp.files import optional_module
from gbt_ocp.frames import seconds_of_counts


def ros_messages(path: Path, asks: Callable[[str, str], bool]) -> Iterator[LoggedMessage]:
    """Messages of a bag in the order of the log.

    Parameters
    ----------
    path
        Folder of a bag of ROS 2, a file in it, or a ``.bag`` of ROS 1.
    asks
        Whether messages of a topic and a type are read.

    Raises
    ------
    ValueError
        If rosbags is not installed, or the bag cannot be read.
    """
    highlevel = optional_module("rosbags.highlevel", "ros", "bags of ROS")
    typesys = optional_module("rosbags.typesys", "ros", "bags of ROS")
    bag = path.parent if path.suffix == ".db3" else path
    store = typesys.get_typestore(typesys.Stores.LATEST)
    try:
        with highlevel.AnyReader([bag], default_typestore=store) as reader:
            chosen = [one for one in reader.connections if asks(one.topic, one.msgtype)]
            if not chosen:
                return
            for connection, stamp, data in reader.messages(connections=chosen):
                time = float(seconds_of_counts(stamp, "ns"))
                content = reader.deserialize(data, connection.msgtype)
                yield LoggedMessage(connection.topic, connection.msgtype, time, content)
    except Exception as fault:  # what a damaged bag raises is not documented: of SQLite, of zstandard, of struct
        reason = " ".join(str(fault).split()) or type(fault).__name__
        raise ValueError(f"found a bag that cannot be read ({reason}); allowed: a bag of ROS 1 or 2") from fault
