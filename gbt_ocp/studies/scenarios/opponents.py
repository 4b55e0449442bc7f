"""Trackers of other packages behind our protocol: Stone Soup's filters, and FilterPy's interacting multiple models.

All have the same first guess, the same model of motion and the same noise as our extended Kalman filter. They take
bearings alone. They come with the extra ``bench``.
"""

from __future__ import annotations

import datetime
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.bearings import tangent_basis
from gbt_ocp.studies.scenarios.scenario import Knowledge
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array

PARTICLES = 3000
"""Particles of Stone Soup's filter."""

STAY_S = 40.0
"""Mean time in s, at a pace of 1, for which a mode of the interacting models lasts."""

_BEGAN = datetime.datetime(2000, 1, 1)


def angles_of(line: Array) -> Array:
    """Azimuth, or elevation and azimuth in space, of a line ``(d,)``; in the order of Stone Soup."""
    azimuth = np.arctan2(line[1], line[0])
    if len(line) == 2:
        return np.array([azimuth])
    return np.array([np.arctan2(line[2], np.hypot(line[0], line[1])), azimuth])


class _Guessed:
    """What all of them begin with."""

    def __init__(self, knowledge: Knowledge, dimension: int) -> None:
        self._knowledge, self._dimension = knowledge, dimension
        self._began = False

    def _start(self, bearing: Array, own: Array) -> tuple[Array, Array]:
        """Mean ``(2d,)`` and covariance of position and velocity, axis by axis: p₁, v₁, p₂, ..."""
        known = self._knowledge
        mean, covariance = known.first_position(bearing, own)
        d = self._dimension
        places = 2 * np.arange(d)
        state, spread = np.zeros(2 * d), np.zeros((2 * d, 2 * d))
        state[places] = mean
        spread[np.ix_(places, places)] = covariance
        spread[places + 1, places + 1] = known.speed**2
        self._began = True
        return state, spread


