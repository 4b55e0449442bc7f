"""What is known of the target's path ahead, as the covariance of its positions at several times.

Position and velocity now have the covariance P, and the velocity changes by white noise with the spectral density Q (a
matrix in m²/s³). Then, with ``H(t) = [I, t I]`` and s the earlier of two times,

    Cov(P_T(t), P_T(t')) = H(t) P H(t')ᵀ + (s²/2) (max(t, t') - s/3) Q.

P is the tracker's own where it has one. Else P and Q are those with which this agrees best, by least squares, with the
covariances that the tracker forecasts: on ``t = t'`` it is ``Σ + t S + t² V + (t³/3) Q`` with the covariance Σ of the
position, V of the velocity, and S twice the symmetric part of that between them, whose other part no forecast shows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.sizes import not_negative, positive
from gbt_ocp.tracking.linalg import symmetric
from gbt_ocp.tracking.protocol import (
    JointForecast,
    JointlyGaussian,
    KnowsMotion,
    PositionTracker,
    Tracker,
)
from gbt_ocp.typing import Array


def path_covariance(times: ArrayLike, present: Array, ahead: Array, motion: Array | None = None) -> Array:
    """Covariance of the positions at several times with each other ``(K, d, K, d)`` in m².

    Parameters
    ----------
    times
        In seconds from now, above 0 ``(K,)``.
    present, ahead
        Covariance of the position now ``(d, d)`` and at these times ``(K, d, d)`` in m², as forecast.
    motion
        Covariance of position and velocity now ``(2d, 2d)``, where it is known.
    """
    t, d = np.asarray(times, dtype=float), len(present)
    if motion is None:
        motion = _motion_of(t, present, ahead)
    way = np.concatenate([np.tile(np.eye(d), (len(t), 1, 1)), t[:, None, None] * np.eye(d)], axis=2)
    straight = np.einsum("kia,ab,ljb->kilj", way, motion, way)
    cubes, weights = t**3 / 3.0, 1.0 / t**2
    left = ahead - np.einsum("kikj->kij", straight)
    density = _definite(np.einsum("k,kij->ij", weights**2 * cubes, left) / np.sum((weights * cubes) ** 2))
    first, last = np.minimum.outer(t, t), np.maximum.outer(t, t)
    spread = 0.5 * first**2 * (last - first / 3.0)
    return np.asarray(straight + np.einsum("kl,ij->kilj", spread, density))


def _motion_of(times: Array, present: Array, ahead: Array) -> Array:
    """Covariance of position and velocity now that agrees best with covariances of the position ahead."""
    d, weights = len(present), 1.0 / times**2
    powers = np.stack([times, times**2, times**3 / 3.0], axis=1)
    values = (ahead - present).reshape(len(times), -1)
    found = np.linalg.lstsq(weights[:, None] * powers, weights[:, None] * values, rcond=None)[0].reshape(3, d, d)
    return _definite(np.block([[present, 0.5 * found[0]], [0.5 * found[0].T, found[1]]]))


def _definite(matrix: Array) -> Array:
    """The symmetric part of a matrix without its negative eigenvalues, each variable in units of its deviation."""
    even = symmetric(matrix)
    size = np.sqrt(np.maximum(np.diag(even), 1e-12))
    values, vectors = np.linalg.eigh(even / np.outer(size, size))
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T * np.outer(size, size))


class PathBelief:
    """The path ahead as a tracker believes it, and what bearings to come will be worth.

    Parameters
    ----------
    tracker
        Whose belief it is.
    angle_variance
        Variance in rad² of the bearings of one piece of a plan together, beside what a tracker says of its own.
    ahead
        Seconds from some of the times that are asked for to others that are added.
    stages
        Numbers of those times, counted from 0.

    Raises
    ------
    ValueError
        If the variance is below 0, or ``ahead`` is not above it.
    """

    def __init__(
        self, tracker: Tracker | PositionTracker, angle_variance: float, ahead: float, stages: Sequence[int]
    ) -> None:
        self._tracker = tracker
        self._angle_variance = not_negative("angle_variance", angle_variance)
        self._ahead = positive("ahead", ahead)
        self._stages = list(stages)

    def __call__(self, now: float, times: ArrayLike) -> JointForecast:
        """Covariances of the positions at the times ``(K,)`` in seconds, after ``now``, and at the added ones."""
        asked, tracker = np.asarray(times, dtype=float), self._tracker
        t = np.concatenate([asked, asked[self._stages] + self._ahead])
        if isinstance(tracker, JointlyGaussian):
            found: JointForecast = tracker.joint(t)
            return found._replace(angle_variance=found.angle_variance + self._angle_variance)
        covariances = np.nan_to_num(tracker.predict(np.concatenate([[now], t])).covariance, nan=0.0)
        motion = tracker.motion_at(now) if isinstance(tracker, KnowsMotion) else None
        path = path_covariance(t - now, covariances[0], covariances[1:], motion)
        return JointForecast(path, 0.0, self._angle_variance)


PathForecast = Callable[[float, ArrayLike], JointForecast]
"""What gives, at a time, the covariances of the positions at later times together."""
