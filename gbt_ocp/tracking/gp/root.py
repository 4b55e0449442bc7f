"""A root of the squared exponential, and conditioning on it: for bearings without noise, or nearly so.

With lags over the length scale ``exp(-(x - x')²/2) = Σ_n φ_n(x) φ_n(x')``, ``φ_n(x) = exp(-x²/2) xⁿ / √n!``, so that a
process is a sum of these functions with independent coefficients c of unit variance. Conditioning it on measurements is
a least-squares problem for c, and its factorisation a QR decomposition. The condition of that is the root of the
covariance's: nuggets that a Cholesky factorisation cannot tell from rounding, down to 1e-22, are told apart by the
likelihood, and what lies ahead of exact bearings is known that much better.

References
----------
Fasshauer and McCourt, Stable evaluation of Gaussian radial basis function interpolants, SIAM J. Sci. Comput. 34 (2012).
Cotter, Keshet and Srebro, Explicit approximations of the Gaussian kernel, arXiv:1109.4603 (2011): these functions.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import lapack

from gbt_ocp.tracking.gp.kernels import Kernel, SquaredExponential, squared_exponential
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.tracking.window import Measurements
from gbt_ocp.typing import Array

NUGGETS = (1e-22, 1e-20, 1e-18, 1e-16)
"""Variances of a measurement relative to the amplitude squared that only a root tells apart, the least first."""

EXACT_PRIOR = LogNormal(1.0e-22, 4.0)
"""Bearings that a covariance cannot tell from exact ones are exact, unless the likelihood says otherwise."""

MOST_FUNCTIONS = 48
"""Functions of a root at most: enough for windows of five length scales, of which covariances are conditioned well."""

TAIL = 1.0e-30
"""Share of the variance in a window that is left to further functions."""

SUM_ROUNDING = 1.0e-13
"""Share of the variance that counts as rounding of a sum of squares near 1."""


def nuggets_near(nugget: float, rounding: float) -> tuple[float, ...]:
    """Those of which the likeliest is taken, where a tuned one may stand for the rounding of a covariance instead."""
    return (*NUGGETS, nugget) if nugget <= 10.0 * rounding else (nugget,)


def functions(x: Array, count: int) -> Array:
    """φ_0 … φ_(m-1) at times over the length scale ``(K,)``: ``(K, m)``."""
    found = np.empty((len(x), count))
    found[:, 0] = np.exp(-0.5 * x**2)
    for n in range(1, count):
        found[:, n] = found[:, n - 1] * (x / math.sqrt(n))
    return found


def count_for(times: Array, length_scale: float, dimension: int) -> int | None:
    """How many functions tell a window of rows at these times ``(R,)``; ``None`` if too many, or if there is no row.

    There are at least as many coefficients as rows.
    """
    if not len(times):
        return None
    reach, left = 0.5 * float(times.max() - times.min()) / length_scale, 1.0
    for count in range(1, MOST_FUNCTIONS + 1):
        left *= reach**2 / count
        if left <= TAIL and count * dimension >= len(times):
            return count
    return None


class _Reflections:
    """The QR decomposition of a matrix ``(n, R)``, n at least R, by Householder's reflections."""

    def __init__(self, matrix: Array) -> None:
        self.size = len(matrix)
        self._packed, self._scalings, _, _ = lapack.dgeqrf(matrix)
        self.upper = np.triu(self._packed[: matrix.shape[1]])

    def times(self, columns: Array) -> Array:
        """The orthogonal factor times columns ``(n, K)``."""
        return self._applied("N", columns)

    def transposed_times(self, columns: Array) -> Array:
        """Its transpose times columns ``(n, K)``."""
        return self._applied("T", columns)

    def _applied(self, transposed: str, columns: Array) -> Array:
        work = 64 * columns.shape[1]
        found: Array = lapack.dormqr("L", transposed, self._packed, self._scalings, columns, work)[0]
        return found


