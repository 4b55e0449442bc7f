"""Simulated sensors: the paper's bearing sensor (section 5.6), and sensors of any kind of measurement."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.models.measurements import Frame, Measurement, MeasurementKind, Mounting, Sighting
from gbt_ocp.models.sizes import not_negative, positive
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class BearingSensor:
    """Measures the bearing to the target once every period.

    Parameters
    ----------
    period
        T in seconds.
    noise
        Standard deviation in radians of the rotation in each direction of the tangent plane.
    missed_probability
        Probability in [0, 1) that a bearing is not measured.
    outlier
        Size in radians of a sporadic rotation in a random direction.
    outlier_every
        Time between outliers in seconds; the first comes after one such time.
    latency
        Time in seconds from a measurement to its arrival at the tracker.

    Raises
    ------
    ValueError
        If a number is out of range.
    """

    period: float
    noise: float = 0.0
    missed_probability: float = 0.0
    outlier: float = 0.0
    outlier_every: float = 10.0
    latency: float = 0.0

    def __post_init__(self) -> None:
        positive("period", self.period)
        positive("outlier_every", self.outlier_every)
        for name in ("noise", "missed_probability", "outlier", "latency"):
            not_negative(name, getattr(self, name))
        if self.missed_probability >= 1.0:
            raise ValueError(f"missed_probability: found {self.missed_probability}; allowed: a number in [0, 1)")

    def measure(self, step: int, target: ArrayLike, own: ArrayLike, rng: np.random.Generator) -> Array | None:
        """Bearing ``(d,)`` at the step, or ``None`` where it is missed or undefined (target at the vehicle).

        The generator is drawn from equally often whatever the settings, so that one seed gives the same noise, and the
        same misses, whether or not the other disturbances are switched on.
        """
        line = np.asarray(target, dtype=float) - np.asarray(own, dtype=float)
        noise = rng.standard_normal(len(line) - 1)
        direction = rng.standard_normal(len(line) - 1)
        missed = rng.random() < self.missed_probability
        if missed or not np.any(line):
            return None
        angle = self.noise * noise
        every = max(1, round(self.outlier_every / self.period))
        if self.outlier > 0.0 and step > 0 and step % every == 0:
            angle = angle + self.outlier * direction / np.linalg.norm(direction)
        bearing = unit_bearing(target, own)
        return rotate_bearing(bearing, angle) if np.any(angle) else bearing


LEAST_LEVEL_SHARE = 1.0e-3
"""Least cosine of the elevation by which the deviation of an azimuth grows."""


@dataclass(frozen=True)
class SimulatedSensor:
    """Measures one kind of quantity once every period, and says how well.

    Parameters
    ----------
    name, kind
        Of the sensor, and what it measures.
    period
        In seconds.
    std
        Standard deviation: of an angle across the line of sight in radians, of a length in metres.
    share
        Standard deviation of a range or an angular size over its value, instead of ``std``.
    missed_probability
        Probability in [0, 1) that a measurement is missed.
    latency
        Time in seconds from a measurement to its arrival.
    frame
        Whether angles and components count from +x or from the bow.
    heading_std
        Standard deviation in radians of the own heading, which turns what is measured from the bow.
    mounting
        Where it sits.
    size
        True size of the target in metres.

    Raises
    ------
    ValueError
        If a number is out of range, or not exactly one of ``std`` and ``share`` is given.
    """

    name: str
    kind: MeasurementKind
    period: float
    std: float | None = None
    share: float | None = None
    missed_probability: float = 0.0
    latency: float = 0.0
    frame: Frame = "earth"
    heading_std: float = 0.0
    mounting: Mounting = field(default_factory=Mounting)
    size: float = 1.0

    def __post_init__(self) -> None:
        positive("period", self.period)
        positive("size", self.size)
        for name in ("missed_probability", "latency", "heading_std"):
            not_negative(name, getattr(self, name))
        if self.missed_probability >= 1.0:
            raise ValueError(f"missed_probability: found {self.missed_probability}; allowed: a number in [0, 1)")
        if (self.std is None) == (self.share is None):
            raise ValueError(f"std and share: found {self.std} and {self.share}; allowed: exactly one of them")
        positive("std" if self.share is None else "share", self.std if self.share is None else self.share)  # type: ignore[arg-type]

    def completed(self, measurement: Measurement) -> Measurement:
        """A measurement of this sensor with its frame, mounting and deviation, where it does not say them."""
        std = measurement.std
        if std is None:
            std = self.std if self.share is None else self.share * np.abs(measurement.components)
        frame, mounting = measurement.frame or self.frame, measurement.mounting or self.mounting
        return replace(measurement, std=std, frame=frame, mounting=mounting)

    def sight(self, time: float, target: ArrayLike, pose: ArrayLike, rng: np.random.Generator) -> Sighting | None:
        """What the tracker is given of the target at a time, or ``None`` where it is missed or undefined.

        The sensor is where the vehicle is; an own heading with an error turns what it measures from the bow.

        Parameters
        ----------
        time
            In seconds.
        target, pose
            Position of the target ``(d,)``, and position and yaw of the vehicle ``(d+1,)``, metres and radians.
        rng
            Drawn from equally often, whatever is measured or missed.
        """
        pose, place = np.asarray(pose, dtype=float), np.asarray(target, dtype=float)
        noise, turned = rng.standard_normal(3), float(rng.standard_normal())
        missed = rng.random() < self.missed_probability
        sensor = Measurement(time, "range", 1.0, frame="earth", mounting=self.mounting).placed(pose).position
        line = place - sensor
        if missed or not np.any(line):
            return None
        value, std = self._true(place, line, float(pose[-1]))
        if self.kind in ("range", "size"):
            # what a sensor says of a length is positive
            value = np.maximum(value + std * noise[:1], 0.01 * value)
            std = self.share * value if self.share is not None else std
        else:
            value = value + std * noise[: value.size]
        measured = Measurement(time, self.kind, value, std, self.name, self.frame, self.mounting)
        believed = pose.copy()
        believed[-1] += self.heading_std * turned
        return measured.placed(believed, self.heading_std)

    def _true(self, target: Array, line: Array, yaw: float) -> tuple[Array, Array]:
        """Value and standard deviation ``(m,)`` each, without noise."""
        far, level = float(np.linalg.norm(line)), float(np.hypot(line[0], line[1]))
        if self.kind in ("range", "size"):
            value = far if self.kind == "range" else 2.0 * np.arctan(0.5 * self.size / far)
            return np.array([value]), np.array([self.std if self.std is not None else (self.share or 0.0) * value])
        assert self.std is not None, "angles and positions have no share"
        turn = yaw + self.mounting.yaw if self.frame == "bow" else 0.0
        if self.kind == "position":
            if self.frame == "earth":
                return target.copy(), np.full(target.size, self.std)
            cosine, sine = np.cos(turn), np.sin(turn)
            ahead = np.array([cosine * line[0] + sine * line[1], cosine * line[1] - sine * line[0], *line[2:]])
            return ahead, np.full(target.size, self.std)
        azimuth = np.arctan2(line[1], line[0]) - turn
        elevation = np.arctan2(line[-1], level)
        steep = max(level / far, LEAST_LEVEL_SHARE) if line.size == 3 else 1.0
        both = {
            "azimuth": ([azimuth], [self.std / steep]),
            "elevation": ([elevation], [self.std]),
            "azimuth_elevation": ([azimuth, elevation], [self.std / steep, self.std]),
        }
        value, std = both[self.kind]
        return np.array(value), np.array(std)
