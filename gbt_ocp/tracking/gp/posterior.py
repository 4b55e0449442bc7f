"""Posterior of a Gaussian process observed through linear measurements (``eq14`` to ``eq17``).

By Cholesky; of the squared exponential with a nugget that is tuned, by a :mod:`~gbt_ocp.tracking.gp.root`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from scipy.linalg import lapack

from gbt_ocp.tracking.gp.kernels import Kernel
from gbt_ocp.tracking.gp.root import Root, root_of
from gbt_ocp.tracking.linalg import NotPositiveDefiniteError, cholesky
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.tracking.window import Measurements
from gbt_ocp.typing import Array

SMALLEST_NUGGET = 1.0e-17
LARGEST_NUGGET = 1.0e-2


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


class Conditional:
    """A Gaussian process of the target's position, conditioned on linear measurements.

    What the process is, a subclass says by :attr:`prior_covariance` and :meth:`_cross`.

    Parameters
    ----------
    measurements
        What was measured.
    centre
        Prior mean ``(d,)``.
    process
        Prior covariance of the rows of the measurements ``(R, R)`` in m², or the root of the process, conditioned
        already: it answers in the place of the factor.
    noise
        Variance of each row on top of its own, in m².

    Raises
    ------
    NotPositiveDefiniteError
        If Ω_yy has no Cholesky factor; see :func:`with_raised_nugget`.
    """

    def __init__(self, measurements: Measurements, centre: Array, process: Array | Root, noise: float) -> None:
        self._data = measurements
        self.noise = noise
        self._centre = centre
        self._root = process if isinstance(process, Root) else None
        if isinstance(process, Root):
            return
        omega = process
        omega[np.diag_indices_from(omega)] += noise + measurements.variances
        # LAPACK wants at least one row; one that no direction enters leaves the prior as it is
        if not len(measurements.times):
            self._data = Measurements(np.zeros(1), np.zeros((1, len(centre))), np.zeros(1), np.ones(1))
            omega = np.ones((1, 1))
        self._factor = cholesky(omega)
        self._weights = lapack.dpotrs(self._factor, self._data.relative_to(centre), lower=1)[0]

    @property
    def prior_covariance(self) -> Array:
        """Prior covariance of the position at any time ``(d, d)`` in m²."""
        raise NotImplementedError

    def _cross(self, times: Array) -> Array:
        """Ω*_yP: rows of measurements against each coordinate at each time ``(R, K, d)``."""
        raise NotImplementedError

    def _among(self, times: Array) -> Array:
        """Prior covariance of the positions at the times ``(K, d, K, d)``."""
        raise NotImplementedError

    def joint_covariance(self, times: Array) -> Array:
        """Posterior covariance of the positions at the times with each other ``(K, d, K, d)`` in m²."""
        if self._root is not None:
            return self._root.joint_covariance(times)
        cross = self._cross(times)
        rows, count, dimension = cross.shape
        solved = lapack.dtrtrs(self._factor, cross.reshape(rows, -1), lower=1)[0]
        shared = (solved.T @ solved).reshape(count, dimension, count, dimension)
        return np.asarray(self._among(times) - shared)

    def predict(self, times: Array) -> Forecast:
        """μ ``(K, d)`` and Σ ``(K, d, d)`` at the times ``(K,)`` (``eq16``, ``eq17``)."""
        if self._root is not None:
            return self._root.predict(times)
        cross = self._cross(times)
        rows, count, dimension = cross.shape
        mean = self._centre + np.tensordot(self._weights, cross, axes=1)
        solved = lapack.dtrtrs(self._factor, cross.reshape(rows, -1), lower=1)[0].reshape(rows, count, dimension)
        covariance = self.prior_covariance - np.einsum("rki,rkj->kij", solved, solved)
        return Forecast(mean, covariance)


class Posterior(Conditional):
    """Conditions ``P_T(t) ~ GP(centre, a² k I)`` on measurements.

    Parameters
    ----------
    kernel, hyperparameters
        The prior.
    measurements
        What was measured.
    centre
        Prior mean ``(d,)``.
    rounding
        The part of the nugget that stands for the rounding of Ω_yy, which the root of a process does not have.

    Raises
    ------
    NotPositiveDefiniteError
        If Ω_yy has no Cholesky factor; see :func:`condition`.
    """

    def __init__(
        self,
        kernel: Kernel,
        hyperparameters: Hyperparameters,
        measurements: Measurements,
        centre: Array,
        rounding: float = 0.0,
    ) -> None:
        self._kernel = kernel
        self._theta = hyperparameters
        self._variance = np.exp(2.0 * hyperparameters.log_amplitude)
        t, h = measurements.times, measurements.directions
        weights = np.eye(len(centre)) * hyperparameters.amplitude
        scales = np.full(len(centre), hyperparameters.length_scale)
        process: Array | Root | None = root_of(
            [kernel], measurements, centre, scales, weights, hyperparameters.nugget, rounding
        )
        if process is None:
            process = self._variance * (kernel(t[:, None] - t[None, :], hyperparameters.log_kernel) * (h @ h.T))
        super().__init__(measurements, centre, process, self._variance * hyperparameters.nugget)

    @property
    def hyperparameters(self) -> Hyperparameters:
        """θ with the nugget that was needed."""
        return self._theta

    @property
    def prior_covariance(self) -> Array:
        """``a² I`` ``(d, d)`` in m²."""
        return np.asarray(self._variance * np.eye(len(self._centre)))

    def _among(self, times: Array) -> Array:
        k = self._variance * self._kernel(times[:, None] - times[None, :], self._theta.log_kernel)
        return np.asarray(k[:, None, :, None] * np.eye(len(self._centre))[None, :, None, :])

    def _cross(self, times: Array) -> Array:
        k = self._variance * self._kernel(self._data.times[:, None] - times[None, :], self._theta.log_kernel)
        return np.asarray(k[:, :, None] * self._data.directions[:, None, :])


AnyPosterior = TypeVar("AnyPosterior", bound=Conditional)


def condition(
    kernel: Kernel,
    hyperparameters: Hyperparameters,
    measurements: Measurements,
    centre: Array,
    rounding: float = 0.0,
) -> tuple[Posterior, int]:
    """The posterior, with the nugget multiplied by ten as often as the Cholesky factorisation needs.

    ``rounding`` is as of :class:`Posterior`.

    Returns
    -------
    The posterior, and how often the nugget had to be raised.
    """
    return with_raised_nugget(
        lambda nugget: Posterior(kernel, replace(hyperparameters, nugget=nugget), measurements, centre, rounding),
        hyperparameters.nugget,
    )


def with_raised_nugget(posterior: Callable[[float], AnyPosterior], nugget: float) -> tuple[AnyPosterior, int]:
    """The posterior as a function of the nugget, at the first of ``nugget · 10^j`` with which it can be computed."""
    retries = 0
    while True:
        try:
            return posterior(nugget), retries
        except NotPositiveDefiniteError:
            # The process has a positive semidefinite matrix with mean diagonal about a²: a per cent always suffices.
            if nugget >= LARGEST_NUGGET:
                raise
            nugget, retries = raised(nugget), retries + 1


def raised(nugget: float) -> float:
    """The next nugget to try, of one with which there is no posterior."""
    return min(10.0 * max(nugget, SMALLEST_NUGGET), LARGEST_NUGGET)
