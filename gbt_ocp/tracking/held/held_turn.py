"""Tracker of noisy bearings whose target holds a turn rate and changes it now and then."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbt_ocp.tracking.bins import BearingBins
from gbt_ocp.tracking.gaps import Gaps, RestartingTracker
from gbt_ocp.tracking.held.ahead import positions_ahead
from gbt_ocp.tracking.held.bank import (
    LOG_RANGE,
    Components,
    HeldTurnPrior,
    advanced,
    begun,
    corrected,
    let_go,
)
from gbt_ocp.tracking.lost import LostTrack
from gbt_ocp.tracking.noise import SCATTER_S, BearingNoise
from gbt_ocp.tracking.priors import PositionPrior, unseen
from gbt_ocp.tracking.protocol import RANGE_OBSERVABLE, Forecast, mixed, mixed_at_median, relative_range_std
from gbt_ocp.tracking.shape.moments import NodeMoments, on_both_sides
from gbt_ocp.typing import Array

COLD_STARTS = (7, 3, 12)
"""Ranges, speeds and courses at which a track is begun."""

START_WIDTH = 4.0
"""Deviations of a bearing's noise within which a track is begun about it."""

OPEN_S = 5.0
"""Seconds after the first bearing in which no component lets go of its turn rate and all starts are kept."""

OPEN_MOST = 4
"""How many times as many components are kept until the range is observable."""

AHEAD_STEP = 2.0
"""Seconds between the nodes of a forecast; between them it is linear."""

LONGEST_AHEAD = 120.0
"""Seconds over which the bank is carried ahead; forecasts for later are extrapolated from there."""

AHEAD_MOST = 40
"""Components that are carried ahead."""


class HeldTurnTracker(RestartingTracker):
    """The mixture over the times at which the turn rate was drawn last; see :mod:`~gbt_ocp.tracking.held.bank`.

    Bearings are averaged over short bins; each full bin is one step of the bank. A track whose recent bearings no
    component foresaw is begun again.

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
        Gaussians kept once the range is observable.
    gate
        Standardised residual from which a bearing counts as a stray one (see
        :class:`~gbt_ocp.tracking.bins.BearingBins`); infinity trusts all of them.
    position
        What is known of the position at the first bearing; by default nothing, with the vehicle at the origin.

    Attributes
    ----------
    restarts
        How often the track was lost and begun again.

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
        components: int = 200,
        gate: float = np.inf,
        position: PositionPrior | None = None,
    ) -> None:
        if not (components >= 1 and gate > 0.0):
            raise ValueError(f"components and gate: found {components}, {gate}; allowed: at least 1, and above 0")
        self.dimension = dimension
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
        b, own = self._bins.checked(t, bearing, own_position)
        if self._gaps.ended(t):
            self._restart(own)
        if self._found is not None and self._bins.is_filled_by(t):
            self._step()
        self._bins.append(t, b, own)
        if self._found is None:
            self._start(t, b, own)

    def _start(self, time: float, bearing: Array, own: Array) -> None:
        """All starts about a bearing, a little wider than its noise: it counts with the rest of its bin."""
        white = self._noise.std**2 + self._noise.correlated_std**2
        self._found = begun(self._prior, _angles(bearing), START_WIDTH**2 * white, *COLD_STARTS)
        self._now = self._first = time
        self._own = own
        self._ahead = None
        if self._position.known is not None:
            self._found = _placed(self._found, own, *self._position.known)

    def _step(self) -> None:
        """Take in the newest bin, now that it is full."""
        assert self._found is not None, "begun"
        means = self._bins.means()
        time, own = float(means.times[-1]), means.own_positions[-1]
        step = time - self._now
        found = self._found
        if step > 0.0:
            if time - self._first > OPEN_S:
                held, again = let_go(self._prior, found, step)
                found = held.joined(again)
            found = advanced(self._prior, found, step, own - self._own)
        noise = self._noise.of_mean(
            float(means.counts[-1]),
            self._bins.width,
            np.exp(found.means[:, LOG_RANGE]),
            self._noise.white_variance(self._bins),
        )
        found, _, squares = corrected(found, _angles(means.bearings[-1]), noise)
        weights = found.weights
        lost = self._lost.after(float(weights @ squares) / (self.dimension - 1))
        open_ = time - self._first <= OPEN_S
        most = len(found) if open_ else self._most * (1 if self._observable(found) else OPEN_MOST)
        self._found = found.likeliest(most)
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


def _scaled(given: Components, share: float) -> Components:
    return Components(given.log_weights + np.log(share), given.means, given.covariances, given.branches)


def _dense(labels: NDArray[np.intp]) -> NDArray[np.intp]:
    return np.asarray(np.unique(labels, return_inverse=True)[1], dtype=np.intp)


def _placed(found: Components, own: Array, mean: Array, covariance: Array) -> Components:
    """The components after the position was measured with this mean and covariance."""
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
