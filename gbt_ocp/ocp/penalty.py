"""The penalty of the paper: a smoothed hinge integrated by the trapezoidal rule (``eq34``, ``eq35``)."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def smoothed_hinge(x: Any, width: Any) -> Any:
    """g(x): zero below -ϖ, x above ϖ, ``(x + ϖ)²/(4ϖ)`` between; continuously differentiable.

    The paper prints ``(x - ϖ)²/(4ϖ)``, which jumps at both ends. Works on numbers and on CasADi expressions.
    """
    clipped = ca.fmin(ca.fmax(x, -width), width)
    return (clipped + width) ** 2 / (4.0 * width) + ca.fmax(x - width, 0.0)


def trapezoid_weights(intervals: int) -> Array:
    """ω_0 … ω_{n_c} = (1/2, 1, …, 1, 1/2) ``(n_c+1,)``."""
    weights = np.ones(intervals + 1)
    weights[[0, -1]] = 0.5
    return weights


def continuation(width: float, weight: float) -> list[tuple[float, float]]:
    """Stages (ϖ, w_p) that lead from an easy penalty to the one asked for, each solved from the last one's solution.

    At ϖ = 0.01 and w_p = 1000 they are (0.5, 10), (0.1, 100), (0.01, 1000).
    """
    return [(50.0 * width, weight / 100.0), (10.0 * width, weight / 10.0), (width, weight)]
