"""Laplace's approximation of motions given binned bearings: damped Gauss-Newton steps, many motions at once.

In the whitened coordinates the negative log posterior is ``½ (‖R^-½ r(z)‖² + ‖z‖²)`` with r the angles from the
predicted to the measured bearings. Linearising at the predicted bearing leaves none of the bias of pseudo-linear
measurements, in which the measured bearing stands on both sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.models.bearings import log_map, tangent_basis
from gbt_ocp.tracking.linalg import cholesky_factors, inverses, solutions
from gbt_ocp.tracking.shape.course import Course
from gbt_ocp.tracking.shape.further import FurtherSightings
from gbt_ocp.tracking.shape.motions import FLAT_ANGLE, Motions, MotionShape
from gbt_ocp.typing import Array

LIMITS = {"range": 1.0, "direction": 0.4, "speed": 1.0, "heading": 0.8}
"""Largest step: of log range and log speed, and of angles in radians."""

SETTLED = 0.1
"""Decrease of the objective promised by a step, below which the motion has settled: a third of a deviation."""

NEAREST = 1.0e-2
"""Range in metres below which a bearing's slope grows no further."""


class Known(NamedTuple):
    """Positions that are known before any bearing of the window, relative to now and to the own position now.

    Attributes
    ----------
    times
        ``(K,)`` in seconds.
    positions
        ``(K, d)`` in metres.
    root
        A ``(Kd, Kd)`` with ``AᵀA`` the inverse of their joint covariance, 1/m.
    """

    times: Array
    positions: Array
    root: Array

    def seen_from(self, time: float, own: Array) -> Known:
        """The same, relative to another time in seconds and own position ``(d,)``, which were zero."""
        return Known(self.times - time, self.positions - own, self.root)


@dataclass(frozen=True)
class Sightings:
    """N mean bearings as one estimate sees them, relative to now and to the own position now.

    Attributes
    ----------
    times
        ``(N,)`` in seconds, at most 0.
    bearings, own_positions
        ``(N, d)``, unit vectors and metres.
    root
        R^-½, its diagonal ``(..., N)`` where R is diagonal, else ``(..., N, N)``; leading axis one or B.
    log_determinant
        log det R, ``(...)``, of one direction of the tangent plane.
    known
        Positions that are known beforehand, if any.
    further
        Measurements that are no bearings, if any.
    """

    times: Array
    bearings: Array
    own_positions: Array
    root: Array
    log_determinant: Array
    known: Known | None = None
    further: FurtherSightings | None = None

    def of(self, which: NDArray[np.bool_]) -> Sightings:
        """What some of the B motions see."""
        if len(self.root) == 1:
            return self
        return replace(self, root=self.root[which], log_determinant=self.log_determinant[which])

    def whitened(self, rows: Array) -> Array:
        """R^-½ times rows ``(B, N, ...)``."""
        if self.root.ndim == 2:
            return np.asarray(self.root.reshape(*self.root.shape, *(1,) * (rows.ndim - 2)) * rows)
        flat = rows.reshape(*rows.shape[:2], -1)
        return np.asarray((self.root @ flat).reshape(rows.shape))


def sightings_root(covariance: Array, diagonal: bool) -> tuple[Array, Array]:
    """R^-½ and log det R of matrices ``(..., N, N)``, for :class:`Sightings`."""
    if diagonal:
        variances = np.diagonal(covariance, axis1=-2, axis2=-1)
        return 1.0 / np.sqrt(variances), np.sum(np.log(variances), axis=-1)
    factor = np.linalg.cholesky(covariance)
    identity = np.broadcast_to(np.eye(covariance.shape[-1]), covariance.shape)
    return np.linalg.solve(factor, identity), 2.0 * np.sum(np.log(np.diagonal(factor, axis1=-2, axis2=-1)), axis=-1)


