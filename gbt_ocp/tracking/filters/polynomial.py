"""Polynomial regression over the window: the plainest smooth motion that fits the bearings."""

from __future__ import annotations

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import ArrayLike

from gbt_ocp.models.measurements import MeasurementKind
from gbt_ocp.tracking.gaps import Gaps, RestartingTracker
from gbt_ocp.tracking.polar import BEARINGS
from gbt_ocp.tracking.priors import RangedPrior
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.tracking.window import Window
from gbt_ocp.typing import Array

POINT_WEIGHT = 0.01
"""Weight of the centre against a bearing while a target that moves is taken for a point: decimetres that it may have
strayed from there, over metres to which the centre is known, squared."""


class PolynomialRegression(RestartingTracker):
    """``p(t) = centre + Σ a_m T_m(s)`` by least squares over the same window and measurements as the Gaussian process.

    ``minimise Σ ‖Nᵀ (p(t_i) - o_i)‖² + ridge Σ ‖a_m‖²``. The time is scaled, s in [-1, 1] over the window, and T_m are
    Chebyshev's polynomials: the span of the powers, better conditioned. A window of N bearings has (d-1) N equations
    for d (order+1) unknowns; while they do not suffice the order is the largest for which they do, since a polynomial
    that is not determined goes astray when it is extrapolated (a reconstruction: the paper does not say). Until a
    straight line is determined it is a point, held to the centre with the weight ``POINT_WEIGHT``: bearings that are
    nearly parallel say little about a target that moves between them. The centre
    is the prior position while the first bearing is in the window; afterwards, and where nothing is known, the point
    on the latest bearing at the prior's range. The spread of the prior is not used. There is no covariance.

    Parameters
    ----------
    prior
        Position before the first bearing.
    window
        N_c, capacity of the window.
    span
        Least time that s runs over in seconds: that of a full window, (N_c - 1) T.
    order
        Degree of the polynomial.
    ridge
        Weight of the coefficients relative to the squared residuals.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """

    takes: tuple[MeasurementKind, ...] = BEARINGS
    """Kinds of measurements that it takes."""

    def __init__(self, prior: RangedPrior, *, window: int, span: float, order: int, ridge: float) -> None:
        if order < 0 or not (span > 0.0 and ridge > 0.0):
            raise ValueError(
                f"order, span and ridge: found {order}, {span}, {ridge}; allowed: a number >= 0, numbers > 0"
            )
        self._capacity = window
        self._span = span
        self._order = order
        self._ridge = ridge
        self._gaps = Gaps(bearings=window)
        self._begin(prior)

    def _begin(self, prior: RangedPrior) -> None:
        self._prior = prior
        self.window = Window(self._capacity)
        self._first: float | None = None
        self._centre = prior.unseen
        self._stretch = self._span
        self._coefficients = np.zeros((1, len(prior.unseen)))

    def _restart(self, own: Array) -> None:
        self._begin(self._prior.elsewhere(own))

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing ``(d,)`` measured at ``own_position`` ``(d,)`` and fit the window.

        Raises
        ------
        ValueError
            If numbers are not finite, the bearing is no unit vector, or time does not increase.
        """
        bearing, own_position = self.window.checked(time, bearing, own_position)
        if self._gaps.ended(float(time)):
            self._restart(own_position)
        self.window.append(time, bearing, own_position)
        if self._first is None:
            self._first = float(time)
        known = self._prior.mean is not None and self.window.times[0] <= self._first
        _, g, own = self.window.latest
        self._centre = self._prior.unseen if known else own + self._prior.range * g
        # missed bearings make the window last longer
        self._stretch = max(self._span, float(self.window.times[-1] - self.window.times[0]))
        rows = self.window.measurements()
        d = rows.directions.shape[1]
        order = min(self._order, max(len(rows.times) // d - 1, 0))
        design = (self._basis(rows.times, order)[:, :, None] * rows.directions[:, None, :]).reshape(len(rows.times), -1)
        several = self.window.times[0] < self.window.times[-1]
        weight = POINT_WEIGHT if order == 0 < self._order and several else self._ridge
        damping = np.sqrt(weight) * np.eye(design.shape[1])
        wanted = np.concatenate([rows.relative_to(self._centre), np.zeros(design.shape[1])])
        self._coefficients = np.linalg.lstsq(np.vstack([design, damping]), wanted, rcond=None)[0].reshape(-1, d)

    def _basis(self, times: Array, order: int) -> Array:
        """T_m(s) ``(K, order+1)``: s = 1 at the latest bearing, -1 a span before."""
        return np.asarray(chebvander(1.0 + 2.0 * (times - self.window.times[-1]) / self._stretch, order))

    def predict(self, times: ArrayLike) -> Forecast:
        """The polynomial at the times ``(K,)`` in seconds; the covariance is NaN."""
        t = np.asarray(times, dtype=float)
        if not len(self.window):
            return self._prior.forecast(len(t))
        mean = self._centre + self._basis(t, len(self._coefficients) - 1) @ self._coefficients
        return Forecast(mean, np.full((*mean.shape, mean.shape[1]), np.nan))
