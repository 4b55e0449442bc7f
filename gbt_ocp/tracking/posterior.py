"""Posterior of a Gaussian process observed through linear measurements (``eq14`` to ``eq17``), by Cholesky."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from gbt_ocp.tracking.kernels import Kernel
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.tracking.window import Measurements

Array = NDArray[np.float64]

SMALLEST_NUGGET = 1.0e-17
LARGEST_NUGGET = 1.0e-2


class NotPositiveDefiniteError(ArithmeticError):
    """A covariance matrix has no Cholesky factor in floating point."""


def cholesky(matrix: Array) -> Array:
    """Lower Cholesky factor; raises :class:`NotPositiveDefiniteError` where there is none."""
    factor, fault = lapack.dpotrf(matrix, lower=1, clean=1)
    if fault != 0 or not np.isfinite(factor[-1, -1]):
        raise NotPositiveDefiniteError
    return np.asarray(factor)


@dataclass(frozen=True)
class Hyperparameters:
    """θ: the kernel's parameters and what belongs to the process.

    Attributes
    ----------
    log_kernel
        Logarithms of the kernel's parameters; the first is that of the length scale l in seconds.
    log_amplitude
        Logarithm of the process's standard deviation in metres.
    nugget
        Variance of a measurement relative to the amplitude squared.
    """

    log_kernel: Array
    log_amplitude: float
    nugget: float

    @property
    def length_scale(self) -> float:
        """l in seconds."""
        return float(np.exp(self.log_kernel[0]))

    @property
    def amplitude(self) -> float:
        """Standard deviation of a coordinate in metres."""
        return float(np.exp(self.log_amplitude))


class Posterior:
    """Conditions ``P_T(t) ~ GP(centre, a² k I)`` on measurements.

    Parameters
    ----------
    kernel, hyperparameters
        The prior.
    measurements
        What was measured.
    centre
        Prior mean ``(d,)``.

    Raises
    ------
    NotPositiveDefiniteError
        If Ω_yy has no Cholesky factor; see :func:`condition`.
    """

    def __init__(
        self, kernel: Kernel, hyperparameters: Hyperparameters, measurements: Measurements, centre: Array
    ) -> None:
        self._kernel = kernel
        self._theta = hyperparameters
        self._data = measurements
        self._centre = centre
        variance = np.exp(2.0 * hyperparameters.log_amplitude)
        t, h = measurements.times, measurements.directions
        omega = variance * (kernel(t[:, None] - t[None, :], hyperparameters.log_kernel) * (h @ h.T))
        omega[np.diag_indices_from(omega)] += variance * hyperparameters.nugget + measurements.variances
        # LAPACK wants at least one row; one that no direction enters leaves the prior as it is
        if not len(t):
            self._data = Measurements(np.zeros(1), np.zeros((1, len(centre))), np.zeros(1), np.ones(1))
            omega = np.ones((1, 1))
        self._factor = cholesky(omega)
        self._weights = lapack.dpotrs(self._factor, self._data.relative_to(centre), lower=1)[0]

    @property
    def hyperparameters(self) -> Hyperparameters:
        """θ with the nugget that was needed."""
        return self._theta

    def predict(self, times: Array) -> Forecast:
        """μ ``(K, d)`` and Σ ``(K, d, d)`` at the times ``(K,)`` (``eq16``, ``eq17``)."""
        variance = np.exp(2.0 * self._theta.log_amplitude)
        data = self._data
        k = variance * self._kernel(data.times[:, None] - times[None, :], self._theta.log_kernel)
        # Ω*_yP: rows of measurements against each coordinate at each time
        cross = k[:, :, None] * data.directions[:, None, :]
        rows, count, dimension = cross.shape
        mean = self._centre + np.tensordot(self._weights, cross, axes=1)
        solved = lapack.dtrtrs(self._factor, cross.reshape(rows, -1), lower=1)[0].reshape(rows, count, dimension)
        covariance = variance * np.eye(dimension) - np.einsum("rki,rkj->kij", solved, solved)
        return Forecast(mean, covariance)


def condition(
    kernel: Kernel, hyperparameters: Hyperparameters, measurements: Measurements, centre: Array
) -> tuple[Posterior, int]:
    """The posterior, with the nugget multiplied by ten as often as the Cholesky factorisation needs.

    Returns
    -------
    The posterior, and how often the nugget had to be raised.
    """
    nugget, retries = hyperparameters.nugget, 0
    while True:
        theta = Hyperparameters(hyperparameters.log_kernel, hyperparameters.log_amplitude, nugget)
        try:
            return Posterior(kernel, theta, measurements, centre), retries
        except NotPositiveDefiniteError:
            # K∘HHᵀ is a positive semidefinite matrix with diagonal a²: a nugget of a per cent always suffices.
            if nugget >= LARGEST_NUGGET:
                raise
            nugget, retries = min(10.0 * max(nugget, SMALLEST_NUGGET), LARGEST_NUGGET), retries + 1
