"""Models of the target's motion, weighed by how well each predicted the bearings: its shape, its velocity, and others.

The Gaussian process on the shape of the motion is the better one where a target keeps its speed, and the worse one
where it does not; that on the velocity knows nothing of speed. Both read the same bins. The evidence of a model M for
the bins 1 to K of the window is, by the chain rule and whatever came before them,

    log p(β_1 … β_K | M) = Σ_k log p(β_k | β_1 … β_(k-1), M),

a sum of densities of bearings that were predicted before they came (the prequential evidence of Dawid, J. R. Stat.
Soc. A 147, 1984; the mode probabilities of interacting multiple models are made of the same densities). So it does not
matter that one model remembers more than its window and the other does not, that their priors have other forms, or
which linearisation each has arrived at: what counts is what was predicted, for the same bins from the same bearings.

Both must have the same unit. Linearised at the predicted position with range r, a bin is a pseudo-measurement
``y = hᵀ P_T + r ε`` in metres, of density N(y; hᵀμ, hᵀΣh + r² R); the angle off the prediction is e = (y - hᵀμ)/r, so

    p(e) = r^(d-1) p(y) = N(e; 0, hᵀΣh/r² + R),

whose logarithm is that of the pseudo-measurement plus log r a row. The r of the two models differ, so densities in
metres would favour the one that has the target nearer.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import digamma, polygamma

from gbt_ocp.models.measurements import MeasurementKind
from gbt_ocp.tracking.bins import BinnedBearings
from gbt_ocp.tracking.displacement.rows import bearing_rows, row_covariance
from gbt_ocp.tracking.displacement.tracker import NoisyGaussianProcessTracker
from gbt_ocp.tracking.gaps import Gaps, RestartingTracker
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.polar import BEARINGS
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.tracking.protocol import (
    RANGE_OBSERVABLE,
    Forecast,
    KeepsHypotheses,
    Tracker,
    WeighedForecasts,
    mixed,
    relative_range_std,
)
from gbt_ocp.tracking.shape.tracker import MotionShapeTracker
from gbt_ocp.typing import Array

ASTRAY = 0.01
"""Probability that a bin says nothing of the target: no single one decides between the models."""

LEAST_WEIGHT = 1.0e-4
"""Weight below which a model is left out of a forecast."""

LEAST_SPREAD = 0.3
"""Least standard deviation of the logarithm of the velocity's scale."""


