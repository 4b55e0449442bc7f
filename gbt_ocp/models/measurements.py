"""What a sensor on the vehicle measured: one record for all kinds, and the same placed in the earth frame.

Angles are mathematical: an azimuth counts from +x (frame ``earth``) or from the bow (frame ``bow``) towards +y,
counter-clockwise, an elevation from the horizontal upwards. All are in radians, lengths in metres, times in seconds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.models.sizes import not_negative, vector
from gbt_ocp.typing import Array

MeasurementKind = Literal["azimuth", "azimuth_elevation", "elevation", "range", "size", "position"]
"""What was measured: ``size`` is the angle that the target fills, ``position`` the target's position."""

Frame = Literal["earth", "bow"]
"""What the angles, or the components of a position, refer to."""

_NUMBERS: dict[str, int] = {"azimuth_elevation": 2}
_AZIMUTHS = ("azimuth", "azimuth_elevation")


@dataclass(frozen=True)
class Mounting:
    """Where a sensor sits on the vehicle, in the body frame.

    Attributes
    ----------
    position
        Of the sensor ``(d,)`` in metres: forward, to port(, up). Empty is the vehicle's origin.
    yaw
        Of the sensor's zero direction from the bow, in radians, counter-clockwise.
    """

    position: tuple[float, ...] = ()
    yaw: float = 0.0


_ORIGIN = Mounting()


@dataclass(frozen=True)
class Sighting:
    """A measurement whose sensor has a place in the earth frame, and whose angles count from +x.

    Attributes
    ----------
    time
        In seconds.
    kind
        What was measured.
    value, std
        ``(m,)`` each; m = 1, but 2 for ``azimuth_elevation`` and d for ``position``. ``std`` is NaN where the
        measurement did not say it. The deviation of an azimuth from the bow has that of the heading in it.
    position
        Of the sensor ``(d,)`` in metres.
    sensor
        Its name.
    direction
        The unit vector ``(d,)`` of the angles where it is known better than from them; ``None`` otherwise.
    platform
        Name of the vehicle that measured it; empty for the own one.
    """

    time: float
    kind: MeasurementKind
    value: Array
    std: Array
    position: Array
    sensor: str
    direction: Array | None = None
    platform: str = ""

    @classmethod
    def of_bearing(cls, time: float, bearing: Array, position: Array, sensor: str = "sensor") -> Sighting:
        """The sighting of a unit vector ``(d,)``, of unstated deviation, from a position ``(d,)`` in metres."""
        kind: MeasurementKind = "azimuth" if bearing.size == 2 else "azimuth_elevation"
        angles = np.array(_angles(bearing))
        return cls(time, kind, angles, np.full(len(angles), np.nan), position, sensor, bearing)

    @property
    def bearing(self) -> Array:
        """The unit vector λ ``(d,)`` of an azimuth in the plane, or of an azimuth and an elevation in space.

        Raises
        ------
        ValueError
            If the kind does not give a direction in this number of dimensions.
        """
        dimension = self.position.size
        if (self.kind, dimension) not in (("azimuth", 2), ("azimuth_elevation", 3)):
            raise ValueError(f"kind: a measurement of kind '{self.kind}' is not a bearing in {dimension} dimensions")
        if self.direction is not None:
            return self.direction
        return _unit(self.value)


