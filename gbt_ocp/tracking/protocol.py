"""What every tracker offers: bearings in, a predicted position with its covariance out."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.tracking.linalg import symmetric
from gbt_ocp.typing import Array


class Forecast(NamedTuple):
    """Predicted positions at K times.

    Attributes
    ----------
    mean
        μ ``(K, d)`` in metres.
    covariance
        Σ ``(K, d, d)`` in m²; NaN from an estimator that has none.
    """

    mean: Array
    covariance: Array


class WeighedForecasts(NamedTuple):
    """Predicted positions under each of M hypotheses, at K times.

    Attributes
    ----------
    weights
        Probability of each ``(M,)``; they sum to one.
    means
        ``(M, K, d)`` in metres.
    covariances
        ``(M, K, d, d)`` in m².
    """

    weights: Array
    means: Array
    covariances: Array


def mixed(weights: Array, means: Array, covariances: Array) -> tuple[Array, Array]:
    """Mean and covariance of mixtures of M Gaussians.

    By total expectation and covariance: ``μ = Σ w_m μ_m``, ``Σ = Σ w_m (Σ_m + (μ_m - μ)(μ_m - μ)ᵀ)``.

    Parameters
    ----------
    weights
        ``(M, ...)``; they sum to one over the first axis.
    means, covariances
        ``(M, ..., n)`` and ``(M, ..., n, n)``. The axes between the first and the last broadcast against those of the
        weights.

    Returns
    -------
    Mean ``(..., n)`` and covariance ``(..., n, n)``, symmetric.
    """
    mean = np.einsum("m...,m...i->...i", weights, means)
    apart = means - mean
    covariance = np.einsum("m...,m...ij->...ij", weights, covariances)
    covariance += np.einsum("m...,m...i,m...j->...ij", weights, apart, apart)
    return mean, symmetric(covariance)


def mixed_at_median(weights: Array, means: Array, covariances: Array) -> tuple[Array, Array]:
    """Moments in direction and log range of M Gaussians relative to the vehicle, mapped to metres at their median.

    Parameters
    ----------
    weights
        ``(M,)``; they sum to one.
    means, covariances
        ``(M, K, d)`` in metres and ``(M, K, d, d)`` in m².
    """
    ranges = np.maximum(np.linalg.norm(means, axis=-1, keepdims=True), 1e-3)
    units = means / ranges
    log_range = np.tensordot(weights, np.log(ranges), 1)
    middle = np.tensordot(weights, units, 1)
    middle /= np.maximum(np.linalg.norm(middle, axis=-1, keepdims=True), 1e-9)
    off = (np.log(ranges) - log_range) * middle + units - middle
    spread = np.tensordot(weights, covariances / ranges[..., None] ** 2, 1)
    spread += np.einsum("m,mki,mkj->kij", weights, off, off)
    return np.exp(log_range) * middle, np.exp(2.0 * log_range)[..., None] * spread


@runtime_checkable
class KeepsHypotheses(Protocol):
    """A tracker that may believe in several motions at once."""

    def hypotheses_at(self, times: ArrayLike) -> WeighedForecasts:
        """What each of them predicts at the times ``(K,)`` in seconds; their mixture is the forecast."""


class JointForecast(NamedTuple):
    """What a Gaussian process knows of positions at K times together, and of bearings to come.

    Attributes
    ----------
    covariance
        ``(K, d, K, d)`` in m².
    floor, angle_variance
        Variance of a further bearing across the line of sight at a range r: ``floor + angle_variance r²``, in m² and
        rad².
    """

    covariance: Array
    floor: float
    angle_variance: float


@runtime_checkable
class JointlyGaussian(Protocol):
    """A tracker that knows how positions at several times vary together, whatever will be measured."""

    def joint(self, times: ArrayLike) -> JointForecast:
        """Of the target's positions at the times ``(K,)`` in seconds."""


@runtime_checkable
class KnowsMotion(Protocol):
    """A tracker that knows how position and velocity vary together."""

    def motion_at(self, time: float) -> Array | None:
        """Covariance of position and velocity at a time in seconds ``(2d, 2d)``, in m², m²/s and m²/s².

        ``None`` before there is anything to know.
        """


RANGE_OBSERVABLE = 0.25
"""Posterior deviation of the range over the range below which range counts as observable."""


def relative_range_std(mean: Array, covariance: Array, own: Array) -> Array:
    """Posterior deviation of the range over the range to the posterior mean: ``(...)``.

    Parameters
    ----------
    mean, covariance
        Of the position, ``(..., d)`` in metres and ``(..., d, d)`` in m².
    own
        Own positions ``(..., d)`` in metres.

    Returns
    -------
    NaN where the covariance is unknown, infinity where the mean lies on the vehicle.
    """
    line = mean - own
    distance = np.linalg.norm(line, axis=-1)
    along = np.einsum("...i,...ij,...j->...", line, covariance, line)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(distance > 0.0, np.sqrt(np.maximum(along, 0.0)) / distance**2, np.inf))


class Tracker(Protocol):
    """Estimates where the target is and will be, from bearings alone."""

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in one bearing ``(d,)`` measured from ``own_position`` ``(d,)`` at ``time`` in seconds."""

    def predict(self, times: ArrayLike) -> Forecast:
        """Posterior of the target's position at the times ``(K,)`` in seconds."""


@runtime_checkable
class PositionTracker(Protocol):
    """An estimator that is given the target's measured position instead of a bearing.

    Attributes
    ----------
    position_std
        Standard deviation in metres of the measured position on each axis.
    """

    position_std: float

    def update_position(self, time: float, position: ArrayLike) -> None:
        """Take in a position ``(d,)`` in metres measured at ``time`` in seconds."""

    def predict(self, times: ArrayLike) -> Forecast:
        """Posterior of the target's position at the times ``(K,)`` in seconds."""


class Scales(Protocol):
    """What is recorded of a process's hyperparameters."""

    @property
    def length_scale(self) -> float:
        """In seconds."""

    @property
    def amplitude(self) -> float:
        """Standard deviation of a coordinate in metres."""

    @property
    def nugget(self) -> float:
        """Variance of a measurement relative to the amplitude squared."""


@runtime_checkable
class GaussianProcess(Tracker, Protocol):
    """A tracker that tunes a kernel on its window and bounds its own error; the closed loop records both."""

    nugget_retries: int
    """How often the nugget had to be raised before a factorisation succeeded."""

    @property
    def hyperparameters(self) -> Scales:
        """θ of the latest posterior."""

    @property
    def prior_covariance(self) -> Array:
        """Prior covariance of the position at any time under θ ``(d, d)`` in m²."""

    def bound(self, times: ArrayLike, delta: float) -> Array:
        """Bound on the error at the times ``(K,)`` that holds with probability ``1 - delta``, in metres ``(K,)``."""
