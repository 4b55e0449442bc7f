"""Writes one log in many formats, each with a library of its format."""

from __future__ import annotations

import csv
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

START = 1_795_000_000.0
"""Seconds since the epoch at which the log begins."""

LATITUDE, LONGITUDE = np.deg2rad([63.44, 10.4])


@dataclass(frozen=True)
class Sailed:
    """What a vehicle did and saw, in the plane: x east, y north."""

    times: np.ndarray
    own: np.ndarray
    target: np.ndarray
    heading: np.ndarray  # clockwise from north, radians
    bearing: np.ndarray  # clockwise from north, radians

    @property
    def azimuth(self):
        """Counter-clockwise from +x."""
        return 0.5 * np.pi - self.bearing

    @property
    def from_bow(self):
        """Clockwise from the bow."""
        return self.bearing - self.heading


def sailed(duration=90.0, meridian=False, noise_deg=0.5, seed=0):
    """A vehicle that swings to and fro, on one meridian if asked for, and a target that passes by.

    All numbers that a format writes in single precision are held exactly by it.
    """
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, duration, 0.25)
    east = 0.0 * times if meridian else 20.0 * np.cos(0.07 * times)
    own = np.round(256.0 * np.column_stack([east, 30.0 * np.sin(0.11 * times)])) / 256.0
    target = np.column_stack([60.0 + 0.3 * times, -10.0 + 0.8 * times])
    line = target - own
    angle = np.arctan2(line[:, 0], line[:, 1]) + np.deg2rad(noise_deg) * rng.standard_normal(len(times))
    heading = np.round(1024.0 * 0.6 * np.sin(0.05 * times)) / 1024.0
    return Sailed(START + times, own, target, heading, np.round(2.0**20 * angle) / 2.0**20)


def table(path, columns, delimiter=",", comma=False):
    """A CSV file of columns by name."""
    with Path(path).open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, delimiter=delimiter)
        writer.writerow(columns)
        for row in zip(*columns.values(), strict=True):
            cells = [repr(float(cell)) if isinstance(cell, float) else str(cell) for cell in row]
            writer.writerow([cell.replace(".", ",") if comma else cell for cell in cells])
    return Path(path)


def in_plane(path, log, **options):
    """East, north, and bearings from +x: ``--bearing-from x``."""
    columns = {"t": log.times, "own_x": log.own[:, 0], "own_y": log.own[:, 1], "bearing_rad": log.azimuth}
    return table(path, columns, **options)


def north_east(path, log, **options):
    """North, east, and bearings in degrees from north: ``--bearing-from north``."""
    bearing = np.rad2deg(np.mod(log.bearing, 2.0 * np.pi))
    columns = {"t": log.times, "own_north": log.own[:, 1], "own_east": log.own[:, 0], "bearing_deg": bearing}
    return table(path, columns, **options)


def geographic(log):
    """Latitude and longitude in radians, and how far north turns from the plane's +y there (clockwise)."""
    import pymap3d

    zero = np.zeros(len(log.times))
    latitude, longitude, _ = pymap3d.enu2geodetic(*log.own.T, zero, LATITUDE, LONGITUDE, 0.0, deg=False)
    # a short way north from each place, as the plane sees it
    step = 1e-6
    east, north, _ = pymap3d.geodetic2enu(latitude + step, longitude, zero, LATITUDE, LONGITUDE, 0.0, deg=False)
    before = pymap3d.geodetic2enu(latitude - step, longitude, zero, LATITUDE, LONGITUDE, 0.0, deg=False)
    return latitude, longitude, np.arctan2(east - before[0], north - before[1])


def on_the_globe(path, log, **options):
    """Latitude, longitude, UTC, a heading and bearings from the bow: ``--bearing-from bow``."""
    from gbt_ocp.frames import utc_of_seconds

    latitude, longitude, turn = geographic(log)
    columns = {
        "utc": [utc_of_seconds(time) for time in log.times],
        "lat_deg": np.rad2deg(latitude),
        "lon_deg": np.rad2deg(longitude),
        "heading_deg": np.mod(np.rad2deg(log.heading - turn), 360.0),
        "bearing_deg": np.rad2deg(log.from_bow),
    }
    return table(path, columns, **options)


def nanoseconds(time):
    return round(time * 8) * 125_000_000


def stamp(store, time):
    whole, rest = divmod(nanoseconds(time), 10**9)
    header, kind = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    return header(stamp=kind(sec=whole, nanosec=rest), frame_id="")


