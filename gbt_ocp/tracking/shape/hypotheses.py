"""The distinct motions that fit the bearings: starts at several ranges, and which of them are one and the same motion.

Near and far motions fit the same bearings while the range is hardly known. Each is a hypothesis, fitted under all
points of the grid of hyperparameters and weighed by Laplace's approximation of the evidence.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.tracking.bins import BinnedBearings
from gbt_ocp.tracking.shape.fit import LaplaceFit, Sightings, fit
from gbt_ocp.tracking.shape.motions import Motions, MotionShape
from gbt_ocp.typing import Array

COLD_ITERATIONS = 8
"""Steps of a start that rests on no earlier estimate."""

APART = 1.0
"""Distance of two modes, in standard deviations of log range and heading, above which they are two hypotheses."""

NEGLIGIBLE = float(np.log(1e-4))
"""Logarithm of the share of the evidence below which a hypothesis or a component is left out."""


class MotionHypothesis(NamedTuple):
    """One of the distinct motions that fit the bearings.

    Attributes
    ----------
    weight
        Its probability.
    range
        Median range now in metres.
    log_range_std
        Standard deviation of the logarithm of its range.
    """

    weight: float
    range: float
    log_range_std: float


@dataclass(frozen=True)
class MotionHypotheses:
    """Distinct motions with their fits.

    Attributes
    ----------
    shape
        The prior of the motions.
    fit
        Fits of B motions.
    labels
        The hypothesis that each of them belongs to ``(B,)``.
    """

    shape: MotionShape
    fit: LaplaceFit
    labels: NDArray[np.intp]

    @property
    def weights(self) -> Array:
        """Probability of each fitted motion ``(B,)``."""
        share = np.exp(self.fit.log_evidence - self.fit.log_evidence.max())
        return np.asarray(share / share.sum())

    @property
    def likely(self) -> tuple[LaplaceFit, Array]:
        """The motions that count, with weights that sum to one."""
        weights = self.weights
        likely = weights > np.exp(NEGLIGIBLE)
        return self.fit[likely], weights[likely] / weights[likely].sum()

    @property
    def likely_motions(self) -> tuple[Array, list[tuple[LaplaceFit, Array]]]:
        """Probability of each hypothesis that counts ``(M,)``, and its fits with weights that sum to one."""
        weights = self.weights
        likely = weights > np.exp(NEGLIGIBLE)
        groups = [likely & (self.labels == name) for name in np.unique(self.labels[likely])]
        totals = np.array([weights[group].sum() for group in groups])
        parts = [(self.fit[group], weights[group] / weights[group].sum()) for group in groups]
        return totals / totals.sum(), parts

    @property
    def log_evidence(self) -> float:
        """Logarithm of the density of the mean bearings in the window, in angles, averaged over the grid."""
        return _log_mean(self.fit.log_evidence) + float(np.log(np.max(self.labels) + 1.0))

    @property
    def summary(self) -> list[MotionHypothesis]:
        """The hypotheses, likeliest first."""
        weights, log_range = self.weights, self.shape.log_range(self.fit.motions)
        variance = self.shape.prior.range.log_std**2 * self.fit.covariance[:, 0, 0]
        found = []
        for name in np.unique(self.labels):
            mine = self.labels == name
            total = weights[mine].sum()
            share = weights[mine] / max(total, 1e-300)
            mean = share @ log_range[mine]
            spread = share @ (variance[mine] + (log_range[mine] - mean) ** 2)
            found.append(MotionHypothesis(float(total), float(np.exp(mean)), float(np.sqrt(spread))))
        return sorted(found, reverse=True)

    def distinct(self, most: int) -> MotionHypotheses:
        """The likeliest hypotheses, at most so many, without those that are the same motion as a likelier one."""
        found = self.fit
        names = np.unique(self.labels)
        totals = np.array([_log_mean(found.log_evidence[self.labels == name]) for name in names])
        kept: list[int] = []
        best: list[int] = []
        for one in np.argsort(-totals):
            if len(kept) == most or totals[one] < totals.max() + NEGLIGIBLE:
                break
            mine = np.flatnonzero(self.labels == names[one])
            top = int(mine[np.argmax(found.log_evidence[mine])])
            if not np.any(_same(self.shape, found[np.array([top])], found[np.array(best, dtype=np.intp)])):
                kept.append(int(names[one]))
                best.append(top)
        keep = np.isin(self.labels, kept)
        numbers = np.asarray(np.unique(self.labels[keep], return_inverse=True)[1], dtype=np.intp)
        return MotionHypotheses(self.shape, found[keep], numbers)


def competed(
    shape: MotionShape,
    kept: MotionHypotheses | None,
    cold: Motions,
    sight: Callable[[Motions], Sightings],
    most: int,
    iterations: int,
) -> MotionHypotheses:
    """The hypotheses so far, and the motions that cold starts lead to if they fit as well and are different ones.

    Parameters
    ----------
    shape
        The prior.
    kept
        Hypotheses so far, if any.
    cold
        Where to start, all under one point of the grid.
    sight
        The bearings as motions see them.
    most
        Largest number of motions added.
    iterations
        Largest number of steps with which they are then fitted under all points of the grid.
    """
    points, middle = np.arange(len(shape.grid)), int(cold.theta[0])
    tried = fit(shape, cold, sight(cold), COLD_ITERATIONS)
    if kept is not None:
        same_point = kept.fit[kept.fit.motions.theta == middle]
        standard = float(same_point.log_evidence.max())
    else:
        same_point, standard = tried[np.zeros(0, dtype=np.intp)], float(tried.log_evidence.max())
    new: list[int] = []
    for one in np.argsort(-tried.log_evidence):
        if tried.log_evidence[one] < standard + 0.5 * NEGLIGIBLE or len(new) == most:
            break
        others = LaplaceFit.joined([same_point, tried[np.array(new, dtype=np.intp)]])
        if not np.any(_same(shape, tried[np.array([one])], others)):
            new.append(int(one))
    if kept is not None and not new:
        return kept
    motions = Motions.joined([shape.transferred(tried.motions[np.array([one])], points) for one in new])
    found = fit(shape, motions, sight(motions), iterations)
    labels = np.repeat(np.arange(len(new)), len(points))
    if kept is None:
        return MotionHypotheses(shape, found, labels)
    return MotionHypotheses(
        shape,
        LaplaceFit.joined([kept.fit, found]),
        np.concatenate([kept.labels, labels + len(kept.labels)]),
    )


def cold_starts(shape: MotionShape, ranges: Array, means: BinnedBearings, now: float, own: Array) -> Motions:
    """Straight lines through the bearings at each of the ranges (m), seen from now (s) and the own position ``(d,)``.

    All of them are under the middle point of the grid.
    """
    times = means.times - now
    count, dimension = len(ranges), shape.dimension
    places = means.own_positions - own + ranges[:, None, None] * means.bearings
    weights = np.sqrt(means.counts) * np.exp(times / 20.0)
    design = np.stack([np.ones_like(times), times], axis=-1) * weights[:, None]
    velocity = np.zeros((count, dimension))
    if len(times) > 2:
        rows = (weights[:, None] * places.transpose(1, 0, 2).reshape(len(times), -1)).reshape(len(times), -1)
        velocity = np.linalg.lstsq(design, rows, rcond=None)[0][1].reshape(count, dimension)
    direction = np.tile(means.bearings[-1], (count, 1))
    point = len(shape.grid) // 2
    return shape.begin(np.full(count, point, dtype=np.intp), ranges, direction, velocity)


def _same(shape: MotionShape, one: LaplaceFit, others: LaplaceFit) -> NDArray[np.bool_]:
    """Whether a fitted motion is the same as each of the others."""
    log_range = [shape.log_range(found.motions) for found in (one, others)]
    deviation = [shape.prior.range.log_std * np.sqrt(found.covariance[:, 0, 0]) for found in (one, others)]
    apart = np.abs(log_range[0] - log_range[1]) / (0.05 + np.maximum(*deviation))
    turn = np.abs(np.angle(np.exp(1j * (one.motions.heading - others.motions.heading))))
    return np.asarray((apart < APART) & (turn < 0.8))


def _log_mean(values: Array) -> float:
    """Logarithm of the mean of the exponentials."""
    largest = float(np.max(values))
    return largest + float(np.log(np.mean(np.exp(values - largest))))
