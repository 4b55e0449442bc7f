"""Linear motion models of the filters: transition matrices and white noise on the highest derivative.

A state stacks position, velocity and, with acceleration, a third block, each ``(d,)``. The noise is that of continuous
white noise integrated over the step (Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and
Navigation*, sections 6.2 and 11.7), of unit density in m²/s³ on the velocity and m²/s⁵ on the acceleration.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.typing import Array


def _each_axis(coefficients: Array, dimension: int) -> Array:
    """Blocks ``c[i, j] I`` for coefficients ``(..., m, m)``: ``(..., md, md)``."""
    blocks = coefficients[..., :, None, :, None] * np.eye(dimension)[None, :, None, :]
    size = coefficients.shape[-1] * dimension
    return np.asarray(blocks.reshape(*coefficients.shape[:-2], size, size))


def constant_velocity(step: ArrayLike, dimension: int) -> tuple[Array, Array]:
    """Transition and unit noise of [p, v] over steps ``(...)`` in seconds: two ``(..., 2d, 2d)``."""
    t = np.asarray(step, dtype=float)
    transition, noise = np.zeros((2, *t.shape, 2, 2))
    transition[..., 0, 0] = transition[..., 1, 1] = 1.0
    transition[..., 0, 1] = noise[..., 1, 1] = t
    noise[..., 0, 0] = t**3 / 3.0
    noise[..., 0, 1] = noise[..., 1, 0] = t**2 / 2.0
    return _each_axis(transition, dimension), _each_axis(noise, dimension)


def constant_acceleration(step: ArrayLike, dimension: int) -> tuple[Array, Array]:
    """Transition and unit noise of [p, v, a] over steps ``(...)`` in seconds: two ``(..., 3d, 3d)``."""
    t = np.asarray(step, dtype=float)
    transition, noise = np.zeros((2, *t.shape, 3, 3))
    transition[..., 0, 0] = transition[..., 1, 1] = transition[..., 2, 2] = 1.0
    transition[..., 0, 1] = transition[..., 1, 2] = noise[..., 2, 2] = t
    transition[..., 0, 2] = noise[..., 1, 2] = noise[..., 2, 1] = t**2 / 2.0
    noise[..., 0, 0] = t**5 / 20.0
    noise[..., 0, 1] = noise[..., 1, 0] = t**4 / 8.0
    noise[..., 0, 2] = noise[..., 2, 0] = t**3 / 6.0
    noise[..., 1, 1] = t**3 / 3.0
    return _each_axis(transition, dimension), _each_axis(noise, dimension)


def with_constant(transition: Array, noise: Array) -> tuple[Array, Array]:
    """Transition and noise ``(..., n+1, n+1)`` of a state with a constant behind it."""
    n = transition.shape[-1]
    longer, calm = np.zeros((2, *transition.shape[:-2], n + 1, n + 1))
    longer[..., :n, :n], calm[..., :n, :n] = transition, noise
    longer[..., n, n] = 1.0
    return longer, calm


def sized_state(size: LogNormal | None, mean: Array, covariance: Array) -> tuple[Array, Array]:
    """A state ``(..., n)`` and its covariance with the logarithm of the size behind it, where that is estimated."""
    if size is None:
        return mean, covariance
    n = mean.shape[-1]
    longer = np.zeros((*covariance.shape[:-2], n + 1, n + 1))
    longer[..., :n, :n] = covariance
    longer[..., n, n] = size.log_std**2
    log_median = np.full((*mean.shape[:-1], 1), np.log(size.median))
    return np.concatenate([mean, log_median], axis=-1), longer


def size_estimate(size: LogNormal | None, mean: Array, covariance: Array) -> LogNormal | None:
    """What a state ``(n,)`` that ends with the logarithm of the size knows of it."""
    return None if size is None else LogNormal(float(np.exp(mean[-1])), float(np.sqrt(covariance[-1, -1])))


def turn_rate(velocity: Array, acceleration: Array, limit: float) -> Array:
    """Rate matrix W of a turn, ``dv/dt = W v``: ``(a vᵀ - v aᵀ)/‖v‖²`` in rad/s, ``(d, d)``.

    It turns in the plane of v and a, in two dimensions as in three, by ``‖v × a‖/‖v‖²``; a faster turn is slowed down
    to the limit.
    """
    speed = float(velocity @ velocity)
    if speed == 0.0:
        return np.zeros((len(velocity), len(velocity)))
    turn = (np.outer(acceleration, velocity) - np.outer(velocity, acceleration)) / speed
    rate = float(np.linalg.norm(turn)) / np.sqrt(2.0)
    return turn if rate <= limit else turn * (limit / rate)


def coordinated_turn(step: ArrayLike, turn: Array) -> Array:
    """Transition of [p, v, a] over steps ``(...)`` at the rate matrix W of :func:`turn_rate`: ``(..., 3d, 3d)``.

    ``v' = exp(W T) v``, ``p' = p + ∫ exp(W s) ds v``, ``a' = W v'``; W³ = -w² W makes both sums of three terms.
    """
    t = np.asarray(step, dtype=float)[..., None, None]
    dimension = len(turn)
    identity, square = np.eye(dimension), turn @ turn
    angle = float(np.linalg.norm(turn)) / np.sqrt(2.0) * t
    # (1 - cos x)/x² and (x - sin x)/x³, which cancel near 0
    first = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    near = np.abs(angle) < 1e-2
    large = np.where(near, 1.0, angle)
    second = np.where(near, 1.0 / 6.0 - angle**2 / 120.0, (large - np.sin(large)) / large**3)
    rotation = identity + np.sinc(angle / np.pi) * t * turn + first * t**2 * square
    transition = np.zeros((*t.shape[:-2], 3 * dimension, 3 * dimension))
    p, v, a = (slice(i * dimension, (i + 1) * dimension) for i in range(3))
    transition[..., p, p] = identity
    transition[..., p, v] = t * identity + first * t**2 * turn + second * t**3 * square
    transition[..., v, v] = rotation
    transition[..., a, v] = turn @ rotation
    return transition
