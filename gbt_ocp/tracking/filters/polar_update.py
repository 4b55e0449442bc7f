"""The update of a filter in the direction, the log range, and velocities over the range.

A filter's state is Cartesian, where its motion is linear. In a measurement of a bearing the range is not observable
without a manoeuvre: all positions and relative velocities may be larger by one factor. Linearised in Cartesian
coordinates that factor has another direction at each estimate, and an extended filter wins a range from it that is not
in the bearings. Here it is a single coordinate, the log range, whatever the estimate: Aidala and Hammel, "Utilization
of modified polar coordinates for bearings-only tracking", IEEE Transactions on Automatic Control 28 (1983). A bearing,
a range and an angular size are linear in these coordinates, so an update has no error of linearisation.
"""

from __future__ import annotations

import numpy as np

from gbt_ocp.models.bearings import rotate_bearing, tangent_basis
from gbt_ocp.tracking.filters.kalman import Update, updated
from gbt_ocp.tracking.linalg import symmetric
from gbt_ocp.tracking.polar import PolarRows
from gbt_ocp.typing import Array

LONGEST_LOG_STEP = 5.0
"""Largest step of the log range in one update."""


def polar_updated(mean: Array, covariance: Array, rows: PolarRows, own: Array, own_velocity: Array) -> Update:
    """Condition states on the rows of a measurement.

    Parameters
    ----------
    mean, covariance
        ``(..., n)`` and ``(..., n, n)``: position, velocity, acceleration if there is one, each ``(d,)``, then the
        logarithm of the size if it is estimated.
    rows
        Of the measurement, at the positions of the mean.
    own, own_velocity
        Of the sensor, ``(d,)`` in metres and m/s. The velocity chooses the coordinates; it is no measurement.
    """
    d, n = len(own), mean.shape[-1]
    blocks = n // d
    basis = tangent_basis(rows.unit)
    relative = mean.copy()
    relative[..., :d] = rows.range[..., None] * rows.unit
    relative[..., d : 2 * d] -= own_velocity
    inward = np.linalg.inv(_slopes(relative, rows.range, basis, blocks))
    observation = np.zeros((*mean.shape[:-1], len(rows.along), n))
    observation[..., : d - 1] = rows.across @ basis
    observation[..., d - 1] = rows.along
    if n > blocks * d:
        observation[..., -1] = rows.size
    noise = rows.stds[..., None] ** 2 * np.eye(len(rows.along))
    polar = symmetric(inward @ covariance @ np.swapaxes(inward, -1, -2))
    done = updated(np.zeros_like(mean), polar, observation, noise, rows.residuals)

    step = done.mean
    distance = rows.range * np.exp(np.clip(step[..., d - 1], -LONGEST_LOG_STEP, LONGEST_LOG_STEP))
    unit = rotate_bearing(rows.unit, step[..., : d - 1])
    scale = (distance / rows.range)[..., None]
    after = relative + step
    after[..., :d] = distance[..., None] * unit
    moving = slice(d, blocks * d)
    after[..., moving] = scale * relative[..., moving] + distance[..., None] * step[..., moving]
    outward = _slopes(after, distance, _carried(basis, rows.unit, unit), blocks)
    covariance = symmetric(outward @ done.covariance @ np.swapaxes(outward, -1, -2))
    after[..., :d] += own
    after[..., d : 2 * d] += own_velocity
    return Update(after, covariance, done.log_likelihood, done.innovation_covariance)


def _slopes(relative: Array, distance: Array, basis: Array, blocks: int) -> Array:
    """Derivatives of a relative state by direction, log range, derivatives over the range, and log size."""
    d = basis.shape[-2]
    slopes = np.zeros((*relative.shape, relative.shape[-1]))
    slopes[..., :d, : d - 1] = distance[..., None, None] * basis
    moving = blocks * d
    slopes[..., :moving, d - 1] = relative[..., :moving]
    index = np.arange(d, moving)
    slopes[..., index, index] = distance[..., None]
    slopes[..., np.arange(moving, relative.shape[-1]), np.arange(moving, relative.shape[-1])] = 1.0
    return slopes


def _carried(basis: Array, before: Array, after: Array) -> Array:
    """The basis of the tangent plane, turned along with its direction."""
    both = before + after
    weight = 1.0 + np.sum(before * after, axis=-1)
    along = np.sum(after[..., None] * basis, axis=-2) / np.maximum(weight, 1e-9)[..., None]
    return np.asarray(basis - both[..., None] * along[..., None, :])


class OwnVelocities:
    """Velocities of sensors, from where they were at their measurements."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[float, Array]] = {}
        self._velocity: Array | None = None

    def at(self, sensor: str, time: float, position: Array) -> Array:
        """The velocity ``(d,)`` in m/s since the sensor's last measurement; 0 before there are two."""
        last = self._last.get(sensor)
        if last is not None and time > last[0]:
            self._velocity = (position - last[1]) / (time - last[0])
        if last is None or time > last[0]:
            self._last[sensor] = (time, position)
        return np.zeros(len(position)) if self._velocity is None else self._velocity
