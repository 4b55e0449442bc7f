"""Covariance functions of how far a coordinate of the target has moved since a reference time.

A tracker of noisy bearings splits the target's motion into its position at a reference time and its displacement since,
``P_T(t) = p_0 + D(t)`` with D(0) = 0 and times relative to the reference. Two sorts of process give D:

- the integral of a Gaussian-process velocity with covariance k_v (class :class:`IntegratedKernel`). With ``F'' = k_v``
  and ``F(0) = F'(0) = 0``, integrating k_v twice gives ``cov(D(t), D(t')) = F(t) + F(t') - F(t - t')``;
- a stationary position (class :class:`PinnedKernel`), whose displacement has covariance
  ``k(t - t') - k(t) - k(t') + 1``.

Both are of unit scale: of 1 m/s standard deviation of the velocity, and of 1 m of the position.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.special import erf

from gbt_ocp.tracking.gp.kernels import KERNELS, Kernel, matern32, ornstein_uhlenbeck, squared_exponential
from gbt_ocp.typing import Array


class DisplacementKernel(Protocol):
    """Covariance of the displacement since time zero, of unit scale."""

    def __call__(self, times: Array, others: Array, log_length: float) -> Array:
        """``cov(D(t), D(t'))`` ``(N, M)`` at the times ``(N,)`` and ``(M,)`` in s, length scale exp(``log_length``)."""

    def variance(self, times: Array, log_length: float) -> Array:
        """Its diagonal, ``(N,)``."""


class IntegratedKernel:
    """Displacement under a velocity that is a stationary Gaussian process of unit variance."""

    def velocity(self, lag: Array, log_length: float) -> Array:
        """k_v at the lags (any shape, in s)."""
        raise NotImplementedError

    def twice_integrated(self, lag: Array, log_length: float) -> Array:
        """F at the lags (any shape, in s), in s²: half the variance of the displacement over the lag."""
        raise NotImplementedError

    def __call__(self, times: Array, others: Array, log_length: float) -> Array:
        """``F(t) + F(t') - F(t - t')``, in s²."""
        first, second = (self.twice_integrated(t, log_length) for t in (times, others))
        return np.asarray(
            first[:, None] + second[None, :] - self.twice_integrated(times[:, None] - others[None, :], log_length)
        )

    def variance(self, times: Array, log_length: float) -> Array:
        """``2 F(t)``, in s²."""
        return 2.0 * self.twice_integrated(times, log_length)


class VelocitySquaredExponential(IntegratedKernel):
    """``k_v = exp(-a²/2)``, ``F = l² (√(π/2) a erf(a/√2) + exp(-a²/2) - 1)`` with a = t/l: smooth velocities."""

    def velocity(self, lag: Array, log_length: float) -> Array:
        """k_v at the lags."""
        return squared_exponential(lag * np.exp(-log_length))

    def twice_integrated(self, lag: Array, log_length: float) -> Array:
        """F at the lags."""
        a = lag * np.exp(-log_length)
        value = np.sqrt(0.5 * np.pi) * a * erf(a * np.sqrt(0.5)) + np.expm1(-0.5 * a * a)
        return np.asarray(np.exp(2.0 * log_length) * value)


class VelocityMatern32(IntegratedKernel):
    """``k_v = (1 + a) exp(-a)``, ``F = l²/3 (2a - 3 + (3 + a) exp(-a))`` with a = √3|t|/l: continuous accelerations."""

    def velocity(self, lag: Array, log_length: float) -> Array:
        """k_v at the lags."""
        return matern32(lag * np.exp(-log_length))

    def twice_integrated(self, lag: Array, log_length: float) -> Array:
        """F at the lags."""
        a = np.sqrt(3.0) * np.abs(lag) * np.exp(-log_length)
        return np.asarray(np.exp(2.0 * log_length) / 3.0 * (2.0 * a + 3.0 * np.expm1(-a) + a * np.exp(-a)))


class VelocityOrnsteinUhlenbeck(IntegratedKernel):
    """``k_v = exp(-a)``, ``F = l² (a + exp(-a) - 1)`` with a = |t|/l: velocities that are continuous and no more."""

    def velocity(self, lag: Array, log_length: float) -> Array:
        """k_v at the lags."""
        return ornstein_uhlenbeck(lag * np.exp(-log_length))

    def twice_integrated(self, lag: Array, log_length: float) -> Array:
        """F at the lags."""
        a = np.abs(lag) * np.exp(-log_length)
        return np.asarray(np.exp(2.0 * log_length) * (a + np.expm1(-a)))


class PinnedKernel:
    """Displacement under a position that is a stationary Gaussian process of unit variance.

    Parameters
    ----------
    kernel
        k, with the length scale for its only parameter.
    """

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel

    def __call__(self, times: Array, others: Array, log_length: float) -> Array:
        """``k(t - t') - k(t) - k(t') + 1``."""
        parameters = np.array([log_length])
        first, second = (self._kernel(t, parameters) for t in (times, others))
        return np.asarray(self._kernel(times[:, None] - others[None, :], parameters) - first[:, None] - second + 1.0)

    def variance(self, times: Array, log_length: float) -> Array:
        """``2 (1 - k(t))``."""
        return np.asarray(2.0 * (1.0 - self._kernel(times, np.array([log_length]))))


VELOCITY_KERNELS: dict[str, IntegratedKernel] = {
    "velocity_se": VelocitySquaredExponential(),
    "velocity_matern32": VelocityMatern32(),
    "velocity_ou": VelocityOrnsteinUhlenbeck(),
}
"""Kernels of the velocity by their names in a configuration."""

DISPLACEMENT_KERNELS: dict[str, DisplacementKernel] = {
    **VELOCITY_KERNELS,
    **{name: PinnedKernel(kernel) for name, kernel in KERNELS.items() if len(kernel.names) == 1},
}
"""All kernels with a length scale and no other parameter."""
