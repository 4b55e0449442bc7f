"""What a public scenario is: own path, target, measurements and prior knowledge, all fixed by a run's number."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gbt_ocp.models.measurements import Measurement, Sighting
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.studies.scenarios.motion_laws import MotionLaw
from gbt_ocp.tracking.filters.ekf import FirstGuess
from gbt_ocp.tracking.priors import RangedPrior
from gbt_ocp.typing import Array

NOISE, GUESS, MOTION, CONTESTANT = range(4)
"""Independent streams of random numbers of a run."""


def stream(run: int, part: int) -> np.random.Generator:
    """The generator of a part of a run."""
    return np.random.default_rng([run, part])


@dataclass(frozen=True)
class Knowledge:
    """What every contestant is given before the first bearing.

    Attributes
    ----------
    range, range_std
        Guess of the first range and its standard deviation in m.
    speed
        Typical speed of the target in m/s; velocities of zero mean get it as a standard deviation of each component.
    bearing_std
        Standard deviation of a bearing in radians.
    pace
        Factor on all times of a tracker's settings, which are those of a boat of 1 m/s at some 40 m.
    acceleration_density
        Spectral density of the acceleration in m²/s³ for filters of constant velocity.
    turn_rate
        Turn rate in rad/s of the models that turn.
    speed_varies
        Whether the speed varies by some 20 % as well.
    turns
        Whether the target may turn, for those who guess its law.
    size
        Median of the true size in m and the share by which it may differ, where sizes are measured.
    size_std
        Standard deviation of an angular size in radians.
    """

    range: float
    range_std: float
    speed: float
    bearing_std: float
    pace: float = 1.0
    acceleration_density: float = 1.0e-2
    turn_rate: float = 0.03
    speed_varies: bool = False
    turns: bool = True
    size: tuple[float, float] | None = None
    size_std: float = 0.01

    def first_position(self, bearing: Array, own: Array) -> tuple[Array, Array]:
        """Mean ``(d,)`` and covariance ``(d, d)`` of the first position, from a bearing and an own position ``(d,)``.

        It is what our extended Kalman filter begins with.
        """
        guess = FirstGuess(RangedPrior(own, range=self.range), self.range_std, self.speed)
        return guess.position(bearing, own, self.bearing_std)


@dataclass(frozen=True)
class RecordedRun:
    """One run of a scenario.

    Attributes
    ----------
    times, own, target
        When something was measured ``(K,)`` in s, own positions and the target's then ``(K, d)`` in m, earth frame.
    ahead
        The target's positions a scenario's ``ahead`` later ``(K, d)``; NaN where they are not known.
    sightings
        The measurements of each time; empty where they were missed.
    knowledge
        What is known beforehand.
    """

    times: Array
    own: Array
    target: Array
    ahead: Array
    sightings: tuple[tuple[Sighting, ...], ...]
    knowledge: Knowledge


@dataclass(frozen=True)
class PublicScenario:
    """A frozen scenario.

    Attributes
    ----------
    name
        On the command line.
    title, source
        What happens, and where it was published.
    dimension
        d.
    runs
        Of a benchmark with the defaults.
    record
        The recording of a run from its number; the same each time.
    ahead
        How far ahead forecasts are scored, in s.
    scored_from, scored_every
        First time after the first measurement at which errors count, and the time between two such times, in s.
    law
        The law by which the target moves, for the particle filter that knows it; ``None`` where there is none.
    differs
        Where it is not what was published.
    """

    name: str
    title: str
    source: str
    dimension: int
    runs: int
    record: Callable[[int], RecordedRun]
    ahead: float
    scored_from: float
    scored_every: float
    law: MotionLaw | None = None
    differs: str = ""


def measured(
    times: Array,
    own: Array,
    target: Array,
    knowledge: Knowledge,
    rng: np.random.Generator,
    *,
    missed: float = 0.0,
    sizes: Array | None = None,
    true_std: float | None = None,
) -> tuple[tuple[Sighting, ...], ...]:
    """The measurements of a run.

    Parameters
    ----------
    times, own, target
        ``(K,)``, ``(K, d)``, ``(K, d)``.
    knowledge
        Its deviations.
    rng
        Source of the noise.
    missed
        Probability that a bearing is missed.
    sizes
        True sizes ``(K,)`` in m; the angle that each fills is measured too.
    true_std
        The deviation of the bearings, where it is not that which is known.
    """
    std = knowledge.bearing_std if true_std is None else true_std
    sensor = BearingSensor(float(np.median(np.diff(times))), std, missed)
    found = []
    for k, time in enumerate(times):
        bearing = sensor.measure(k, target[k], own[k], rng)
        at = [] if bearing is None else [Sighting.of_bearing(float(time), bearing, own[k])]
        if sizes is not None:
            angle = 2.0 * np.arctan(0.5 * sizes[k] / np.linalg.norm(target[k] - own[k]))
            angle += knowledge.size_std * rng.standard_normal()
            if angle > 0.0:
                pose = np.append(own[k], 0.0)
                at.append(Measurement(float(time), "size", angle, knowledge.size_std, "camera").placed(pose))
        found.append(tuple(at))
    return tuple(found)
