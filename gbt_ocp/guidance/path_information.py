"""Objectives on where the target will be believed after the planned bearings: its path has a few coordinates.

Before the plan the positions at its endpoints, and at the times that are asked about, are jointly Gaussian with the
forecast's mean. The positions asked about, and the largest modes of what is left of the others, are coordinates c of
the path, with ``P(t_i) = μ(t_i) + B_i c + a rest that counts as noise of the bearing``. A bearing along λ_i at a range
r_i then adds ``B_iᵀ (I - λ_i λ_iᵀ) B_i / v_i`` to their information, ``v_i = floor + angle_variance r_i² + rest_i``, so
that the posterior covariance of all of them is a function of sums over the endpoints. (It is that of a process of
reduced rank, FITC in Quiñonero-Candela and Rasmussen, J. Mach. Learn. Res. 6 (2005).) It does not depend on what will
be measured, for a vehicle that sees the target where it is expected.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol

import casadi as ca
import numpy as np

from gbt_ocp.guidance.information import packed, unpacked
from gbt_ocp.guidance.objectives import NEAR
from gbt_ocp.guidance.others import lines_of_others
from gbt_ocp.models.sizes import at_least
from gbt_ocp.ocp.terms import Moments, needed
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.typing import Array

COORDINATES = 6
"""Of a path, at most: the number of sums grows with its square, and their derivatives with its fourth power."""

SUBSPACE_ITERATIONS = 4

ROUND_OFF = 1.0e-9
"""Variance, as a share of the mean one, below which what the positions asked about have is round-off."""


class JointMoments(Protocol):
    """What is known of the positions at several times together, and of the bearings to come.

    Attributes
    ----------
    covariance
        ``(K, d, K, d)`` in m².
    floor, angle_variance
        A bearing's variance across the line of sight at a range r is ``floor + angle_variance r²``, in m² and rad².
    """

    covariance: Array
    floor: float
    angle_variance: float


class Coordinates(NamedTuple):
    """Coordinates of a path, the positions asked about before the modes.

    Attributes
    ----------
    loadings
        B ``(p, d, q)`` of the positions at the endpoints.
    rest
        Mean variance on an axis that they leave at each endpoint, in m² ``(p,)``.
    information
        Of the coordinates, before the plan ``(q, q)`` in 1/m² and without unit.
    """

    loadings: Array
    rest: Array
    information: Array


def coordinates(covariance: Array, pieces: int, asked: Sequence[int], modes: int) -> Coordinates:
    """Coordinates of a path.

    Parameters
    ----------
    covariance
        Of the positions at the endpoints and further times ``(K, d, K, d)`` in m².
    pieces
        p, how many of the times are endpoints, the first ones.
    asked
        Numbers of the times that are asked about.
    modes
        How many modes of the rest are coordinates.
    """
    d = covariance.shape[1]
    rows = np.concatenate([np.arange(d) + d * number for number in asked])
    full = covariance.reshape(len(covariance) * d, -1)
    own = full[np.ix_(rows, rows)]
    own = own + ROUND_OFF * np.trace(own) / len(own) * np.eye(len(own))
    information = np.linalg.inv(own)
    weights = full[: pieces * d, rows] @ information
    left = full[: pieces * d, : pieces * d] - weights @ full[rows, : pieces * d]
    largest = _largest_modes(left, modes)
    rest = (np.diag(left) - np.sum(largest**2, axis=1)).reshape(pieces, d).mean(axis=1)
    size = len(rows) + modes
    whole = np.eye(size)
    whole[: len(rows), : len(rows)] = 0.5 * (information + information.T)
    return Coordinates(np.hstack([weights, largest]).reshape(pieces, d, size), np.maximum(rest, 0.0), whole)


def _largest_modes(covariance: Array, count: int) -> Array:
    """Eigenvectors of the largest eigenvalues times the roots of these ``(n, count)``, by subspace iteration.

    A plan needs a few of them, roughly; all of them take longer than the plan.
    """
    if count == 0:
        return np.zeros((len(covariance), 0))
    basis = covariance[:, np.linspace(0, len(covariance) - 1, count).astype(int)]
    for _ in range(SUBSPACE_ITERATIONS):
        basis = covariance @ np.linalg.qr(basis)[0]
    basis = np.linalg.qr(basis)[0]
    values, vectors = np.linalg.eigh(basis.T @ covariance @ basis)
    return np.asarray(basis @ vectors * np.sqrt(np.maximum(values, 0.0)))


def one_sight(line: Any, loadings: Any, rest: Any, variance: Any) -> Any:
    """Information of a bearing along ``line`` ``(d,)`` about the coordinates ``(q, q)``, a CasADi matrix."""
    square = ca.sumsqr(line) + NEAR**2
    along = ca.mtimes(loadings.T, line)
    across = ca.mtimes(loadings.T, loadings) - ca.mtimes(along, along.T) / square
    return across / (variance[0] + variance[1] * square + rest)


def gained(line: Array, loadings: Array, rest: Array, variance: Array) -> Array:
    """:func:`one_sight` of numbers: what a bearing of another vehicle adds ``(q, q)``."""
    return np.asarray(one_sight(ca.DM(line), ca.DM(loadings), ca.DM(rest), ca.DM(variance)), dtype=float)


def without_last(matrix: Any, count: int) -> Any:
    """Information about the first coordinates ``(n - count,)`` where nothing is known of the last ones but itself."""
    for _ in range(count):
        last = matrix[:-1, -1]
        matrix = matrix[:-1, :-1] - ca.mtimes(last, last.T) / matrix[-1, -1]
    return matrix


def log_determinant(matrix: Any) -> Any:
    """Of a symmetric positive definite CasADi matrix, by its pivots."""
    total = ca.SX(0)
    for _ in range(matrix.shape[0]):
        total += ca.log(matrix[-1, -1])
        matrix = without_last(matrix, 1)
    return total


def trace_of_inverse(matrix: Any) -> Any:
    """Of a symmetric positive definite CasADi matrix: the sum of the variances that it is the information of.

    The last variable is eliminated, and what its variance is through the others goes to their weights.
    """
    weights, total = ca.SX.eye(matrix.shape[0]), ca.SX(0)
    while matrix.shape[0]:
        own, share, across = weights[-1, -1], matrix[:-1, -1] / matrix[-1, -1], weights[:-1, -1]
        total += own / matrix[-1, -1]
        cross = ca.mtimes(across, share.T)
        weights = weights[:-1, :-1] - cross - cross.T + own * ca.mtimes(share, share.T)
        matrix = without_last(matrix, 1)
    return total


@dataclass(frozen=True)
class PosteriorVariance:
    """How well the target's position at the end of the plan is known after the planned bearings (``eq17``).

    ``-(p/2) log tr Σ(t_p)``, where Σ is the covariance of a Gaussian process after the window's bearings and one more
    at each endpoint, perpendicular to the line of sight to the forecast's mean, with at most :data:`COORDINATES`
    coordinates of its path, and after those of other vehicles (``others``, places at the knots). Needs ``forecast`` and
    ``joint`` (:class:`JointMoments` at the endpoints).

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
    def size(self) -> int:
        """q, the coordinates of the path."""
        return min(COORDINATES, self.pieces * self.dimension)

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """Mean, loadings, the parts of a bearing's variance, and the information before the plan."""
        q = self.size
        return {"mean": (self.dimension, 1), "loadings": (self.dimension, q), "variance": (3, 1), "known": (q, q)}

    def accumulated(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """Lower triangle of the information about the coordinates ``(q (q+1)/2,)``."""
        line, variance = parameters["mean"] - point.z[: self.dimension], parameters["variance"]
        return packed(parameters["known"] + one_sight(line, parameters["loadings"], variance[2], variance))

    def of_sums(self, sums: Any) -> Any:
        """``-(p/2) log tr Σ(t_p)``, a CasADi scalar."""
        at_end = without_last(unpacked(sums), self.size - self.dimension)
        return -0.5 * self.pieces * ca.log(trace_of_inverse(at_end))

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Means ``(p, d, 1)``, loadings ``(p, d, q)``, variances ``(p, 3, 1)`` and what is known ``(p, q, q)``."""
        forecast: Moments = needed(data, "forecast", self)
        joint: JointMoments = needed(data, "joint", self)
        covariance = np.asarray(joint.covariance, dtype=float)
        found = coordinates(covariance, pieces, [pieces - 1], self.size - self.dimension)
        known = np.zeros((pieces, self.size, self.size))
        known[0] = found.information
        mean, variance = np.asarray(forecast.mean[:pieces], dtype=float), _variances(joint, found.rest)
        for number, line in lines_of_others(data, mean):
            known[number] += gained(line, found.loadings[number], variance[number, 2], variance[number])
        return {"mean": mean[..., None], "loadings": found.loadings, "variance": variance, "known": known}


def _variances(joint: JointMoments, rest: Array) -> Array:
    """``(floor, angle_variance, rest)`` at each endpoint ``(p, 3, 1)``."""
    parts = [np.full(len(rest), joint.floor), np.full(len(rest), joint.angle_variance), rest]
    return np.stack(parts, axis=1)[..., None]


MotionCriterion = Literal["logdet", "trace"]


@dataclass(frozen=True)
class MotionInformation:
    """How well the target's position and motion are known after the planned bearings (belief-space planning).

    At each of a few stages of the plan, the covariance Σ of the position then and ``ahead`` later, whose difference is
    the velocity, after the bearings until then: ``trace`` is the mean over the stages of ``-(p/2) log tr Σ``,
    ``logdet`` that of ``-(p/(4 d)) (log det Σ(t) + log det Σ(t + ahead))``. Needs ``forecast`` and ``path``
    (:class:`JointMoments` at the endpoints and ``ahead`` after each stage). What the target may do on its way beside
    going from one position to the other counts as noise of the bearings, so that earlier bearings count less. Bearings
    that other vehicles will take (``others``, their places at the knots) count like those of the plan.

    Parameters
    ----------
    dimension
        d.
    pieces
        p, the endpoints of the plan.
    criterion
        ``logdet`` or ``trace``.
    stages
        How many times are asked about, evenly spaced, the last one at the end of the plan.

    Raises
    ------
    ValueError
        If a number is not a whole one from 1 on, there are more stages than pieces, or the criterion is unknown.
    """

    dimension: int
    pieces: int
    criterion: MotionCriterion = "logdet"
    stages: int = 1

    def __post_init__(self) -> None:
        at_least("pieces", self.pieces, 1)
        if at_least("stages", self.stages, 1) > self.pieces:
            raise ValueError(f"stages: found {self.stages}; allowed: at most pieces = {self.pieces}")
        if self.criterion not in ("logdet", "trace"):
            raise ValueError(f"criterion: found {self.criterion!r}; allowed: logdet, trace")

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """Mean, and of each stage loadings, parts of a bearing's variance, and the information before the plan."""
        d, stages = self.dimension, self.stages
        return {
            "mean": (d, 1),
            "loadings": (d, 2 * d * stages),
            "variance": (2 + stages, 1),
            "known": (2 * d, 2 * d * stages),
        }

    def accumulated(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """Lower triangles of the information about the two positions of each stage ``(stages d (2d+1),)``."""
        line, variance = parameters["mean"] - point.z[: self.dimension], parameters["variance"]
        known, loadings = (ca.horzsplit(parameters[name], 2 * self.dimension) for name in ("known", "loadings"))
        gained = [one_sight(line, own, variance[2 + stage], variance) for stage, own in enumerate(loadings)]
        return ca.vertcat(*(packed(before + gain) for before, gain in zip(known, gained, strict=True)))

    def of_sums(self, sums: Any) -> Any:
        """The criterion, a CasADi scalar."""
        each = sums.shape[0] // self.stages
        return sum(self._stage(unpacked(part)) for part in ca.vertsplit(sums, each)) / self.stages

    def _stage(self, matrix: Any) -> Any:
        d = self.dimension
        if self.criterion == "trace":
            return -0.5 * self.pieces * ca.log(trace_of_inverse(matrix))
        both = log_determinant(matrix)
        parts = log_determinant(matrix[:d, :d]) + log_determinant(matrix[d:, d:])
        return 0.25 * self.pieces / d * (2.0 * both - parts)

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Means, loadings, variances and what is known, each ``(p, *shape)`` as of :attr:`shapes`."""
        forecast: Moments = needed(data, "forecast", self)
        path: JointMoments = needed(data, "path", self)
        covariance, width = np.asarray(path.covariance, dtype=float), 2 * self.dimension
        known = np.zeros((pieces, width, width * self.stages))
        loadings = np.zeros((pieces, self.dimension, width * self.stages))
        variance = np.zeros((pieces, 2 + self.stages, 1))
        variance[:, :2, 0] = path.floor, path.angle_variance
        for stage, last in enumerate(stage_ends(pieces, self.stages)):
            found = coordinates(covariance, pieces, [last, pieces + stage], 0)
            own = slice(stage * width, (stage + 1) * width)
            known[0, :, own] = found.information
            loadings[: last + 1, :, own] = found.loadings[: last + 1]
            variance[:, 2 + stage, 0] = found.rest
        mean = np.asarray(forecast.mean[:pieces], dtype=float)
        for number, line in lines_of_others(data, mean):
            for stage in range(self.stages):
                own = slice(stage * width, (stage + 1) * width)
                rest = variance[number, 2 + stage]
                known[number, :, own] += gained(line, loadings[number, :, own], rest, variance[number])
        return {"mean": mean[..., None], "loadings": loadings, "variance": variance, "known": known}


def stage_ends(pieces: int, stages: int) -> list[int]:
    """Numbers of the endpoints at the ends of the stages of a plan, counted from 0."""
    return [round(pieces * (stage + 1) / stages) - 1 for stage in range(stages)]
