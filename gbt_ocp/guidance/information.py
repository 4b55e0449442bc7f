"""Objectives that couple the endpoints: what all bearings together, past and planned, say about the target.

The Fisher information of bearings with equal noise about the position of a target whose motion is otherwise known is
``Σ (I - λ λᵀ)/(σ r)²`` (Bishop et al., "Optimality analysis of sensor-target localization geometries", Automatica 46
(2010)). Here it is counted in units of one bearing at a reference range ρ, so that σ drops out, and a bearing at every
endpoint of the plan.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import casadi as ca
import numpy as np

from gbt_ocp.guidance.objectives import NEAR
from gbt_ocp.models.sizes import at_least, positive
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
    window's bearings in the same units, ``(d, d)``).

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
        """The predicted mean, and the past, which is the same at every endpoint."""
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

    def total(self, points: Sequence[FlatPoint], parameters: Sequence[Mapping[str, Any]]) -> Any:
        """The criterion of all bearings, a CasADi scalar."""
        count, d = len(points), self.dimension
        matrix = parameters[0]["past"] + FLOOR * ca.DM.eye(d)
        for point, given in zip(points, parameters, strict=True):
            matrix = matrix + self.one_bearing(given["mean"] - point.z[:d])
        if self.criterion == "trace":
            return ca.trace(matrix) / d
        if self.criterion == "logdet":
            return count / d * ca.log(ca.det(matrix / count))
        if self.criterion == "min_eigenvalue":
            return smooth_smallest(matrix)
        return count * (ca.log(smooth_smallest(matrix)) - ca.log(smooth_largest(matrix)))

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Means ``(p, d, 1)`` and the past ``(p, d, d)``."""
        forecast: Moments = needed(data, "forecast", self)
        past = np.asarray(needed(data, "past", self), dtype=float)
        mean = np.asarray(forecast.mean[:pieces], dtype=float)[..., None]
        return {"mean": mean, "past": np.tile(past, (pieces, 1, 1))}


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


@dataclass(frozen=True)
class PosteriorVariance:
    """How well the target's position at the end of the plan is known after the planned bearings (``eq17``).

    ``-(p/2) log tr Σ(t_p)``, where Σ is the covariance of a Gaussian process after the window's bearings and one more
    at each endpoint, perpendicular to the line of sight to the forecast's mean. It does not depend on what will be
    measured, so it is the posterior's own, exactly, for a vehicle that sees the target where it is expected. Needs
    ``forecast`` and ``joint`` (:class:`JointMoments` at the endpoints).

    Parameters
    ----------
    dimension
        d.
    pieces
        p, the endpoints of the plan.

    Raises
    ------
    ValueError
        If ``pieces`` is not a whole number from 1 on.
    """

    dimension: int
    pieces: int

    def __post_init__(self) -> None:
        at_least("pieces", self.pieces, 1)

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """Mean, covariance with the position at every endpoint, and the two parts of a bearing's variance."""
        d = self.dimension
        return {"mean": (d, 1), "covariance": (d, self.pieces * d), "variance": (2, 1)}

    def total(self, points: Sequence[FlatPoint], parameters: Sequence[Mapping[str, Any]]) -> Any:
        """``-(p/2) log tr Σ(t_p)``, a CasADi scalar."""
        d, count = self.dimension, len(points)
        joint = ca.vertcat(*(given["covariance"] for given in parameters))
        rows, noises = [], []
        for number, (point, given) in enumerate(zip(points, parameters, strict=True)):
            line = given["mean"] - point.z[:d]
            variance = given["variance"][0] + given["variance"][1] * ca.sumsqr(line)
            for across in tangents(line):
                row = [ca.SX.zeros(1, d)] * count
                row[number] = across.T
                rows.append(ca.horzcat(*row))
                noises.append(variance)
        seen = ca.vertcat(*rows)
        cross = ca.mtimes(seen, joint)
        factor = ca.chol(ca.mtimes(cross, seen.T) + ca.diag(ca.vertcat(*noises)))
        known = ca.solve(factor.T, cross[:, -d:])
        left = ca.trace(joint[-d:, -d:]) - ca.sumsqr(known)
        return -0.5 * count * ca.log(left)

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Means ``(p, d, 1)``, covariances ``(p, d, p d)`` and variances ``(p, 2, 1)``."""
        forecast: Moments = needed(data, "forecast", self)
        joint: JointMoments = needed(data, "joint", self)
        d = self.dimension
        mean = np.asarray(forecast.mean[:pieces], dtype=float)[..., None]
        covariance = np.asarray(joint.covariance, dtype=float).reshape(pieces, d, pieces * d)
        variance = np.array([[joint.floor], [joint.angle_variance]], dtype=float)
        return {"mean": mean, "covariance": covariance, "variance": np.tile(variance, (pieces, 1, 1))}


class JointMoments(Protocol):
    """What a Gaussian process knows of the positions at the endpoints together, and of the bearings to come.

    Attributes
    ----------
    covariance
        ``(p, d, p, d)`` in m².
    floor, angle_variance
        A bearing's variance across the line of sight at a range r is ``floor + angle_variance r²``, in m² and rad².
    """

    covariance: Array
    floor: float
    angle_variance: float


def tangents(line: Any) -> list[Any]:
    """Unit vectors ``(d,)`` across a line ``(d,)`` and each other; in space undefined along the vertical."""
    level = ca.sqrt(line[0] ** 2 + line[1] ** 2 + NEAR**2)
    if line.numel() == 2:
        return [ca.vertcat(-line[1], line[0]) / level]
    length = ca.sqrt(ca.sumsqr(line) + NEAR**2)
    first = ca.vertcat(-line[1], line[0], 0.0) / level
    return [first, ca.cross(line / length, first)]
