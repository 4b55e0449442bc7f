"""What a sensor on the vehicle measured: one record for all kinds, and the same placed in the earth frame.

Angles are mathematical: an azimuth counts from +x (frame ``earth``) or from the bow (frame ``bow``) towards +y,
counter-clockwise, an elevation from the horizontal upwards. All are in radians, lengths in metres, times in seconds.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

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
    """

    time: float
    kind: MeasurementKind
    value: Array
    std: Array
    position: Array
    sensor: str
    direction: Array | None = None

    @classmethod
    def of_bearing(cls, time: float, bearing: Array, position: Array, sensor: str = "sensor") -> Sighting:
        """The sighting of a unit vector ``(d,)``, of unstated deviation, from a position ``(d,)`` in metres."""
        angles = [np.arctan2(bearing[1], bearing[0])]
        if bearing.size == 3:
            angles.append(np.arctan2(bearing[2], np.hypot(bearing[0], bearing[1])))
        kind: MeasurementKind = "azimuth" if bearing.size == 2 else "azimuth_elevation"
        std = np.full(len(angles), np.nan)
        return cls(time, kind, np.array(angles), std, position, sensor, bearing)

    @property
    def directed(self) -> bool:
        """Whether the kind gives a direction in this number of dimensions."""
        return (self.kind, self.position.size) in (("azimuth", 2), ("azimuth_elevation", 3))

    @property
    def bearing(self) -> Array:
        """The unit vector λ ``(d,)`` of an azimuth in the plane, or of an azimuth and an elevation in space.

        Raises
        ------
        ValueError
            If the kind does not give a direction in this number of dimensions.
        """
        dimension = self.position.size
        if not self.directed:
            raise ValueError(f"kind: a measurement of kind '{self.kind}' is not a bearing in {dimension} dimensions")
        if self.direction is not None:
            return self.direction
        level = np.array([np.cos(self.value[0]), np.sin(self.value[0])])
        if dimension == 2:
            return level
        return np.append(np.cos(self.value[1]) * level, np.sin(self.value[1]))


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

    Raises
    ------
    ValueError
        If the kind or the frame is unknown, a number is not finite, or a standard deviation is not above 0.
    """

    time: float
    kind: MeasurementKind
    value: float | ArrayLike
    std: float | ArrayLike | None = None
    sensor: str = "sensor"
    frame: Frame | None = None
    mounting: Mounting | None = field(default=None)

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

    @property
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
        mounting = self.mounting if self.mounting is not None else Mounting()
        if mounting.position:
            arm = vector("mounting.position", mounting.position, position.size)
            position[:2] += _turned(arm[:2], yaw)
            position[2:] += arm[2:]
        value = self.components
        std = np.full(value.size, np.nan)
        if self.std is not None:
            std = np.broadcast_to(np.asarray(self.std, dtype=float), value.shape).copy()
        if self.frame == "bow":
            if self.kind == "position":
                value[:2] = _turned(value[:2], yaw + mounting.yaw)
                value += position
            elif self.kind in _AZIMUTHS:
                value[0] += yaw + mounting.yaw
                std[0] = np.hypot(std[0], heading_std)
        return Sighting(self.time, self.kind, value, std, position, self.sensor)


def _turned(level: Array, angle: float) -> Array:
    """A horizontal vector ``(2,)`` turned by an angle in radians, counter-clockwise."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([cosine * level[0] - sine * level[1], sine * level[0] + cosine * level[1]])
