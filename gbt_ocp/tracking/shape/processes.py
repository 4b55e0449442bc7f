"""The processes behind a motion's shape: turn rate, log speed and climb angle at knots, as factors of whitened ones.

A process at its knots is ``L z`` with z ~ N(0, I) and the Cholesky factor L of their covariance, knots of the past
first: those of the future then enter a forecast and not an estimate. Between knots it is interpolated linearly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Literal, NamedTuple

import numpy as np

from gbt_ocp.tracking.gp.kernels import matern32, ornstein_uhlenbeck
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.typing import Array

SLOWER = 2
"""Knots of the turn rate per knot of log speed and climb angle, which vary more slowly."""

JITTER = 1.0e-9
"""Relative variance added to the knots, so that smooth kernels have a Cholesky factor."""


class ShapeHyperparameters(NamedTuple):
    """One point of the grid: deviations in rad/s, 1 (log speed) and rad, times in s."""

    turn_std: float
    turn_time: float
    speed_std: float
    speed_time: float
    climb_std: float
    climb_time: float


@dataclass(frozen=True)
class ShapePrior:
    """Prior of a motion: what the user may know of it, and the grid over which the rest is averaged.

    Attributes
    ----------
    speed
        Speed of the target in m/s.
    range
        Range of the target in metres, at whatever time it is asked for.
    climb_std
        Standard deviation of the climb angle in radians; of no meaning in the plane.
    kernel
        Of the turn rate: ``matern32`` (smooth) or ``ou`` (Ornstein-Uhlenbeck: it jumps).
    turn_stds, turn_times, speed_stds
        The grid: standard deviation of the turn rate in rad/s, its time scale in s, and standard deviation of the
        change of log speed.
    speed_time, climb_change_std, climb_time
        Time scale in s of the change of log speed; standard deviation in radians and time scale of the change of the
        climb angle. Both are Ornstein-Uhlenbeck processes.
    """

    speed: LogNormal = field(default_factory=lambda: LogNormal(1.0, 1.0))
    range: LogNormal = field(default_factory=lambda: LogNormal(50.0, 1.0))
    climb_std: float = 0.3
    kernel: Literal["matern32", "ou"] = "matern32"
    turn_stds: Sequence[float] = (0.01, 0.03, 0.09)
    turn_times: Sequence[float] = (8.0, 25.0)
    speed_stds: Sequence[float] = (0.03, 0.1, 0.3)
    speed_time: float = 30.0
    climb_change_std: float = 0.1
    climb_time: float = 20.0

    def __post_init__(self) -> None:
        deviations = (*self.turn_stds, *self.turn_times, *self.speed_stds, self.climb_std, self.climb_change_std)
        if not (self.grid() and min(*deviations, self.speed_time, self.climb_time) > 0.0):
            raise ValueError("deviations and times of the processes: allowed: numbers > 0, at least one of each")

    def grid(self) -> list[ShapeHyperparameters]:
        """All points of the grid."""
        return [
            ShapeHyperparameters(turn, time, speed, self.speed_time, self.climb_change_std, self.climb_time)
            for turn, time, speed in product(self.turn_stds, self.turn_times, self.speed_stds)
        ]


class Operators(NamedTuple):
    """From whitened knots to nodes, for each of the T points of the grid.

    Attributes
    ----------
    nodes
        Evenly spaced times, the first of them now ``(G,)`` in seconds.
    turn, rate, speed, climb
        Change of the heading since now, turn rate, and changes of log speed and climb angle: ``(T, G, m)``.
    """

    nodes: Array
    turn: Array
    rate: Array
    speed: Array
    climb: Array


def operators(prior: ShapePrior, knot: float, steps: int, past: int, future: int) -> Operators:
    """Operators of the nodes of the past, or of those ahead.

    Parameters
    ----------
    prior
        The processes.
    knot
        Time between knots of the turn rate in seconds.
    steps
        Nodes per knot.
    past
        Slow knots behind now.
    future
        Slow knots ahead; 0 for the nodes of the past.
    """
    fast_knots = _knots(knot, SLOWER * past, SLOWER * future)
    slow_knots = _knots(SLOWER * knot, past, future)
    step = (1.0 if future else -1.0) * knot / steps
    nodes = np.asarray(step * np.arange(SLOWER * steps * (future or past) + 1), dtype=float)
    fast, slow = _between(fast_knots, nodes), _between(slow_knots, nodes)
    integral = np.zeros_like(fast)
    integral[1:] = np.cumsum(0.5 * step * (fast[1:] + fast[:-1]), axis=0)

    grid, factors = prior.grid(), unit_factors(prior, knot, past, future)
    turned = {time: integral @ factor for time, factor in factors.turn.items()}
    turning = {time: fast @ factor for time, factor in factors.turn.items()}
    faster, steeper = slow[:, 1:] @ factors.speed, slow[:, 1:] @ factors.climb
    return Operators(
        nodes,
        np.stack([point.turn_std * turned[point.turn_time] for point in grid]),
        np.stack([point.turn_std * turning[point.turn_time] for point in grid]),
        np.stack([point.speed_std * faster for point in grid]),
        np.stack([point.climb_std * steeper for point in grid]),
    )


class UnitFactors(NamedTuple):
    """Lower Cholesky factors of the processes at their knots, of deviation 1.

    Attributes
    ----------
    turn
        Of the turn rate, by its time scale in s.
    speed, climb
        Of log speed and climb angle, which are zero now; the knot of now is left out.
    """

    turn: dict[float, Array]
    speed: Array
    climb: Array


def unit_factors(prior: ShapePrior, knot: float, past: int, future: int) -> UnitFactors:
    """Factors at the knots of :func:`operators`."""
    kernel = {"matern32": matern32, "ou": ornstein_uhlenbeck}[prior.kernel]
    fast_knots = _knots(knot, SLOWER * past, SLOWER * future)
    slow_knots, identity = _knots(SLOWER * knot, past, future), np.eye(len(fast_knots))
    return UnitFactors(
        {
            float(time): np.asarray(np.linalg.cholesky(kernel(_lags(fast_knots) / time) + JITTER * identity))
            for time in prior.turn_times
        },
        _pinned(slow_knots, prior.speed_time),
        _pinned(slow_knots, prior.climb_time),
    )


def interpolation(nodes: Array, times: Array) -> Array:
    """Weights ``(K, G)`` of linear interpolation between evenly spaced nodes ``(G,)``, held beyond their ends."""
    place = np.clip((times - nodes[0]) / (nodes[1] - nodes[0]), 0.0, len(nodes) - 1.0)
    left = np.minimum(place.astype(np.intp), len(nodes) - 2)
    weights = np.zeros((len(times), len(nodes)))
    rows = np.arange(len(times))
    weights[rows, left] = 1.0 - (place - left)
    weights[rows, left + 1] = place - left
    return weights


def applied(matrices: Array, vectors: Array) -> Array:
    """Products of matrices ``(B, i, j)`` and vectors ``(B, j)``."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def _knots(spacing: float, past: int, future: int) -> Array:
    """Now, the past from now backwards, the future from now onwards."""
    return np.concatenate([-spacing * np.arange(past + 1), spacing * np.arange(1, future + 1)])


def _between(knots: Array, nodes: Array) -> Array:
    """Weights ``(G, m)`` of linear interpolation between knots in the order of :func:`_knots`."""
    order = np.argsort(knots)
    weights = np.zeros((len(nodes), len(knots)))
    weights[:, order] = interpolation(knots[order], nodes)
    return weights


def _pinned(knots: Array, time: float) -> Array:
    """Factor of an Ornstein-Uhlenbeck process that is zero now, whose first knot is left out."""
    rest = knots[1:]
    since = ornstein_uhlenbeck(rest / time)
    return np.asarray(
        np.linalg.cholesky(ornstein_uhlenbeck(_lags(rest) / time) - np.outer(since, since) + JITTER * np.eye(len(rest)))
    )


def _lags(times: Array) -> Array:
    """Differences of the times ``(m,)``: ``(m, m)``."""
    return np.asarray(times[:, None] - times[None, :])
