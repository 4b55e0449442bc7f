"""What measurements make of the Gaussians of the bank: their moments, and their weights by what each foresaw."""

from __future__ import annotations

import numpy as np

from gbt_ocp.tracking.held.bank import AZIMUTH, ELEVATION, LEAST_COSINE, LOG_SIZE, Components, wrapped
from gbt_ocp.tracking.polar import PolarRows
from gbt_ocp.typing import Array


def corrected(given: Components, angles: Array, noise: Array) -> tuple[Components, Array, Array]:
    """The components after a bearing, its log density under each, and its squared standardised innovations.

    Parameters
    ----------
    given
        The components at its time.
    angles
        Azimuth, and elevation in space, in radians ``(d-1,)``.
    noise
        Variance of the bearing across the line of sight under each component, in rad² ``(N,)``.

    Returns
    -------
    The components, and ``(N,)`` twice; the density is in rad^-(d-1).
    """
    m, cov = given.means, given.covariances
    seen = [AZIMUTH] if len(angles) == 1 else [AZIMUTH, ELEVATION]
    off = np.stack([wrapped(angles[0] - m[:, AZIMUTH]), *(angles[1:] - m[:, seen[1:]]).T], axis=-1)
    gain = cov[:, :, seen]
    spread = gain[:, seen, :].copy()
    spread[:, 0, 0] += noise if len(seen) == 1 else noise / np.maximum(np.cos(m[:, ELEVATION]), LEAST_COSINE) ** 2
    if len(seen) == 2:
        spread[:, 1, 1] += noise
        determinant = spread[:, 0, 0] * spread[:, 1, 1] - spread[:, 0, 1] ** 2
        inverse = np.empty_like(spread)
        inverse[:, 0, 0], inverse[:, 1, 1] = spread[:, 1, 1], spread[:, 0, 0]
        inverse[:, 0, 1] = inverse[:, 1, 0] = -spread[:, 0, 1]
        inverse /= determinant[:, None, None]
    else:
        determinant, inverse = spread[:, 0, 0], 1.0 / spread
    gain = gain @ inverse
    squares = np.einsum("ni,nij,nj->n", off, inverse, off)
    density = -0.5 * (squares + np.log(determinant) + len(seen) * np.log(2.0 * np.pi))
    means = m + np.einsum("nij,nj->ni", gain, off)
    covariances = cov - gain @ spread @ np.swapaxes(gain, 1, 2)
    covariances = 0.5 * (covariances + np.swapaxes(covariances, 1, 2))
    return Components(given.log_weights + density, means, covariances, given.branches), density, squares


def sighted(given: Components, slopes: Array, rows: PolarRows) -> Components:
    """The components after a measurement, weighed by its density in units of its deviation.

    Parameters
    ----------
    given
        The components.
    slopes
        Of the positions at the time of the measurement by their states ``(N, d, n)``.
    rows
        Of the measurement at these positions.
    """
    along = rows.across + rows.along[:, None] * rows.unit[:, None, :]
    observation = along @ slopes / (rows.range[:, None] * rows.stds)[..., None]
    if np.any(rows.size):
        observation[..., LOG_SIZE] += rows.size / rows.stds
    off = rows.residuals / rows.stds
    gain = given.covariances @ np.swapaxes(observation, 1, 2)
    spread = observation @ gain + np.eye(len(rows.along))
    inverse = np.linalg.inv(spread)
    gain = gain @ inverse
    density = -0.5 * (np.einsum("ni,nij,nj->n", off, inverse, off) + np.linalg.slogdet(spread)[1])
    means = given.means + np.einsum("nij,nj->ni", gain, off)
    covariances = given.covariances - gain @ spread @ np.swapaxes(gain, 1, 2)
    covariances = 0.5 * (covariances + np.swapaxes(covariances, 1, 2))
    return Components(given.log_weights + density, means, covariances, given.branches)


def placed(found: Components, own: Array, mean: Array, covariance: Array) -> Components:
    """The components after the position was measured with a mean ``(d,)`` and covariance, own is the vehicle's."""
    place, slopes = found.positions()
    gain = found.covariances @ np.swapaxes(slopes, 1, 2)
    spread = slopes @ gain + covariance
    off = mean - own - place
    inverse = np.linalg.inv(spread)
    gain = gain @ inverse
    density = -0.5 * (np.einsum("ni,nij,nj->n", off, inverse, off) + np.linalg.slogdet(spread)[1])
    means = found.means + np.einsum("nij,nj->ni", gain, off)
    covariances = found.covariances - gain @ spread @ np.swapaxes(gain, 1, 2)
    return Components(found.log_weights + density, means, covariances, found.branches)
