"""Turn rates that are drawn again, and manners in which the speed changes from then on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.tracking.held.bank import (
    AZIMUTH,
    CHANGE,
    CLIMB,
    COURSE,
    FORGOTTEN,
    LEVEL,
    LOG_RANGE,
    TURN,
    Components,
    HeldTurnPrior,
    in_space,
    wrapped,
)

CELL = (0.4, np.pi / 4.0)
"""Log range and course within which components are taken together when the turn rate is drawn again."""

FARTHEST_CELL = 10
"""Cells of log range from that of the likeliest component, on either side; what is beyond is in the last."""

NEW_MANNER = 0.02
"""Probability that the speed changes in another manner where the turn rate is drawn again."""


def let_go(prior: HeldTurnPrior, given: Components, step: float) -> tuple[Components, Components]:
    """Those that hold on to their turn rate over ``step`` seconds, and one for each cell that draws it again."""
    share = -np.expm1(-step / prior.hold)
    held = Components(given.log_weights + np.log1p(-share), given.means, given.covariances, given.branches)
    given = in_other_manners(prior, given, NEW_MANNER)
    m = given.means
    log_range = np.floor(m[:, LOG_RANGE] / CELL[0])
    log_range = np.clip(log_range - log_range[np.argmax(given.log_weights)], -FARTHEST_CELL, FARTHEST_CELL)
    cells = np.stack([given.branches, log_range, np.floor(wrapped(m[:, COURSE]) / CELL[1])], axis=-1)
    _, label = np.unique(cells, axis=0, return_inverse=True)
    again = merged(given, np.asarray(label, dtype=np.intp).ravel())
    return held, drawn(prior, Components(again.log_weights + np.log(share), *list(vars(again).values())[1:]))


def in_every_manner(prior: HeldTurnPrior, given: Components) -> Components:
    """Those that began in one manner of changing the speed, and as likely in each other one."""
    return in_other_manners(prior, given, 1.0 - 1.0 / len(prior.speed_stds))


def in_other_manners(prior: HeldTurnPrior, given: Components, probability: float) -> Components:
    """Those given, and with a probability in other manners of changing the speed: in each of them alike.

    Another manner begins at the speed that there is: its level is that, and the change from it is drawn. None begins
    from what would be :data:`~gbt_ocp.tracking.held.bank.FORGOTTEN` with its share.
    """
    manners = len(prior.speed_stds)
    if manners == 1:
        return given
    kept = Components(given.log_weights + np.log1p(-probability), *list(vars(given).values())[1:])
    turn, manner = np.divmod(given.branches, manners)
    means, covariances = given.means.copy(), given.covariances.copy()
    means[:, LEVEL] += means[:, CHANGE]
    covariances[:, LEVEL] += covariances[:, CHANGE]
    covariances[:, :, LEVEL] += covariances[:, :, CHANGE]
    means[:, CHANGE] = 0.0
    covariances[:, CHANGE, :] = covariances[:, :, CHANGE] = 0.0
    share = probability / (manners - 1)
    some = share * np.exp(given.log_weights - given.log_weights.max()) > FORGOTTEN
    for further in range(1, manners):
        branches = turn * manners + (manner + further) % manners
        spread = covariances.copy()
        spread[:, CHANGE, CHANGE] = prior.branches[1][branches] ** 2
        kept = kept.joined(Components(given.log_weights + np.log(share), means, spread, branches)[some])
    return kept


def drawn(prior: HeldTurnPrior, given: Components) -> Components:
    """The same with the turn rate, and the vertical speed, drawn from the prior."""
    means, covariances = given.means.copy(), given.covariances.copy()
    new = [(TURN, prior.branches[0][given.branches] ** 2)]
    if in_space(means):
        new.append((CLIMB, np.full(len(given), prior.climb_std**2)))
    for place, variance in new:
        means[:, place] = 0.0
        covariances[:, place, :] = covariances[:, :, place] = 0.0
        covariances[:, place, place] = variance
    return Components(given.log_weights, means, covariances, given.branches)


def merged(given: Components, label: NDArray[np.intp]) -> Components:
    """One Gaussian for each label 0 … G-1, with the moments of those that have it, angles near the likeliest's."""
    top = given.log_weights.max()
    weights = np.exp(given.log_weights - top)
    count = int(label.max()) + 1
    member = (label[:, None] == np.arange(count)).astype(float)
    totals = weights @ member
    best = np.argmax(np.where(member > 0.0, given.log_weights[:, None], -np.inf), axis=0)
    means = given.means.copy()
    for angle in (AZIMUTH, COURSE):
        near = given.means[best[label], angle]
        means[:, angle] = near + wrapped(means[:, angle] - near)
    share = (weights[:, None] * member / np.maximum(totals, 1e-300)).T
    mean = share @ means
    apart = means - mean[label]
    n = means.shape[1]
    spread = given.covariances + apart[:, :, None] * apart[:, None, :]
    covariance = (share @ spread.reshape(len(given), n * n)).reshape(count, n, n)
    with np.errstate(divide="ignore"):
        return Components(np.log(totals) + top, mean, covariance, given.branches[best])