@dataclass(frozen=True)
class Measurement:
    """One measurement of one sensor.

    Attributes
    ----------
    time
        When it was measured, in seconds.
    kind
        One of :data:`MeasurementKind`.
    value
        The angle in radians, the range in metres, azimuth and elevation ``(2,)``, or the position ``(d,)`` in metres.
    std
        Standard deviation, a number or one for each component; ``None`` leaves it to what is configured.
    sensor
        Name of the sensor.
    frame
        What angles and positions refer to. ``None`` leaves it to what is configured for the sensor, and is ``earth``
        for a sensor that is not configured.
    mounting
        Where the sensor sits. ``None`` leaves it to what is configured, and is the vehicle's origin otherwise.
    direction
        The angles as a unit vector ``(d,)`` in the same frame, which is exact to the last bit where they are rounded;
        see :meth:`of_direction`.

    Raises
    ------
    ValueError
        If the kind or the frame is unknown, a number is not finite, a standard deviation is not above 0, or the
        direction is not that of the angles.
    """

    time: float
    kind: MeasurementKind
    value: float | ArrayLike
    std: float | ArrayLike | None = None
    sensor: str = "sensor"
    frame: Frame | None = None
    mounting: Mounting | None = field(default=None)
    direction: ArrayLike | None = None

    @classmethod
    def of_direction(
        cls,
        time: float,
        direction: ArrayLike,
        std: float | ArrayLike | None = None,
        sensor: str = "sensor",
        frame: Frame | None = None,
        mounting: Mounting | None = None,
    ) -> Measurement:
        """The measurement of a direction ``(d,)``, a vector of any length in the frame of the angles.

        It is of kind ``azimuth`` in the plane, ``azimuth_elevation`` in space.

        Raises
        ------
        ValueError
            If the direction is not two or three finite numbers, or is zero.
        """
        line = vector("direction", direction, 3 if np.size(direction) == 3 else 2)
        if not np.any(line):
            raise ValueError(f"direction: found {direction!r}; allowed: a vector that is not zero")
        unit = unit_bearing(line, np.zeros_like(line))
        kind: MeasurementKind = "azimuth" if unit.size == 2 else "azimuth_elevation"
        angles = _angles(unit)
        return cls(time, kind, angles[0] if len(angles) == 1 else angles, std, sensor, frame, mounting, unit)

    def __post_init__(self) -> None:
        if self.kind not in get_args(MeasurementKind):
            raise ValueError(f"kind: found {self.kind!r}; allowed: {', '.join(get_args(MeasurementKind))}")
        if self.frame is not None and self.frame not in get_args(Frame):
            raise ValueError(f"frame: found {self.frame!r}; allowed: {', '.join(get_args(Frame))}")
        if not np.isfinite(self.time):
            raise ValueError(f"time: found {self.time!r}; allowed: a finite number of seconds")
        count = self.components.size
        if self.std is not None:
            vector("std", np.broadcast_to(np.asarray(self.std, dtype=float), (count,)), count, above_zero=True)
        if self.direction is not None:
            unit = _unit(self.components)
            if self.kind not in _AZIMUTHS or not np.allclose(vector("direction", self.direction, unit.size), unit):
                raise ValueError(
                    f"direction: found {self.direction!r}; allowed: the unit vector of the angles, or none"
                )

    @cached_property
    def components(self) -> Array:
        """The value as an array ``(m,)``."""
        found = np.atleast_1d(np.asarray(self.value, dtype=float))
        count = found.size if self.kind == "position" and found.size in (2, 3) else _NUMBERS.get(self.kind, 1)
        return vector("value", found, count)

    def placed(self, pose: ArrayLike, heading_std: float = 0.0) -> Sighting:
        """The measurement in the earth frame.

        Parameters
        ----------
        pose
            Of the vehicle at the time of the measurement, position and yaw ``(d+1,)``, metres and radians, earth frame.
        heading_std
            Standard deviation of the yaw in radians; it is added to that of an azimuth from the bow.
        """
        pose = np.asarray(pose, dtype=float)
        position, yaw = pose[:-1].copy(), float(pose[-1])
        not_negative("heading_std", heading_std)
        mounting = self.mounting if self.mounting is not None else _ORIGIN
        if mounting.position:
            arm = vector("mounting.position", mounting.position, position.size)
            position[:2] += _turned(arm[:2], yaw)
            position[2:] += arm[2:]
        value = self.components.copy()
        direction = None if self.direction is None else np.array(self.direction, dtype=float)
        std = np.empty(value.size)
        std[:] = math.nan if self.std is None else self.std
        if self.frame == "bow":
            if self.kind == "position":
                value[:2] = _turned(value[:2], yaw + mounting.yaw)
                value += position
            elif self.kind in _AZIMUTHS:
                value[0] += yaw + mounting.yaw
                if direction is not None:
                    direction[:2] = _turned(direction[:2], yaw + mounting.yaw)
                std[0] = math.hypot(std[0], heading_std)
        return Sighting(self.time, self.kind, value, std, position, self.sensor, direction)


def _unit(angles: Array) -> Array:
    """The unit vector of an azimuth ``(2,)``, or of an azimuth and an elevation ``(3,)``."""
    level = [math.cos(angles[0]), math.sin(angles[0])]
    if angles.size == 1:
        return np.array(level)
    up = math.cos(angles[1])
    return np.array([up * level[0], up * level[1], math.sin(angles[1])])


def _angles(unit: Array) -> list[float]:
    """Azimuth, and elevation in space, of a unit vector ``(d,)``."""
    azimuth = float(np.arctan2(unit[1], unit[0]))
    return [azimuth] if unit.size == 2 else [azimuth, float(np.arctan2(unit[2], np.hypot(unit[0], unit[1])))]


def _turned(level: Array, angle: float) -> Array:
    """A horizontal vector ``(2,)`` turned by an angle in radians, counter-clockwise."""
    cosine, sine = math.cos(angle), math.sin(angle)
    x, y = level.tolist()  # numbers of Python are quicker than those of an array
    return np.array([cosine * x - sine * y, sine * x + cosine * y])