@dataclass(frozen=True)
class LaplaceFit:
    """Gaussians of B motions, in steps of the whitened coordinates about their modes.

    Attributes
    ----------
    motions
        The modes.
    covariance
        ``(B, n, n)``.
    log_evidence
        Laplace's approximation of the logarithm of the bearings' density ``(B,)``, in angles: radians to the power of
        minus the number of rows.
    residuals
        R^-½ r at the mode, ``(B, N, d-1)``: independent and of variance one, less what the fit has taken.
    angles
        r itself ``(B, N, d-1)`` in radians.
    ranges
        Predicted ranges of the bins ``(B, N)`` in metres.
    iterations
        Steps that were taken.
    """

    motions: Motions
    covariance: Array
    log_evidence: Array
    residuals: Array
    angles: Array
    ranges: Array
    iterations: int

    def __getitem__(self, which: NDArray[np.intp] | NDArray[np.bool_]) -> LaplaceFit:
        return LaplaceFit(
            self.motions[which],
            self.covariance[which],
            self.log_evidence[which],
            self.residuals[which],
            self.angles[which],
            self.ranges[which],
            self.iterations,
        )

    @staticmethod
    def joined(parts: Sequence[LaplaceFit]) -> LaplaceFit:
        """All components of the parts, which saw the same bearings, in order."""
        return LaplaceFit(
            Motions.joined([part.motions for part in parts]),
            np.concatenate([part.covariance for part in parts]),
            np.concatenate([part.log_evidence for part in parts]),
            np.concatenate([part.residuals for part in parts]),
            np.concatenate([part.angles for part in parts]),
            np.concatenate([part.ranges for part in parts]),
            max(part.iterations for part in parts),
        )


@dataclass(frozen=True)
class _Misfit:
    """Whitened residuals of B motions, and what their slopes are made of."""

    course: Course
    across: Array
    rows: Array
    angles: Array
    ranges: Array
    objective: Array
    further: Array | None = None


class _View:
    """Bearings as the nodes of the motions see them: the same for all steps of a fit."""

    def __init__(self, shape: MotionShape, seen: Sightings) -> None:
        self._shape, self._seen = shape, seen
        self._way = shape.way(seen.times)
        self._known_way = None if seen.known is None else shape.way(seen.known.times)
        self._further_way = None if seen.further is None else shape.way(seen.further.times)
        self._slopes: Array | None = None

    def misfit(self, motions: Motions) -> _Misfit:
        """Residuals of motions, without the slopes, which take most of the time."""
        seen, course = self._seen, self._shape.past(motions)
        line = course.positions_after(self._way) - seen.own_positions
        ranges = np.maximum(np.linalg.norm(line, axis=-1), NEAREST)
        unit = line / ranges[..., None]
        basis = tangent_basis(unit)
        angles = log_map(unit, seen.bearings, basis)
        rows = seen.whitened(angles).reshape(len(motions), -1)
        if seen.known is not None and self._known_way is not None:
            off = (seen.known.positions - course.positions_after(self._known_way)).reshape(len(motions), -1)
            rows = np.concatenate([rows, off @ seen.known.root.T], axis=1)
        further = None
        if seen.further is not None and self._further_way is not None:
            residuals, further = seen.further.rows(course.positions_after(self._further_way))
            rows = np.concatenate([rows, residuals], axis=1)
        objective = np.sum(rows**2, axis=1) + np.sum(motions.white**2, axis=1)
        across = np.swapaxes(basis, -1, -2) / ranges[..., None, None]
        return _Misfit(course, across, rows, angles, ranges, objective, further)

    def slopes(self, at: _Misfit) -> Array:
        """Derivatives of the predicted rows by the whitened coordinates ``(B, R, n)``; valid until the next ones."""
        seen, across = self._seen, at.across
        count, times, each, d = across.shape
        bearings = times * each
        # the largest array of an estimate: new memory for it at every step takes longer than filling it
        if self._slopes is None or len(self._slopes) != count:
            self._slopes = np.empty((count, at.rows.shape[1], self._shape.size))
        slopes = self._slopes
        if seen.root.ndim == 2:  # the smaller of the two to whiten
            at.course.slopes_after(self._way, seen.whitened(across), slopes[:, :bearings])
        else:
            at.course.slopes_after(self._way, across, slopes[:, :bearings])
            whole = seen.whitened(slopes[:, :bearings].reshape(count, times, -1))
            slopes[:, :bearings] = whole.reshape(count, bearings, -1)
        if seen.known is not None and self._known_way is not None:
            known = slopes[:, bearings : bearings + seen.known.root.shape[0]]
            axes = np.broadcast_to(np.eye(d), (count, len(self._known_way), d, d))
            at.course.slopes_after(self._known_way, axes, known)
            known[:] = seen.known.root @ known
        if seen.further is not None and self._further_way is not None and at.further is not None:
            last = slopes[:, slopes.shape[1] - len(seen.further.times) :]
            at.course.slopes_after(self._further_way, at.further[:, :, None, :], last)
            last[:] = seen.further.root @ last
        return slopes