def ros2_bag(path, log, storage="sqlite3"):
    """nav_msgs/Odometry and geometry_msgs/Vector3Stamped: ``--bearing-from x``."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    plugin = {"sqlite3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}[storage]
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        odometry = writer.add_connection("/odom", "nav_msgs/msg/Odometry", typestore=store)
        bearings = writer.add_connection("/sonar/bearing", "geometry_msgs/msg/Vector3Stamped", typestore=store)
        other = writer.add_connection("/chatter", "std_msgs/msg/String", typestore=store)
        vector, point = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Point"]
        quaternion = types["geometry_msgs/msg/Quaternion"]
        zero = vector(x=0.0, y=0.0, z=0.0)
        for k, time in enumerate(log.times):
            yaw = 0.5 * np.pi - log.heading[k]
            pose = types["geometry_msgs/msg/Pose"](
                position=point(x=log.own[k, 0], y=log.own[k, 1], z=-3.0),
                orientation=quaternion(x=0.0, y=0.0, z=np.sin(0.5 * yaw), w=np.cos(0.5 * yaw)),
            )
            twist = types["geometry_msgs/msg/Twist"](linear=zero, angular=zero)
            message = types["nav_msgs/msg/Odometry"](
                header=stamp(store, time),
                child_frame_id="",
                pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36)),
                twist=types["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=np.zeros(36)),
            )
            late = nanoseconds(time) + 40_000_000  # when it was recorded
            writer.write(odometry, late, store.serialize_cdr(message, "nav_msgs/msg/Odometry"))
            seen = types["geometry_msgs/msg/Vector3Stamped"](
                header=stamp(store, time), vector=vector(x=log.azimuth[k], y=0.0, z=0.0)
            )
            writer.write(bearings, late, store.serialize_cdr(seen, "geometry_msgs/msg/Vector3Stamped"))
            said = types["std_msgs/msg/String"](data="hello")
            writer.write(other, late, store.serialize_cdr(said, "std_msgs/msg/String"))
    return Path(path)


def ros1_bag(path, log):
    """The messages of :func:`ros2_bag` in a bag of ROS 1."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    vector, point = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Point"]
    zero, level = vector(x=0.0, y=0.0, z=0.0), types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)

    def header(time):
        whole, rest = divmod(nanoseconds(time), 10**9)
        now = types["builtin_interfaces/msg/Time"](sec=whole, nanosec=rest)
        return types["std_msgs/msg/Header"](seq=0, stamp=now, frame_id="")

    with Writer(path) as writer:
        odometry = writer.add_connection("/odom", "nav_msgs/msg/Odometry", typestore=store)
        bearings = writer.add_connection("/sonar/bearing", "geometry_msgs/msg/Vector3Stamped", typestore=store)
        for k, time in enumerate(log.times):
            pose = types["geometry_msgs/msg/Pose"](
                position=point(x=log.own[k, 0], y=log.own[k, 1], z=-3.0), orientation=level
            )
            twist = types["geometry_msgs/msg/Twist"](linear=zero, angular=zero)
            message = types["nav_msgs/msg/Odometry"](
                header=header(time),
                child_frame_id="",
                pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36)),
                twist=types["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=np.zeros(36)),
            )
            writer.write(odometry, nanoseconds(time), store.serialize_ros1(message, "nav_msgs/msg/Odometry"))
            seen = types["geometry_msgs/msg/Vector3Stamped"](
                header=header(time), vector=vector(x=log.azimuth[k], y=0.0, z=0.0)
            )
            writer.write(bearings, nanoseconds(time), store.serialize_ros1(seen, "geometry_msgs/msg/Vector3Stamped"))
    return Path(path)


HEADER_TEXT = """std_msgs/Header header
{}
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""

FIX = HEADER_TEXT.format(
    """sensor_msgs/NavSatStatus status
