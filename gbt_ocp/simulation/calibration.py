"""Whether errors are as large as a posterior says: squared errors in units of its covariance, and its regions."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbt_ocp.tracking.gp.bounds import confidence_radius
from gbt_ocp.typing import Array

CONFIDENCE = 0.95
"""Probability of the regions that are drawn and whose coverage is counted."""


def squared_errors(error: ArrayLike, covariance: ArrayLike) -> Array:
    """Normalised estimation error squared (NEES), ``eᵀ Σ⁻¹ e``: χ² with d degrees of freedom if calibrated.

    Parameters
    ----------
    error, covariance
        e ``(..., d)`` in m and Σ ``(..., d, d)`` in m².

    Returns
    -------
    ``(...)``; NaN where either is not finite. Eigenvalues of Σ below its round-off count as that round-off, so an
    error that a singular Σ rules out is very large or infinite.
    """
    e, sigma = np.asarray(error, dtype=float), np.asarray(covariance, dtype=float)
    known = np.isfinite(sigma).all(axis=(-2, -1)) & np.isfinite(e).all(axis=-1)
    values, axes = np.linalg.eigh(np.where(known[..., None, None], sigma, np.eye(sigma.shape[-1])))
    floor = np.finfo(float).eps * np.maximum(values[..., -1:], np.finfo(float).tiny)
    turned = np.einsum("...ji,...j->...i", axes, np.where(known[..., None], e, 0.0))
    with np.errstate(over="ignore"):
        squared = np.sum(turned**2 / np.maximum(values, floor), axis=-1)
    return np.asarray(np.where(known, squared, np.nan))


def region_radius(dimension: int, probability: float = CONFIDENCE) -> float:
    """Square root of the NEES inside which a normal error of this dimension lies with this probability."""
    return confidence_radius(dimension, 1.0 - probability, 1)


def within(squared: ArrayLike, dimension: int, probability: float = CONFIDENCE) -> NDArray[np.bool_]:
    """Whether each of :func:`squared_errors` lies inside the region of this probability; NaN does not."""
    return np.asarray(np.asarray(squared, dtype=float) <= region_radius(dimension, probability) ** 2)
