"""Hypotheses of a motion: starts at several ranges, and which of the motions that fit are different ones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.tracking.bins import BinnedBearings
from gbt_ocp.tracking.shape.fit import Fit
from gbt_ocp.tracking.shape.motions import Motions, MotionShape
from gbt_ocp.typing import Array

APART = 1.0
"""Distance of two modes, in standard deviations of log range and heading, above which they are two hypotheses."""

UNLIKELY = np.log(1e-4)
"""Share of the evidence below which a hypothesis is given up and a component is left out of a forecast."""


class Hypothesis(NamedTuple):
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


def same_motion(shape: MotionShape, one: Fit, others: Fit) -> NDArray[np.bool_]:
    """Whether a component is the same motion as each of the others."""
    log_range = [shape.log_range(found.motions) for found in (one, others)]
    deviation = [shape.prior.range.log_std * np.sqrt(found.covariance[:, 0, 0]) for found in (one, others)]
    apart = np.abs(log_range[0] - log_range[1]) / (0.05 + np.maximum(*deviation))
    turn = np.abs(np.angle(np.exp(1j * (one.motions.heading - others.motions.heading))))
    return np.asarray((apart < APART) & (turn < 0.8))


def cold_starts(
    shape: MotionShape, means: BinnedBearings, now: float, own: Array, ranges: Array, point: int
) -> Motions:
    """Straight lines through the bearings at each of several ranges.

    Parameters
    ----------
    shape
        Of the motions.
    means
        The bearings in bins.
    now, own
        Time in seconds and own position ``(d,)`` in metres of the newest bearing.
    ranges
        Ranges in metres at which the lines begin ``(S,)``.
    point
        Number of the point of the grid of hyperparameters.
    """
    times = means.times - now
    count, dimension = len(ranges), len(own)
    places = means.own_positions - own + ranges[:, None, None] * means.bearings
    weights = np.sqrt(means.counts) * np.exp(times / 20.0)
    design = np.stack([np.ones_like(times), times], axis=-1) * weights[:, None]
    velocity = np.zeros((count, dimension))
    if len(times) > 2:
        rows = (weights[:, None] * places.transpose(1, 0, 2).reshape(len(times), -1)).reshape(len(times), -1)
        velocity = np.linalg.lstsq(design, rows, rcond=None)[0][1].reshape(count, dimension)
    direction = np.tile(means.bearings[-1], (count, 1))
    return shape.begin(np.full(count, point, dtype=np.intp), ranges, direction, velocity)


def distinct(shape: MotionShape, found: Fit, labels: NDArray[np.intp], most: int) -> tuple[Fit, NDArray[np.intp]]:
    """The likeliest hypotheses that are not the same motion twice.

    Parameters
    ----------
    shape
        Of the motions.
    found
        Components ``(B,)`` of all hypotheses.
    labels
        Number of the hypothesis of each component ``(B,)``.
    most
        How many hypotheses are kept.

    Returns
    -------
    The components that are kept, and the numbers of their hypotheses from 0 on.
    """
    names = np.unique(labels)
    totals = np.array([log_mean(found.log_evidence[labels == name]) for name in names])
    kept: list[int] = []
    best: list[int] = []
    for one in np.argsort(-totals):
        if len(kept) == most or totals[one] < totals.max() + UNLIKELY:
            break
        mine = np.flatnonzero(labels == names[one])
        top = int(mine[np.argmax(found.log_evidence[mine])])
        if not np.any(same_motion(shape, found[np.array([top])], found[np.array(best, dtype=np.intp)])):
            kept.append(int(names[one]))
            best.append(top)
    keep = np.isin(labels, kept)
    renumbered = np.unique(labels[keep], return_inverse=True)[1]
    return found[keep], np.asarray(renumbered, dtype=np.intp)


def log_mean(values: Array) -> float:
    """Logarithm of the mean of the exponentials."""
    largest = float(np.max(values))
    return largest + float(np.log(np.mean(np.exp(values - largest))))
