"""Measurements that are no mean bearings, as rows of an estimate of the motion's shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gbt_ocp.models.measurements import Sighting
from gbt_ocp.tracking.polar import polar_rows
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class FurtherSightings:
    """M measurements of one number each, relative to now and to the own position now.

    Log ranges and the logs of angular sizes are linear in the coordinates of a motion's shape; the error of the true
    size, which all angular sizes share, is part of their noise.

    Attributes
    ----------
    times
        ``(M,)`` in seconds, at most 0.
    sightings
        The measurements, whose sensors have their places relative to the own position now.
    root
        A ``(M, M)`` that whitens residuals over their own deviations.
    log_determinant
        log det of the covariance of the residuals.
    log_size
        Logarithm of the median of the true size.
    """

    times: Array
    sightings: tuple[Sighting, ...]
    root: Array
    log_determinant: float
    log_size: float

    def rows(self, positions: Array) -> tuple[Array, Array]:
        """Whitened residuals ``(B, M)`` at positions ``(B, M, d)``, and what positions do to them ``(B, M, d)``.

        The latter are derivatives of the predicted rows by the positions, over their own deviations, before
        :attr:`root`.
        """
        residuals, slopes = np.empty(positions.shape[:2]), np.empty(positions.shape)
        for k, sighting in enumerate(self.sightings):
            found = polar_rows(sighting, positions[:, k], 1.0, self.log_size)
            std = found.stds[:, 0]
            residuals[:, k] = found.residuals[:, 0] / std
            toward = found.across[:, 0] + found.along[0] * found.unit
            slopes[:, k] = toward / (found.range * std)[:, None]
        return residuals @ self.root.T, slopes


def further_sightings(
    found: Sequence[Sighting], size: LogNormal | None, now: float, own: Array
) -> FurtherSightings | None:
    """The measurements as seen from now (s) and the own position ``(d,)``; ``None`` without any.

    Parameters
    ----------
    found
        Measurements of one number each.
    size
        The true size in metres, if there are angular sizes.
    now, own
        Time in seconds and own position ``(d,)``.
    """
    if not found:
        return None
    stds = np.array([_deviation(one) for one in found])
    sized = np.array([one.kind == "size" for one in found])
    shared = np.where(sized, (0.0 if size is None else size.log_std) / stds, 0.0)
    covariance = np.eye(len(found)) + np.outer(shared, shared)
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    log_determinant = float(np.linalg.slogdet(covariance)[1] + 2.0 * np.sum(np.log(stds)))
    return FurtherSightings(
        np.array([one.time for one in found]) - now,
        tuple(replace(one, position=one.position - own) for one in found),
        root,
        log_determinant,
        0.0 if size is None else float(np.log(size.median)),
    )


def _deviation(one: Sighting) -> float:
    """Deviation of an angle in radians, or of the logarithm of a length."""
    if one.kind == "range":
        return float(one.std[0] / one.value[0])
    return float(one.std[0] / np.sin(one.value[0])) if one.kind == "size" else float(one.std[0])
