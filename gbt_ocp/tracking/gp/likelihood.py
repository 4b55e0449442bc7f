"""Log likelihood of the pseudo-linear measurements (``like1``), its gradient, and its maximisation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from gbt_ocp.tracking.gp.kernels import Kernel
from gbt_ocp.tracking.linalg import NotPositiveDefiniteError, cholesky
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.tracking.window import Measurements
from gbt_ocp.typing import Array

EVALUATIONS = 40
"""Most expansions of the likelihood in one tuning."""

LONGEST_STEP = 2.0
"""Largest change of the logarithm of a hyperparameter in one step."""

SMALLEST_FALL = 0.02
"""Fall of the gradient along a step, relative to what was expected, below which it tells nothing of the curvature."""

LOG_TWO_PI = math.log(2.0 * math.pi)

GAIN = 1.0e-5
"""Expected gain in log likelihood below which tuning stops: far less than would change a posterior visibly."""

ROUNDING = float(np.finfo(float).eps)
"""Rounding of a log likelihood times the nugget: of 20 rows its deviation is a fifth of that to once."""


class LogLikelihood:
    """``log p(y|t) = -½ (yᵀ Ω⁻¹ y + log det Ω + R log 2π)`` with R = (d-1) N rows, as a function of log θ.

    The paper's ``like1`` has the signs of the last two terms wrong inside its bracket. θ is the kernel's parameters
    followed by the amplitude and, where it is tuned, the nugget, all as logarithms.

    Parameters
    ----------
    kernel
        Unit-amplitude covariance.
    measurements
        Rows of the window.
    centre
        Prior mean ``(d,)``.
    nugget
        Variance relative to the amplitude squared; ``None`` makes its logarithm the last entry of log θ.
    """

    def __init__(self, kernel: Kernel, measurements: Measurements, centre: Array, nugget: float | None) -> None:
        t, h = measurements.times, measurements.directions
        self._kernel = kernel
        self._lag = t[:, None] - t[None, :]
        self._gram = h @ h.T
        self._values = measurements.relative_to(centre)
        self._variances = measurements.variances
        self._nugget = nugget
        self._known = bool(np.any(self._variances))
        self._further = (nugget is None) + self._known
        self._turn = self._turned()

    def _turned(self) -> Array:
        """∂Ω/∂θ ``(p, q)`` as sums of what is expanded: shapes, nugget, the rows' own variances, and Ω itself.

        The amplitude scales all of Ω but the rows' own variances V: its slope is ``2 (Ω - V)``, and that of Ω needs no
        solution of a linear system.
        """
        shapes, tuned = len(self._kernel.names), self._nugget is None
        turn = np.zeros((shapes + 1 + tuned, shapes + self._further + 1))
        turn[:shapes, :shapes] = np.eye(shapes)
        if self._known:
            turn[shapes, -2] = -2.0
        turn[shapes, -1] = 2.0
        if tuned:
            turn[shapes + 1, shapes] = 1.0
        return turn

    def __call__(self, log_theta: Array) -> tuple[float, Array]:
        """Value and gradient by log θ; see :meth:`expand`."""
        return self.expand(log_theta)[:2]

    def expand(self, log_theta: Array) -> tuple[float, Array, Array]:
        """Value, gradient, and Fisher information (the expected negative Hessian) by log θ.

        Raises
        ------
        NotPositiveDefiniteError
            If Ω has no Cholesky factor.
        """
        shapes = len(self._kernel.names)
        variance = math.exp(2.0 * log_theta[shapes])
        nugget = self.nugget(log_theta)
        k, derivatives = self._kernel.derivatives(self._lag, log_theta[:shapes])
        scaled = variance * self._gram
        slopes = np.empty((shapes + self._further, *scaled.shape))
        for slope, dk in zip(slopes, derivatives, strict=False):
            np.multiply(scaled, dk, out=slope)
        omega = np.multiply(scaled, k, out=scaled)
        diagonal = slice(None, None, len(omega) + 1)  # of a flattened matrix
        omega.reshape(-1)[diagonal] += variance * nugget + self._variances
        slopes[shapes:] = 0.0
        if self._nugget is None:
            slopes[shapes].reshape(-1)[diagonal] = variance * nugget
        if self._known:
            slopes[-1].reshape(-1)[diagonal] = self._variances
        value, gradient, information = scaled_expansion(self._values, omega, slopes)
        return value, self._turn @ gradient, self._turn @ information @ self._turn.T

    def nugget(self, log_theta: Array) -> float:
        """The nugget of θ, tuned or not."""
        return math.exp(log_theta[-1]) if self._nugget is None else self._nugget


class Likelihood(Protocol):
    """A log likelihood of hyperparameters that can be maximised."""

    def expand(self, log_theta: Array) -> tuple[float, Array, Array]:
        """Value, gradient and Fisher information at θ; may raise :class:`NotPositiveDefiniteError`."""

    def nugget(self, log_theta: Array) -> float:
        """The nugget of θ."""


def scaled_expansion(values: Array, omega: Array, slopes: Array) -> tuple[float, Array, Array]:
    """:func:`gaussian_expansion` with a further, last parameter: the logarithm of a factor on all of Ω."""
    count, rows, _ = slopes.shape
    factor = cholesky(omega)
    weights = lapack.dpotrs(factor, values, lower=1)[0]
    square = values @ weights
    value = -0.5 * (square + rows * LOG_TWO_PI) - np.log(factor.diagonal()).sum()
    # B_i = L⁻¹ ∂Ω/∂θ_i L⁻ᵀ has the traces of W_i, is symmetric and costs products only; of Ω itself it is I
    inverse = lapack.dtrtri(factor, lower=1)[0]
    whitened = (inverse @ slopes @ inverse.T).reshape(count, -1)
    gradient, information = np.empty(count + 1), np.empty((count + 1, count + 1))
    traces = whitened[:, :: rows + 1].sum(axis=1)
    gradient[:-1] = 0.5 * ((slopes @ weights) @ weights - traces)
    gradient[-1] = 0.5 * (square - rows)
    information[:-1, :-1] = 0.5 * (whitened @ whitened.T)
    information[-1, :-1] = information[:-1, -1] = 0.5 * traces
    information[-1, -1] = 0.5 * rows
    return float(value), gradient, information


def gaussian_expansion(values: Array, omega: Array, slopes: Array) -> tuple[float, Array, Array]:
    """Log density of ``y ~ N(0, Ω)``, its gradient, and the Fisher information, by the p parameters of Ω.

    With ``W_i = Ω⁻¹ ∂Ω/∂θ_i`` the gradient is ``½ (αᵀ ∂Ω/∂θ_i α - tr W_i)``, ``α = Ω⁻¹ y``, and the information
    ``½ tr(W_i W_j)`` (Rasmussen and Williams 2006, equation 5.9; Mardia and Marshall 1984).

    Parameters
    ----------
    values
        y ``(R,)``.
    omega
        Ω ``(R, R)``.
    slopes
        ∂Ω/∂θ_i ``(p, R, R)``, each symmetric.

    Raises
    ------
    NotPositiveDefiniteError
        If Ω has no Cholesky factor.
    """
    value, gradient, information = scaled_expansion(values, omega, slopes)
    return value, gradient[:-1], information[:-1, :-1]


def maximise(
    likelihood: Likelihood,
    start: Array,
    bounds: Sequence[tuple[float, float]],
    priors: Sequence[LogNormal | None],
    least_nugget: float = 0.0,
) -> Array:
    """The log θ that maximises likelihood times priors within bounds, from a start, by Fisher scoring.

    Newton's method with the Fisher information for the Hessian: it is always positive semidefinite, comes almost free
    with the gradient, and with what the last steps taught of the curvature (:func:`_corrected`) a warm start needs a
    handful of evaluations. A search ends where a step promises less than rounding moves the likelihood, and once the
    nugget has fallen below the least one that is of interest. A step that does not improve is damped, and what was
    taught is forgotten. A parameter whose bounds coincide stays fixed. Points at which Ω is not positive definite count
    as worthless; if the start is one, it is returned as it is.
    """
    low, high = np.array(bounds, dtype=float).T
    tuned = high > low
    theta: Array = np.clip(np.asarray(start, dtype=float), low, high)
    here = _posterior_expansion(likelihood, theta, priors)
    if here is None:
        return theta
    value, gradient, information = here
    damping, correction = 0.0, np.zeros_like(information)
    for _ in range(EVALUATIONS):
        # what the gradient would push through its bound stays there
        free = tuned & ((theta > low) | (gradient > 0.0)) & ((theta < high) | (gradient < 0.0))
        if not any(free.tolist()):
            break
        nugget = likelihood.nugget(theta)
        if nugget < least_nugget:
            break
        least = GAIN + ROUNDING / nugget
        step = _limited(_scoring_step(information + correction, gradient, free, damping))
        if float(gradient @ step) < least:
            # the Fisher information has the last word: a correction from few steps may be wrong elsewhere
            step = _limited(_scoring_step(information, gradient, free, damping))
            if float(gradient @ step) < least:
                break
        trial = np.minimum(np.maximum(theta + step, low), high)
        there = _posterior_expansion(likelihood, trial, priors)
        if there is not None and there[0] > value:
            correction = _corrected(correction, there[2], trial - theta, gradient - there[1])
            theta, damping = trial, damping / 4.0 if damping > 1e-3 else 0.0
            value, gradient, information = there
        else:
            correction = np.zeros_like(information)
            damping = max(4.0 * damping, 0.3 * float(information.diagonal()[free].max()))
    return theta


def _corrected(correction: Array, information: Array, step: Array, fall: Array) -> Array:
    """What to add to the Fisher information ``(p, p)`` for it to explain how the gradient fell along the last step.

    The expected curvature can be several times the true one along a ridge of length scale and amplitude, and scoring
    then converges slowly. This is the update of Broyden, Fletcher, Goldfarb and Shanno on the sum of the two
    (Dennis, Gay and Welsch 1981 do so for least squares). Zero where the gradient did not fall.
    """
    expected = (information + correction) @ step
    told, found = float(step @ expected), float(step @ fall)
    if not found > SMALLEST_FALL * told > 0.0:
        return np.zeros_like(correction)
    return np.asarray(correction + fall[:, None] * (fall / found) - expected[:, None] * (expected / told))


def _limited(step: Array) -> Array:
    """The step, as far as a quadratic in the logarithms can be trusted."""
    longest = max(map(abs, step.tolist()))
    return step if longest <= LONGEST_STEP else step * (LONGEST_STEP / longest)


def _scoring_step(information: Array, gradient: Array, free: NDArray[np.bool_], damping: float) -> Array:
    """The damped step of the free parameters, zero in the others ``(p,)``."""
    everything = all(free.tolist())
    curvature = information.copy() if everything else information[np.ix_(free, free)]
    curvature.reshape(-1)[:: len(curvature) + 1] += damping + 1e-9 * (1.0 + max(curvature.ravel().tolist()))
    # straight to LAPACK: for two or three parameters numpy's checks take longer than the solution
    found, fault = lapack.dgesv(curvature, gradient if everything else gradient[free])[2:]
    if fault != 0:
        raise np.linalg.LinAlgError("Singular matrix")
    if everything:
        return np.asarray(found)
    step = np.zeros_like(gradient)
    step[free] = found
    return step


def likelier(likelihood: Likelihood, first: Array, second: Array, priors: Sequence[LogNormal | None]) -> Array:
    """Whichever log θ has the larger likelihood times priors; the first in a tie."""
    here, there = (_posterior_expansion(likelihood, theta, priors) for theta in (first, second))
    if there is None or (here is not None and here[0] >= there[0]):
        return first
    return second


def _posterior_expansion(
    likelihood: Likelihood, theta: Array, priors: Sequence[LogNormal | None]
) -> tuple[float, Array, Array] | None:
    """Value, gradient and information of likelihood times priors; ``None`` where Ω is not positive definite."""
    try:
        value, gradient, information = likelihood.expand(theta)
    except NotPositiveDefiniteError:
        return None
    for i, prior in enumerate(priors):
        if prior is not None:
            density, slope = prior(theta[i])
            value, gradient[i] = value + density, gradient[i] + slope
            information[i, i] += 1.0 / prior.log_std**2
    return value, gradient, information