def fit(shape: MotionShape, motions: Motions, seen: Sightings, iterations: int) -> LaplaceFit:
    """The modes near the given motions, with the Gaussians about them.

    A step that raises the objective is taken back to a quarter. It ends early when all motions have settled.

    Parameters
    ----------
    shape
        The prior.
    motions
        Where to start.
    seen
        The bearings.
    iterations
        Largest number of steps.
    """
    view = _View(shape, seen)
    best = view.misfit(motions)
    slopes = view.slopes(best)
    factors, step, decrement = _newton(shape, best, slopes, motions)
    taken = 0
    while taken < iterations and np.max(decrement) > SETTLED:
        taken += 1
        candidate = shape.moved(motions, step)
        tried = view.misfit(candidate)
        better = tried.objective <= best.objective + 1e-9
        if np.all(better):
            motions, best, slopes = candidate, tried, view.slopes(tried)
        elif np.any(better):
            motions = _chosen(better, candidate, motions)
            part = _View(shape, seen.of(better))
            slopes[better] = part.slopes(part.misfit(candidate[better]))
            best = _either(better, tried, best)
        else:
            step = 0.25 * step
            continue
        factors, fresh, decrement = _newton(shape, best, slopes, motions)
        step = np.where(better[:, None], fresh, 0.25 * step)
    # what is left is too small to bend anything: the last step is taken without looking again
    last = decrement <= SETTLED
    motions = shape.moved(motions, np.where(last[:, None], step, 0.0))
    objective = best.objective - np.where(last, decrement, 0.0)
    log_determinant = 2.0 * np.sum(np.log(np.diagonal(factors, axis1=1, axis2=2)), axis=1)
    directions = shape.dimension - 1
    rows = directions * len(seen.times)
    log_evidence = -0.5 * (objective + log_determinant + directions * seen.log_determinant + rows * np.log(2.0 * np.pi))
    if seen.further is not None:
        count = len(seen.further.times)
        log_evidence = log_evidence - 0.5 * (seen.further.log_determinant + count * np.log(2.0 * np.pi))
    residuals = best.rows[:, :rows].reshape(len(motions), len(seen.times), directions)
    return LaplaceFit(motions, inverses(factors), log_evidence, residuals, best.angles, best.ranges, taken)


def _newton(shape: MotionShape, at: _Misfit, slopes: Array, motions: Motions) -> tuple[Array, Array, Array]:
    """Factors of the precisions, shortened steps ``(B, n)``, and the decrease that full ones promise ``(B,)``."""
    gradient = (at.rows[:, None, :] @ slopes)[:, 0] - motions.white
    factors = cholesky_factors(_precision(slopes))
    full = solutions(factors, gradient)
    return factors, np.asarray(full * _shortening(shape, full)[:, None]), np.asarray(np.sum(full * gradient, axis=1))


def _either(which: NDArray[np.bool_], new: _Misfit, old: _Misfit) -> _Misfit:
    """The new residuals where they are chosen; the course stays behind, for its slopes have been made."""

    def chosen(a: Array, b: Array) -> Array:
        return np.asarray(np.where(which.reshape(-1, *(1,) * (a.ndim - 1)), a, b))

    # the course and what is made of it stay behind, for the slopes have been made
    return _Misfit(
        new.course,
        new.across,
        chosen(new.rows, old.rows),
        chosen(new.angles, old.angles),
        chosen(new.ranges, old.ranges),
        chosen(new.objective, old.objective),
    )


def _precision(slopes: Array) -> Array:
    precision = np.asarray(np.swapaxes(slopes, 1, 2) @ slopes)
    diagonal = np.arange(slopes.shape[2])
    precision[:, diagonal, diagonal] += 1.0
    return precision


def _shortening(shape: MotionShape, step: Array) -> Array:
    """Factor in (0, 1] that keeps each step ``(B, n)`` within :data:`LIMITS`."""
    d, p, size = shape.dimension, shape.prior, np.abs(step)
    ratios = [
        size[:, 0] * p.range.log_std / LIMITS["range"],
        FLAT_ANGLE * np.max(size[:, 1:d], axis=1) / LIMITS["direction"],
        size[:, shape.speed_at] * p.speed.log_std / LIMITS["speed"],
        FLAT_ANGLE * size[:, shape.heading_at] / LIMITS["heading"],
    ]
    return np.asarray(1.0 / np.maximum(1.0, np.max(ratios, axis=0)))


def _chosen(which: NDArray[np.bool_], new: Motions, old: Motions) -> Motions:
    column = which[:, None]
    return Motions(
        old.theta,
        np.where(column, new.direction, old.direction),
        np.where(which, new.heading, old.heading),
        np.where(column, new.white, old.white),
    )
