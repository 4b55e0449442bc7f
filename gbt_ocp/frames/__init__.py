"""Frames: geographic coordinates to a local plane and back, axes, angles, units and clocks.

Inside the package positions are in metres in a plane whose x points east, y north and z up; angles are in radians,
counter-clockwise from +x; times are in seconds. This room brings other conventions there and back. Each function says
the frame it takes: nothing is guessed from the numbers.
"""

from gbt_ocp.frames.angles import (
    bow_to_earth,
    compass_to_math,
    earth_to_bow,
    enu_to_ned,
    math_to_compass,
    ned_to_enu,
    wrapped,
    yaw_of_quaternion,
)
from gbt_ocp.frames.clocks import seconds_of_counts, seconds_of_utc, utc_of_seconds
from gbt_ocp.frames.geodesy import LocalPlane
from gbt_ocp.frames.units import ANGLE_UNITS, LENGTH_UNITS, TIME_UNITS, in_si

__all__ = [
    "ANGLE_UNITS",
    "LENGTH_UNITS",
    "TIME_UNITS",
    "LocalPlane",
    "bow_to_earth",
    "compass_to_math",
    "earth_to_bow",
    "enu_to_ned",
    "in_si",
    "math_to_compass",
    "ned_to_enu",
    "seconds_of_counts",
    "seconds_of_utc",
    "utc_of_seconds",
    "wrapped",
    "yaw_of_quaternion",
]
