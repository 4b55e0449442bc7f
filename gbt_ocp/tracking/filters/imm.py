"""Interacting multiple models: constant velocity, constant acceleration and coordinated turn, weighed by likelihood.

The cycle is that of Blom and Bar-Shalom, "The interacting multiple model algorithm for systems with Markovian switching
coefficients", IEEE Transactions on Automatic Control 33 (1988). The paper gives no modes; these three are a
reconstruction. All of them share the state [p, v, a].
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.measurements import MeasurementKind
from gbt_ocp.tracking.filters.kalman import Update, predicted, updated
from gbt_ocp.tracking.filters.motion_models import (
    constant_acceleration,
    constant_velocity,
    coordinated_turn,
    sized_state,
    turn_rate,
    with_constant,
)
from gbt_ocp.tracking.filters.plkf import pseudo_linear, pseudo_noise
from gbt_ocp.tracking.gaps import Gaps, RestartingTracker
from gbt_ocp.tracking.polar import BEARINGS
from gbt_ocp.tracking.priors import LogNormal, RangedPrior
from gbt_ocp.tracking.protocol import Forecast, mixed
from gbt_ocp.tracking.window import checked_sample
from gbt_ocp.typing import Array

MODES = ("constant velocity", "constant acceleration", "coordinated turn")

STEADY_VARIANCE = 1.0e-9
"""Variance of the acceleration in m²/s⁴ under constant velocity; 0 would leave the covariance singular."""


class InteractingMultipleModel:
    """The three modes, their mixing and prediction, whatever is measured.

    Parameters
    ----------
    initial_variance
        P₀: of velocity (m²/s²) and acceleration (m²/s⁴) on each axis, and of the position (m²) where nothing is known.
    process_noise
        q, spectral density of the white noise in m²/s³ on the velocity of constant velocity and coordinated turn.
    jerk_noise
        Spectral density of the white noise in m²/s⁵ on the acceleration of constant acceleration and coordinated turn.
    stay_probability
        Probability that a mode lasts from one measurement to the next; the others share the rest.
    turn_rate_max
        Largest turn rate in rad/s.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """

    def __init__(
        self,
        *,
        initial_variance: float,
        process_noise: float,
        jerk_noise: float,
        stay_probability: float,
        turn_rate_max: float,
    ) -> None:
        if not (initial_variance > 0.0 and process_noise > 0.0 and jerk_noise > 0.0 and turn_rate_max > 0.0):
            raise ValueError(
                "initial_variance, process_noise, jerk_noise and turn_rate_max: found "
                f"{initial_variance}, {process_noise}, {jerk_noise}, {turn_rate_max}; allowed: numbers > 0"
            )
        if not 0.0 < stay_probability < 1.0:
            raise ValueError(f"stay_probability: found {stay_probability}; allowed: a number between 0 and 1")
        count = len(MODES)
        self._initial_variance = initial_variance
        self._process_noise = process_noise
        self._jerk_noise = jerk_noise
        self._turn_rate_max = turn_rate_max
        self.transition = np.full((count, count), (1.0 - stay_probability) / (count - 1))
        np.fill_diagonal(self.transition, stay_probability)
        self.probabilities: Array = np.full(count, 1.0 / count)
        """μ ``(3,)``, in the order of :data:`MODES`."""
        self.size: LogNormal | None = None
        """The true size in metres, where its logarithm stands behind the states of the modes: n = 3d + 1, else 3d."""
        self._means = np.zeros((count, 0))
        self._covariances = np.zeros((count, 0, 0))

    @property
    def settings(self) -> tuple[float, float, float, float, float]:
        """P₀, q, the density of the jerk, the probability that a mode lasts, and the largest turn rate."""
        stay = float(self.transition[0, 0])
        return self._initial_variance, self._process_noise, self._jerk_noise, stay, self._turn_rate_max

    def begin(self, position: Array, covariance: Array) -> None:
        """Start all modes at rest at a position ``(d,)`` with its covariance ``(d, d)``."""
        d, count = len(position), len(MODES)
        self.probabilities = np.full(count, 1.0 / count)
        spread = self._initial_variance * np.eye(3 * d)
        spread[:d, :d] = covariance
        mean, spread = sized_state(self.size, np.concatenate([position, np.zeros(2 * d)]), spread)
        self._means = np.tile(mean, (count, 1))
        self._covariances = np.tile(spread, (count, 1, 1))

    @property
    def means(self) -> Array:
        """State of each mode ``(3, n)``."""
        return self._means

    @property
    def covariances(self) -> Array:
        """Covariance of each mode ``(3, n, n)``."""
        return self._covariances

    def combined(self) -> tuple[Array, Array]:
        """Mean ``(n,)`` and covariance ``(n, n)`` of the mixture."""
        return mixed(self.probabilities, self._means, self._covariances)

    def models(self, step: ArrayLike) -> tuple[Array, Array]:
        """Transition and noise of each mode over steps ``(...)`` in seconds: two ``(..., 3, n, n)``.

        The turn rate is that of the combined estimate.
        """
        d = self._means.shape[1] // 3
        state, _ = self.combined()
        turn = turn_rate(state[d : 2 * d], state[2 * d : 3 * d], self._turn_rate_max)
        velocity, velocity_noise = constant_velocity(step, d)
        acceleration, acceleration_noise = constant_acceleration(step, d)
        transitions = np.zeros((*np.shape(step), len(MODES), 3 * d, 3 * d))
        noises = np.zeros_like(transitions)
        transitions[..., 0, : 2 * d, : 2 * d] = velocity
        transitions[..., 1, :, :] = acceleration
        transitions[..., 2, :, :] = coordinated_turn(step, turn)
        noises[..., 0, :, :] = STEADY_VARIANCE * np.eye(3 * d)
        noises[..., 1:, :, :] = self._jerk_noise * acceleration_noise[..., None, :, :]
        noises[..., ::2, : 2 * d, : 2 * d] += self._process_noise * velocity_noise[..., None, :, :]
        return (transitions, noises) if self.size is None else with_constant(transitions, noises)

    def advance(self, step: float) -> None:
        """Mix the modes and predict each by a step in seconds."""
        ahead = self.probabilities @ self.transition
        weights = self.transition * self.probabilities[:, None] / ahead
        models = self.models(step)
        self.probabilities = ahead
        start = mixed(weights, self._means[:, None], self._covariances[:, None])
        self._means, self._covariances = predicted(*start, *models)

    def correct(self, observation: Array, noise: Array, value: Array) -> None:
        """Condition each mode on ``value = H x + noise`` with R ``(3, k, k)``, and the modes' probabilities on it.

        H ``(k, n)`` and the value ``(k,)`` may differ from mode to mode, with a leading axis.
        """
        self.weigh(updated(self._means, self._covariances, observation, noise, value))

    def weigh(self, done: Update) -> None:
        """Take over the modes after a measurement, and their probabilities by its likelihood in each."""
        self._means, self._covariances = done.mean, done.covariance
        weights = self.probabilities * np.exp(done.log_likelihood - np.max(done.log_likelihood))
        # a mode that is never believed again could never come back
        self.probabilities = np.maximum(weights / np.sum(weights), np.finfo(float).tiny)

    def forecast(self, ahead: Array) -> Forecast:
        """Position at the times ``(K,)`` in seconds from now: each mode by its own model, the probabilities kept."""
        d = self._means.shape[1] // 3
        means, covariances = predicted(self._means, self._covariances, *self.models(ahead))
        return Forecast(
            *mixed(self.probabilities, np.swapaxes(means[..., :d], 0, 1), np.swapaxes(covariances[..., :d, :d], 0, 1))
        )


class ImmTracker(RestartingTracker):
    """What both trackers share: the models, the time of the latest measurement, and the forecast."""

    def __init__(self, prior: RangedPrior, models: InteractingMultipleModel) -> None:
        self.models = models
        self._prior = prior
        self._time: float | None = None
        self._gaps = Gaps()

    def _restart(self, own: Array) -> None:
        self._prior = self._prior.elsewhere(own)
        self._time = None

    def _advance(self, time: float, place: Array, begin: Callable[[], tuple[Array, Array]]) -> None:
        """Bring the models to the time of a measurement.

        Parameters
        ----------
        time
            In seconds.
        place
            The own position ``(d,)``, or the measured one of the target.
        begin
            Gives mean and covariance of the position at the first measurement of a track.
        """
        if self._gaps.ended(float(time)):
            self._restart(place)
        if self._time is None:
            self.models.begin(*begin())
        else:
            self.models.advance(float(time) - self._time)
        self._time = float(time)

    def predict(self, times: ArrayLike) -> Forecast:
        """Position and its covariance at the times ``(K,)`` in seconds, of the models without further measurements."""
        t = np.asarray(times, dtype=float)
        return self._prior.forecast(len(t)) if self._time is None else self.models.forecast(t - self._time)

    def motion_at(self, time: float) -> Array | None:
        """Covariance of position and velocity ``(2d, 2d)``; ``None`` before the first measurement."""
        if self._time is None:
            return None
        states = predicted(self.models.means, self.models.covariances, *self.models.models(time - self._time))
        both = 2 * (self.models.means.shape[1] // 3)
        return mixed(self.models.probabilities, *states)[1][:both, :both]


class ImmPseudoLinearTracker(ImmTracker):
    """IMM-PLKF: each mode is a :class:`~gbt_ocp.tracking.filters.plkf.PseudoLinearKalmanFilter` with its own range.

    Parameters
    ----------
    prior
        Position before the first bearing, with its covariance.
    models
        The modes.
    bearing_std
        σ in radians.
    initial_variance
        Variance of the position in m² on each axis where the prior knows nothing.
    """

    takes: tuple[MeasurementKind, ...] = BEARINGS
    """Kinds of measurements that it takes."""

    def __init__(
        self, prior: RangedPrior, models: InteractingMultipleModel, *, bearing_std: float, initial_variance: float
    ) -> None:
        if not bearing_std > 0.0:
            raise ValueError(f"bearing_std: found {bearing_std}; allowed: a number > 0")
        super().__init__(prior, models)
        self._deviation = bearing_std
        self._initial_variance = initial_variance

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing ``(d,)`` measured at ``own_position`` ``(d,)``.

        Raises
        ------
        ValueError
            If numbers are not finite, the bearing is no unit vector, or time does not increase.
        """
        g, own = checked_sample(time, bearing, own_position, self._time)
        self._advance(time, own, lambda: self._prior.gaussian(g, own, self._initial_variance))
        observation, value = pseudo_linear(g, own, self.models.means.shape[1])
        self.models.correct(observation, pseudo_noise(self.models.means[:, : len(own)], own, self._deviation), value)


