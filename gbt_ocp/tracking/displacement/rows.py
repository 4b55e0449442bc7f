"""Noisy bearings as linear measurements, linearised where the target is believed to be.

The paper's measurement ``λ̄ᵀ P_T = λ̄ᵀ P_A`` takes the tangent of the *measured* bearing. With noise that is biased: the
error of the tangent is correlated with that of the value, and the fit is drawn towards the vehicle. Linearised at a
predicted position with range r and tangent basis H, the measured direction is an angle e in the tangent plane and

    Hᵀ P_T = Hᵀ P_A + r e + r ε,   ε ~ N(0, σ² I),

which has no bias of first order. Repeated from the posterior it is Gauss-Newton on the angles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.models.bearings import log_map, tangent_basis
from gbt_ocp.models.measurements import Sighting
from gbt_ocp.tracking.bins import BinnedBearings
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.polar import polar_rows
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.typing import Array

FARTHEST = 0.4
"""Angle in radians between predicted and measured bearing beyond which the measured tangent is kept."""

MOST_INWARD = -0.7
"""Share of the predicted range by which one linearisation may shorten it."""

NO_DIRECTION = 1.0e-4
"""Range in metres below which a predicted position has no direction; the measured one stands in."""


@dataclass(frozen=True)
class BearingRows:
    """Linear measurements ``y = hᵀ P_T(t) + r ε``, d-1 rows a sample, those of one sample together.

    Attributes
    ----------
    sample
        Number of the sample that each row belongs to ``(R,)``.
    directions
        h ``(R, d)``, unit vectors.
    values
        y ``(R,)`` in metres.
    ranges
        r of each row ``(R,)`` in metres, positive.
    axes
        Axis about which the measured direction turns along h ``(R, 3)``: λ̂ × h.
    residuals
        Angle from the predicted to the measured direction along each row ``(R,)`` in radians.
    others
        The rows behind those of bearings, if there are any: of other measurements, each with a noise of its own.
    """

    sample: Array
    directions: Array
    values: Array
    ranges: Array
    axes: Array
    residuals: Array
    others: OtherRows | None = None


@dataclass(frozen=True)
class OtherRows:
    """Noise of the rows of measurements that are no bearings. A range has the range 1, so that it stays in metres.

    Attributes
    ----------
    variances
        Of each row over its range squared ``(M,)``: of an angle in rad², of the log of a size, of a range in m².
    shared
        Deviation in metres of what all angular sizes have in common ``(M,)``, the true size; zero in other rows.
    """

    variances: Array
    shared: Array


def bearing_rows(samples: BinnedBearings, predicted: Array) -> BearingRows:
    """Rows of the samples, linearised at the predicted positions ``(N, d)`` in metres."""
    line = predicted - samples.own_positions
    ranges = np.linalg.norm(line, axis=1)
    near = ranges < NO_DIRECTION
    expected = np.where(near[:, None], samples.bearings, line / np.where(near, 1.0, ranges)[:, None])
    basis = tangent_basis(expected)
    angle = log_map(expected, samples.bearings, basis)
    far = np.linalg.norm(angle, axis=1) > FARTHEST
    if far.any():
        measured_basis = tangent_basis(samples.bearings)
        basis = np.where(far[:, None, None], measured_basis, basis)
        expected = np.where(far[:, None], samples.bearings, expected)
    # with the measured tangent the measured direction is where the row is taken: no angle is left to add
    offset = np.where(far[:, None], 0.0, angle)
    ranges = np.maximum(ranges, NO_DIRECTION)
    directions = np.swapaxes(basis, 1, 2)
    values = np.einsum("nji,ni->nj", directions, samples.own_positions) + ranges[:, None] * offset
    count, rows, dimension = directions.shape
    return BearingRows(
        np.repeat(np.arange(count), rows),
        directions.reshape(-1, dimension),
        values.ravel(),
        np.repeat(ranges, rows),
        _turning_axes(expected, directions).reshape(-1, 3),
        angle.ravel(),
    )


def rows_with_others(
    samples: BinnedBearings,
    others: Sequence[Sighting],
    predicted: Array,
    bearing_std: float,
    size: LogNormal | None,
) -> BearingRows:
    """Rows of bearings and of other measurements, linearised at predicted positions.

    A range is linear in metres along the line of sight. An angular size is linear in the log of the range. Its error,
    and that of the true size which all sizes share, are shares of the predicted range: as shares of what was measured
    they would favour the sizes that came out large.

    Parameters
    ----------
    samples
        The bearings, and behind them times and places of the others ``(N + M)``.
    others
        M measurements.
    predicted
        Positions ``(N + M, d)`` in metres.
    bearing_std
        Deviation in radians of an angle that did not say it.
    size
        The true size in metres, if there are angular sizes.
    """
    if not others:
        return bearing_rows(samples, predicted)
    count = len(samples) - len(others)
    one = BinnedBearings(*(values[:count] for values in vars(samples).values()))
    rows = bearing_rows(one, predicted[:count])
    directions, values, ranges, residuals, variances, shared = ([] for _ in range(6))
    for sighting, place in zip(others, predicted[count:], strict=True):
        polar = polar_rows(sighting, place, bearing_std, 0.0 if size is None else float(np.log(size.median)))
        far, std = float(polar.range), float(polar.stds[0])
        if sighting.kind == "range":
            far = float(np.linalg.norm(place - sighting.position))
            direction, scale, residual, std = polar.unit, 1.0, float(sighting.value[0]) - far, float(sighting.std[0])
        else:
            sized = sighting.kind == "size"
            # a size says by how much less the log of the range is
            direction = polar.unit if sized else polar.across[0]
            scale, residual = far, float(polar.residuals[0]) * (-1.0 if sized else 1.0)
        directions.append(direction)
        values.append(direction @ place + scale * max(residual, MOST_INWARD if scale != 1.0 else -np.inf))
        ranges.append(scale)
        residuals.append(residual)
        variances.append(std**2)
        shared.append(size.log_std * far if sighting.kind == "size" and size is not None else 0.0)
    return BearingRows(
        np.concatenate([rows.sample, count + np.arange(len(others))]),
        np.concatenate([rows.directions, directions]),
        np.concatenate([rows.values, values]),
        np.concatenate([rows.ranges, ranges]),
        np.concatenate([rows.axes, np.zeros((len(others), 3))]),
        np.concatenate([rows.residuals, residuals]),
        OtherRows(np.array(variances), np.array(shared)),
    )


def _turning_axes(bearings: Array, directions: Array) -> Array:
    """λ × h ``(N, d-1, 3)``; in the plane the axis is the vertical."""
    count, rows, dimension = directions.shape
    if dimension == 3:
        return np.cross(bearings[:, None, :], directions)
    axes = np.zeros((count, rows, 3))
    axes[:, :, 2] = bearings[:, None, 0] * directions[:, :, 1] - bearings[:, None, 1] * directions[:, :, 0]
    return axes


def row_covariance(
    rows: BearingRows, samples: BinnedBearings, noise: BearingNoise, white_variance: float, trust: Array
) -> Array:
    """Covariance of the noise of the rows ``(R, R)`` in m².

    On the diagonal ``(r² σ²/w + own²)/n``. Where the sensor's error lasts, it is a rotation of the sensor, so
    ``r_i r_j σ_c² exp(-|t_i - t_j|/T_c)`` times the inner product of the axes about which the two directions turn.

    Parameters
    ----------
    rows, samples
        Measurements and what they were made from.
    noise
        Of the sensor.
    white_variance
        σ² of a single bearing in rad², in place of that of ``noise``.
    trust
        w of each row ``(R,)``: 1, or less for a suspected outlier.
    """
    counts = samples.counts[rows.sample]
    white = white_variance / trust
    if rows.others is not None:
        white[-len(rows.others.variances) :] = rows.others.variances
    matrix = np.diag((rows.ranges**2 * white + noise.own_std**2) / counts)
    if rows.others is not None:
        shared = np.concatenate([np.zeros(len(white) - len(rows.others.shared)), rows.others.shared])
        matrix += np.outer(shared, shared)
    if noise.correlated_std > 0.0:
        lasting = noise.correlated(samples.times)[np.ix_(rows.sample, rows.sample)]
        matrix += np.outer(rows.ranges, rows.ranges) * lasting * (rows.axes @ rows.axes.T)
    return matrix


def tail_weights(
    rows: BearingRows,
    samples: BinnedBearings,
    covariance: Array,
    unseen: NDArray[np.bool_],
    white_variance: float,
    own_std: float,
    tails: float,
) -> Array:
    """Weights of the rows under heavy tails, from the expected squares of their residuals (EM).

    Parameters
    ----------
    rows, samples
        The rows, d-1 a sample, and the samples that they come from.
    covariance
        Of the position at each sample ``(N, d, d)`` in m², from the last fit.
    unseen
        Samples ``(N,)`` that the last fit has not seen: they are compared with its prediction.
    white_variance
        σ² of a bearing in rad².
    own_std
        Standard deviation of the own position in metres.
    tails
        Degrees of freedom of Student's t.
    """
    across = np.einsum("ri,rij,rj->r", rows.directions, covariance[rows.sample], rows.directions)
    variance = white_variance + (own_std / rows.ranges) ** 2
    square = rows.residuals**2 * samples.counts[rows.sample] / variance
    predicted = across * samples.counts[rows.sample] / (rows.ranges**2 * variance)
    expected = np.where(unseen[rows.sample], square / (1.0 + predicted), square + predicted)
    size = covariance.shape[-1] - 1
    total = expected.reshape(-1, size).sum(axis=1)
    return np.repeat((tails + size) / (tails + total), size)