class StoneSoupTracker(_Guessed):
    """A filter of Stone Soup.

    Parameters
    ----------
    kind
        ``ekf``, ``ukf`` or ``particle``.
    knowledge, dimension
        What is known beforehand, and d.
    seed
        Of the particles.

    Raises
    ------
    ImportError
        If Stone Soup is not installed.
    """

    def __init__(self, kind: str, knowledge: Knowledge, dimension: int, seed: int = 0) -> None:
        super().__init__(knowledge, dimension)
        linear = import_module("stonesoup.models.transition.linear")
        axis = linear.ConstantVelocity(knowledge.acceleration_density, seed=seed)
        model = linear.CombinedLinearGaussianTransitionModel([axis] * dimension, seed=seed)
        self._kind, self._seed = kind, seed
        where = "particle" if kind == "particle" else "kalman"
        name = {"ekf": "ExtendedKalman", "ukf": "UnscentedKalman", "particle": "Particle"}[kind]
        self._predictor = getattr(import_module(f"stonesoup.predictor.{where}"), f"{name}Predictor")(model)
        updater: Any = getattr(import_module(f"stonesoup.updater.{where}"), f"{name}Updater")
        if kind == "particle":
            resampler = import_module("stonesoup.resampler.particle")
            regulariser = import_module("stonesoup.regulariser.particle")
            # moves of particles compare with the step before, which the first one has not
            self._first_updater = updater(None, resampler=resampler.ESSResampler())
            self._updater = updater(
                None, resampler=resampler.ESSResampler(), regulariser=regulariser.MCMCRegulariser(model)
            )
        else:
            self._first_updater = self._updater = updater(None)
        self._nonlinear = import_module("stonesoup.models.measurement.nonlinear")
        self._types = {
            name: import_module(f"stonesoup.types.{name}")
            for name in ("angle", "array", "detection", "hypothesis", "prediction", "state")
        }
        self._state: Any = None

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """See :class:`~gbt_ocp.tracking.Tracker`."""
        line, own = np.asarray(bearing, dtype=float), np.asarray(own_position, dtype=float)
        now = _BEGAN + datetime.timedelta(seconds=float(time))
        updater = self._updater if self._began else self._first_updater
        if not self._began:
            prediction = self._first(*self._start(line, own), now)
        else:
            prediction = self._predictor.predict(self._state, timestamp=now)
        types, mapping = self._types, tuple(2 * np.arange(self._dimension))
        # an azimuth's deviation is that of the direction over the cosine of the elevation
        std = np.full(self._dimension - 1, self._knowledge.bearing_std)
        if self._dimension == 3:
            std[1] /= max(float(np.hypot(line[0], line[1])), 1e-3)
        plane = self._dimension == 2
        name = "Cartesian2DToBearing" if plane else "CartesianToElevationBearing"
        model = getattr(self._nonlinear, name)(
            ndim_state=2 * self._dimension,
            mapping=mapping,
            noise_covar=np.diag(std**2),
            translation_offset=own[:, None],
        )
        found = angles_of(line)
        angle = types["angle"]
        parts = [angle.Bearing(found[0])] if plane else [angle.Elevation(found[0]), angle.Bearing(found[1])]
        detection = types["detection"].Detection(
            types["array"].StateVector(parts), timestamp=now, measurement_model=model
        )
        self._state = updater.update(types["hypothesis"].SingleHypothesis(prediction, detection))

    def _first(self, mean: Array, covariance: Array, now: datetime.datetime) -> Any:
        prediction = self._types["prediction"]
        if self._kind != "particle":
            return prediction.GaussianStatePrediction(mean[:, None], covariance, timestamp=now)
        rng = np.random.default_rng(self._seed)
        drawn = rng.multivariate_normal(mean, covariance, PARTICLES).T
        vectors = self._types["array"].StateVectors(drawn)
        weights = np.full(PARTICLES, 1.0 / PARTICLES)
        return prediction.ParticleStatePrediction(vectors, weight=weights, timestamp=now)

    def predict(self, times: ArrayLike) -> Forecast:
        """See :class:`~gbt_ocp.tracking.Tracker`."""
        means, covariances = [], []
        places = 2 * np.arange(self._dimension)
        for time in np.atleast_1d(np.asarray(times, dtype=float)):
            now = _BEGAN + datetime.timedelta(seconds=float(time))
            state = self._state
            if now > state.timestamp:
                state = self._predictor.predict(state, timestamp=now)
            means.append(np.asarray(state.mean, dtype=float).ravel()[places])
            covariances.append(np.asarray(state.covar, dtype=float)[np.ix_(places, places)])
        return Forecast(np.array(means), np.array(covariances))


