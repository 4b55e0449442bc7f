"""Moments of the position ahead, of Gaussians that hold their turn rate and draw it again now and then.

A turn rate ω that is held for times of mean h and then drawn again with variance σ² has the mean ``ω e^(-t/h)``, the
variance ``(1 - e^(-t/h)) (σ² + ω² e^(-t/h))``, and the covariance of two times is ``e^(-(t-s)/h)`` times the variance
at the earlier one, s. A Gaussian process with independent steps has the same moments, as the deviation of log speed has
by itself. So nothing is summed over draws to come. Course and log speed at nodes of time are linear in
the state now and in independent draws between the nodes; the position is the integral of the velocity at their means,
by the trapezoidal rule, and its slopes are integrals of those of the velocity.
"""

from __future__ import annotations

import numpy as np

from gbt_ocp.tracking.held.bank import (
    CHANGE,
    CLIMB,
    COURSE,
    LARGEST_LOG_SPEED,
    LEVEL,
    TURN,
    Components,
    HeldTurnPrior,
)
from gbt_ocp.typing import Array


def _fading(times: Array, scale: float) -> tuple[Array, Array]:
    """What is left of a value now at each node ``(G,)``, and at each node of a draw at each later one ``(G, G-1)``."""
    lags = times[:, None] - times[None, 1:]
    return np.exp(-times / scale), np.where(lags >= 0.0, np.exp(-np.maximum(lags, 0.0) / scale), 0.0)


def _draws(variances: Array, left: Array) -> Array:
    """Standard deviations of the draws ``(N, G-1)`` that make up variances at the nodes ``(N, G)``."""
    keep = left[1:] / left[:-1]
    return np.sqrt(np.maximum(variances[:, 1:] - keep**2 * variances[:, :-1], 0.0))


def _held_draws(left: Array, present: Array, drawn: Array) -> Array:
    """The same for a value that is held: its mean square now and the variance of a draw are ``(N,)``."""
    return _draws((1.0 - left) * (drawn[:, None] + present[:, None] * left), left)


def _integral(times: Array) -> Array:
    """The trapezoidal rule from the first node to each ``(G, G)``."""
    steps = 0.5 * np.diff(times)
    weights = np.zeros((len(times), len(times)))
    below = np.tril(np.ones((len(times), len(times) - 1)), -1)
    weights[:, :-1] += below * steps
    weights[:, 1:] += below * steps
    return weights


def positions_ahead(prior: HeldTurnPrior, given: Components, times: Array) -> tuple[Array, Array]:
    """Positions relative to the own one now, of each component.

    Parameters
    ----------
    prior
        Of the motion.
    given
        N components now.
    times
        Nodes ``(G,)`` in seconds from now, the first of them 0, increasing.

    Returns
    -------
    Means ``(N, G, d)`` in metres and covariances ``(N, G, d, d)`` in m².
    """
    m = given.means
    turn_std, speed_std = (values[given.branches] for values in prior.branches)
    left, draws = _fading(times, prior.hold)
    kept, changes = _fading(times, prior.speed_time)
    add_up = _integral(times)
    turned = add_up @ np.column_stack([left, draws])  # course of a turn rate now, and of its draws
    course = m[:, COURSE, None] + m[:, TURN, None] * turned[:, 0]
    speed = np.exp(np.minimum(m[:, LEVEL, None] + m[:, CHANGE, None] * kept, LARGEST_LOG_SPEED))
    along = speed[..., None] * np.stack([np.cos(course), np.sin(course)], axis=-1)  # (N, G, 2)
    across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    place, now = given.positions()
    count, d, _ = now.shape
    nodes = len(times)
    means = np.repeat(place[:, None], nodes, axis=1)
    means[..., :2] += add_up @ along
    slopes = np.repeat(now[:, None], nodes, axis=1)  # by the state now
    ones = np.ones(nodes)
    by_course = np.column_stack([ones, turned])
    by_speed = np.column_stack([ones, kept, changes])
    # (N, 2, G, columns): integrals of the velocity's slopes
    sideways = add_up @ (np.swapaxes(across, 1, 2)[..., None] * by_course)
    onwards = add_up @ (np.swapaxes(along, 1, 2)[..., None] * by_speed)
    sideways, onwards = np.swapaxes(sideways, 1, 2), np.swapaxes(onwards, 1, 2)
    slopes[:, :, :2, [COURSE, TURN]] += sideways[..., :2]
    slopes[:, :, :2, [LEVEL, CHANGE]] += onwards[..., :2]
    turns = _held_draws(left, m[:, TURN] ** 2 + given.covariances[:, TURN, TURN], turn_std**2)
    speeds = _draws(speed_std[:, None] ** 2 * (1.0 - kept**2), kept)
    noises = np.concatenate(
        [turns[:, None, None] * sideways[..., 2:], speeds[:, None, None] * onwards[..., 2:]], axis=-1
    )
    spread = np.zeros((count, nodes, d, d))
    spread[..., :2, :2] = noises @ np.swapaxes(noises, -1, -2)
    if d == 3:
        means[..., 2] += m[:, CLIMB, None] * turned[:, 0]
        slopes[:, :, 2, CLIMB] += turned[:, 0]
        present = m[:, CLIMB] ** 2 + given.covariances[:, CLIMB, CLIMB]
        climbs = _held_draws(left, present, np.full(count, prior.climb_std**2))
        spread[..., 2, 2] += climbs**2 @ (turned[:, 1:] ** 2).T
    spread += slopes @ given.covariances[:, None] @ np.swapaxes(slopes, -1, -2)
    return means, spread
