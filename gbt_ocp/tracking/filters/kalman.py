"""The measurement update of a Kalman filter, for one mode or several at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gbt_ocp.tracking.linalg import symmetric
from gbt_ocp.typing import Array


class Update(NamedTuple):
    """A Gaussian after a measurement; leading axes run over modes.

    Attributes
    ----------
    mean
        ``(..., n)``.
    covariance
        ``(..., n, n)``, symmetric.
    log_likelihood
        Logarithm of the measurement's density before it was known ``(...)``.
    innovation_covariance
        S ``(..., k, k)``.
    """

    mean: Array
    covariance: Array
    log_likelihood: Array
    innovation_covariance: Array


def predicted(mean: Array, covariance: Array, transition: Array, noise: Array) -> tuple[Array, Array]:
    """Mean ``(..., n)`` and covariance ``(..., n, n)`` after a step with transition and noise ``(..., n, n)``."""
    moved = transition @ covariance @ np.swapaxes(transition, -1, -2) + noise
    return np.asarray((transition @ mean[..., None])[..., 0]), symmetric(moved)


def updated(mean: Array, covariance: Array, observation: Array, noise: Array, value: Array) -> Update:
    """Condition on ``value = H x + noise``.

    Joseph's form, of a square root of the covariance, keeps it positive semidefinite whatever the round-off: also where
    a gap of years has made it 1e25 m².

    Parameters
    ----------
    mean, covariance
        ``(..., n)`` and ``(..., n, n)``.
    observation
        H ``(..., k, n)``.
    noise
        R ``(..., k, k)``.
    value
        ``(..., k)``.
    """
    innovation = value - (observation @ mean[..., None])[..., 0]
    cross = observation @ covariance
    spread = symmetric(cross @ np.swapaxes(observation, -1, -2) + noise)
    gain = np.swapaxes(np.linalg.solve(spread, cross), -1, -2)
    kept = np.eye(mean.shape[-1]) - gain @ observation
    root = kept @ _covariance_root(covariance)
    after = root @ np.swapaxes(root, -1, -2) + gain @ noise @ np.swapaxes(gain, -1, -2)
    whitened = np.linalg.solve(spread, innovation[..., None])[..., 0]
    _, log_determinant = np.linalg.slogdet(spread)
    log_likelihood = -0.5 * (
        np.sum(innovation * whitened, axis=-1) + log_determinant + innovation.shape[-1] * np.log(2.0 * np.pi)
    )
    return Update(mean + (gain @ innovation[..., None])[..., 0], symmetric(after), log_likelihood, spread)


def _covariance_root(covariance: Array) -> Array:
    """L with ``L Lᵀ`` the covariance ``(..., n, n)``, whose negative eigenvalues are taken for round-off."""
    try:
        return np.asarray(np.linalg.cholesky(covariance))
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(covariance)
        return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :])
