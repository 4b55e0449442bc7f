"""The Gaussian-process tracker of noisy bearings: linearised at its own posterior, range hypotheses at the start.

One step: take in the bearing, linearise the window at what the last posterior says, condition, linearise again, and
average over the hyperparameters. Until the range is observable the posterior is a mixture of such fits, each with its
own prior range (a range-parametrised start), because Gauss-Newton from one range cannot tell near from far.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.measurements import MeasurementKind, Sighting
from gbt_ocp.tracking.bins import BearingBins, BinnedBearings
from gbt_ocp.tracking.decomposed import BY_ITSELF, SightingParts, parts_of
from gbt_ocp.tracking.displacement.fit import Anchor, DisplacementFit, Node, PosteriorMixture
from gbt_ocp.tracking.displacement.hypotheses import MotionPriors, RangeHypothesis, range_hypotheses
from gbt_ocp.tracking.displacement.innovations import RECENT_BEARINGS, ResetTest, innovation
from gbt_ocp.tracking.displacement.kernels import DISPLACEMENT_KERNELS
from gbt_ocp.tracking.displacement.rows import rows_with_others
from gbt_ocp.tracking.displacement.samples import SampleStore
from gbt_ocp.tracking.displacement.trust import row_trust
from gbt_ocp.tracking.gaps import Gaps, RestartingTracker
from gbt_ocp.tracking.gp.posterior import Hyperparameters
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.polar import ALL_KINDS, WITHOUT_SIZE, checked_sighting
from gbt_ocp.tracking.priors import LogNormal, PositionPrior
from gbt_ocp.tracking.protocol import RANGE_OBSERVABLE, Forecast, relative_range_std
from gbt_ocp.typing import Array

RANGE_LOST = 0.5
"""Standard deviation of the range over the range, at the oldest sample, above which range is observable no more."""

FEWEST = 10
"""Samples before range may count as observable."""

FAR_BEHIND = 7.0
"""Difference in log evidence from the best hypothesis beyond which one is left out of the mixture."""

STRAY = 4.0
"""Deviations from its bin's median beyond which a bearing is left out, where bearings are binned."""