float64 latitude
float64 longitude
float64 altitude
float64[9] position_covariance
uint8 position_covariance_type
================================================================================
MSG: sensor_msgs/NavSatStatus
int8 status
uint16 service"""
)

USBL = HEADER_TEXT.format("int32 source_id\nint32 type\nfloat32 range\nfloat32 bearing\nfloat32 elevation")


def mcap_file(path, log, types=None, ranges=None):
    """sensor_msgs/NavSatFix and fixes of a USBL, those of type 1 an azimuth alone and of type 0 a range alone."""
    from mcap_ros2.writer import Writer

    latitude, longitude, turn = geographic(log)
    types = np.ones(len(log.times), dtype=int) if types is None else types
    with Path(path).open("wb") as stream:
        writer = Writer(stream)
        fix = writer.register_msgdef("sensor_msgs/msg/NavSatFix", FIX)
        usbl = writer.register_msgdef("auv_msgs/msg/USBLFix", USBL)
        for k, time in enumerate(log.times):
            now = nanoseconds(time)
            header = {"stamp": {"sec": now // 10**9, "nanosec": now % 10**9}, "frame_id": ""}
            position = {
                "header": header,
                "status": {"status": -1 if k % 7 == 3 else 0, "service": 1},
                "latitude": float(np.rad2deg(latitude[k])) if k % 7 != 3 else 0.0,
                "longitude": float(np.rad2deg(longitude[k])) if k % 7 != 3 else 0.0,
                "altitude": 0.0,
                "position_covariance": [0.0] * 9,
                "position_covariance_type": 0,
            }
            if k % 7 != 3 or types[k] != 1:
                writer.write_message("/gps/fix", fix, position, log_time=now + 10**6, publish_time=now)
            seen = {
                "header": header,
                "source_id": 7,
                "type": int(types[k]),
                "range": 0.0 if ranges is None else float(ranges[k]),
                "bearing": float(log.bearing[k] - turn[k]),
                "elevation": 0.0,
            }
            if k % 7 != 3 or types[k] != 1:  # a bearing between two fixes would be at an interpolated position
                writer.write_message("/usbl", usbl, seen, log_time=now + 10**6, publish_time=now)
        writer.finish()
    return Path(path)


def telemetry(path, log, size=0.0, distance=0.0):
    """LOCAL_POSITION_NED, ATTITUDE and LANDING_TARGET of a camera that looks ahead."""
    from pymavlink.dialects.v20 import ardupilotmega

    mav = ardupilotmega.MAVLink(None)
    sizes, distances = np.broadcast_to(size, log.times.shape), np.broadcast_to(distance, log.times.shape)
    with Path(path).open("wb") as file:
        for k, time in enumerate(log.times):
            since = int(1000.0 * (time - log.times[0]))
            east, north = log.own[k]
            for message in (
                mav.attitude_encode(since, 0.0, 0.0, log.heading[k], 0.0, 0.0, 0.0),
                mav.local_position_ned_encode(since, north, east, 2.0, 0.0, 0.0, 0.0),
                mav.landing_target_encode(since * 1000, 0, 12, log.from_bow[k], 0.0, distances[k], sizes[k], sizes[k]),
            ):
                file.write(struct.pack(">Q", nanoseconds(time) // 1000) + message.pack(mav))
    return Path(path)


def lsf(path, log, accuracy=0.0):
    """EstimatedState and UsblAnglesExtended."""
    import imcpy

    with Path(path).open("wb") as file:
        for k, time in enumerate(log.times):
            state = imcpy.EstimatedState()
            state.timestamp, state.lat, state.lon, state.height = time, LATITUDE, LONGITUDE, 0.0
            (state.y, state.x), state.z, state.psi = map(float, log.own[k]), 0.0, float(log.heading[k])
            usbl = imcpy.UsblAnglesExtended()
            usbl.timestamp, usbl.target, usbl.accuracy = time, "buoy", accuracy
            usbl.bearing, usbl.elevation, usbl.lbearing = float(log.bearing[k]), 0.0, float(log.from_bow[k])
            for message in (state, usbl):
                file.write(imcpy.Packet.serialize(message))
    return Path(path)


def autopilot(path, log):
    """POS, ATT and a message BRG of one's own, in the binary format of ArduPilot: each type says its layout first."""
    latitude, longitude, turn = geographic(log)

    def described(number, name, form, labels, length):
        texts = name.ljust(4, "\0"), form.ljust(16, "\0"), labels.ljust(64, "\0")
        return struct.pack("<BBBBB4s16s64s", 0xA3, 0x95, 0x80, number, length, *(text.encode() for text in texts))

    with Path(path).open("wb") as file:
        file.write(described(0x80, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns", 89))
        file.write(described(1, "POS", "QLLf", "TimeUS,Lat,Lng,Alt", 23))
        file.write(described(2, "ATT", "Qd", "TimeUS,Yaw", 19))
        file.write(described(3, "BRG", "Qdd", "TimeUS,Rel,Std", 27))
        for k, time in enumerate(log.times):
            since = int(1e6 * (time - log.times[0])) + 10**6
            where = [round(1e7 * np.rad2deg(angle[k])) for angle in (latitude, longitude)]
            file.write(struct.pack("<BBBQiif", 0xA3, 0x95, 1, since, *where, 0.0))
            file.write(struct.pack("<BBBQd", 0xA3, 0x95, 2, since, np.rad2deg(log.heading[k] - turn[k])))
            file.write(struct.pack("<BBBQdd", 0xA3, 0x95, 3, since, np.rad2deg(log.from_bow[k]), 0.5))
    return Path(path)
