"""What a tracker by the shape of the motion says between two estimates: forecasts, hypotheses, range."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.tracking.gaps import RestartingTracker
from gbt_ocp.tracking.priors import PositionPrior, unseen
from gbt_ocp.tracking.protocol import RANGE_OBSERVABLE, Forecast, WeighedForecasts, relative_range_std
from gbt_ocp.tracking.shape.hypotheses import MotionHypotheses, MotionHypothesis
from gbt_ocp.tracking.shape.moments import (
    NodeMoments,
    moments_ahead,
    moments_behind,
    moments_now,
    motion_covariance,
    on_both_sides,
)
from gbt_ocp.tracking.shape.motions import MotionShape
from gbt_ocp.tracking.shape.processes import ShapePrior
from gbt_ocp.typing import Array


class MotionOutlook(RestartingTracker):
    """Reads the latest estimate of a :class:`~gbt_ocp.tracking.shape.tracker.MotionShapeTracker`, which makes it."""

    dimension: int
    _shape: MotionShape
    _prior: ShapePrior
    _position: PositionPrior
    _own: Array
    _now: float
    _found: MotionHypotheses | None
    _ahead: NodeMoments | None
    _behind: NodeMoments | None
    _reach: float
    _asked: float

    @property
    def estimated_at(self) -> float:
        """Time of the latest estimate in seconds; NaN before the first."""
        return float(self._now)

    @property
    def log_evidence(self) -> float:
        """Logarithm of the density of the mean bearings in the window, in angles; 0 before the first bearing."""
        return 0.0 if self._found is None else self._found.log_evidence

    @property
    def hypotheses(self) -> list[MotionHypothesis]:
        """The distinct motions that fit, likeliest first; none before the first bearing."""
        return [] if self._found is None else self._found.summary

    @property
    def range_std_over_range(self) -> float:
        """Posterior standard deviation of the range now over the range; that of the prior before the first bearing."""
        if self._found is None:
            return self._prior.range.log_std
        now = self._moments_ahead(self._found, 0.0)
        return float(relative_range_std(now.mean[0], now.covariance[0], np.zeros(self.dimension)))

    @property
    def range_observable(self) -> bool:
        """Whether the range is known to a quarter; before, it is mostly the prior's."""
        return self.range_std_over_range < RANGE_OBSERVABLE

    def _moments_ahead(self, found: MotionHypotheses, horizon: float) -> NodeMoments:
        horizon = min(horizon, self._shape.longest_ahead)
        self._asked = max(self._asked, horizon)
        if self._ahead is None or self._ahead.times[-1] < horizon - 1e-9:
            # as far as it was asked for after the last estimate, or well beyond what was asked for after this one
            known = self._reach if self._ahead is None else 2.0 * float(self._ahead.times[-1])
            longest = max(horizon, known)
            self._ahead = moments_ahead(self._shape, *found.likely, longest)
        return self._ahead

    def predict(self, times: ArrayLike) -> Forecast:
        """Posterior mean ``(K, d)`` and covariance ``(K, d, d)`` at the times ``(K,)`` in seconds.

        Times in the past give the smoothed track, as far as the window reaches. Times further ahead than
        :attr:`~gbt_ocp.tracking.shape.motions.MotionShape.longest_ahead` are extrapolated (see
        :meth:`~gbt_ocp.tracking.shape.moments.NodeMoments.at`). Before the first bearing, only the prior on position or
        range is known.
        """
        t = np.atleast_1d(np.asarray(times, dtype=float))
        found = self._found
        if found is None:
            return unseen(self._position, self._prior.range, self._own, len(t))
        mean, covariance = on_both_sides(
            t - self._now,
            lambda lag: self._moments_ahead(found, float(lag.max())).at(lag),
            lambda lag: self._moments_behind(found).at(lag),
        )
        return Forecast(self._own + mean, covariance)

    def _moments_behind(self, found: MotionHypotheses) -> NodeMoments:
        if self._behind is None:
            self._behind = moments_behind(self._shape, *found.likely)
        return self._behind

    def motion_at(self, time: float) -> Array | None:
        """Covariance of position and velocity ``(2d, 2d)``; ``None`` before the first bearing."""
        if self._found is None:
            return None
        times, _, covariance = moments_now(self._shape, *self._found.likely)
        return motion_covariance(times, covariance, time - self._now)

    def hypotheses_at(self, times: ArrayLike) -> WeighedForecasts:
        """What each of the distinct motions that fit predicts, at times ``(K,)`` that are not past."""
        t = np.atleast_1d(np.asarray(times, dtype=float))
        if self._found is None:
            return WeighedForecasts(
                np.ones(1), *(values[None] for values in unseen(self._position, self._prior.range, self._own, len(t)))
            )
        lag = np.maximum(t - self._now, 0.0)
        horizon = min(float(lag.max()), self._shape.longest_ahead)
        weights, parts = self._found.likely_motions
        found = [moments_ahead(self._shape, fitted, share, horizon).at(lag) for fitted, share in parts]
        means, covariances = (np.array(values) for values in zip(*found, strict=True))
        return WeighedForecasts(weights, self._own + means, covariances)