class NoisyGaussianProcessTracker(RestartingTracker):
    """Tracks a target by noisy bearings, ``P_T(t) = p_0 + D(t)`` with D a Gaussian process.

    Parameters
    ----------
    dimension
        d.
    noise
        Of the sensor. If its σ is ``estimated``, it is averaged over with the other hyperparameters.
    window
        Bearings kept; with ``bin_width`` the age in seconds of the oldest bin.
    bin_width
        Width in seconds of the bins over which bearings are averaged; ``None`` takes each by itself. A bearing further
        from its bin's median than :data:`STRAY` deviations is left out.
    bins
        Bins that another tracker fills, instead of ``window`` and ``bin_width``; see :meth:`follow`.
    kernel
        A name of :data:`~gbt_ocp.tracking.displacement.kernels.DISPLACEMENT_KERNELS`.
    priors
        What is known of the target.
    hyperparameters
        ``averaged`` over a grid by evidence, or ``maximum``: the likeliest node of the grid alone.
    tails
        Degrees of freedom of a Student-t likelihood that lets outliers go; ``None`` is Gaussian.
    linearisations
        Times the window is linearised an update.
    prior
        What is known of the position at the first bearing; by default nothing, with the vehicle at the origin.
    size
        The true size of the target in metres, if angular sizes are measured.

    Attributes
    ----------
    restarts
        How often a lost track was begun again.
    takes
        Kinds of measurements that :meth:`take` takes.

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
        window: float = 40,
        bin_width: float | None = None,
        bins: BearingBins | None = None,
        kernel: str = "velocity_se",
        priors: MotionPriors | None = None,
        hyperparameters: Literal["averaged", "maximum"] = "averaged",
        tails: float | None = None,
        linearisations: int = 2,
        prior: PositionPrior | None = None,
        size: LogNormal | None = None,
    ) -> None:
        if kernel not in DISPLACEMENT_KERNELS:
            raise ValueError(f"kernel: found {kernel!r}; allowed: {', '.join(DISPLACEMENT_KERNELS)}")
        if linearisations < 1:
            raise ValueError(f"linearisations: found {linearisations}; allowed: a whole number >= 1")
        if tails is not None and not tails > 0.0:
            raise ValueError(f"tails: found {tails}; allowed: None or a number > 0")
        self.dimension = dimension
        self.restarts = self.nugget_retries = 0
        self._noise = noise
        self._size = size
        self.takes: tuple[MeasurementKind, ...] = WITHOUT_SIZE if size is None else ALL_KINDS
        made = bins if bin_width is None else BearingBins(bin_width, window, STRAY * noise.std)
        self._store = SampleStore(int(window) if made is None else 2, made, bins is not None)
        self._kernel = DISPLACEMENT_KERNELS[kernel]
        self._priors = MotionPriors() if priors is None else priors
        self._averaged = hyperparameters == "averaged"
        self._tails = tails
        self._linearisations = linearisations
        # bins that another tracker fills are watched for gaps there
        self._gaps = Gaps(
            span=np.inf if bins is not None else window if bin_width is not None else None, bearings=int(window)
        )
        self._begin(PositionPrior(np.zeros(dimension)) if prior is None else prior)

    def _begin(self, prior: PositionPrior) -> None:
        self._store.clear()
        self._prior = prior
        self._known = prior.known
        self._log_factor = 0.0
        self._hypotheses: list[RangeHypothesis] = []
        self._anchor_time = 0.0
        self._observable = False
        self._relative_spread = np.inf
        self._mixture: PosteriorMixture | None = None
        self._reset = ResetTest()

    def _restart(self, own: Array) -> None:
        self._begin(self._prior.elsewhere(own))

    def begin_elsewhere(self, own: Array) -> None:
        """Begin a new track with the vehicle at ``own`` ``(d,)``, for a tracker that follows another one's bins."""
        self._restart(own)

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing ``(d,)`` measured at ``own_position`` ``(d,)`` and condition on the window.

        Raises
        ------
        ValueError
            If numbers are not finite, the bearing is no unit vector, or time does not increase; the tracker is then
            unchanged.
        """
        self._seen(float(time), *self._store.checked(float(time), bearing, own_position))

    def take(self, sighting: Sighting) -> None:
        """Take in a measurement of any kind in :attr:`takes`, with its own noise, at or after the latest time.

        Measurements that are no bearings count from the first bearing of the window on.

        Raises
        ------
        ValueError
            If the kind is not taken or the measurement is out of order; the tracker is then unchanged.
        """
        checked_sighting(sighting, self.takes, "gp", self.dimension, self._store.latest)
        parts = parts_of(sighting, self._noise.std)
        if parts.bearing is not None:
            self._seen(sighting.time, parts.bearing, sighting.position, parts)
            return
        self._store.others.extend(parts.singles)
        if self._mixture is not None:
            self._condition(None)

    def _seen(self, time: float, bearing: Array, own: Array, parts: SightingParts = BY_ITSELF) -> None:
        """Take in a bearing with its own noise, and what came with it."""
        if self._gaps.ended(time):
            self._restart(own)
        self._store.others.extend(parts.singles)
        weight, platform = parts.worth(self._noise.std), parts.platform
        ahead, square = self._innovation(time, bearing, own, weight)
        suspect = square > STRAY**2
        self._store.append(time, bearing, own, weight=weight, expected=ahead, suspect=suspect, platform=platform)
        self._condition(square)

    def follow(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Condition on the window, in which the sample is the latest already: as :meth:`update`, but adding nothing."""
        b, own = np.asarray(bearing, dtype=float), np.asarray(own_position, dtype=float)
        self._condition(self._innovation(float(time), b, own)[1])

    def _condition(self, square: float | None) -> None:
        """Condition on the window, whose latest bearing was so far from where it was expected; ``None`` is none."""
        if self._mixture is not None and square is not None and self._reset.lost(square):
            self.restarts += 1
            self._begin_again()
        samples = self._store.bearings()
        if not self._observable:
            self._anchor(samples)
        nodes = self._priors.nodes(self._noise, self._log_factor)
        if self._observable:
            one = self._hypotheses[0]
            fit = self._fit(one, Anchor(*self._here(samples)), samples, nodes)
            one.mixture = self._average(fit, nodes)
            self._mixture = one.mixture
        else:
            self._mixture = self._compare(samples, nodes)
        self._log_factor = 0.5 * float(np.log(self._mixture.best[1].node.white_variance / self._noise.std**2))
        self._judge_range(samples)

    def _innovation(self, time: float, bearing: Array, own: Array, weight: float = 1.0) -> tuple[Array | None, float]:
        """Where the target is expected, and the squared innovation; nothing and 0 before the first bearing."""
        if self._mixture is None:
            return None, 0.0
        return innovation(self._mixture, self._noise, time, bearing, own, weight)

    def _begin_again(self) -> None:
        """Begin a lost track again: forget all but the latest samples, and all hypotheses."""
        self._store.keep_latest(RECENT_BEARINGS, 3)
        self._hypotheses, self._observable, self._known = [], False, None
        self._reset.clear()

    def _here(self, samples: BinnedBearings) -> tuple[float, Array, Array]:
        """Time, mean and covariance of the wide prior position about the vehicle's latest."""
        return (
            float(samples.times[-1]),
            samples.own_positions[-1],
            self._priors.position_std**2 * np.eye(self.dimension),
        )

    def _anchor(self, samples: BinnedBearings) -> None:
        """Make hypotheses of the range at the oldest sample, and again whenever it has left the window."""
        oldest = float(samples.times[0])
        if self._hypotheses:
            # the means of bins shift while they fill, and the process reaches back a while beyond the oldest sample
            if oldest - self._anchor_time <= (0.0 if self._store.bins is None else self._store.bins.width):
                return
            self._known = None
        self._anchor_time = oldest
        if self._known is not None:
            self._hypotheses = [RangeHypothesis(*self._known, 0.0)]
            return
        self._hypotheses = range_hypotheses(samples, self._priors.range)

    def _compare(self, samples: BinnedBearings, nodes: Sequence[Node]) -> PosteriorMixture:
        """The mixture of the hypotheses by Laplace's evidence."""
        fits = []
        for one in self._hypotheses:
            fit = self._fit(one, Anchor(self._anchor_time, one.mean, one.covariance), samples, nodes)
            solution = fit.solve(self._last_node(one, nodes))
            # only the best node decides whether the rest of the grid is worth its time
            fits.append((one, fit, solution, solution.log_evidence + one.log_prior - fit.misfit(solution)))
        best = max(value for *_, value in fits)
        mixtures, log_priors = [], []
        for one, fit, solution, value in fits:
            likely = value > best - FAR_BEHIND
            one.mixture = self._average(fit, nodes if likely else [solution.node])
            if likely:
                mixtures.append(one.mixture)
                log_priors.append(one.log_prior - fit.misfit(one.mixture.best[1]))
        return PosteriorMixture.of(mixtures, log_priors)

    def _average(self, fit: DisplacementFit, nodes: Sequence[Node]) -> PosteriorMixture:
        mixture = PosteriorMixture.over(fit, nodes)
        if self._averaged:
            return mixture
        return replace(mixture, parts=((*mixture.best, 1.0),))

    def _last_node(self, one: RangeHypothesis, nodes: Sequence[Node]) -> Node:
        """The hypothesis's likeliest hyperparameters, or the middle of the priors."""
        return nodes[len(nodes) // 2] if one.mixture is None else one.mixture.best[1].node

    def _fit(
        self, one: RangeHypothesis, anchor: Anchor, samples: BinnedBearings, nodes: Sequence[Node]
    ) -> DisplacementFit:
        """The window linearised where the hypothesis has the target."""
        node = self._last_node(one, nodes)
        last = None if one.mixture is None else one.mixture.best
        others = tuple(self._store.others)
        everything = self._store.everything(samples)
        for count in range(self._linearisations):
            places = np.tile(one.mean, (len(everything), 1))
            if last is not None:
                places = last[0].mean(last[1], everything.times)
            rows = rows_with_others(everything, others, places, self._noise.std, self._size)
            trust = row_trust(rows, last, samples, places, node.white_variance, self._tails)
            fit = DisplacementFit(self._kernel, anchor, self._noise, everything, rows, trust, others, self._size)
            if count + 1 < self._linearisations:
                last = fit, fit.solve(node)
        return fit

    def _judge_range(self, samples: BinnedBearings) -> None:
        """Decide whether range is observable at the oldest sample, of which the manoeuvres since say most."""
        assert self._mixture is not None
        first = self._mixture.predict(samples.times[:1])
        self._relative_spread = float(relative_range_std(first.mean[0], first.covariance[0], samples.own_positions[0]))
        if not self._observable and len(samples) >= FEWEST and self._relative_spread < RANGE_OBSERVABLE:
            self._observable = True
            self._hypotheses = [RangeHypothesis(*self._here(samples)[1:], 0.0, self._mixture)]
        elif self._observable and self._relative_spread > RANGE_LOST:
            self._observable, self._hypotheses = False, []

    @property
    def range_observable(self) -> bool:
        """Whether the bearings say how far the target is; if not, the posterior repeats the prior of the range."""
        return self._observable

    @property
    def relative_range_std(self) -> float:
        """Posterior standard deviation of the range over the range, at the oldest sample of the window."""
        return self._relative_spread

    def predict(self, times: ArrayLike) -> Forecast:
        """Posterior mean ``(K, d)`` and covariance ``(K, d, d)`` at the times ``(K,)`` in seconds."""
        at = np.asarray(times, dtype=float)
        if self._mixture is not None:
            return self._mixture.predict(at)
        nothing = self._prior.start, self._priors.range.median**2 * np.eye(self.dimension)
        mean, covariance = self._known or nothing
        return Forecast(np.tile(mean, (len(at), 1)), np.tile(covariance, (len(at), 1, 1)))

    @property
    def hyperparameters(self) -> Hyperparameters:
        """The likeliest θ: its amplitude is the scale of the kernel, its nugget σ² in rad²."""
        if self._mixture is None:
            prior = self._priors
            return Hyperparameters(np.log([prior.length.median]), float(np.log(prior.scale.median)), self._noise.std**2)
        node = self._mixture.best[1].node
        return Hyperparameters(np.array([node.log_length]), node.log_scale, node.white_variance)

    @property
    def prior_covariance(self) -> Array:
        """The wide prior of the position ``(d, d)`` in m²."""
        return np.asarray(self._priors.position_std**2 * np.eye(self.dimension))

    def bound(self, times: ArrayLike, delta: float) -> Array:
        """NaN ``(K,)``: theorem 1 is for one process and a fixed noise, not for an average over several."""
        return np.full(len(np.asarray(times)), np.nan)
