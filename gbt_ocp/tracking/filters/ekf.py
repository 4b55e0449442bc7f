"""Extended Kalman filters: the recursive filters that do not collapse under noisy bearings.

The update is linearised along the tangent of the *predicted* bearing, and the innovation is the angle from it to the
measured one. A pseudo-linear update takes the tangent of the measured bearing, so that its error stands in H and in the
measurement at once and pulls the estimate onto the vehicle: slowly at each update, to the end at ten a second.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.bearings import log_map, tangent_basis
from gbt_ocp.tracking.filters.imm import ImmTracker, InteractingMultipleModel
from gbt_ocp.tracking.filters.kalman import predicted, updated
from gbt_ocp.tracking.filters.motion_models import constant_velocity
from gbt_ocp.tracking.gaps import Gaps, RestartingTracker
from gbt_ocp.tracking.priors import RangedPrior
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.tracking.window import checked_sample
from gbt_ocp.typing import Array

NEAREST = 1.0e-2
"""Range in metres below which a bearing says no more about the position across it."""


def angle_measurement(position: Array, own: Array, bearing: Array, size: int) -> tuple[Array, Array]:
    """The bearing as a linear measurement of states whose position is predicted.

    Parameters
    ----------
    position
        Predicted positions ``(..., d)`` in metres.
    own, bearing
        Own position and measured bearing ``(d,)``.
    size
        n, length of a state that begins with the position.

    Returns
    -------
    H ``(..., d-1, n)`` in 1/m and the innovation ``(..., d-1)`` in radians.
    """
    line = np.where(np.abs(position - own).max(axis=-1, keepdims=True) > 0.0, position - own, NEAREST * bearing)
    distance = np.linalg.norm(line, axis=-1)
    unit = line / distance[..., None]
    basis = tangent_basis(unit)
    observation = np.zeros((*basis.shape[:-2], basis.shape[-1], size))
    observation[..., : len(own)] = np.swapaxes(basis, -1, -2) / np.maximum(distance, NEAREST)[..., None, None]
    return observation, log_map(unit, bearing, basis)


@dataclass(frozen=True)
class FirstGuess:
    """Where a filter begins at the first bearing.

    Attributes
    ----------
    prior
        The position, known or on the bearing at a range.
    range_std
        Standard deviation of that range in metres, where the position is not known.
    speed_std
        Standard deviation of each component of the velocity in m/s.
    """

    prior: RangedPrior
    range_std: float
    speed_std: float

    def __post_init__(self) -> None:
        if not (self.range_std > 0.0 and self.speed_std > 0.0):
            raise ValueError(f"range_std and speed_std: found {self.range_std}, {self.speed_std}; allowed: numbers > 0")

    def elsewhere(self, own: Array) -> FirstGuess:
        """The guess of a new track, with the vehicle at ``own`` ``(d,)``: the position is not known any more."""
        return replace(self, prior=self.prior.elsewhere(own))

    def position(self, bearing: Array, own: Array, deviation: float) -> tuple[Array, Array]:
        """Mean ``(d,)`` and covariance ``(d, d)`` before the first bearing is taken in, whose noise is ``deviation``.

        Across the bearing it is wide enough to leave that to the bearing, and no wider: in metres a cone is no box.
        """
        mean, _ = self.prior.gaussian(bearing, own, 1.0)
        if self.prior.covariance is not None:
            return mean, self.prior.covariance
        along = np.outer(bearing, bearing)
        across = max(10.0 * deviation, 0.1) * self.prior.range
        return mean, self.range_std**2 * along + across**2 * (np.eye(len(own)) - along)


class ExtendedKalmanFilter(RestartingTracker):
    """State [p, v] with white noise on the velocity, updated along the tangent of the predicted bearing.

    Source: Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and Navigation*, section 10.3.

    Parameters
    ----------
    guess
        Where it begins.
    process_noise
        q, spectral density of the white acceleration in m²/s³.
    bearing_std
        σ in radians.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """

    def __init__(self, guess: FirstGuess, *, process_noise: float, bearing_std: float) -> None:
        if not (process_noise > 0.0 and bearing_std > 0.0):
            raise ValueError(
                f"process_noise and bearing_std: found {process_noise}, {bearing_std}; allowed: numbers > 0"
            )
        self._process_noise = process_noise
        self._deviation = bearing_std
        self._gaps = Gaps()
        self._begin(guess)

    def _begin(self, guess: FirstGuess) -> None:
        self._guess = guess
        self._time: float | None = None
        self._mean = np.zeros(0)
        self._covariance = np.zeros((0, 0))

    def _restart(self, own: Array) -> None:
        self._begin(self._guess.elsewhere(own))

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
            position, covariance = self._guess.position(g, own, self._deviation)
            self._mean = np.concatenate([position, np.zeros(d)])
            self._covariance = self._guess.speed_std**2 * np.eye(2 * d)
            self._covariance[:d, :d] = covariance
        else:
            self._mean, self._covariance = self._ahead(float(time) - self._time)
        self._time = float(time)
        observation, innovation = angle_measurement(self._mean[:d], own, g, 2 * d)
        noise = self._deviation**2 * np.eye(d - 1)
        value = observation @ self._mean + innovation
        done = updated(self._mean, self._covariance, observation, noise, value)
        self._mean, self._covariance = done.mean, done.covariance

    def _ahead(self, step: ArrayLike) -> tuple[Array, Array]:
        transition, noise = constant_velocity(step, self._mean.size // 2)
        return predicted(self._mean, self._covariance, transition, self._process_noise * noise)

    def predict(self, times: ArrayLike) -> Forecast:
        """Position and its covariance at the times ``(K,)`` in seconds, of the model without further bearings."""
        t = np.asarray(times, dtype=float)
        if self._time is None:
            return self._guess.prior.forecast(len(t))
        d = self._mean.size // 2
        mean, covariance = self._ahead(t - self._time)
        return Forecast(mean[:, :d], covariance[:, :d, :d])


class ImmExtendedTracker(ImmTracker):
    """IMM-EKF: each mode is updated as an :class:`ExtendedKalmanFilter`.

    Parameters
    ----------
    guess
        Where it begins.
    models
        The modes.
    bearing_std
        σ in radians.
    """

    def __init__(self, guess: FirstGuess, models: InteractingMultipleModel, *, bearing_std: float) -> None:
        if not bearing_std > 0.0:
            raise ValueError(f"bearing_std: found {bearing_std}; allowed: a number > 0")
        super().__init__(guess.prior, models)
        self._guess = guess
        self._deviation = bearing_std

    def _restart(self, own: Array) -> None:
        super()._restart(own)
        self._guess = self._guess.elsewhere(own)

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing ``(d,)`` measured at ``own_position`` ``(d,)``.

        Raises
        ------
        ValueError
            If numbers are not finite, the bearing is no unit vector, or time does not increase.
        """
        g, own = checked_sample(time, bearing, own_position, self._time)
        self._advance(time, own, lambda: self._guess.position(g, own, self._deviation))
        means = self.models.means
        observation, innovation = angle_measurement(means[:, : len(own)], own, g, means.shape[1])
        value = (observation @ means[..., None])[..., 0] + innovation
        noise = np.tile(self._deviation**2 * np.eye(len(own) - 1), (len(means), 1, 1))
        self.models.correct(observation, noise, value)
