"""A particle filter of bearings, and of angular sizes, for any law of motion: the limit where the law is the true one.

Bearings of a short while count as one with their mean and the deviation of a mean. Where particles are drawn again they
are blurred by a kernel that keeps mean and covariance (West 1993), in polar coordinates about the vehicle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.bearings import log_map, rotate_bearing
from gbt_ocp.models.measurements import Sighting
from gbt_ocp.studies.scenarios.motion_laws import MotionLaw
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array

BLUR = 0.08
"""Deviation of the kernel over that of the particles."""

FORECAST_PARTICLES = 2000
"""Particles that a forecast moves at most."""


class LawParticleFilter:
    """Particles that move by a law.

    Parameters
    ----------
    law
        The law.
    dimension
        d.
    count
        Number of particles.
    bearing_std
        Standard deviation of a bearing in radians.
    range
        Prior of the first range in m.
    bin_width
        Bearings within this time in s count as one.
    rng
        Source of the draws.
    size
        Prior of the true size in m; without it angular sizes are not taken.
    """

    def __init__(
        self,
        law: MotionLaw,
        dimension: int,
        *,
        count: int,
        bearing_std: float,
        range: LogNormal,
        bin_width: float,
        rng: np.random.Generator,
        size: LogNormal | None = None,
    ) -> None:
        self._law, self._dimension, self._count, self._std = law, dimension, count, bearing_std
        self._range, self._width, self._rng, self._size = range, bin_width, rng, size
        self._states = np.empty((0, 0))
        self._sizes = np.empty(0)
        self._weights = np.full(count, 1.0 / count)
        self._time = 0.0
        self._waiting: list[tuple[float, Array, Array]] = []
        self.takes = (("azimuth",) if dimension == 2 else ("azimuth_elevation",)) + (("size",) if size else ())

    def take(self, sighting: Sighting) -> None:
        """Take in a bearing, or an angular size with its deviation."""
        if sighting.kind != "size":
            self.update(sighting.time, sighting.bearing, sighting.position)
            return
        self._use()
        if not len(self._states):
            return
        self._moved_to(sighting.time)
        far = np.linalg.norm(self._states[:, : self._dimension] - sighting.position, axis=1)
        off = sighting.value[0] - 2.0 * np.arctan(0.5 * self._sizes / far)
        self._weigh(-0.5 * (off / sighting.std[0]) ** 2, sighting.position)

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing ``(d,)`` from ``own_position`` ``(d,)``; it counts once its bin is full."""
        if self._waiting and time - self._waiting[0][0] > self._width - 1e-9:
            self._use()
        self._waiting.append((time, np.asarray(bearing, dtype=float), np.asarray(own_position, dtype=float)))

    def predict(self, times: ArrayLike) -> Forecast:
        """Mean and covariance of the particles at the times ``(K,)``, none before the latest bearing.

        Raises
        ------
        ValueError
            Before the first bearing.
        """
        self._use()
        if not len(self._states):
            raise ValueError("found no bearing yet; allowed: a forecast after the first one")
        # at the time of the latest measurement all particles count, ahead of it a sample of them
        means, covariances = [], []
        sample, at = None, self._time
        for time in np.atleast_1d(np.asarray(times, dtype=float)):
            if time <= self._time + 1e-9:
                states, weights = self._law.moved(self._states, 0.0, self._rng), self._weights
            else:
                if sample is None:
                    sample = self._states[self._drawn(min(FORECAST_PARTICLES, self._count))]
                sample = self._law.moved(sample, float(time) - at, self._rng)
                at = float(time)
                states, weights = sample, np.full(len(sample), 1.0 / len(sample))
            mean, covariance = _moments(states[:, : self._dimension], weights)
            means.append(mean)
            covariances.append(covariance)
        return Forecast(np.array(means), np.array(covariances))

    def _use(self) -> None:
        """Weigh the particles by the bearings that wait."""
        if not self._waiting:
            return
        times, bearings, owns = (np.array(column) for column in zip(*self._waiting, strict=True))
        self._waiting = []
        time, own = float(np.mean(times)), owns.mean(axis=0)
        bearing = bearings.sum(axis=0)
        bearing /= np.linalg.norm(bearing)
        std = self._std / np.sqrt(len(times))
        if not len(self._states):
            self._begin(time, bearing, own, std)
        else:
            self._moved_to(time)
            line = self._states[:, : self._dimension] - own
            unit = line / np.maximum(np.linalg.norm(line, axis=1, keepdims=True), 1e-9)
            angle = log_map(bearing, unit)
            self._weigh(-0.5 * np.sum((angle / std) ** 2, axis=1), own)
        if times[-1] > time:
            self._moved_to(float(times[-1]))

    def _begin(self, time: float, bearing: Array, own: Array, std: float) -> None:
        count, rng = self._count, self._rng
        angles = std * rng.standard_normal((count, self._dimension - 1))
        units = rotate_bearing(bearing, angles)
        far = self._range.median * np.exp(self._range.log_std * rng.standard_normal(count))
        self._states = self._law.begun(own + far[:, None] * units, -units, rng)
        size = self._size
        self._sizes = (
            np.ones(count) if size is None else size.median * np.exp(size.log_std * rng.standard_normal(count))
        )
        self._time = time

    def _moved_to(self, time: float) -> None:
        if time > self._time:
            self._states = self._law.moved(self._states, time - self._time, self._rng)
            self._time = time

    def _weigh(self, logarithms: Array, own: Array) -> None:
        with np.errstate(divide="ignore"):
            found = np.log(self._weights) + logarithms
        found = np.exp(found - found.max())
        self._weights = found / found.sum()
        if 1.0 / np.sum(self._weights**2) < 0.5 * self._count:
            self._draw_again(own)

    def _drawn(self, count: int) -> Array:
        """Numbers of particles, drawn by their weights at even steps."""
        steps = (self._rng.random() + np.arange(count)) / count
        return np.minimum(np.searchsorted(np.cumsum(self._weights), steps), self._count - 1)

    def _draw_again(self, own: Array) -> None:
        d = self._dimension
        chosen = self._drawn(self._count)
        states, sizes = self._states[chosen], self._sizes[chosen]
        line = states[:, :d] - own
        far = np.linalg.norm(line, axis=1)
        middle = line.mean(axis=0)
        middle /= np.linalg.norm(middle)
        angle = log_map(middle, line / far[:, None])
        columns = [k for k in range(d, states.shape[1]) if k not in self._law.kept(d)]
        polar = np.column_stack([np.log(far), angle, states[:, columns], np.log(sizes)])
        mean = polar.mean(axis=0)
        covariance = np.atleast_2d(np.cov(polar.T)) + 1e-18 * np.eye(polar.shape[1])
        values, axes = np.linalg.eigh(covariance)
        blurred = (axes * np.sqrt(np.maximum(values, 0.0))) @ self._rng.standard_normal((polar.shape[1], self._count))
        polar = mean + np.sqrt(1.0 - BLUR**2) * (polar - mean) + BLUR * blurred.T
        units = rotate_bearing(middle, polar[:, 1:d])
        states = states.copy()
        states[:, :d] = own + np.exp(polar[:, :1]) * units
        states[:, columns] = polar[:, d:-1]
        self._states, self._sizes = states, np.exp(polar[:, -1])
        self._weights = np.full(self._count, 1.0 / self._count)


def _moments(positions: Array, weights: Array) -> tuple[Array, Array]:
    mean = weights @ positions
    apart = positions - mean
    return mean, (weights[:, None] * apart).T @ apart
