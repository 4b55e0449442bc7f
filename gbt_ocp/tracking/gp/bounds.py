"""Probabilistic bounds on the tracking error (lemma 1, theorems 1 and 2 of the paper).

Lemma 1 bounds the error by the posterior covariance (``eqA1``). The theorems replace the covariance by what the
bearings and the prior alone say: theorem 1 (``eq19``, ``eq20``) for one kernel on all axes, theorem 2
(``eqnew_bound``, ``eqnew_sigma``) for a coregionalised process. All hold for every t_i in T_k at once with probability
``1 - δ``, given that the target is a draw of the prior. Theorem 2 as printed does not hold for every process
(docs/theory.md has counter-examples); :func:`weighted_bearing_bound` is what its proof does show.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import gammaincinv

from gbt_ocp.models.bearings import cumulative_bearing_matrix
from gbt_ocp.typing import Array


@lru_cache(maxsize=64)
def confidence_radius(dimension: int, delta: float, count: int) -> float:
    """``β(δ)``: root of the ``1 - δ/|T_k|`` quantile of χ² with d degrees of freedom.

    Parameters
    ----------
    dimension, delta, count
        d, δ in (0, 1], and the number of times in T_k for which the bound shall hold at once.
    """
    # the quantile of χ² with d degrees of freedom; scipy.stats has it too, and takes a second to import
    return float(np.sqrt(2.0 * gammaincinv(0.5 * dimension, 1.0 - delta / count)))


def posterior_bound(covariance: ArrayLike, *, delta: float) -> Array:
    """Bound ``β(δ) √‖Σ_k(t_i)‖`` of lemma 1 (``eqA1``), the tightest of those in this module.

    Parameters
    ----------
    covariance
        Σ_k at the times of T_k ``(..., n+1, d, d)`` in m².
    delta
        δ in (0, 1].

    Returns
    -------
    Bounds ``(..., n+1)`` in metres; NaN where the covariance is.
    """
    sigma = np.asarray(covariance, dtype=float)
    known = np.isfinite(sigma).all(axis=(-2, -1))
    largest = np.linalg.eigvalsh(np.where(known[..., None, None], sigma, 0.0))[..., -1]
    radius = confidence_radius(sigma.shape[-1], delta, sigma.shape[-3])
    return np.where(known, radius * np.sqrt(np.maximum(largest, 0.0)), np.nan)


def bearing_bound(
    covariances: ArrayLike,
    variance: float,
    bearing_matrix: ArrayLike,
    *,
    delta: float,
    noise_variance: float = 0.0,
    constant: float | None = None,
) -> Array:
    """Bound ``β(δ) σ̄_k(t_i)`` on the error at every t_i in T_k at once, with probability ``1 - δ`` (theorem 1).

    ``σ̄² = k(t_i,t_i) - min k²(t_i,t) / (√(d/(d-1)) max k(t,t) cond(P) + σ_n²/λ_min(P))``. The last term of the
    denominator is not in the paper, whose design is noise-free; it vanishes with the nugget.

    Parameters
    ----------
    covariances
        k(t_i, t) between the times of T_k and of the window ``(n+1, N)`` in m².
    variance
        k(t, t) in m², the same at every time for a stationary kernel.
    bearing_matrix
        P_{c:k} ``(d, d)``.
    delta
        δ in (0, 1].
    noise_variance
        σ_n² in m².
    constant
        In place of the printed ``√(d/(d-1))``; 1 holds too, and is tighter: Ω is the Schur product of the kernel's
        matrix with ``λ̄_iᵀ λ̄_j``, whose norm is at most the largest diagonal entry of the one times the norm of the
        other, which is λ_max(P) (Schur 1911; docs/theory.md has the proof).

    Returns
    -------
    Bounds ``(n+1,)`` in metres; while P is singular they are those of the prior, β √k.
    """
    k = np.asarray(covariances, dtype=float)
    least, largest = _extreme_eigenvalues(np.asarray(bearing_matrix, dtype=float))
    dimension = np.shape(bearing_matrix)[0]
    factor = np.sqrt(dimension / (dimension - 1.0)) if constant is None else constant
    # multiplied through by λ_min, so that a singular P gives no reduction instead of a division by zero
    denominator = factor * variance * largest + noise_variance
    reduction = np.min(k * k, axis=1) * least / denominator if k.shape[1] else np.zeros(len(k))
    radius = confidence_radius(dimension, delta, len(k))
    return np.asarray(radius * np.sqrt(np.maximum(variance - reduction, 0.0)))


def coregionalized_bound(
    covariances: ArrayLike,
    prior: ArrayLike,
    bearings: ArrayLike,
    *,
    delta: float,
    noise_variance: float = 0.0,
    constant: float | None = None,
) -> Array:
    """Bound ``β(δ) σ̄_k(t_i)`` of theorem 2 as printed (``eqnew_bound``, ``eqnew_sigma``), for a coregionalised process.

    ``σ̄² = ‖k_f(t_i,t_i)‖ - min λ_min(k_f(t_i,t))² / ((d/(d-1))^¾ max ‖k_f(t,t)‖ cond(P) + σ_n²/λ_min(P))``. Proven
    where all latent functions have the same kernel; otherwise a posterior can exceed it, see
    :func:`weighted_bearing_bound`.

    Parameters
    ----------
    covariances
        k_f(t_i, t) between the times of T_k and of the window ``(n+1, N, d, d)`` in m², symmetric matrices.
    prior
        k_f(t, t) ``(d, d)`` in m², the same at every time for stationary kernels.
    bearings
        λ of the window ``(N, d)``.
    delta
        δ in (0, 1].
    noise_variance
        σ_n² in m².
    constant
        In place of the printed ``(d/(d-1))^¾``; the norm of Ω needs ``d/(d-1)`` for some kernels.

    Returns
    -------
    Bounds ``(n+1,)`` in metres; while P is singular they are those of the prior, β √‖k_f‖.
    """
    cross, own = np.asarray(covariances, dtype=float), np.asarray(prior, dtype=float)
    dimension, norm = len(own), np.linalg.norm(own, 2)
    reduction = np.zeros(len(cross))
    if cross.shape[1]:
        least, largest = _extreme_eigenvalues(cumulative_bearing_matrix(bearings))
        factor = (dimension / (dimension - 1.0)) ** 0.75 if constant is None else constant
        # the smallest by size: where a kernel is negative, λ_min squared would not be the smallest square
        smallest = np.min(np.linalg.eigvalsh(cross) ** 2, axis=(1, 2))
        reduction = smallest * least / (factor * norm * largest + noise_variance)
    radius = confidence_radius(dimension, delta, len(cross))
    return np.asarray(radius * np.sqrt(np.maximum(norm - reduction, 0.0)))


def weighted_bearing_bound(
    covariances: ArrayLike,
    prior: ArrayLike,
    bearings: ArrayLike,
    *,
    delta: float,
    noise_variance: float = 0.0,
) -> Array:
    """Bound on the error of a coregionalised process that holds for all kernels and weights, unlike theorem 2.

    ``Σ_k(t_i) ≤ k_f(t_i,t_i) - Σ_j k_f(t_i,t_j) P(t_j) k_f(t_i,t_j)ᵀ / (N ‖k_f(t,t)‖ + σ_n²)``, the matrix inequality
    that the proof of theorem 2 starts from (``eqA8``), with each bearing weighted by the prior covariance *before* the
    smallest eigenvalue is taken: ``eqB4`` takes it of the sum of P(t_j) alone, which is no lower bound, because
    k_f(t_i,t_j) turns each bearing's plane by its own angle.

    Parameters
    ----------
    covariances, prior, bearings, delta, noise_variance
        As of :func:`coregionalized_bound`.

    Returns
    -------
    Bounds ``(n+1,)`` in metres.
    """
    cross, own = np.asarray(covariances, dtype=float), np.asarray(prior, dtype=float)
    sigma = np.broadcast_to(own, (len(cross), *own.shape))
    if cross.shape[1]:
        b = np.asarray(bearings, dtype=float)
        planes = np.eye(len(own)) - b[:, :, None] * b[:, None, :]
        weighted = np.einsum("ijab,jbc,ijdc->iad", cross, planes, cross, optimize=True)
        sigma = sigma - weighted / (len(b) * np.linalg.norm(own, 2) + noise_variance)
    return posterior_bound(sigma, delta=delta)


def _extreme_eigenvalues(matrix: Array) -> tuple[float, float]:
    """λ_min and λ_max of a positive semidefinite matrix; λ_min is zero where it is round-off."""
    values = np.linalg.eigvalsh(matrix)
    least = values[0] if values[0] > values[-1] * len(values) * np.finfo(float).eps else 0.0
    return float(least), float(values[-1])
