"""How far a bearing lies from where it was expected, and the reset test that is made of it."""

from __future__ import annotations

from collections import deque

import numpy as np

from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.tracking.bins import BinnedBearings
from gbt_ocp.tracking.displacement.fit import PosteriorMixture
from gbt_ocp.tracking.displacement.rows import bearing_rows
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.typing import Array

RECENT_BEARINGS = 10
"""Innovations over which the reset test looks."""

LOST_INNOVATION = 9.0
"""Mean squared standardised innovation of the recent bearings above which the track counts as lost."""

GROSS = 16.0
"""Largest share of one innovation in that mean, so that no single outlier makes a lost track."""


def innovation(
    mixture: PosteriorMixture, noise: BearingNoise, time: float, bearing: Array, own: Array, weight: float = 1.0
) -> tuple[Array | None, float]:
    """Where the target is expected, and the bearing's mean squared standardised distance from there.

    Parameters
    ----------
    mixture
        What is known before the bearing.
    noise
        Of the sensor.
    time, bearing, own
        Time in seconds, bearing and own position ``(d,)``.
    weight
        Number of ordinary bearings that it is worth.

    Returns
    -------
    Unit vector ``(d,)``, ``None`` where the target is expected at the vehicle, and the squared distance, about 1.
    """
    forecast = mixture.predict(np.array([time]))
    rows = bearing_rows(BinnedBearings(np.array([time]), bearing[None], own[None], np.ones(1)), forecast.mean)
    across = rows.directions @ forecast.covariance[0] @ rows.directions.T / rows.ranges[0] ** 2
    variance = mixture.best[1].node.white_variance / weight + noise.correlated_std**2
    across[np.diag_indices_from(across)] += variance + (noise.own_std / rows.ranges[0]) ** 2
    square = float(rows.residuals @ np.linalg.solve(across, rows.residuals)) / len(rows.residuals)
    there = forecast.mean[0]
    return None if np.array_equal(there, own) else unit_bearing(there, own), square


class ResetTest:
    """Finds a lost track: its recent bearings are not where it said."""

    def __init__(self) -> None:
        self._squares: deque[float] = deque(maxlen=RECENT_BEARINGS)

    def lost(self, square: float) -> bool:
        """Whether the track is lost, given the squared innovation of one more bearing."""
        self._squares.append(min(square, GROSS))
        return len(self._squares) == RECENT_BEARINGS and bool(np.mean(self._squares) > LOST_INNOVATION)

    def clear(self) -> None:
        """Begin again."""
        self._squares.clear()
