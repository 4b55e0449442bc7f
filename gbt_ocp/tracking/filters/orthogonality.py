"""Orthogonality-based estimators: what is off the bearing is driven onto it, and range follows as the bearing turns.

A bearing g taken at o says ``P (o - p) = 0`` with ``P = I - g gᵀ``; both laws feed ``y = P (o - p̂)`` back. They have
no covariance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.measurements import MeasurementKind
from gbt_ocp.tracking.gaps import Gaps, RestartingTracker
from gbt_ocp.tracking.polar import BEARINGS
from gbt_ocp.tracking.priors import RangedPrior
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.tracking.window import checked_sample
from gbt_ocp.typing import Array


class OrthogonalityTracker(RestartingTracker):
    """The law ``dp̂/dt = v̂ + c₁ y``, ``dv̂/dt = c₂ y``.

    With c₂ = 0 it is OE-S, for a static target: Deghat, Shames, Anderson and Yu, "Localization and circumnavigation of
    a slowly moving target using bearing measurements", IEEE Transactions on Automatic Control 59 (2014). With c₂ > 0 it
    is OE-CV, for constant velocity, reconstructed here as that law with an integrator for the velocity.

    With a line of sight that turns at w rad/s the error of OE-S obeys ``s² + c₁ s + w² = 0``: c₁ = 2w is fastest, and a
    large gain is slow (rate w²/c₁). OE-CV is stable only if c₂ < w², whatever c₁ is; best is c₁ = 2w, c₂ = 0.55 w².

    From bearing to bearing the estimate moves with v̂, and then the feedback acts for as long, with the newest bearing
    held and taken exactly: ``p̂ += (1 - exp(-c₁ T)) y``, ``v̂ += c₂/c₁ (1 - exp(-c₁ T)) y``. To first order in T this is
    a step of Euler's, but no gain and no gap in the measurements makes it unstable, and a target that moves as v̂ says
    is not left behind.

    Parameters
    ----------
    prior
        Where the estimate begins: on the first bearing, at rest.
    position_gain
        c₁ (k₁ of OE-S) in 1/s.
    velocity_gain
        c₂ in 1/s²; 0 for a static target.

    Raises
    ------
    ValueError
        If a gain is out of range.
    """

    takes: tuple[MeasurementKind, ...] = BEARINGS
    """Kinds of measurements that it takes."""

    def __init__(self, prior: RangedPrior, *, position_gain: float, velocity_gain: float = 0.0) -> None:
        if not position_gain > 0.0:
            raise ValueError(f"position_gain: found {position_gain}; allowed: a number > 0")
        if not velocity_gain >= 0.0:
            raise ValueError(f"velocity_gain: found {velocity_gain}; allowed: a number >= 0")
        self._position_gain = position_gain
        self._velocity_gain = velocity_gain
        self._gaps = Gaps()
        self._begin(prior)

    def _begin(self, prior: RangedPrior) -> None:
        self._prior = prior
        self._time: float | None = None
        self._position = prior.unseen
        self._velocity = np.zeros_like(prior.unseen)

    def _restart(self, own: Array) -> None:
        self._begin(self._prior.elsewhere(own))

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing ``(d,)`` measured at ``own_position`` ``(d,)``.

        Raises
        ------
        ValueError
            If numbers are not finite, the bearing is no unit vector, or time does not increase.
        """
        g, own = checked_sample(time, bearing, own_position, self._time)
        if self._gaps.ended(float(time)):
            self._restart(own)
        if self._time is None:
            self._time, self._position = float(time), self._prior.seen(g, own)
            return
        step = float(time) - self._time
        position = self._position + step * self._velocity
        off = own - position
        across = -np.expm1(-self._position_gain * step) * (off - g * (g @ off))
        self._position = position + across
        self._velocity = self._velocity + self._velocity_gain / self._position_gain * across
        self._time = float(time)

    def predict(self, times: ArrayLike) -> Forecast:
        """Position at the times ``(K,)`` in seconds under the latest velocity; the covariance is NaN."""
        t = np.asarray(times, dtype=float)
        if self._time is None:
            return self._prior.forecast(len(t))
        mean = self._position + (t - self._time)[:, None] * self._velocity
        return Forecast(mean, np.full((*mean.shape, mean.shape[1]), np.nan))
