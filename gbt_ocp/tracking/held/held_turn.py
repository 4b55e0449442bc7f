"""Tracker of noisy bearings whose target holds a turn rate and changes it now and then."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.measurements import MeasurementKind, Sighting
from gbt_ocp.tracking.bins import BearingBins
from gbt_ocp.tracking.decomposed import BY_ITSELF, SightingParts, parts_of
from gbt_ocp.tracking.gaps import Gaps, RestartingTracker
from gbt_ocp.tracking.held.ahead import positions_ahead
from gbt_ocp.tracking.held.bank import (
    LOG_RANGE,
    LOG_SIZE,
    Components,
    HeldTurnPrior,
    advanced,
    begun,
    moved_on,
)
from gbt_ocp.tracking.held.corrections import corrected, placed, sighted
from gbt_ocp.tracking.held.draws import in_every_manner, let_go
from gbt_ocp.tracking.lost import LostTrack
from gbt_ocp.tracking.noise import SCATTER_S, BearingNoise
from gbt_ocp.tracking.polar import ALL_KINDS, WITHOUT_SIZE, checked_sighting, polar_rows
from gbt_ocp.tracking.priors import PositionPrior, unseen
from gbt_ocp.tracking.protocol import RANGE_OBSERVABLE, Forecast, mixed, mixed_at_median, relative_range_std
from gbt_ocp.tracking.shape.moments import NodeMoments, on_both_sides
from gbt_ocp.typing import Array

COLD_STARTS = (5, 3, 8)
"""Ranges, speeds and courses at which a track is begun."""

START_WIDTH = 4.0
"""Deviations of a bearing's noise within which a track is begun about it."""

OPEN_S = 5.001
"""Seconds after the first bearing in which no component lets go of its turn rate, the speed of all changes in the first
manner, and all starts are kept. No time between bearings, of which rounding would decide whether it is longer."""

AHEAD_STEP = 2.0
"""Seconds between the nodes of a forecast; between them it is linear."""

LONGEST_AHEAD = 120.0
"""Seconds over which the bank is carried ahead; forecasts for later are extrapolated from there."""

AHEAD_MOST = 40
"""Components that are carried ahead."""


