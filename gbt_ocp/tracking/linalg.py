"""Symmetric matrices: Cholesky factors, solutions and inverses, directly by LAPACK.

numpy solves and inverts by a general factorisation, which takes twice the operations and several times the time.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from gbt_ocp.typing import Array


def symmetric(matrix: Array) -> Array:
    """Mean of the matrices ``(..., n, n)`` and their transposes."""
    return np.asarray(0.5 * (matrix + np.swapaxes(matrix, -1, -2)))


def cholesky_factors(matrices: Array) -> Array:
    """Upper factors U with ``UᵀU`` the matrices ``(B, n, n)``, which are overwritten by them.

    Raises
    ------
    numpy.linalg.LinAlgError
        If one of the matrices is not positive definite.
    """
    for matrix in matrices:
        # LAPACK counts columns first: it sees the transpose, and works in place
        factor, fault = lapack.dpotrf(matrix.T, lower=1, clean=1, overwrite_a=1)
        if fault != 0:
            raise np.linalg.LinAlgError("Matrix is not positive definite")
        if not np.shares_memory(factor, matrix):
            matrix.T[:] = factor
    return matrices


def solutions(factors: Array, values: Array) -> Array:
    """Solutions ``(B, n)`` of the matrices whose factors are given, for the right-hand sides ``(B, n)``."""
    return np.array([lapack.dpotrs(factor.T, value, lower=1)[0] for factor, value in zip(factors, values, strict=True)])


def inverses(factors: Array) -> Array:
    """Inverses ``(B, n, n)`` of the matrices whose factors are given."""
    half = np.array([lapack.dpotri(factor.T, lower=1)[0].T for factor in factors])
    # LAPACK fills one triangle; the other one of a factor is zero
    whole = half + np.swapaxes(half, 1, 2)
    diagonal = np.arange(half.shape[1])
    whole[:, diagonal, diagonal] *= 0.5
    return np.asarray(whole)


class NotPositiveDefiniteError(ArithmeticError):
    """A covariance matrix has no Cholesky factor in floating point."""


def cholesky(matrix: Array) -> Array:
    """Lower Cholesky factor; raises :class:`NotPositiveDefiniteError` where there is none."""
    factor, fault = lapack.dpotrf(matrix, lower=1, clean=1)
    if fault != 0 or not np.isfinite(factor[-1, -1]):
        raise NotPositiveDefiniteError
    return np.asarray(factor)
