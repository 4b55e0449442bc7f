"""A filter that is given the means of short bins, in log-polar coordinates, and begun again where its track is lost."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.bearings import log_map, tangent_basis
from gbt_ocp.models.measurements import Sighting
from gbt_ocp.tracking.bins import BearingBins
from gbt_ocp.tracking.gaps import Gaps, RestartingTracker
from gbt_ocp.tracking.intake import SightingTracker
from gbt_ocp.tracking.lost import LostTrack
from gbt_ocp.tracking.noise import SCATTER_S, BearingNoise
from gbt_ocp.tracking.priors import RangedPrior
from gbt_ocp.tracking.protocol import RANGE_OBSERVABLE, Forecast, relative_range_std
from gbt_ocp.typing import Array

LEAST_COSINE = 0.05
"""Least cosine of an elevation: straight above the vehicle there is no azimuth."""


class BinnedFilter(RestartingTracker):
    """Bearings are averaged over bins; each full one is a measurement of the filter, with the noise of its mean.

    Parameters
    ----------
    make
        Makes the filter from what is known of the position.
    position
        What is known at the first bearing; the filter begins at its range where that is nothing.
    noise
        Of the sensor. A part that lasts counts as white noise of the same effect.
    bin_width
        Width of a bin in seconds.
    gate
        Standardised residual from which a bearing counts as a stray one (see
        :class:`~gbt_ocp.tracking.bins.BearingBins`); infinity trusts all of them.

    Attributes
    ----------
    restarts
        How often the track was lost and begun again.
    """

    def __init__(
        self,
        make: Callable[[RangedPrior], SightingTracker],
        position: RangedPrior,
        noise: BearingNoise,
        *,
        bin_width: float = 0.5,
        gate: float = np.inf,
    ) -> None:
        self._make = make
        self._noise = noise
        self._bins = BearingBins(bin_width, max(SCATTER_S, 2.0 * bin_width), gate * noise.std)
        self._gaps = Gaps(span=SCATTER_S)
        self._lost = LostTrack()
        self.restarts = 0
        self._begin(position)

    @property
    def settings(self) -> tuple[SightingTracker, BearingNoise, BearingBins]:
        """The filter, as it is now; noise and bins."""
        return self._filter, self._noise, self._bins

    def _begin(self, position: RangedPrior) -> None:
        self._position = position
        self._filter = self._make(position)
        self._own = position.start
        self._lost.clear()

    def _restart(self, own: Array) -> None:
        self._bins.clear()
        self._begin(self._position.elsewhere(own))

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing ``(d,)`` measured at ``own_position`` ``(d,)``.

        Raises
        ------
        ValueError
            If numbers are not finite, the bearing is no unit vector, or time does not increase; the tracker is then
            unchanged.
        """
        t = float(time)
        b, own = self._bins.checked(t, bearing, own_position)
        if self._gaps.ended(t):
            self._restart(own)
        if self._bins.is_filled_by(t):
            self._step()
        self._bins.append(t, b, own)
        self._own = own

    def _step(self) -> None:
        """Take in the newest bin, now that it is full."""
        means = self._bins.means()
        time, bearing, own = float(means.times[-1]), means.bearings[-1], means.own_positions[-1]
        (mean,), (covariance,) = self._filter.predict([time])
        line = mean - own
        distance = float(np.linalg.norm(line))
        noise = self._noise.of_mean(
            float(means.counts[-1]), self._bins.width, max(distance, 1e-3), self._noise.white_variance(self._bins)
        )
        if distance > 0.0 and np.all(np.isfinite(covariance)):
            basis = tangent_basis(line / distance)
            spread = basis.T @ covariance @ basis / distance**2 + noise * np.eye(len(own) - 1)
            angle = log_map(line / distance, bearing, basis)
            if self._lost.after(float(angle @ np.linalg.solve(spread, angle)) / len(angle)):
                self.restarts += 1
                self._begin(self._position.elsewhere(own))
        said = Sighting.of_bearing(time, bearing, own, "bins")
        std = np.full(len(said.value), np.sqrt(noise))
        if len(std) == 2:
            std[0] /= max(np.cos(said.value[1]), LEAST_COSINE)  # an azimuth counts about the vertical
        self._filter.take(Sighting(time, said.kind, said.value, std, own, "bins", bearing))

    @property
    def range_observable(self) -> bool:
        """Whether the range is known to a quarter; before, it is mostly the prior's."""
        latest = self._bins.latest
        if latest is None:
            return False
        mean, covariance = self._filter.predict([latest])
        return bool(relative_range_std(mean[0], covariance[0], self._own) < RANGE_OBSERVABLE)

    def predict(self, times: ArrayLike) -> Forecast:
        """Posterior of the target's position at the times ``(K,)`` in seconds."""
        return self._filter.predict(np.atleast_1d(np.asarray(times, dtype=float)))
