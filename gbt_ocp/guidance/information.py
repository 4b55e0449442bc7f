"""Objectives that couple the endpoints: what all bearings together, past and planned, say about the target.

The Fisher information of bearings with equal noise about the position of a target whose motion is otherwise known is
``Σ (I - λ λᵀ)/(σ r)²`` (Bishop et al., "Optimality analysis of sensor-target localization geometries", Automatica 46
(2010)). Here it is counted in units of one bearing at a reference range ρ, so that σ drops out, and a bearing at every
endpoint of the plan.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca
import numpy as np

from gbt_ocp.guidance.objectives import NEAR
from gbt_ocp.guidance.others import lines_of_others
from gbt_ocp.models.sizes import positive
from gbt_ocp.ocp.terms import Moments, needed
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.typing import Array

Criterion = Literal["logdet", "trace", "min_eigenvalue", "condition_number"]

CRITERIA: tuple[Criterion, ...] = ("logdet", "trace", "min_eigenvalue", "condition_number")

SOFTENING = 0.1
"""Range below which a bearing counts no more, as a share of the reference."""

FLOOR = 1.0e-3
"""Added to the information on every axis, in planned bearings: a plan with a single direction has no determinant."""

POWER = 16
"""Order of the Schatten norms that stand for the extreme eigenvalues; a power of two."""


def power(matrix: Any, exponent: int) -> Any:
    """A CasADi matrix to a power of two, by squaring."""
    while exponent > 1:
        matrix, exponent = ca.mtimes(matrix, matrix), exponent // 2
    return matrix


def packed(matrix: Any) -> Any:
    """Lower triangle of a symmetric matrix ``(n, n)`` as a CasADi column, row by row."""
    return ca.vertcat(*(matrix[row, column] for row in range(matrix.shape[0]) for column in range(row + 1)))


def unpacked(entries: Any) -> Any:
    """The symmetric matrix of a lower triangle ``(n (n+1)/2,)``."""
    size = math.isqrt(2 * entries.shape[0])
    first = [row * (row + 1) // 2 for row in range(size)]
    return ca.vertcat(*(ca.horzcat(*(entries[first[max(a, b)] + min(a, b)] for b in range(size))) for a in range(size)))


def smooth_largest(matrix: Any) -> Any:
    """``(tr Aᑫ)^(1/q)``: at least the largest eigenvalue, at most ``d^(1/q)`` of it, and smooth where two are equal."""
    size = ca.trace(matrix)
    return size * ca.trace(power(matrix / size, POWER)) ** (1.0 / POWER)


def smooth_smallest(matrix: Any) -> Any:
    """``(tr A⁻ᑫ)^(-1/q)``: at most the smallest eigenvalue, at least ``d^(-1/q)`` of it."""
    return 1.0 / smooth_largest(ca.inv(matrix))


@dataclass(frozen=True)
class FisherInformation:
    """A number of the information matrix ``J = past + Σ w(r_i) (I - λ_i λ_iᵀ)`` of p planned bearings.

    λ_i and r_i are direction and range from endpoint i to the forecast's mean, and ``w(r) = ρ²/(r² + (ρ/10)²)``.
    ``logdet`` is ``(p/d) log det (J/p)``, ``trace`` is ``tr J/d``, ``min_eigenvalue`` the smallest eigenvalue of J
    (smoothed from below: at least 0.92 of it), and ``condition_number`` is ``-p log κ`` of the same sum without the
    weights, the matrix P of ``eq20`` (smoothed from above). Needs ``forecast`` and ``past`` (information of the
    window's bearings in the same units, ``(d, d)``). Bearings that other vehicles will take (``others``, their places
    at the knots ``(M, p+1, d)``) count like those of the plan.

    Parameters
    ----------
    dimension
        d.
    criterion
        One of :data:`CRITERIA`.
    reference
        ρ in metres.

    Raises
    ------
    ValueError
        If the criterion is unknown, or the reference is not above 0.
    """

    dimension: int
    criterion: Criterion = "logdet"
    reference: float = 1.0

    def __post_init__(self) -> None:
        positive("reference", self.reference)
        if self.criterion not in CRITERIA:
            raise ValueError(f"criterion: found {self.criterion!r}; allowed: {', '.join(CRITERIA)}")

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """The predicted mean, and what the past adds."""
        return {"mean": (self.dimension, 1), "past": (self.dimension, self.dimension)}

    def one_bearing(self, line: Any) -> Any:
        """Information of a bearing along ``line`` ``(d,)``, a CasADi matrix."""
        square = ca.sumsqr(line) + NEAR**2
        across = ca.DM.eye(self.dimension) - ca.mtimes(line, line.T) / square
        if self.criterion == "condition_number":
            return across
        return across * (self.reference**2 / (square + (SOFTENING * self.reference) ** 2))

    def weight(self, range_: float) -> float:
        """w(r) of a range in metres; one where the criterion does not weigh."""
        if self.criterion == "condition_number":
            return 1.0
        return self.reference**2 / (range_**2 + (SOFTENING * self.reference) ** 2)

    def accumulated(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """Lower triangle of the information of one bearing, and one for the bearing itself ``(d (d+1)/2 + 1,)``."""
        matrix = parameters["past"] + self.one_bearing(parameters["mean"] - point.z[: self.dimension])
        return ca.vertcat(packed(matrix), 1.0)

    def of_sums(self, sums: Any) -> Any:
        """The criterion of all bearings, a CasADi scalar."""
        d, count = self.dimension, sums[-1]
        matrix = unpacked(sums[:-1]) + FLOOR * ca.SX.eye(d)
        if self.criterion == "trace":
            return ca.trace(matrix) / d
        if self.criterion == "logdet":
            return count / d * ca.log(ca.det(matrix / count))
        if self.criterion == "min_eigenvalue":
            return smooth_smallest(matrix)
        return count * (ca.log(smooth_smallest(matrix)) - ca.log(smooth_largest(matrix)))

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Means ``(p, d, 1)``, and what past and other vehicles add ``(p, d, d)``: the past at the first endpoint."""
        forecast: Moments = needed(data, "forecast", self)
        mean = np.asarray(forecast.mean[:pieces], dtype=float)
        past = np.zeros((pieces, self.dimension, self.dimension))
        past[0] = np.asarray(needed(data, "past", self), dtype=float)
        for number, line in lines_of_others(data, mean):
            past[number] += np.asarray(self.one_bearing(ca.DM(line)))
        return {"mean": mean[..., None], "past": past}


@dataclass(frozen=True)
class NearInformation:
    """The trace of :class:`FisherInformation` as a sum over endpoints, which every solver takes.

    ``(d-1)/d Σ w(r_i)``: the trace does not see directions, only ranges, and the past adds a constant. Needs
    ``forecast``.

    Parameters
    ----------
    dimension
        d.
    reference
        ρ in metres.

    Raises
    ------
    ValueError
        If the reference is not above 0.
    """

    dimension: int
    reference: float = 1.0

    def __post_init__(self) -> None:
        positive("reference", self.reference)

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """The predicted mean."""
        return {"mean": (self.dimension, 1)}

    def value(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """``(d-1)/d w(r)`` at one endpoint."""
        line = parameters["mean"] - point.z[: self.dimension]
        return ca.trace(FisherInformation(self.dimension, "trace", self.reference).one_bearing(line)) / self.dimension

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Predicted means ``(p, d, 1)``."""
        forecast: Moments = needed(data, "forecast", self)
        return {"mean": np.asarray(forecast.mean[:pieces], dtype=float)[..., None]}

    def from_moments(self, mean: Any, root: Any, desired: Any) -> Mapping[str, Any]:
        """The mean of the forecast."""
        return {"mean": mean}
