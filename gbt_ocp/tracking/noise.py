"""The noise of binned bearings: white, correlated in time, and the uncertainty of the own position."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gbt_ocp.tracking.bins import BearingBins, BinnedBearings
from gbt_ocp.tracking.gp.kernels import ornstein_uhlenbeck
from gbt_ocp.typing import Array

SURE_OF_SCATTER = 20
"""Degrees of freedom of the scatter in the bins with which the prior σ weighs, where σ is estimated."""

SCATTER_S = 30.0
"""Seconds of short bins that are kept, from which the noise is estimated where that is asked for."""


@dataclass(frozen=True)
class BearingNoise:
    """What is known of the sensor, in angles: no range enters but for the own position.

    Attributes
    ----------
    std
        σ of the white part of a single bearing in radians.
    correlated_std
        Standard deviation in radians of a part that lasts (a detector that sees the bow and not the middle, a mounting
        that bends); averaging over a bin does not reduce it.
    correlation_time
        Time in seconds in which that part forgets itself: its correlation is ``exp(-|t - t'|/T_c)``.
    own_std
        Standard deviation in metres of the own position on each axis, independent from sample to sample.
    estimated
        Whether σ is estimated from the scatter in the bins; ``std`` is then what is expected before.
    """

    std: float
    correlated_std: float = 0.0
    correlation_time: float = 5.0
    own_std: float = 0.0
    estimated: bool = False

    def __post_init__(self) -> None:
        if not (self.std > 0.0 and self.correlated_std >= 0.0 and self.correlation_time > 0.0 and self.own_std >= 0.0):
            raise ValueError(
                "std and correlation_time must be > 0, correlated_std and own_std >= 0; found "
                f"{self.std}, {self.correlation_time}, {self.correlated_std}, {self.own_std}"
            )

    def white_variance(self, bins: BearingBins) -> float:
        """σ² of a single bearing in rad²: as given, or pooled with the scatter in the bins."""
        if not self.estimated:
            return self.std**2
        variance, freedom = bins.scatter()
        if freedom == 0:
            return self.std**2
        return (freedom * variance + SURE_OF_SCATTER * self.std**2) / (freedom + SURE_OF_SCATTER)

    def of_mean(self, count: float, width: float, ranges: Any, white_variance: float) -> Any:
        """Variance in rad² of the mean of ``count`` bearings in a bin, that of the lasting part as white noise.

        Parameters
        ----------
        count
            Bearings in the bin.
        width
            Of the bin in seconds.
        ranges
            Predicted range in metres, a number or an array.
        white_variance
            σ² in rad² of a single bearing.

        Returns
        -------
        As ``ranges``. A part of deviation s that lasts T has the effect of white noise with the variance
        ``s² max(1, 2T/width)`` a bin.
        """
        lasting = self.correlated_std**2 * max(1.0, 2.0 * self.correlation_time / width)
        return (white_variance + (self.own_std / ranges) ** 2) / count + lasting

    def correlated(self, times: Array) -> Array:
        """Covariance of the correlated part at the times ``(N,)`` in seconds: ``(N, N)`` in rad²."""
        lag = (times[:, None] - times[None, :]) / self.correlation_time
        return np.asarray(self.correlated_std**2 * ornstein_uhlenbeck(lag))

    def covariance(self, means: BinnedBearings, ranges: Array, white_variance: float | None = None) -> Array:
        """R of the mean bearings along each direction of the tangent plane, in rad².

        Parameters
        ----------
        means
            The bins.
        ranges
            Predicted ranges ``(..., N)`` in metres.
        white_variance
            σ² in rad² of a single bearing; by default that of :attr:`std`.

        Returns
        -------
        ``R_ij = δ_ij (σ² + own²/r_i²)/n_i + s_c² exp(-|t_i - t_j|/T_c)``, ``(..., N, N)``. What lasts is not common
        to two vehicles.
        """
        white = self.std**2 if white_variance is None else white_variance
        single = (white + (self.own_std / ranges) ** 2) / means.counts
        lasting = self.correlated(means.times) * (means.platforms[:, None] == means.platforms)
        matrix = np.broadcast_to(lasting, (*single.shape, single.shape[-1])).copy()
        step = np.arange(single.shape[-1])
        matrix[..., step, step] += single
        return matrix
