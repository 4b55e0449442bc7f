"""A filter that is given the means of short bins, in log-polar coordinates, and begun again where its track is lost."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from copy import deepcopy
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.bearings import log_map, tangent_basis
from gbt_ocp.models.measurements import MeasurementKind, Sighting
from gbt_ocp.tracking.bins import BearingBins
from gbt_ocp.tracking.decomposed import BY_ITSELF, SightingParts, parts_of
from gbt_ocp.tracking.gaps import Gaps, RestartingTracker
from gbt_ocp.tracking.intake import SightingTracker
from gbt_ocp.tracking.lost import LostTrack
from gbt_ocp.tracking.noise import SCATTER_S, BearingNoise
from gbt_ocp.tracking.polar import checked_sighting
from gbt_ocp.tracking.priors import RangedPrior
from gbt_ocp.tracking.protocol import RANGE_OBSERVABLE, Forecast, relative_range_std
from gbt_ocp.typing import Array

LEAST_COSINE = 0.05
"""Least cosine of an elevation: straight above the vehicle there is no azimuth."""

ON_TIME = 1.0e-9
"""Rounding of a mean time in seconds."""


class BinnedFilter(RestartingTracker):
    """Bearings are averaged over bins; each full one is a measurement of the filter, with the noise of its mean.

    What is no bearing, or was seen by another vehicle, waits until the bin is full, so that the filter takes all in
    order; a forecast takes it into account at once.

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
    takes
        Kinds of measurements that :meth:`take` takes: those of the filter.
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
        self._full = True
        self._latest = -np.inf
        self._waiting: list[Sighting] = []
        self._begin(position)
        self.takes: tuple[MeasurementKind, ...] = self._filter.takes

    @property
    def settings(self) -> tuple[SightingTracker, BearingNoise, BearingBins]:
        """The filter, as it is now; noise and bins."""
        return self._filter, self._noise, self._bins

    def _begin(self, position: RangedPrior) -> None:
        self._position = position
        self._filter = self._make(position)
        self._begun = False
        self._own = position.start
        self._lost.clear()

    def _restart(self, own: Array) -> None:
        self._bins.clear()
        self._full = True
        self._waiting = []
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
        self._seen(t, *self._bins.checked(t, bearing, own_position, since=self._latest))

    def take(self, sighting: Sighting) -> None:
        """Take in a measurement of any kind in :attr:`takes`, with its own noise, at or after the latest time.

        Measurements that are no bearings count from the bin of the first bearing on.

        Raises
        ------
        ValueError
            If the kind is not taken or the measurement is out of order; the tracker is then unchanged.
        """
        own = sighting.position
        checked_sighting(sighting, self.takes, "a filter in bins", len(self._position.start), self._latest)
        parts = parts_of(sighting, self._noise.std)
        if parts.bearing is not None and not parts.platform:
            self._seen(sighting.time, parts.bearing, own, parts)
            return
        singles = (sighting,) if parts.platform else parts.singles
        self._note(sighting.time, self._own if parts.platform else own)
        if self._begun and self._full:
            for single in singles:
                _given(self._filter, single)
        else:
            self._waiting.extend(singles)

    def _seen(self, time: float, bearing: Array, own: Array, parts: SightingParts = BY_ITSELF) -> None:
        """Take in a bearing, and what came with it."""
        self._note(time, own)
        self._bins.append(time, bearing, own, weight=parts.worth(self._noise.std), same_time=True)
        self._full = False
        self._own = own
        self._waiting.extend(parts.singles)

    def _note(self, time: float, own: Array) -> None:
        """Begin a new track after a gap; take in the newest bin once that is full."""
        if self._gaps.ended(time):
            self._restart(own)
        self._latest = time
        if not self._full and self._bins.is_filled_by(time):
            self._step()
        if self._full:
            self._waiting = [one for one in self._waiting if self._bins.are_together(one.time, time)]

    def _step(self) -> None:
        """Take in the newest bin, now that it is full, and what has waited for it."""
        means = self._bins.means()
        time, bearing, own = float(means.times[-1]), means.bearings[-1], means.own_positions[-1]
        # a filter begins with a bearing
        early = [one for one in self._waiting if one.time < time - ON_TIME] if self._begun else []
        for single in early:
            _given(self._filter, single)
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
        for single in self._waiting[len(early) :]:
            # what is earlier than the mean of the first bin, by less than its width, counts as of its time
            _given(self._filter, replace(single, time=max(single.time, time)))
        self._waiting = []
        self._full = self._begun = True

    @property
    def range_observable(self) -> bool:
        """Whether the range is known to a quarter; before, it is mostly the prior's."""
        latest = self._bins.latest
        if latest is None:
            return False
        mean, covariance = self.predict([latest])
        return bool(relative_range_std(mean[0], covariance[0], self._own) < RANGE_OBSERVABLE)

    def predict(self, times: ArrayLike) -> Forecast:
        """Posterior of the target's position at the times ``(K,)`` in seconds."""
        at, known = np.atleast_1d(np.asarray(times, dtype=float)), self._filter
        if self._waiting and self._begun:
            known = deepcopy(known)
            for single in self._waiting:
                _given(known, single)
        return known.predict(at)


def _given(filter_: SightingTracker, single: Sighting) -> None:
    """Give a filter what is no bearing.

    After a gap that is long beside the intervals of its measurements it begins again, and refuses what is no bearing.
    """
    with suppress(ValueError):
        filter_.take(single)