class HeldTurnTracker(RestartingTracker):
    """The mixture over the times at which the turn rate was drawn last; see :mod:`~gbt_ocp.tracking.held.bank`.

    Bearings are averaged over short bins; each full bin is one step of the bank. A track whose recent bearings no
    component foresaw is begun again. What is no bearing, or was seen by another vehicle, counts at once, by what the
    components that there are foresee of its time.

    Parameters
    ----------
    dimension
        d.
    noise
        Of the sensor. A part that lasts counts as white noise of the same effect.
    prior
        Of the motion.
    bin_width
        Width of a bin in seconds.
    components
        Gaussians kept once a track has begun.
    gate
        Standardised residual from which a bearing counts as a stray one (see
        :class:`~gbt_ocp.tracking.bins.BearingBins`); infinity trusts all of them.
    position
        What is known of the position at the first bearing; by default nothing, with the vehicle at the origin.

    Attributes
    ----------
    restarts
        How often the track was lost and begun again.
    takes
        Kinds of measurements that :meth:`take` takes; sizes where the prior says what is known of the true one.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """

    def __init__(
        self,
        dimension: int,
        *,
        noise: BearingNoise,
        prior: HeldTurnPrior,
        bin_width: float = 0.5,
        components: int = 120,
        gate: float = np.inf,
        position: PositionPrior | None = None,
    ) -> None:
        if not (components >= 1 and gate > 0.0):
            raise ValueError(f"components and gate: found {components}, {gate}; allowed: at least 1, and above 0")
        self.dimension = dimension
        self.takes: tuple[MeasurementKind, ...] = WITHOUT_SIZE if prior.size is None else ALL_KINDS
        self._bins = BearingBins(bin_width, max(SCATTER_S, 2.0 * bin_width), gate * noise.std)
        self._noise = noise
        self._prior = prior
        self._most = components
        self._gaps = Gaps(span=SCATTER_S)
        self.restarts = 0
        self._begin(PositionPrior(np.zeros(dimension)) if position is None else position)

    @property
    def settings(self) -> tuple[HeldTurnPrior, BearingNoise, BearingBins, int, PositionPrior]:
        """Priors, noise and bins; how many components are kept; and where a track begins."""
        return self._prior, self._noise, self._bins, self._most, self._position

    def _begin(self, position: PositionPrior) -> None:
        self._bins.clear()
        self._position = position
        self._own = position.start
        self._now = self._first = np.nan
        self._found: Components | None = None
        self._full = False
        self._latest = -np.inf
        self._waiting: list[Sighting] = []
        self._ahead: NodeMoments | None = None
        self._asked = 0.0
        self._lost = LostTrack()

    def _restart(self, own: Array) -> None:
        self._begin(self._position.elsewhere(own))

    # ---- bearings in ------------------------------------------------------------------------------------------------

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
        checked_sighting(sighting, self.takes, "held_turn", self.dimension, self._latest)
        parts, own = parts_of(sighting, self._noise.std), sighting.position
        if parts.bearing is not None and not parts.platform:
            self._seen(sighting.time, parts.bearing, own, parts)
            return
        if parts.platform:
            self._further(sighting.time, (sighting,), self._own)
        else:
            self._further(sighting.time, parts.singles, own)

    def _seen(self, time: float, bearing: Array, own: Array, parts: SightingParts = BY_ITSELF) -> None:
        """Take in a bearing, and what came with it."""
        self._note(time, own)
        self._bins.append(time, bearing, own, weight=parts.worth(self._noise.std), same_time=True)
        self._full = False
        if self._found is None:
            self._start(time, bearing, own)
            waiting, self._waiting = self._waiting, []
            self._count(time, own, waiting)
        self._count(time, own, parts.singles)

    def _further(self, time: float, singles: Sequence[Sighting], own: Array) -> None:
        """Take in what is no bearing of the own vehicle, which is at ``own`` ``(d,)`` as far as it is known."""
        self._note(time, own)
        if self._found is None:
            self._waiting.extend(singles)
        else:
            self._count(time, own, singles)

    def _note(self, time: float, own: Array) -> None:
        """Begin a new track after a gap; take in the newest bin once that is full."""
        if self._gaps.ended(time):
            self._restart(own)
        self._latest = time
        self._waiting = [one for one in self._waiting if self._bins.are_together(one.time, time)]
        if self._found is not None and not self._full and self._bins.is_filled_by(time):
            self._step()
            self._full = True

    def _start(self, time: float, bearing: Array, own: Array) -> None:
        """All starts about a bearing, a little wider than its noise: it counts with the rest of its bin."""
        white = self._noise.std**2 + self._noise.correlated_std**2
        self._found = begun(self._prior, _angles(bearing), START_WIDTH**2 * white, *COLD_STARTS)
        self._now = self._first = time
        self._own = own
        self._ahead = None
        if self._position.known is not None:
            self._found = placed(self._found, own, *self._position.known)

    def _carried(self, time: float, own: Array) -> Components:
        """The components at a time in seconds after now, with the vehicle at ``own`` ``(d,)``."""
        assert self._found is not None, "begun"
        step, found = time - self._now, self._found
        if time - self._first > OPEN_S >= self._now - self._first:
            found = in_every_manner(self._prior, found)
        elif time - self._first > OPEN_S:
            held, again = let_go(self._prior, found, step)
            found = held.joined(again)
        return advanced(self._prior, found, step, own - self._own)

    def _count(self, time: float, own: Array, singles: Sequence[Sighting]) -> None:
        """Weigh and correct the components by measurements of a time; nothing waits for what is in a full bin."""
        if not singles:
            return
        # what is in the newest bin has a mean time to come: the bank waits at the oldest of it
        at, place = (time, own) if self._full else self._bins.first
        if at > self._now:
            self._found = self._carried(at, place)
            self._now, self._own = at, place
        for single in singles:
            assert self._found is not None, "begun"
            found = self._found
            place, slopes = moved_on(found, single.time - self._now, np.zeros(self.dimension))
            log_size = 0.0 if self._prior.size is None else found.means[:, LOG_SIZE]
            found = sighted(found, slopes, polar_rows(single, self._own + place, self._noise.std, log_size))
            self._found, self._ahead = self._kept(found, self._now), None

    def _kept(self, found: Components, time: float) -> Components:
        """The likeliest components; all starts for a while."""
        return found.likeliest(len(found) if time - self._first <= OPEN_S else self._most)

    def _step(self) -> None:
        """Take in the newest bin, now that it is full."""
        assert self._found is not None, "begun"
        means = self._bins.means()
        time, own = float(means.times[-1]), means.own_positions[-1]
        found = self._carried(time, own) if time > self._now else self._found
        noise = self._noise.of_mean(
            float(means.counts[-1]),
            self._bins.width,
            np.exp(found.means[:, LOG_RANGE]),
            self._noise.white_variance(self._bins),
        )
        found, _, squares = corrected(found, _angles(means.bearings[-1]), noise)
        weights = found.weights
        lost = self._lost.after(float(weights @ squares) / (self.dimension - 1))
        self._found = self._kept(found, time)
        self._now, self._own, self._ahead = time, own, None
        if lost:
            self.restarts += 1
            self._lost.clear()
            self._position = self._position.elsewhere(own)
            self._start(time, means.bearings[-1], own)

    # ---- what is known ----------------------------------------------------------------------------------------------

    def _moments(self, found: Components) -> tuple[Array, Array]:
        """Mean ``(d,)`` and covariance ``(d, d)`` relative to the vehicle: each component at its median range."""
        place, slopes = found.positions()
        spread = slopes @ found.covariances @ np.swapaxes(slopes, 1, 2)
        mean, covariance = self._together(found, found.weights, place[:, None], spread[:, None])
        return mean[0], covariance[0]

    def _observable(self, found: Components) -> bool:
        mean, covariance = self._moments(found)
        return bool(relative_range_std(mean, covariance, np.zeros(self.dimension)) < RANGE_OBSERVABLE)

    @property
    def range_observable(self) -> bool:
        """Whether the range is known to a quarter; before, it is mostly the prior's."""
        return self._found is not None and self._observable(self._found)

    def _moments_ahead(self, found: Components, horizon: float) -> NodeMoments:
        """Nodes from now on."""
        horizon = min(horizon, LONGEST_AHEAD)
        self._asked = max(self._asked, horizon)
        if self._ahead is not None and self._ahead.times[-1] >= horizon - 1e-9:
            return self._ahead
        nodes = int(np.ceil(max(self._asked, AHEAD_STEP) / AHEAD_STEP)) + 1
        times = AHEAD_STEP * np.arange(float(nodes))
        known = found.likeliest(AHEAD_MOST)
        positions, covariances = positions_ahead(self._prior, known, times)
        self._ahead = NodeMoments(times, *self._together(found, known.weights, positions, covariances))
        return self._ahead

    def _together(self, found: Components, weights: Array, means: Array, covariances: Array) -> tuple[Array, Array]:
        if found.range_deviation > RANGE_OBSERVABLE:
            return mixed_at_median(weights, means, covariances)
        return mixed(np.broadcast_to(weights[:, None], means.shape[:2]), means, covariances)

    def predict(self, times: ArrayLike) -> Forecast:
        """Posterior mean ``(K, d)`` and covariance ``(K, d, d)`` at the times ``(K,)`` in seconds.

        Times further ahead than :data:`LONGEST_AHEAD` are extrapolated (see
        :meth:`~gbt_ocp.tracking.shape.moments.NodeMoments.at`). Times before the latest full bin are those of the
        present motion led back. Before the first bearing, only the prior on position or range is known.
        """
        t = np.atleast_1d(np.asarray(times, dtype=float))
        found = self._found
        if found is None:
            return unseen(self._position, self._prior.range, self._own, len(t))
        mean, covariance = on_both_sides(
            t - self._now,
            lambda lag: self._moments_ahead(found, float(lag.max())).at(lag),
            lambda lag: self._moments_before(found, lag),
        )
        return Forecast(self._own + mean, covariance)

    def _moments_before(self, found: Components, lags: Array) -> tuple[Array, Array]:
        """Moments at lags before the latest full bin ``(K,)`` in seconds: the present motion led back."""
        still = np.zeros(self.dimension)
        moments = [self._moments(advanced(self._prior, found, float(lag), still)) for lag in lags]
        means, covariances = (np.array(values) for values in zip(*moments, strict=True))
        return means, covariances


def _angles(bearing: Array) -> Array:
    """Azimuth, and elevation in space, of a unit vector ``(d,)``, in radians."""
    azimuth = np.arctan2(bearing[1], bearing[0])
    if len(bearing) == 2:
        return np.array([azimuth])
    return np.array([azimuth, np.arctan2(bearing[2], np.hypot(bearing[0], bearing[1]))])
