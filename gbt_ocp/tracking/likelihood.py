"""Log likelihood of the pseudo-linear measurements (``like1``), its gradient, and its maximisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack
from scipy.optimize import minimize

from gbt_ocp.tracking.kernels import Kernel
from gbt_ocp.tracking.posterior import NotPositiveDefiniteError, cholesky
from gbt_ocp.tracking.window import Measurements

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LogNormal:
    """A weak prior on a positive hyperparameter: its logarithm is normal.

    Attributes
    ----------
    median
        In the parameter's unit.
    spread
        Standard deviation of the logarithm.
    """

    median: float
    spread: float

    def __call__(self, log_value: float) -> tuple[float, float]:
        """Log density up to a constant, and its derivative."""
        excess = (log_value - np.log(self.median)) / self.spread
        return float(-0.5 * excess**2), float(-excess / self.spread)


class LogLikelihood:
    """``log p(y|t) = -½ (yᵀ Ω⁻¹ y + log det Ω + R log 2π)`` with R = (d-1) N rows, as a function of log θ.

    The paper's ``like1`` has the signs of the last two terms wrong inside its bracket. θ is the kernel's parameters
    followed by the amplitude, all as logarithms.

    Parameters
    ----------
    kernel
        Unit-amplitude covariance.
    measurements
        Rows of the window.
    centre
        Prior mean ``(d,)``.
    nugget
        Variance relative to the amplitude squared.
    """

    def __init__(self, kernel: Kernel, measurements: Measurements, centre: Array, nugget: float) -> None:
        t, h = measurements.times, measurements.directions
        self._kernel = kernel
        self._lag = t[:, None] - t[None, :]
        self._gram = h @ h.T
        self._values = measurements.relative_to(centre)
        self._variances = measurements.variances
        self._nugget = nugget

    def __call__(self, log_theta: Array) -> tuple[float, Array]:
        """Value and gradient by log θ.

        Raises
        ------
        NotPositiveDefiniteError
            If Ω has no Cholesky factor.
        """
        variance = np.exp(2.0 * log_theta[-1])
        k, derivatives = self._kernel.derivatives(self._lag, log_theta[:-1])
        process = variance * self._gram * k
        diagonal = np.arange(len(process))
        process[diagonal, diagonal] += variance * self._nugget
        omega = process.copy()
        omega[diagonal, diagonal] += self._variances
        factor = cholesky(omega)
        weights = lapack.dpotrs(factor, self._values, lower=1)[0]
        value = -0.5 * (self._values @ weights + len(weights) * np.log(2.0 * np.pi)) - np.log(factor.diagonal()).sum()
        inverse = lapack.dpotri(factor, lower=1)[0]
        # dpotri fills one triangle; both count the same in the sums below
        inverse = np.tril(inverse) + np.tril(inverse, -1).T
        # ∂/∂θ log p = ½ tr((α αᵀ - Ω⁻¹) ∂Ω/∂θ)
        sensitivity = np.outer(weights, weights) - inverse
        gradient = [0.5 * variance * np.sum(sensitivity * self._gram * dk) for dk in derivatives]
        gradient.append(np.sum(sensitivity * process))
        return float(value), np.array(gradient)


def maximise(
    likelihood: LogLikelihood,
    start: Array,
    bounds: Sequence[tuple[float, float]],
    priors: Sequence[LogNormal | None],
) -> Array:
    """The log θ that maximises likelihood times priors within bounds, from a start.

    A parameter whose bounds coincide stays fixed. Points at which Ω is not positive definite count as worthless; if
    the start is one, it is returned as it is.
    """

    def negative(log_theta: Array) -> tuple[float, Array]:
        try:
            value, gradient = likelihood(log_theta)
        except NotPositiveDefiniteError:
            return 1e10, np.zeros_like(log_theta)
        for i, prior in enumerate(priors):
            if prior is not None:
                density, slope = prior(log_theta[i])
                value, gradient[i] = value + density, gradient[i] + slope
        return -value, -gradient

    found = minimize(negative, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 30})
    return np.asarray(found.x) if np.isfinite(found.fun) and found.fun < 1e10 else start