def velocity_scale(speed: LogNormal, dimension: int) -> LogNormal:
    """Prior of the scale of a velocity process under which the speed has the logarithm's mean and variance of a prior.

    With d independent components of deviation s the speed is s χ_d, and log χ_d has the mean (log 2 + ψ(d/2))/2 and the
    variance ψ'(d/2)/4.

    Parameters
    ----------
    speed
        Of the speed in m/s.
    dimension
        d.

    Returns
    -------
    Prior of s in m/s; its deviation is at least :data:`LEAST_SPREAD`, where that of the speed is less than even a known
    s leaves.
    """
    mean = 0.5 * float(np.log(2.0) + digamma(0.5 * dimension))
    variance = 0.25 * float(polygamma(1, 0.5 * dimension))
    spread = np.sqrt(max(speed.log_std**2 - variance, LEAST_SPREAD**2))
    return LogNormal(speed.median * float(np.exp(-mean)), float(spread))


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
    """The mixture of a motion-shape process, a velocity process and other trackers by evidence.

    Bearings go to the bins of the first; whenever it estimates again, the second does so from the same bins. The others
    are given each bearing. A lost track of any is begun again by its own test; bins that the first then forgets no
    longer count as evidence.

    Parameters
    ----------
    motion
        The process on the shape of the motion.
    velocity
        The process on the velocity, made with ``bins=motion.bins``.
    noise
        Of the sensor.
    others
        Further trackers, each with a lost-track test of its own.
    forgetting
        Time T in seconds in which evidence fades: a bin counts by ``exp(-age/T)``. Infinity forgets with the window.

    Raises
    ------
    ValueError
        If the two have not the same dimension, or the time is not above 0.
    """

    takes: tuple[MeasurementKind, ...] = BEARINGS
    """Kinds of measurements that it takes."""

    def __init__(
        self,
        motion: MotionShapeTracker,
        velocity: NoisyGaussianProcessTracker,
        noise: BearingNoise,
        *,
        others: Sequence[Tracker] = (),
        forgetting: float = np.inf,
    ) -> None:
        if motion.dimension != velocity.dimension:
            raise ValueError(f"dimension: found {motion.dimension} and {velocity.dimension}; allowed: the same")
        if not forgetting > 0.0:
            raise ValueError(f"forgetting: found {forgetting}; allowed: a number > 0")
        self.others = tuple(others)
        self._members: tuple[Tracker, ...] = (motion, velocity, *self.others)
        self._forgetting = forgetting
        self.dimension = motion.dimension
        self.motion = motion
        self.velocity = velocity
        self._noise = noise
        self._gaps = Gaps(span=motion.bins.window)
        self._begin(np.zeros(self.dimension))

    def _begin(self, own: Array) -> None:
        self._own = own
        self._begins = -np.inf
        self._predicted: list[Forecast] = []
        self._scores: deque[tuple[float, Array]] = deque()

    def _restart(self, own: Array) -> None:
        """The motion tracker and the others find the same gap themselves; the first clears the bins."""
        self.velocity.begin_elsewhere(own)
        self._begin(own)

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing ``(d,)`` measured at ``own_position`` ``(d,)``.

        Raises
        ------
        ValueError
            If numbers are not finite, the bearing is no unit vector, or time does not increase; the tracker is then
            unchanged.
        """
        bins = self.motion.bins
        b, own = bins.checked(time, bearing, own_position)
        if self._gaps.ended(float(time)):
            self._restart(own)
        begins = float(np.floor(time / bins.width) * bins.width)
        if begins != self._begins:
            self._score()
            self._begins = begins
            if len(bins):
                ends = [begins, begins + bins.width]
                self._predicted = [member.predict(ends) for member in self._members]
        self._own = own
        self.motion.update(time, b, own)
        if self.motion.estimated_at == time:
            self.velocity.follow(time, b, own)
        for other in self.others:
            other.update(time, b, own)
        while self._scores and self._scores[0][0] < bins.begins - 1e-9:
            self._scores.popleft()

    def _score(self) -> None:
        """Judge the models by the bin that has just been filled: what they said of it before it began."""
        if not self._predicted:
            return
        bins = self.motion.bins
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
        self._scores.append((self._begins, np.array(scores)))

    @property
    def log_evidence(self) -> Array:
        """Of the motion's shape, the velocity and the others ``(M,)``, for the full bins of the window, faded."""
        total = np.zeros(len(self._members))
        for begins, scores in self._scores:
            total += scores * np.exp((begins - self._scores[-1][0]) / self._forgetting)
        return total

    @property
    def weights(self) -> Array:
        """Probability of the motion's shape, the velocity and the others ``(M,)``; equal before any bin is judged."""
        evidence = self.log_evidence
        share = np.exp(evidence - evidence.max())
        return np.asarray(share / share.sum())

    @property
    def restarts(self) -> int:
        """How often a track was lost and begun again, of all."""
        return sum(int(getattr(member, "restarts", 0)) for member in self._members)

    @property
    def range_observable(self) -> bool:
        """Whether the range is known to a quarter; before, it is mostly the prior's."""
        latest = self.motion.bins.latest
        if latest is None:
            return False
        mean, covariance = self.predict([latest])
        return bool(relative_range_std(mean[0], covariance[0], self._own) < RANGE_OBSERVABLE)

    def predict(self, times: ArrayLike) -> Forecast:
        """Posterior mean ``(K, d)`` and covariance ``(K, d, d)`` at the times ``(K,)`` in seconds.

        A model counts while it tells the range: the velocity process may hold hypotheses of range over decades, whose
        mean is nowhere near any of them. While the motion's shape does not tell it, others that do stand in its place;
        without any it stands alone.
        """
        at = np.atleast_1d(np.asarray(times, dtype=float))
        weights, parts = self._counted
        forecasts = [part.predict(at) for part in parts]
        return Forecast(*mixed(weights, *map(np.array, zip(*forecasts, strict=True))))

    def hypotheses_at(self, times: ArrayLike) -> WeighedForecasts:
        """What each hypothesis of each model predicts, at times ``(K,)`` that are not past."""
        at = np.atleast_1d(np.asarray(times, dtype=float))
        found = []
        for weight, part in zip(*self._counted, strict=True):
            if isinstance(part, KeepsHypotheses):
                shares, means, covariances = part.hypotheses_at(at)
            else:
                shares, (means, covariances) = np.ones(1), (values[None] for values in part.predict(at))
            found.append((weight * shares, means, covariances))
        return WeighedForecasts(*(np.concatenate(values) for values in zip(*found, strict=True)))

    @property
    def _counted(self) -> tuple[Array, list[Tracker]]:
        """The models that a forecast is made of, with weights that sum to one."""
        known = np.array([self._tells_range(number, member) for number, member in enumerate(self._members)])
        weights = self.weights * known if np.any(known) else np.eye(len(known))[0]
        likely = weights > LEAST_WEIGHT * weights.sum()
        parts = [part for part, one in zip(self._members, likely, strict=True) if one]
        return weights[likely] / weights[likely].sum(), parts

    def _tells_range(self, number: int, member: Tracker) -> bool:
        """Whether a model knows the range to a quarter; the velocity process only counts where the shape does."""
        if number < 2:
            return self.motion.range_observable
        observable = getattr(member, "range_observable", None)
        if observable is None and self._predicted:
            mean, covariance = (values[-1] for values in self._predicted[number])
            observable = relative_range_std(mean, covariance, self._own) < RANGE_OBSERVABLE
        return bool(observable)
