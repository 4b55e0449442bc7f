"""Trackers with different ideas of motion, weighed by how well each predicted the bearings of late.

The evidence of a model M for the bins 1 to K is, by the chain rule and whatever came before them,

    log p(β_1 … β_K | M) = Σ_k log p(β_k | β_1 … β_(k-1), M),

a sum of densities of bearings that were predicted before they came (the prequential evidence of Dawid, J. R. Stat.
Soc. A 147, 1984; the mode probabilities of interacting multiple models are made of the same densities). So it does not
matter what one model remembers and another does not, that their priors have other forms, or which linearisation each
has arrived at: what counts is what was predicted, for the same bins from the same bearings.

All must have the same unit. Linearised at the predicted position with range r, a bin is a pseudo-measurement
``y = hᵀ P_T + r ε`` in metres, of density N(y; hᵀμ, hᵀΣh + r² R); the angle off the prediction is e = (y - hᵀμ)/r, so

    p(e) = r^(d-1) p(y) = N(e; 0, hᵀΣh/r² + R),

whose logarithm is that of the pseudo-measurement plus log r a row. The r of the models differ, so densities in
metres would favour the one that has the target nearer.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.measurements import MeasurementKind, Sighting
from gbt_ocp.tracking.bins import BearingBins, BinnedBearings
from gbt_ocp.tracking.decomposed import parts_of
from gbt_ocp.tracking.displacement.rows import bearing_rows, row_covariance
from gbt_ocp.tracking.gaps import Gaps, RestartingTracker
from gbt_ocp.tracking.intake import take_in, taken_kinds
from gbt_ocp.tracking.noise import SCATTER_S, BearingNoise
from gbt_ocp.tracking.polar import ALL_KINDS, checked_sighting
from gbt_ocp.tracking.protocol import (
    RANGE_OBSERVABLE,
    Forecast,
    KeepsHypotheses,
    Tracker,
    WeighedForecasts,
    mixed,
    mixed_at_median,
    relative_range_std,
)
from gbt_ocp.typing import Array

ASTRAY = 0.01
"""Probability that a bin says nothing of the target: no single one decides between the models."""

LEAST_WEIGHT = 1.0e-4
"""Weight below which a model is left out of a forecast."""


def log_density(one: BinnedBearings, expected: Forecast, noise: BearingNoise, white_variance: float) -> float:
    """Logarithm of the density of a mean bearing in angles, in rad^-(d-1), under a predicted position.

    Parameters
    ----------
    one
        A single bin.
    expected
        Position at its time: mean ``(1, d)`` and covariance ``(1, d, d)``.
    noise
        Of the sensor.
    white_variance
        σ² of a single bearing in rad².
    """
    rows = bearing_rows(one, expected.mean)
    spread = rows.directions @ expected.covariance[0] @ rows.directions.T
    spread += row_covariance(rows, one, noise, white_variance, np.ones(len(rows.values)))
    # metres over the range are radians
    spread /= np.outer(rows.ranges, rows.ranges)
    if not np.all(np.isfinite(spread)):
        return -np.inf
    variances, axes = np.linalg.eigh(spread)
    variances = np.maximum(variances, white_variance / one.counts[0])  # the least there is; below it is round-off
    return float(-0.5 * np.sum((rows.residuals @ axes) ** 2 / variances + np.log(2.0 * np.pi * variances)))


class MixtureTracker(RestartingTracker):
    """The mixture of other trackers by evidence.

    Each of them is given each bearing and begins a lost track again by its own test. Bearings are averaged over bins;
    each full bin is judged by what the trackers said of it before it began. What is no bearing, or was seen by another
    vehicle, is given to all of them and judges none.

    Parameters
    ----------
    dimension
        d.
    members
        The trackers by name. The first stands for all until each of them has begun.
    noise
        Of the sensor.
    bin_width
        Width of a bin in seconds.
    gate
        Standardised residual from which a bearing counts as a stray one (see
        :class:`~gbt_ocp.tracking.bins.BearingBins`); infinity trusts all of them.
    forgetting
        Time T in seconds in which evidence fades: a bin counts by ``exp(-age/T)``. Infinity forgets nothing.

    Attributes
    ----------
    takes
        Kinds of measurements that :meth:`take` takes: those that each of the members does.

    Raises
    ------
    ValueError
        If there are no members, or the time is not above 0.
    """

    def __init__(
        self,
        dimension: int,
        members: Mapping[str, Tracker],
        noise: BearingNoise,
        *,
        bin_width: float = 1.0,
        gate: float = np.inf,
        forgetting: float = np.inf,
    ) -> None:
        if not members:
            raise ValueError("members: found none; allowed: at least one")
        if not forgetting > 0.0:
            raise ValueError(f"forgetting: found {forgetting}; allowed: a number > 0")
        self.dimension = dimension
        self.members: Mapping[str, Tracker] = dict(members)
        self._forgetting = forgetting
        self._noise = noise
        self._bins = BearingBins(bin_width, max(SCATTER_S, 2.0 * bin_width), gate * noise.std)
        self._gaps = Gaps(span=SCATTER_S)
        kinds = [taken_kinds(member) for member in self.members.values()]
        self.takes: tuple[MeasurementKind, ...] = tuple(one for one in ALL_KINDS if all(one in some for some in kinds))
        self._last = -np.inf
        self._begin(np.zeros(dimension))

    @property
    def settings(self) -> tuple[BearingNoise, BearingBins, float]:
        """Noise and bins by which the members are judged, and the time in seconds in which evidence fades."""
        return self._noise, self._bins, self._forgetting

    def _begin(self, own: Array) -> None:
        self._own = own
        self._begins = -np.inf
        self._predicted: list[Forecast] = []
        self._evidence = np.zeros(len(self.members))

    def _restart(self, own: Array) -> None:
        """The members find the same gap themselves."""
        self._bins.clear()
        self._begin(own)

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing ``(d,)`` measured at ``own_position`` ``(d,)``.

        Raises
        ------
        ValueError
            If numbers are not finite, the bearing is no unit vector, or time does not increase; the tracker is then
            unchanged.
        """
        b, own = self._bins.checked(time, bearing, own_position, since=self._last)
        self._note(float(time), own)
        self._seen(float(time), b, own)
        for member in self.members.values():
            member.update(time, b, own)

    def take(self, sighting: Sighting) -> None:
        """Take in a measurement of any kind in :attr:`takes`, with its own noise, at or after the latest time.

        Raises
        ------
        ValueError
            If the kind is not taken or the measurement is out of order; the tracker is then unchanged.
        """
        checked_sighting(sighting, self.takes, "mixture", self.dimension, self._last)
        parts = parts_of(sighting, self._noise.std)
        self._note(sighting.time, self._own if parts.platform else sighting.position)
        if parts.bearing is not None and not parts.platform:
            self._seen(sighting.time, parts.bearing, sighting.position, parts.worth(self._noise.std))
        for member in self.members.values():
            take_in(member, sighting)

    def _note(self, time: float, own: Array) -> None:
        """Begin a new track after a gap."""
        if self._gaps.ended(time):
            self._restart(own)
        self._last = time

    def _seen(self, time: float, bearing: Array, own: Array, weight: float = 1.0) -> None:
        """Judge the members by a bin that is full, and add a bearing to the newest one."""
        bins = self._bins
        begins = float(np.floor(time / bins.width) * bins.width)
        if begins != self._begins:
            self._score(begins)
            self._begins = begins
            if len(bins):
                ends = np.array([begins, begins + bins.width])
                self._predicted = [member.predict(ends) for member in self.members.values()]
        self._own = own
        bins.append(time, bearing, own, weight=weight, same_time=True)

    def _score(self, begins: float) -> None:
        """Judge the models by the bin that has just been filled: what they said of it before it began."""
        if not self._predicted:
            return
        bins = self._bins
        means = bins.means()
        newest = BinnedBearings(means.times[-1:], means.bearings[-1:], means.own_positions[-1:], means.counts[-1:])
        late = float((newest.times[0] - self._begins) / bins.width)
        white = self._noise.white_variance(bins)
        uniform = -np.log((2.0 if self.dimension == 2 else 4.0) * np.pi)
        scores = []
        for mean, covariance in self._predicted:
            there = Forecast(
                (1.0 - late) * mean[:1] + late * mean[1:], (1.0 - late) * covariance[:1] + late * covariance[1:]
            )
            density = log_density(newest, there, self._noise, white)
            scores.append(np.logaddexp(np.log1p(-ASTRAY) + density, np.log(ASTRAY) + uniform))
        self._evidence = (self._evidence + scores) * np.exp((self._begins - begins) / self._forgetting)

    @property
    def _latest(self) -> float | None:
        """Time of the latest bearing in seconds."""
        return self._bins.latest

    @property
    def log_evidence(self) -> Array:
        """Of the members ``(M,)``, for the full bins until now, faded."""
        return self._evidence.copy()

    @property
    def weights(self) -> Array:
        """Probability of the members ``(M,)``; equal before any bin is judged."""
        evidence = self.log_evidence
        share = np.exp(evidence - evidence.max())
        return np.asarray(share / share.sum())

    @property
    def restarts(self) -> int:
        """How often a track was lost and begun again, of all."""
        return sum(int(getattr(member, "restarts", 0)) for member in self.members.values())

    @property
    def range_observable(self) -> bool:
        """Whether the range is known to a quarter; before, it is mostly the prior's."""
        if self._latest is None:
            return False
        mean, covariance = self.predict([self._latest])
        return bool(relative_range_std(mean[0], covariance[0], self._own) < RANGE_OBSERVABLE)

    def predict(self, times: ArrayLike) -> Forecast:
        """Posterior mean ``(K, d)`` and covariance ``(K, d, d)`` at the times ``(K,)`` in seconds.

        A model counts while it tells the range, if those that do have at least half of the weight. Otherwise all count,
        and are mixed in direction and log range: ranges over decades have a mean in metres that is near none of them.
        """
        at = np.atleast_1d(np.asarray(times, dtype=float))
        told, weights, parts = self._counted
        forecasts = [part.predict(at) for part in parts]
        means, covariances = map(np.array, zip(*forecasts, strict=True))
        if told:
            return Forecast(*mixed(weights, means, covariances))
        mean, covariance = mixed_at_median(weights, means - self._own, covariances)
        return Forecast(self._own + mean, covariance)

    def hypotheses_at(self, times: ArrayLike) -> WeighedForecasts:
        """What each hypothesis of each model predicts, at times ``(K,)`` that are not past.

        Where a range is told, their mean and covariance are those of :meth:`predict`.
        """
        at = np.atleast_1d(np.asarray(times, dtype=float))
        found = []
        for weight, part in zip(*self._counted[1:], strict=True):
            if isinstance(part, KeepsHypotheses):
                shares, means, covariances = part.hypotheses_at(at)
            else:
                shares, (means, covariances) = np.ones(1), (values[None] for values in part.predict(at))
            found.append((weight * shares, means, covariances))
        return WeighedForecasts(*(np.concatenate(values) for values in zip(*found, strict=True)))

    @property
    def _counted(self) -> tuple[bool, Array, list[Tracker]]:
        """Whether the range is told, and the models that a forecast is made of, with weights that sum to one."""
        weights, members = self.weights, list(self.members.values())
        known = weights * [self._tells_range(member) for member in members]
        told = bool(known.sum() >= 0.5)
        if told:
            weights = known
        elif self._latest is None or not all(self._has_covariance(member) for member in members):
            weights = np.eye(len(weights))[0]
        likely = weights > LEAST_WEIGHT * weights.sum()
        parts = [part for part, one in zip(members, likely, strict=True) if one]
        return told or len(parts) == 1, weights[likely] / weights[likely].sum(), parts

    def _has_covariance(self, member: Tracker) -> bool:
        """Whether a model has begun; a filter before its first measurement knows no covariance."""
        return bool(np.all(np.isfinite(member.predict(np.array([self._latest])).covariance)))

    def _tells_range(self, member: Tracker) -> bool:
        """Whether a model knows the range to a quarter."""
        observable = getattr(member, "range_observable", None)
        if observable is None and self._latest is not None:
            mean, covariance = member.predict(np.array([self._latest]))
            observable = relative_range_std(mean[0], covariance[0], self._own) < RANGE_OBSERVABLE
        return bool(observable)