class Root:
    """A process ``centre + A P_u(t)``, latent functions independent squared exponentials, given linear measurements.

    Parameters
    ----------
    measurements
        What was measured; at least one row.
    centre
        Prior mean ``(d,)``.
    length_scales
        Of the latent functions in seconds ``(Q,)``.
    weights
        A ``(d, Q)`` in metres.
    variance
        In m²: of each row on top of its own, over the nugget.
    nuggets
        Of which the likeliest is taken.
    count
        Functions of each latent function; see :func:`count_for`.
    """

    def __init__(
        self,
        measurements: Measurements,
        centre: Array,
        length_scales: ArrayLike,
        weights: Array,
        variance: float,
        nuggets: Iterable[float],
        count: int,
    ) -> None:
        t = measurements.times
        self._middle = 0.5 * float(t.min() + t.max())
        self._scales, self._weights, self._centre = np.asarray(length_scales, dtype=float), weights, centre
        self._count, self._rows = count, len(t)
        self._process = _Reflections(np.einsum("rd,rdm->rm", measurements.directions, self._at(t)).T)
        values, likeliest = measurements.relative_to(centre), -math.inf
        for nugget in nuggets:
            diagonal = np.diag(np.sqrt(variance * nugget + measurements.variances))
            reflections = _Reflections(np.concatenate([self._process.upper, diagonal]))
            whitened = lapack.dtrtrs(reflections.upper, values, trans=1)[0]
            spread = float(np.sum(np.log(np.abs(reflections.upper.diagonal()))))
            likelihood = EXACT_PRIOR(math.log(nugget))[0] - 0.5 * float(whitened @ whitened) - spread
            # the first one too where nothing is a number
            if not likelihood <= likeliest:
                likeliest, self._noise, solution = likelihood, reflections, whitened
        explained = self._noise.times(np.concatenate([solution, np.zeros(len(t))])[:, None])[: len(t)]
        padded = np.concatenate([explained, np.zeros((self._process.size - len(t), 1))])
        self._found = self._process.times(padded)[:, 0]

    def _at(self, times: Array) -> Array:
        """What each coefficient moves each coordinate by, at the times: ``(K, d, Q m)``."""
        each = [functions((times - self._middle) / scale, self._count) for scale in self._scales]
        moved = self._weights.T[:, None, :, None] * np.array(each)[:, :, None, :]
        return np.asarray(np.concatenate(list(moved), axis=2))

    def _unexplained(self, moved: Array) -> Array:
        """What the measurements leave of each coordinate at each time ``(Q m, K d)``: columns of a root."""
        turned = self._process.transposed_times(moved.reshape(-1, moved.shape[2]).T)
        seen = np.concatenate([turned[: self._rows], np.zeros((self._rows, turned.shape[1]))])
        return np.concatenate([self._noise.transposed_times(seen)[self._rows :], turned[self._rows :]])

    def _tail(self, x: Array) -> Array:
        """Share of the variance that further functions have, at times over the length scale: it counts far ahead."""
        left = 1.0 - np.sum(functions(x, self._count) ** 2, axis=1) - SUM_ROUNDING
        return np.asarray(np.maximum(left, 0.0))

    def joint_covariance(self, times: Array) -> Array:
        """Posterior covariance of the positions at the times with each other ``(K, d, K, d)`` in m²."""
        moved = self._at(times)
        left = self._unexplained(moved)
        shape = (len(times), moved.shape[1], len(times), moved.shape[1])
        return np.asarray((left.T @ left).reshape(shape) + self._further(times))

    def _further(self, times: Array) -> Array:
        """Prior covariance ``(K, d, K, d)`` that further functions have; it counts far beyond the window."""
        found = np.zeros((len(times), len(self._centre), len(times), len(self._centre)))
        for scale, weight in zip(self._scales, self._weights.T, strict=True):
            x = (times - self._middle) / scale
            known = functions(x, self._count)
            rest = squared_exponential(x[:, None] - x[None, :]) - known @ known.T
            found += np.einsum("a,ij,b->iajb", weight, np.where(np.abs(rest) > SUM_ROUNDING, rest, 0.0), weight)
        return found

    def predict(self, times: Array) -> Forecast:
        """μ ``(K, d)`` and Σ ``(K, d, d)`` at the times ``(K,)``."""
        moved = self._at(times)
        left = self._unexplained(moved).T.reshape(*moved.shape[:2], -1)
        tails = np.array([self._tail((times - self._middle) / scale) for scale in self._scales])
        further = np.einsum("aq,qk,bq->kab", self._weights, tails, self._weights)
        return Forecast(self._centre + moved @ self._found, left @ np.swapaxes(left, 1, 2) + further)


def root_of(
    kernels: Sequence[Kernel],
    measurements: Measurements,
    centre: Array,
    length_scales: Array,
    weights: Array,
    nugget: float,
    rounding: float,
) -> Root | None:
    """The root of a process, conditioned; ``None`` where it has none, and of a nugget that is given (rounding 0).

    ``nugget`` is relative to the mean variance of the coordinates; the other parameters are as of :class:`Root`.
    """
    if not (rounding > 0.0 and all(isinstance(kernel, SquaredExponential) for kernel in kernels)):
        return None
    count = count_for(measurements.times, float(length_scales.min()), len(length_scales))
    if count is None:
        return None
    variance = float(np.sum(weights**2)) / len(weights)
    return Root(measurements, centre, length_scales, weights, variance, nuggets_near(nugget, rounding), count)
