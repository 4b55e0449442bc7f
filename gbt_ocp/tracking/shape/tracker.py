"""Tracker of noisy bearings with a Gaussian process on the shape of the motion, for ranges that may not be observable.

Every estimate starts from the last one, moved to the present time, and competes with starts at several ranges. The
result is a mixture: the distinct motions that fit (near and far), each averaged over the grid of hyperparameters and
weighed by Laplace's approximation of the evidence.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.bearings import log_map, tangent_basis
from gbt_ocp.tracking.bins import BearingBins, BinnedBearings
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.priors import PositionPrior
from gbt_ocp.tracking.protocol import RANGE_OBSERVABLE, Forecast, relative_range_std
from gbt_ocp.tracking.shape.fit import Fit, Known, Sightings, fit, sightings_root, whitening
from gbt_ocp.tracking.shape.hypotheses import UNLIKELY, Hypothesis, cold_starts, distinct, log_mean, same_motion
from gbt_ocp.tracking.shape.moments import Moments, moments_ahead, moments_behind, moments_now
from gbt_ocp.tracking.shape.motions import Motions, MotionShape
from gbt_ocp.tracking.shape.processes import ShapePrior
from gbt_ocp.typing import Array

COLD_ITERATIONS = 8
"""Steps of a start that nothing is known of."""

RECENT = 8
"""Bins over which the reset test looks."""

LOST = 6.0
"""Mean squared standardised residual of the recent bins above which a track counts as lost."""


class MotionShapeTracker:
    """Tracks a target by the shape of its motion; see :mod:`~gbt_ocp.tracking.shape.motions`.

    Parameters
    ----------
    dimension
        d.
    noise
        Of the sensor.
    prior
        Of the motion.
    bin_width, window
        Width of a bin and age of the oldest, in seconds.
    update
        Least time between two estimates in seconds; in between, the last one is predicted.
    knot
        Time between the knots of the processes in seconds; by default two bins.
    starts
        Ranges in metres at which a track is begun; by default four around the prior's median.
    hypotheses
        Largest number of distinct motions kept.
    memory
        Factor on the deviations of the position and velocity that are remembered from before the window: the posterior
        when the window's first bearing came, of the bearings that have left. Its error comes back every window and it
        is no exact Gaussian, so it is trusted less than it says. Infinity remembers nothing.
    iterations
        Largest number of Gauss-Newton steps of an estimate that starts from the last one.
    gate
        Standardised residual from which a bearing counts as a stray one (see
        :class:`~gbt_ocp.tracking.bins.BearingBins`); infinity trusts all of them.
    position
        What is known of the position at the first bearing; by default nothing, with the vehicle at the origin.

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
        prior: ShapePrior | None = None,
        bin_width: float = 1.5,
        window: float = 60.0,
        update: float = 1.0,
        knot: float | None = None,
        starts: Sequence[float] | None = None,
        hypotheses: int = 3,
        memory: float = np.inf,
        iterations: int = 3,
        gate: float = np.inf,
        position: PositionPrior | None = None,
    ) -> None:
        if not (update >= 0.0 and hypotheses >= 1 and iterations >= 1 and gate > 0.0 and memory > 0.0):
            raise ValueError(
                "update must be >= 0, hypotheses and iterations >= 1, memory and gate > 0; "
                f"found {update}, {hypotheses}, {iterations}, {memory}, {gate}"
            )
        self.dimension = dimension
        # the lasting part of the error is the same all over a bin
        self.bins = BearingBins(bin_width, window, gate * noise.std)
        self._prior = prior if prior is not None else ShapePrior()
        # what is remembered may be older than the oldest bin by two updates and the time between two nodes
        knot = knot or 2.0 * bin_width
        self._span = window + bin_width + (2.0 * update + knot if np.isfinite(memory) else 0.0)
        self._shape = MotionShape(dimension, self._prior, span=self._span, knot=knot)
        self._noise = noise
        self._update = update
        p = self._prior.range
        self._starts = np.array(starts if starts else p.median * np.exp(p.log_std * np.array([-1.2, -0.3, 0.6, 1.5])))
        self._most = hypotheses
        self._iterations = iterations
        self._gate = gate
        self._position = PositionPrior(np.zeros(dimension)) if position is None else position
        self._own = self._position.start
        self._memory = memory
        self._trail: deque[tuple[float, Known]] = deque()
        self._first: float | None = None
        self._now = np.nan
        self._fit: Fit | None = None
        self._labels = np.zeros(0, dtype=np.intp)
        self._ahead: Moments | None = None
        self._reach = self._asked = 0.0
        self._behind: Moments | None = None
        self._estimates = 0
        self._unfit = 0
        self._open = True
        self.resets = 0
        """How often the track was lost and begun anew."""

    # ---- bearings in ------------------------------------------------------------------------------------------------

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing ``(d,)`` measured at ``own_position`` ``(d,)``; estimate anew when it is time.

        Raises
        ------
        ValueError
            If numbers are not finite, the bearing is no unit vector, or time does not increase; the tracker is then
            unchanged.
        """
        expected, suspect = self._expected(time, bearing, own_position)
        self.bins.append(time, bearing, own_position, expected=expected, suspect=suspect)
        if self._first is None:
            self._first = float(time)
        if self._fit is None or time - self._now >= self._update - 1e-9:
            self._estimate(float(time), np.array(own_position, dtype=float))

    def _expected(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> tuple[Array | None, bool]:
        """Direction in which the target is expected ``(d,)``, and whether a bearing lies beyond the gate from it."""
        if self._fit is None or not np.isfinite(self._gate):
            return None, False
        mean, covariance = (values[0] for values in self.predict([time]))
        line = mean - np.asarray(own_position, dtype=float)
        distance = float(np.linalg.norm(line))
        b = np.asarray(bearing, dtype=float)
        if not (distance > 0.0 and np.all(np.isfinite(b))):
            return None, False
        unit = line / distance
        basis = tangent_basis(unit)
        angle = log_map(unit, b, basis)
        n = self._noise
        single = n.std**2 + n.correlated_std**2 + (n.own_std / distance) ** 2
        spread = basis.T @ covariance @ basis / distance**2 + single * np.eye(self.dimension - 1)
        return unit, bool(angle @ np.linalg.solve(spread, angle) > self._gate**2)

    # ---- estimating -------------------------------------------------------------------------------------------------

    def _estimate(self, now: float, own: Array) -> None:
        means = self.bins.means()
        warm = self._fit
        if warm is not None:
            motions = self._shape.advanced(warm.motions, now - self._now, own - self._own)
            self._now, self._own = now, own
            self._fit = fit(self._shape, motions, self._sightings(means, motions), self._iterations)
        self._now, self._own = now, own
        self._ahead = self._behind = None
        self._reach, self._asked = self._asked, 0.0
        self._estimates += 1
        # at every estimate while it is open where the target is, now and then afterwards
        if self._fit is None or self._unfit or self._estimates % 5 == 0 or self._open:
            self._compete(means)
        assert self._fit is not None, "the competition adds one"
        self._fit, self._labels = distinct(self._shape, self._fit, self._labels, self._most)
        self._open = not self.range_observable
        if not self._open and np.isfinite(self._memory):
            times, mean, covariance = moments_now(self._shape, *self._likely())
            self._trail.append((now, Known(now + times, own + mean, whitening(covariance) / self._memory)))
        self._check()

    def _compete(self, means: BinnedBearings) -> None:
        """Add the motions that starts at several ranges lead to, if they fit no worse and are others."""
        points = np.arange(len(self._shape.grid))
        middle = len(points) // 2
        cold = cold_starts(self._shape, means, self._now, self._own, self._starts, middle)
        tried = fit(self._shape, cold, self._sightings(means, cold), COLD_ITERATIONS)
        kept = self._fit
        if kept is not None:
            same_point = kept[kept.motions.theta == middle]
            standard = float(same_point.log_evidence.max())
        else:
            same_point, standard = tried[np.zeros(0, dtype=np.intp)], float(tried.log_evidence.max())
        new: list[int] = []
        for one in np.argsort(-tried.log_evidence):
            if tried.log_evidence[one] < standard + 0.5 * UNLIKELY or len(new) == self._most:
                break
            others = Fit.joined([same_point, tried[np.array(new, dtype=np.intp)]])
            if not np.any(same_motion(self._shape, tried[np.array([one])], others)):
                new.append(int(one))
        if not new:
            return
        motions = Motions.joined([self._shape.transferred(tried.motions[np.array([one])], points) for one in new])
        found = fit(self._shape, motions, self._sightings(means, motions), self._iterations)
        labels = np.repeat(np.arange(len(new)) + len(self._labels), len(points))
        self._fit = found if kept is None else Fit.joined([kept, found])
        self._labels = labels if kept is None else np.concatenate([self._labels, labels])

    def _sightings(self, means: BinnedBearings, motions: Motions) -> Sightings:
        times, own = means.times - self._now, means.own_positions - self._own
        n = self._noise
        if n.own_std > 0.0:
            nodes = self._shape.past(motions)
            ranges = np.linalg.norm(self._shape.at(times) @ nodes.positions - own, axis=-1)
        else:
            ranges = np.ones((1, len(times)))
        covariance = n.covariance(means, np.maximum(ranges, 1e-2), n.white_variance(self.bins))
        root, log_determinant = sightings_root(covariance, n.correlated_std == 0.0)
        known = self._remembered()
        assert self._first is not None, "there is a bearing"
        if known is None and self._position.known is not None and means.times[0] <= self._first + self.bins.width:
            position, spread = self._position.known
            known = Known(np.array([self._first]), position[None], whitening(spread))
        seen = None if known is None else known.seen_from(self._now, self._own)
        return Sightings(times, means.bearings, own, root, log_determinant, seen)

    def _remembered(self) -> Known | None:
        """What the bearings say that have left the window, if anything; it rests on none of the window's."""
        begins = self.bins.begins
        while len(self._trail) > 1 and self._trail[1][0] <= begins + 1e-9:
            self._trail.popleft()
        if not self._trail or self._trail[0][0] > begins + 1e-9 or self._trail[0][1].times[-1] < self._now - self._span:
            return None
        return self._trail[0][1]

    def _check(self) -> None:
        """Reset test: bearings that no motion of the prior explains mean that the track is lost."""
        assert self._fit is not None
        recent = self._fit.residuals[int(np.argmax(self._fit.log_evidence)), -RECENT:]
        self._unfit = self._unfit + 1 if np.mean(recent**2) > LOST else 0
        if self._unfit >= 3:
            self.resets += 1
            self._unfit = 0
            self._fit = None
            self._trail.clear()
            self.bins.forget_before(self._now - 0.4 * self.bins.window)
            self._estimate(self._now, self._own)

    # ---- what is known ----------------------------------------------------------------------------------------------

    @property
    def estimated_at(self) -> float:
        """Time of the latest estimate in seconds; NaN before the first."""
        return float(self._now)

    @property
    def weights(self) -> Array:
        """Probability of each component ``(B,)``."""
        assert self._fit is not None
        share = np.exp(self._fit.log_evidence - self._fit.log_evidence.max())
        return np.asarray(share / share.sum())

    @property
    def log_evidence(self) -> float:
        """Logarithm of the density of the mean bearings in the window, in angles, averaged over the grid."""
        if self._fit is None:
            return 0.0
        return log_mean(self._fit.log_evidence) + float(np.log(np.max(self._labels) + 1.0))

    @property
    def hypotheses(self) -> list[Hypothesis]:
        """The distinct motions that fit, likeliest first; none before the first bearing."""
        if self._fit is None:
            return []
        weights, log_range = self.weights, self._shape.log_range(self._fit.motions)
        variance = self._prior.range.log_std**2 * self._fit.covariance[:, 0, 0]
        found = []
        for name in np.unique(self._labels):
            mine = self._labels == name
            total = weights[mine].sum()
            share = weights[mine] / max(total, 1e-300)
            mean = share @ log_range[mine]
            spread = share @ (variance[mine] + (log_range[mine] - mean) ** 2)
            found.append(Hypothesis(float(total), float(np.exp(mean)), float(np.sqrt(spread))))
        return sorted(found, reverse=True)

    @property
    def range_std_over_range(self) -> float:
        """Posterior standard deviation of the range now over the range; that of the prior before the first bearing."""
        if self._fit is None:
            return self._prior.range.log_std
        now = self._moments_ahead(0.0)
        return float(relative_range_std(now.mean[0], now.covariance[0], np.zeros(self.dimension)))

    @property
    def range_observable(self) -> bool:
        """Whether the range is known to a quarter; before, it is mostly the prior's."""
        return self.range_std_over_range < RANGE_OBSERVABLE

    def _moments_ahead(self, horizon: float) -> Moments:
        self._asked = max(self._asked, horizon)
        if self._ahead is None or self._ahead.times[-1] < horizon - 1e-9:
            # as far as it was asked for after the last estimate, or well beyond what was asked for after this one
            known = self._reach if self._ahead is None else 2.0 * float(self._ahead.times[-1])
            longest = max(horizon, known)
            self._ahead = moments_ahead(self._shape, *self._likely(), longest)
        return self._ahead

    def _likely(self) -> tuple[Fit, Array]:
        assert self._fit is not None
        likely = self.weights > np.exp(UNLIKELY)
        return self._fit[likely], self.weights[likely] / self.weights[likely].sum()

    def predict(self, times: ArrayLike) -> Forecast:
        """Posterior mean ``(K, d)`` and covariance ``(K, d, d)`` at the times ``(K,)`` in seconds.

        Times in the past give the smoothed track, as far as the window reaches. Before the first bearing, nothing but
        the priors on position or range is known.
        """
        t = np.atleast_1d(np.asarray(times, dtype=float))
        if self._fit is None:
            return self._unseen(len(t))
        lag = t - self._now
        mean = np.empty((len(t), self.dimension))
        covariance = np.empty((len(t), self.dimension, self.dimension))
        ahead = lag >= 0.0
        if np.any(ahead):
            mean[ahead], covariance[ahead] = self._moments_ahead(float(lag.max())).at(lag[ahead])
        if not np.all(ahead):
            if self._behind is None:
                self._behind = moments_behind(self._shape, *self._likely())
            mean[~ahead], covariance[~ahead] = self._behind.at(lag[~ahead])
        return Forecast(self._own + mean, covariance)

    def _unseen(self, count: int) -> Forecast:
        if self._position.known is not None:
            position, covariance = self._position.known
            return Forecast(np.tile(position, (count, 1)), np.tile(covariance, (count, 1, 1)))
        p = self._prior.range
        second = p.median**2 * np.exp(2.0 * p.log_std**2) / self.dimension
        return Forecast(np.tile(self._own, (count, 1)), np.tile(second * np.eye(self.dimension), (count, 1, 1)))