class ImmPositionTracker(ImmTracker):
    """IMM-KF-F: the same modes, updated with the target's full position.

    Parameters
    ----------
    prior
        Position before the first measurement, with its covariance; without one, that of the first measurement.
    models
        The modes.
    position_std
        σ_p in metres, of the measured position on each axis.
    """

    takes: tuple[MeasurementKind, ...] = ("position",)
    """Kinds of measurements that it takes."""

    def __init__(self, prior: RangedPrior, models: InteractingMultipleModel, *, position_std: float) -> None:
        if not position_std > 0.0:
            raise ValueError(f"position_std: found {position_std}; allowed: a number > 0")
        super().__init__(prior, models)
        self.position_std = position_std

    def update_position(self, time: float, position: ArrayLike) -> None:
        """Take in the measured position of the target ``(d,)`` in metres.

        Raises
        ------
        ValueError
            If numbers are not finite, or time does not increase.
        """
        value = np.array(position, dtype=float)
        if not (np.isfinite(time) and np.all(np.isfinite(value))):
            raise ValueError("time and position must be finite")
        if self._time is not None and time <= self._time:
            raise ValueError(f"time must increase, found {time} after {self._time}")
        d = len(value)
        noise = self.position_std**2 * np.eye(d)
        self._advance(time, value, lambda: self._prior.known or (value, noise))
        observation = np.eye(d, self.models.means.shape[1])
        self.models.correct(observation, np.tile(noise, (len(MODES), 1, 1)), value)
