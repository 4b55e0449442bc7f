"""The pseudo-linear Kalman filter: constant velocity, and a bearing as a linear measurement across it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.bearings import tangent_basis
from gbt_ocp.models.measurements import MeasurementKind
from gbt_ocp.tracking.filters.kalman import predicted, updated
from gbt_ocp.tracking.filters.motion_models import constant_velocity
from gbt_ocp.tracking.gaps import Gaps, RestartingTracker
from gbt_ocp.tracking.polar import BEARINGS
from gbt_ocp.tracking.priors import RangedPrior
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.tracking.window import checked_sample
from gbt_ocp.typing import Array

NOISELESS = 1.0e-3
"""Range in metres below which the noise of a bearing shrinks no further: at no range it would have none."""


def pseudo_linear(bearing: Array, own: Array, size: int) -> tuple[Array, Array]:
    """H ``(d-1, size)`` and z ``(d-1,)`` of ``Nᵀ o = Nᵀ p`` for a state of ``size`` that begins with the position."""
    basis = tangent_basis(bearing)
    observation = np.zeros((basis.shape[1], size))
    observation[:, : len(own)] = basis.T
    return observation, basis.T @ own


def pseudo_noise(position: Array, own: Array, deviation: float) -> Array:
    """R = r̂² σ² I in m² ``(..., d-1, d-1)`` for the estimated positions ``(..., d)`` and σ in radians."""
    distance = np.maximum(np.linalg.norm(position - own, axis=-1), NOISELESS)
    return np.asarray((distance[..., None, None] * deviation) ** 2 * np.eye(len(own) - 1))


class PseudoLinearKalmanFilter(RestartingTracker):
    """State [p, v] with white noise on the velocity, updated in the tangent plane of the bearing.

    Law: Lin, Kirubarajan and Bar-Shalom, "Pseudo-measurement approach in target tracking using bearings-only
    measurements", and Aidala and Nardone, "Biased estimation properties of the pseudolinear tracking filter", IEEE
    Transactions on Aerospace and Electronic Systems 18 (1982). Written in the tangent plane, ``Nᵀ o = Nᵀ p`` with
    ``R = r̂² σ² I``, it is algebraically the filter with ``H = [P 0]`` and a pseudo-inverse, and its likelihood is a
    density.

    The noise of the bearing is in H too, which pulls the range towards the vehicle. The compensated filter takes that
    bias of each update off to second order in the noise: with ``dN = -g εᵀ`` and the residual ``r ε``,
    ``E[K r ε] = -r σ² (P⁺ g tr S⁻¹ - P N S⁻² Nᵀ P g)``, where P⁺ is the covariance after the update. Where R dominates
    S this is the compensation of Nguyen and Doğançay, "Improved pseudolinear Kalman filter algorithms for bearings-only
    target tracking", IEEE Transactions on Signal Processing 65 (2017); elsewhere theirs is too large.

    Parameters
    ----------
    prior
        Position before the first bearing, with its covariance.
    initial_variance
        P₀: of the velocity on each axis in m²/s², and of the position in m² where the prior knows nothing.
    process_noise
        q, spectral density of the white acceleration in m²/s³.
    bearing_std
        σ in radians.
    bias_compensated
        Whether the bias is taken off.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """

    takes: tuple[MeasurementKind, ...] = BEARINGS
    """Kinds of measurements that it takes."""

    def __init__(
        self,
        prior: RangedPrior,
        *,
        initial_variance: float,
        process_noise: float,
        bearing_std: float,
        bias_compensated: bool = False,
    ) -> None:
        if not (initial_variance > 0.0 and process_noise > 0.0 and bearing_std > 0.0):
            raise ValueError(
                "initial_variance, process_noise and bearing_std: "
                f"found {initial_variance}, {process_noise}, {bearing_std}; allowed: numbers > 0"
            )
        self._initial_variance = initial_variance
        self._process_noise = process_noise
        self._deviation = bearing_std
        self._bias_compensated = bias_compensated
        self._gaps = Gaps()
        self._begin(prior)

    def _begin(self, prior: RangedPrior) -> None:
        self._prior = prior
        self._time: float | None = None
        self._mean = np.concatenate([prior.unseen, np.zeros_like(prior.unseen)])
        self._covariance = np.full((self._mean.size,) * 2, np.nan)

    def _restart(self, own: Array) -> None:
        self._begin(self._prior.elsewhere(own))

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing ``(d,)`` measured at ``own_position`` ``(d,)``.

        Raises
        ------
        ValueError
            If numbers are not finite, the bearing is no unit vector, or time does not increase.
        """
        g, own = checked_sample(time, bearing, own_position, self._time)
        if self._gaps.ended(float(time)):
            self._restart(own)
        d = len(own)
        if self._time is None:
            position, covariance = self._prior.gaussian(g, own, self._initial_variance)
            self._mean = np.concatenate([position, np.zeros(d)])
            self._covariance = self._initial_variance * np.eye(2 * d)
            self._covariance[:d, :d] = covariance
        else:
            self._mean, self._covariance = self._ahead(float(time) - self._time)
        self._time = float(time)
        observation, value = pseudo_linear(g, own, 2 * d)
        noise = pseudo_noise(self._mean[:d], own, self._deviation)
        before = self._covariance
        done = updated(self._mean, before, observation, noise, value)
        self._mean, self._covariance = done.mean, done.covariance
        if self._bias_compensated:
            inverse = np.linalg.inv(done.innovation_covariance)
            across = before @ observation.T @ inverse
            line = np.concatenate([g, np.zeros(d)])
            bias = np.trace(inverse) * done.covariance @ line - across @ across.T @ line
            distance = max(float(np.linalg.norm(done.mean[:d] - own)), NOISELESS)
            self._mean = done.mean + distance * self._deviation**2 * bias

    def _ahead(self, step: ArrayLike) -> tuple[Array, Array]:
        transition, noise = constant_velocity(step, self._mean.size // 2)
        return predicted(self._mean, self._covariance, transition, self._process_noise * noise)

    def predict(self, times: ArrayLike) -> Forecast:
        """Position and its covariance at the times ``(K,)`` in seconds, of the model without further bearings."""
        d, t, latest = self._mean.size // 2, np.asarray(times, dtype=float), self._time
        if latest is None:
            return self._prior.forecast(len(t))
        mean, covariance = self._ahead(t - latest)
        return Forecast(mean[:, :d], covariance[:, :d, :d])