class FilterPyImm(_Guessed):
    """FilterPy's interacting multiple models: constant velocity, and turns to either side, with extended updates.

    Parameters
    ----------
    knowledge, dimension
        What is known beforehand, and d.

    Raises
    ------
    ImportError
        If FilterPy is not installed.
    """

    def __init__(self, knowledge: Knowledge, dimension: int) -> None:
        super().__init__(knowledge, dimension)
        self._package = import_module("filterpy.kalman")
        self._rates = knowledge.turn_rate * np.array([0.0, 1.0, -1.0])
        self._imm: Any = None
        self._time = 0.0

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """See :class:`~gbt_ocp.tracking.Tracker`."""
        line, own = np.asarray(bearing, dtype=float), np.asarray(own_position, dtype=float)
        if not self._began:
            mean, covariance = self._start(line, own)
            filters = [self._filter(mean, covariance) for _ in self._rates]
            self._imm = self._package.IMMEstimator(filters, [0.8, 0.1, 0.1], np.eye(3))
        else:
            self._to(self._imm, time)
        self._time = float(time)
        for one in self._imm.filters:
            one.seen_from(own, self._knowledge.bearing_std)
        self._imm.update(line)

    def _filter(self, mean: Array, covariance: Array) -> Any:
        found = _angular(self._package.ExtendedKalmanFilter)(len(mean), self._dimension - 1)
        found.x, found.P = mean.copy(), covariance.copy()
        return found

    def _to(self, imm: Any, time: float) -> None:
        duration, pace = float(time) - self._time, self._knowledge.pace
        leave = 1.0 - np.exp(-duration / (STAY_S * pace))
        # the modes are mixed for the time until this measurement
        imm.M = np.array([[1 - leave, 0.5 * leave, 0.5 * leave], [leave, 1 - leave, 0.0], [leave, 0.0, 1 - leave]])
        imm._compute_mixing_probabilities()
        for one, rate in zip(imm.filters, self._rates, strict=True):
            one.F, one.Q = turning(duration, rate, self._dimension, self._knowledge.acceleration_density)
        imm.predict(0.0)  # no control input

    def predict(self, times: ArrayLike) -> Forecast:
        """See :class:`~gbt_ocp.tracking.Tracker`."""
        places = 2 * np.arange(self._dimension)
        means, covariances = [], []
        for time in np.atleast_1d(np.asarray(times, dtype=float)):
            means.append(self._imm.x[places].copy())
            covariances.append(self._imm.P[np.ix_(places, places)])
            duration = float(time) - self._time
            if duration > 0.0:
                # each mode goes on as it is
                weights, mean, spread = self._imm.mu, 0.0, 0.0
                ahead = []
                for one, rate in zip(self._imm.filters, self._rates, strict=True):
                    step, noise = turning(duration, rate, self._dimension, self._knowledge.acceleration_density)
                    ahead.append(((step @ one.x)[places], (step @ one.P @ step.T + noise)[np.ix_(places, places)]))
                mean = sum(w * m for w, (m, _) in zip(weights, ahead, strict=True))
                spread = sum(w * (p + np.outer(m - mean, m - mean)) for w, (m, p) in zip(weights, ahead, strict=True))
                means[-1], covariances[-1] = mean, spread
        return Forecast(np.array(means), np.array(covariances))


def turning(duration: float, rate: float, dimension: int, density: float) -> tuple[Array, Array]:
    """Transition and noise ``(2d, 2d)`` of a coordinated turn, and of a constant vertical velocity in space."""
    size = 2 * dimension
    transition, noise = np.eye(size), np.zeros((size, size))
    angle = rate * duration
    along = duration * np.sinc(angle / np.pi)
    across = 0.5 * angle * duration * np.sinc(0.5 * angle / np.pi) ** 2
    cosine, sine = np.cos(angle), np.sin(angle)
    transition[:4, :4] = [[1, along, 0, -across], [0, cosine, 0, -sine], [0, across, 1, along], [0, sine, 0, cosine]]
    block = density * np.array([[duration**3 / 3.0, duration**2 / 2.0], [duration**2 / 2.0, duration]])
    for k in range(dimension):
        noise[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = block
        if k == 2:
            transition[4, 5] = duration
    return transition, noise


def _angular(base: Any) -> Any:
    """FilterPy's extended Kalman filter whose measurement is the angle across the predicted line of sight."""

    class AngularFilter(base):  # type: ignore[misc]  # a class of a package without types
        def seen_from(self, own: Array, std: float) -> None:
            """The vehicle's position ``(d,)`` and the deviation of the bearing to come."""
            self._own = own
            self.R = std**2 * np.eye(self.dim_z)

        def update(self, bearing: Array) -> None:
            """Take in a bearing ``(d,)``."""
            line = self.x[::2] - self._own
            far = max(float(np.linalg.norm(line)), 1e-9)
            basis = tangent_basis(line / far)
            slope = np.zeros((self.dim_z, self.dim_x))
            slope[:, ::2] = basis.T / far
            across = basis.T @ bearing
            size = float(np.linalg.norm(across))
            angle = np.arctan2(size, float(bearing @ line) / far)
            found = across if size == 0.0 else across * angle / size
            super().update(found, lambda _: slope, lambda _: np.zeros(self.dim_z))

    return AngularFilter
