"""Extended Kalman filters: the recursive filters that do not collapse under noisy bearings.

The update is linearised along the tangent of the *predicted* bearing, and the innovation is the angle from it to the
measured one. A pseudo-linear update takes the tangent of the measured bearing, so that its error stands in H and in the
measurement at once and pulls the estimate onto the vehicle: slowly at each update, to the end at ten a second.

Measurements that come with a noise of their own, of any kind, are taken in in polar coordinates: see
:mod:`~gbt_ocp.tracking.filters.polar_update`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.bearings import log_map, tangent_basis
from gbt_ocp.models.measurements import MeasurementKind, Sighting
from gbt_ocp.tracking.filters.imm import ImmTracker, InteractingMultipleModel
from gbt_ocp.tracking.filters.kalman import predicted, updated
from gbt_ocp.tracking.filters.motion_models import constant_velocity, size_estimate, sized_state, with_constant
from gbt_ocp.tracking.filters.polar_update import OwnVelocities, polar_updated
from gbt_ocp.tracking.gaps import Gaps, RestartingTracker
from gbt_ocp.tracking.polar import ALL_KINDS, WITHOUT_SIZE, checked_sighting, polar_rows
from gbt_ocp.tracking.priors import LogNormal, RangedPrior
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

    def sighted(self, sighting: Sighting, deviation: float) -> tuple[Array, Array]:
        """Mean ``(d,)`` and covariance ``(d, d)`` before the first measurement is taken in, of whatever kind.

        Raises
        ------
        ValueError
            If it does not say where the target is, and no prior does.
        """
        own, kind = sighting.position, sighting.kind
        if self.prior.known is not None:
            return self.prior.known
        if kind == "position":
            return sighting.value, np.diag((2.0 * sighting.std) ** 2)
        if kind in ("azimuth", "azimuth_elevation"):
            std = float(np.fmax(np.nanmax(sighting.std, initial=0.0), deviation))
            if kind == "azimuth" and len(own) == 3:
                level = replace(sighting, kind="azimuth_elevation", value=np.append(sighting.value, 0.0))
                mean, covariance = self.position(level.bearing, own, std)
                covariance[2, 2] += (UNKNOWN_ELEVATION * self.prior.range) ** 2
                return mean, covariance
            return self.position(sighting.bearing, own, std)
        raise ValueError(
            f"kind: found '{kind}' before the track has begun; allowed: a bearing or a position first, or tracker.prior"
        )


UNKNOWN_ELEVATION = 0.5
"""Standard deviation in radians of the elevation at the first measurement, if that is an azimuth alone."""


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
        σ in radians of a bearing that does not say its own.
    size
        The true size of the target in metres, if angular sizes are measured; it is estimated.

    Attributes
    ----------
    takes
        Kinds of measurements that :meth:`take` takes.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """

    def __init__(
        self, guess: FirstGuess, *, process_noise: float, bearing_std: float, size: LogNormal | None = None
    ) -> None:
        if not (process_noise > 0.0 and bearing_std > 0.0):
            raise ValueError(
                f"process_noise and bearing_std: found {process_noise}, {bearing_std}; allowed: numbers > 0"
            )
        self._process_noise = process_noise
        self._deviation = bearing_std
        self._size_prior = size
        self.takes: tuple[MeasurementKind, ...] = WITHOUT_SIZE if size is None else ALL_KINDS
        self._gaps = Gaps()
        self._begin(guess)

    @property
    def settings(self) -> tuple[FirstGuess, float, float, LogNormal | None]:
        """Where a track begins, q in m²/s³, σ of a bearing in radians, and what was known of the size in metres."""
        return self._guess, self._process_noise, self._deviation, self._size_prior

    def _begin(self, guess: FirstGuess) -> None:
        self._guess = guess
        self._time: float | None = None
        self._mean = np.zeros(0)
        self._covariance = np.zeros((0, 0))
        self._own_velocities = OwnVelocities()

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
        d = len(own)
        self._advance(float(time), own, lambda: self._guess.position(g, own, self._deviation))
        observation, innovation = angle_measurement(self._mean[:d], own, g, self._mean.size)
        noise = self._deviation**2 * np.eye(d - 1)
        value = observation @ self._mean + innovation
        done = updated(self._mean, self._covariance, observation, noise, value)
        self._mean, self._covariance = done.mean, done.covariance

    def take(self, sighting: Sighting) -> None:
        """Take in a measurement of any kind in :attr:`takes`, with its own noise, at or after the latest time.

        Raises
        ------
        ValueError
            If the kind is not taken, the measurement is out of order, or the first one does not say where the target
            is; the filter is then unchanged.
        """
        own = sighting.position
        checked_sighting(sighting, self.takes, "ekf", len(self._guess.prior.start), self._time)
        if self._time is None:
            self._guess.sighted(sighting, self._deviation)
        self._advance(sighting.time, own, lambda: self._guess.sighted(sighting, self._deviation))
        rows = polar_rows(sighting, self._mean[: len(own)], self._deviation, self._mean[-1])
        velocity = self._own_velocities.at(sighting.sensor, sighting.time, own)
        done = polar_updated(self._mean, self._covariance, rows, own, velocity)
        self._mean, self._covariance = done.mean, done.covariance

    @property
    def size(self) -> LogNormal | None:
        """What is known of the target's true size in metres; ``None`` where it is not estimated."""
        return self._size_prior if self._time is None else size_estimate(self._size_prior, self._mean, self._covariance)

    def _advance(self, time: float, own: Array, begin: Callable[[], tuple[Array, Array]]) -> None:
        """Bring the state to a time in seconds; ``begin`` gives the position at the first measurement of a track."""
        if self._gaps.ended(time):
            self._restart(own)
        if self._time is None:
            d = len(own)
            position, spread = begin()
            covariance = self._guess.speed_std**2 * np.eye(2 * d)
            covariance[:d, :d] = spread
            mean = np.concatenate([position, np.zeros(d)])
            self._mean, self._covariance = sized_state(self._size_prior, mean, covariance)
        else:
            self._mean, self._covariance = self._ahead(time - self._time)
        self._time = time

    def _ahead(self, step: ArrayLike) -> tuple[Array, Array]:
        transition, noise = constant_velocity(step, self._mean.size // 2)
        if self._size_prior is not None:
            transition, noise = with_constant(transition, noise)
        return predicted(self._mean, self._covariance, transition, self._process_noise * noise)

    def predict(self, times: ArrayLike) -> Forecast:
        """Position and its covariance at the times ``(K,)`` in seconds, of the model without further bearings."""
        t = np.asarray(times, dtype=float)
        if self._time is None:
            return self._guess.prior.forecast(len(t))
        d = self._mean.size // 2
        mean, covariance = self._ahead(t - self._time)
        return Forecast(mean[:, :d], covariance[:, :d, :d])

    def motion_at(self, time: float) -> Array | None:
        """Covariance of position and velocity ``(2d, 2d)``; ``None`` before the first measurement."""
        both = 2 * (self._mean.size // 2)
        return None if self._time is None else self._ahead(time - self._time)[1][:both, :both]


class ImmExtendedTracker(ImmTracker):
    """IMM-EKF: each mode is updated as an :class:`ExtendedKalmanFilter`.

    Parameters
    ----------
    guess
        Where it begins.
    models
        The modes.
    bearing_std
        σ in radians of a bearing that does not say its own.
    size
        The true size of the target in metres, if angular sizes are measured; it is estimated.

    Attributes
    ----------
    takes
        Kinds of measurements that :meth:`take` takes.
    """

    def __init__(
        self,
        guess: FirstGuess,
        models: InteractingMultipleModel,
        *,
        bearing_std: float,
        size: LogNormal | None = None,
    ) -> None:
        if not bearing_std > 0.0:
            raise ValueError(f"bearing_std: found {bearing_std}; allowed: a number > 0")
        super().__init__(guess.prior, models)
        self._guess = guess
        self._deviation = bearing_std
        self._size_prior = models.size = size
        self.takes: tuple[MeasurementKind, ...] = WITHOUT_SIZE if size is None else ALL_KINDS
        self._own_velocities = OwnVelocities()

    @property
    def settings(self) -> tuple[FirstGuess, InteractingMultipleModel, float, LogNormal | None]:
        """Where a track begins, the modes, σ of a bearing in radians, and what was known of the size in metres."""
        return self._guess, self.models, self._deviation, self._size_prior

    def _restart(self, own: Array) -> None:
        super()._restart(own)
        self._own_velocities = OwnVelocities()
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

    def take(self, sighting: Sighting) -> None:
        """Take in a measurement of any kind in :attr:`takes`; as :meth:`ExtendedKalmanFilter.take`."""
        own = sighting.position
        checked_sighting(sighting, self.takes, "imm_ekf", len(self._guess.prior.start), self._time)
        if self._time is None:
            self._guess.sighted(sighting, self._deviation)
        self._advance(sighting.time, own, lambda: self._guess.sighted(sighting, self._deviation))
        means = self.models.means
        rows = polar_rows(sighting, means[:, : len(own)], self._deviation, means[:, -1])
        velocity = self._own_velocities.at(sighting.sensor, sighting.time, own)
        self.models.weigh(polar_updated(means, self.models.covariances, rows, own, velocity))

    @property
    def size(self) -> LogNormal | None:
        """What is known of the target's true size in metres; ``None`` where it is not estimated."""
        return self._size_prior if self._time is None else size_estimate(self._size_prior, *self.models.combined())
