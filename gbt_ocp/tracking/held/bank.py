"""Gaussians in log-polar coordinates, one for each time at which the turn rate may have been drawn last.

A boat holds its rudder for a while. With a constant hazard of letting go, what is known of it is a mixture over the
time of the last change (the run length of Adams and MacKay, Bayesian online changepoint detection, arXiv:0710.3742,
2007). Each component is an extended Kalman filter of

    β, ρ = log r, χ, ω, ℓ, s (in space ε, w; last the log of the size, where that is estimated):

azimuth and log range of the target seen from the vehicle, its course, turn rate, level of the log speed and deviation
from it (Ornstein-Uhlenbeck); in space its elevation and vertical speed as well. Bearings are coordinates of this state,
so an update is linear, and what is not observable, the scale of range and speed, is a straight line in it (Aidala and
Hammel, Utilization of modified polar coordinates for bearings-only tracking, IEEE T. Automatic Control 28, 1983).
At each step all components give a part of their weight to one whose turn rate is drawn again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.typing import Array

AZIMUTH, LOG_RANGE, COURSE, TURN, LEVEL, CHANGE, ELEVATION, CLIMB = range(8)
"""Places in a state; the last two in space only."""

LOG_SIZE = -1
"""Place of the log of the size, where it is estimated."""

LARGEST_LOG_SPEED = float(np.log(30.0))
"""Of a component whose speed nothing has told yet."""

NEAREST_SQUARED = 1.0
"""Square in m² of the range below which a component no longer tells directions apart."""

LEAST_COSINE = 0.05
"""Least cosine of an elevation: straight above the vehicle there is no azimuth."""

FORGOTTEN = 1.0e-6
"""Weight below which a component is dropped."""


@dataclass(frozen=True)
class HeldTurnPrior:
    """What is known of the motion.

    Attributes
    ----------
    speed
        Of the horizontal speed in m/s.
    range
        Of the range in metres at the first bearing.
    turn_stds
        Standard deviations of a turn rate when it is drawn, in rad/s; averaged over by evidence.
    hold
        Mean time in seconds for which a turn rate is held.
    speed_stds
        Standard deviations of the change of log speed, a manner each: a speed that is kept, one that drifts, and one
        that varies. Averaged over by evidence; where a turn rate is drawn, the manner may be another from then on.
    speed_time
        Time scale of that change in seconds.
    climb_std
        Standard deviation of a vertical speed when it is drawn, in m/s.
    size
        Of the target's true size in metres, where angular sizes are measured; ``None`` where it is not estimated.

    Raises
    ------
    ValueError
        If a number is not positive.
    """

    speed: LogNormal
    range: LogNormal
    turn_stds: tuple[float, ...] = (0.03,)
    hold: float = 20.0
    speed_stds: tuple[float, ...] = (0.007, 0.04, 0.2)
    speed_time: float = 30.0
    climb_std: float = 0.1
    size: LogNormal | None = None

    def __post_init__(self) -> None:
        numbers = (*self.turn_stds, self.hold, *self.speed_stds, self.speed_time, self.climb_std)
        if not (self.turn_stds and self.speed_stds and min(numbers) > 0.0):
            raise ValueError(
                f"turn_stds, hold, speed_stds, speed_time, climb_std: found {numbers}; allowed: numbers > 0"
            )

    @property
    def branches(self) -> tuple[Array, Array]:
        """Deviation of the turn rate and of the change of log speed under each pair ``(B,)``."""
        turn, speed = np.meshgrid(self.turn_stds, self.speed_stds, indexing="ij")
        return turn.ravel(), speed.ravel()


@dataclass(frozen=True)
class Components:
    """N weighed Gaussians.

    Attributes
    ----------
    log_weights
        ``(N,)``.
    means, covariances
        ``(N, n)`` and ``(N, n, n)``, n = 6 or 8, and one more where the size is estimated.
    branches
        The pair of deviations that each of them belongs to ``(N,)``.
    """

    log_weights: Array
    means: Array
    covariances: Array
    branches: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.log_weights)

    def __getitem__(self, which: NDArray[np.intp] | NDArray[np.bool_]) -> Components:
        return Components(self.log_weights[which], self.means[which], self.covariances[which], self.branches[which])

    @property
    def weights(self) -> Array:
        """Probabilities ``(N,)``."""
        share = np.exp(self.log_weights - self.log_weights.max())
        return np.asarray(share / share.sum())

    def joined(self, other: Components) -> Components:
        """These and others."""
        parts = zip(vars(self).values(), vars(other).values(), strict=True)
        return Components(*(np.concatenate(both) for both in parts))

    def likeliest(self, most: int) -> Components:
        """The likeliest, at most so many, without those that are :data:`FORGOTTEN`."""
        weights = self.weights
        keep = np.argsort(-weights, kind="stable")[:most]
        return self[keep[weights[keep] > FORGOTTEN]]

    @property
    def range_deviation(self) -> float:
        """Standard deviation of the log range."""
        weights = self.weights
        mean = weights @ self.means[:, LOG_RANGE]
        off = self.means[:, LOG_RANGE] - mean
        return float(np.sqrt(weights @ (self.covariances[:, LOG_RANGE, LOG_RANGE] + off**2)))

    def positions(self) -> tuple[Array, Array]:
        """Positions relative to the vehicle at the modes ``(N, d)``, and their slopes ``(N, d, n)``."""
        m = self.means
        r = np.exp(m[:, LOG_RANGE])
        cosine, sine = np.cos(m[:, AZIMUTH]), np.sin(m[:, AZIMUTH])
        if not in_space(m):
            place = np.stack([r * cosine, r * sine], axis=-1)
            slopes = np.zeros((len(m), 2, m.shape[1]))
            slopes[..., AZIMUTH] = np.stack([-r * sine, r * cosine], axis=-1)
        else:
            level, up = r * np.cos(m[:, ELEVATION]), r * np.sin(m[:, ELEVATION])
            place = np.stack([level * cosine, level * sine, up], axis=-1)
            slopes = np.zeros((len(m), 3, m.shape[1]))
            slopes[..., AZIMUTH] = np.stack([-level * sine, level * cosine, np.zeros_like(r)], axis=-1)
            slopes[..., ELEVATION] = np.stack([-up * cosine, -up * sine, level], axis=-1)
        slopes[..., LOG_RANGE] = place
        return place, slopes


def begun(prior: HeldTurnPrior, angles: Array, variance: float, ranges: int, levels: int, courses: int) -> Components:
    """Components at several ranges, speeds and courses on a first bearing, under every deviation of the turn rate.

    The speed of all of them changes in the first manner; it takes a while until that tells them apart.

    Parameters
    ----------
    prior
        Of the motion.
    angles
        Azimuth, and elevation in space, of the bearing in radians ``(d-1,)``.
    variance
        Of the bearing in rad².
    ranges, levels, courses
        How many of each.
    """
    turn, speed = prior.branches
    firsts = np.arange(0, len(turn), len(prior.speed_stds))
    n = (6 if len(angles) == 1 else 8) + (prior.size is not None)
    z, y = _grid(2.0, ranges), _grid(1.0, levels)
    # between the borders of the cells in which turn rates are drawn again: rounding would decide on them
    x = (np.arange(courses) + 0.5) * 2.0 * np.pi / courses - np.pi
    grid = np.stack(np.meshgrid(z, y, x, firsts, indexing="ij"), axis=-1).reshape(-1, 4)
    branch = grid[:, 3].astype(np.intp)
    means, covariances = np.zeros((len(grid), n)), np.zeros((len(grid), n, n))
    means[:, AZIMUTH] = angles[0]
    means[:, LOG_RANGE] = np.log(prior.range.median) + prior.range.log_std * grid[:, 0]
    means[:, COURSE] = grid[:, 2]
    means[:, LEVEL] = np.log(prior.speed.median) + prior.speed.log_std * grid[:, 1]
    spread = np.zeros((len(grid), n))
    spread[:, AZIMUTH] = variance
    spread[:, LOG_RANGE] = prior.range.log_std**2 * _remainder(z)
    spread[:, COURSE] = (0.6 * 2.0 * np.pi / courses) ** 2
    spread[:, TURN] = turn[branch] ** 2
    spread[:, LEVEL] = prior.speed.log_std**2 * _remainder(y)
    spread[:, CHANGE] = speed[branch] ** 2
    if len(angles) == 2:
        means[:, ELEVATION] = angles[1]
        spread[:, AZIMUTH] /= max(np.cos(angles[1]), LEAST_COSINE) ** 2
        spread[:, ELEVATION] = variance
        spread[:, CLIMB] = prior.climb_std**2
    if prior.size is not None:
        means[:, LOG_SIZE] = np.log(prior.size.median)
        spread[:, LOG_SIZE] = prior.size.log_std**2
    covariances[:, np.arange(n), np.arange(n)] = spread
    return Components(-0.5 * np.sum(grid[:, :2] ** 2, axis=1), means, covariances, branch)


def _grid(most: float, count: int) -> Array:
    """Numbers within so many deviations; opposite ones exactly so: no rounding makes one likelier than the other."""
    return most * (np.arange(1.0 - count, count, 2.0) / (count - 1)) if count > 1 else np.array([-most])


def _remainder(grid: Array) -> float:
    """Variance of the Gaussians on a grid that make up a standard one, weighed by its density."""
    weights = np.exp(-0.5 * grid**2)
    return max(1.0 - float(weights @ grid**2 / weights.sum()), 0.05)


def moved_on(given: Components, step: float, moved: Array) -> tuple[Array, Array]:
    """Positions ``step`` seconds later relative to the vehicle, which has moved by ``moved`` ``(d,)`` in metres.

    Returns
    -------
    Positions ``(N, d)`` in metres and their slopes by the states now ``(N, d, n)``. What is drawn in the meantime moves
    nothing yet.
    """
    m = given.means
    place, slopes = given.positions()
    course = m[:, COURSE] + 0.5 * step * m[:, TURN]
    way = step * np.exp(np.minimum(m[:, LEVEL] + m[:, CHANGE], LARGEST_LOG_SPEED))
    cosine, sine = way * np.cos(course), way * np.sin(course)
    place[:, 0] += cosine - moved[0]
    place[:, 1] += sine - moved[1]
    slopes[:, 0, COURSE], slopes[:, 1, COURSE] = -sine, cosine
    slopes[:, :2, TURN] = 0.5 * step * slopes[:, :2, COURSE]
    slopes[:, 0, LEVEL], slopes[:, 1, LEVEL] = cosine, sine
    slopes[:, :2, CHANGE] = slopes[:, :2, LEVEL]
    if len(moved) == 3:
        place[:, 2] += step * m[:, CLIMB] - moved[2]
        slopes[:, 2, CLIMB] = step
    return place, slopes


def advanced(prior: HeldTurnPrior, given: Components, step: float, moved: Array) -> Components:
    """The components ``step`` seconds later, the vehicle having moved by ``moved`` ``(d,)`` in metres."""
    m = given.means
    n, d = m.shape[1], len(moved)
    place, slopes = moved_on(given, step, moved)
    level = np.maximum(place[:, 0] ** 2 + place[:, 1] ** 2, LEAST_COSINE**2 * NEAREST_SQUARED)
    square = np.maximum(np.sum(place**2, axis=1), NEAREST_SQUARED)
    keep = np.exp(-abs(step) / prior.speed_time)
    transition = np.zeros((len(m), n, n))
    transition[:, np.arange(n), np.arange(n)] = 1.0
    transition[:, AZIMUTH] = (place[:, 0, None] * slopes[:, 1] - place[:, 1, None] * slopes[:, 0]) / level[:, None]
    transition[:, LOG_RANGE] = np.einsum("mi,mij->mj", place, slopes) / square[:, None]
    transition[:, COURSE, TURN] = step
    transition[:, CHANGE, CHANGE] = keep
    means = m.copy()
    means[:, AZIMUTH] += wrapped(np.arctan2(place[:, 1], place[:, 0]) - m[:, AZIMUTH])
    means[:, LOG_RANGE] = 0.5 * np.log(square)
    means[:, COURSE] = wrapped(m[:, COURSE] + step * m[:, TURN])
    means[:, CHANGE] *= keep
    if d == 3:
        flat = np.sqrt(level)
        along = (place[:, 0, None] * slopes[:, 0] + place[:, 1, None] * slopes[:, 1]) / flat[:, None]
        transition[:, ELEVATION] = (flat[:, None] * slopes[:, 2] - place[:, 2, None] * along) / square[:, None]
        means[:, ELEVATION] = np.arctan2(place[:, 2], flat)
    covariances = transition @ given.covariances @ np.swapaxes(transition, 1, 2)
    covariances[:, CHANGE, CHANGE] += prior.branches[1][given.branches] ** 2 * (1.0 - keep**2)
    return Components(given.log_weights, means, covariances, given.branches)


def in_space(means: Array) -> bool:
    """Whether states ``(N, n)`` have an elevation and a vertical speed."""
    return bool(means.shape[1] > CLIMB)


def wrapped(angle: Array) -> Array:
    """Angles in radians, in [-π, π)."""
    return np.asarray(np.mod(angle + np.pi, 2.0 * np.pi) - np.pi)
