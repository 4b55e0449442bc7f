"""Probabilistic bounds on the tracking error that depend on the bearings (theorem 1: ``eq19``, ``eq20``)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import chi2

Array = NDArray[np.float64]


def confidence_radius(dimension: int, delta: float, count: int) -> float:
    """``β(δ)``: root of the ``1 - δ/|T_k|`` quantile of χ² with d degrees of freedom.

    Parameters
    ----------
    dimension, delta, count
        d, δ in (0, 1], and the number of times in T_k for which the bound shall hold at once.
    """
    return float(np.sqrt(chi2.ppf(1.0 - delta / count, dimension)))


def bearing_bound(
    covariances: ArrayLike, variance: float, bearing_matrix: ArrayLike, *, delta: float, noise_variance: float = 0.0
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

    Returns
    -------
    Bounds ``(n+1,)`` in metres; while P is singular they are those of the prior, β √k.
    """
    k = np.asarray(covariances, dtype=float)
    values = np.linalg.eigvalsh(np.asarray(bearing_matrix, dtype=float))
    dimension = len(values)
    least = values[0] if values[0] > values[-1] * dimension * np.finfo(float).eps else 0.0
    # multiplied through by λ_min, so that a singular P gives no reduction instead of a division by zero
    denominator = np.sqrt(dimension / (dimension - 1.0)) * variance * values[-1] + noise_variance
    reduction = np.min(k * k, axis=1) * least / denominator if k.shape[1] else np.zeros(len(k))
    radius = confidence_radius(dimension, delta, len(k))
    return np.asarray(radius * np.sqrt(np.maximum(variance - reduction, 0.0)))
