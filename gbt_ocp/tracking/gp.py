"""The Gaussian-process tracker (algorithm 1): window, tuning, posterior, and the numbers that explain them."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbt_ocp.tracking.bounds import bearing_bound
from gbt_ocp.tracking.kernels import KERNELS
from gbt_ocp.tracking.likelihood import LogLikelihood, LogNormal, likelier, maximise
from gbt_ocp.tracking.posterior import Hyperparameters, Posterior, condition
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.tracking.window import Measurements, Window

Array = NDArray[np.float64]

SHORT = -1.0
"""Logarithm of the share of its prior median below which a length scale is suspected of telling noise."""

NOISY = 1.0e-4
"""Nugget from which the search for a smooth motion with noise starts."""

SHAPE_BOUNDS = (0.05, 100.0)
"""Range of a kernel's further parameters (α of the rational quadratic)."""


class GaussianProcessTracker:
    """Tracks a target whose motion is a priori ``P_T(t) ~ GP(centre, a² k(t, t') I)``.

    It never raises for a badly conditioned window: the nugget is multiplied by ten until the Cholesky factorisation
    succeeds, and :attr:`nugget_retries` counts how often. Missed and irregular samples need no special case.

    Parameters
    ----------
    dimension
        d.
    window
        N_c, capacity of the window.
    kernel
        ``se``, ``matern32``, ``matern52`` or ``rq``.
    centre
        Prior mean: the earth-fixed ``origin`` as in the paper, or the ``vehicle``'s latest position.
    length_scale, amplitude
        A value to keep (s, m), or ``None`` to maximise the likelihood at every update.
    nugget
        Variance of a measurement relative to the amplitude squared, or ``None`` to tune it too.
    prior_position, prior_covariance
        What is known of the position when the first bearing is taken: mean ``(d,)`` in metres and covariance
        ``(d, d)`` in m². It counts as a measurement for as long as that bearing is in the window.
    start
        Stands for the vehicle's position until the first bearing ``(d,)``.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """

    length_scale_prior = LogNormal(3.0, 1.0)
    amplitude_prior = LogNormal(3.0, 1.0)
    length_scale_bounds = (0.3, 200.0)
    amplitude_bounds = (0.5, 200.0)
    nugget_prior = LogNormal(1e-11, 4.0)
    nugget_bounds = (1e-14, 1e-2)

    def __init__(
        self,
        dimension: int,
        *,
        window: int = 20,
        kernel: str = "se",
        centre: Literal["origin", "vehicle"] = "vehicle",
        length_scale: float | None = None,
        amplitude: float | None = None,
        nugget: float | None = None,
        prior_position: ArrayLike | None = None,
        prior_covariance: ArrayLike | None = None,
        start: ArrayLike | None = None,
    ) -> None:
        if kernel not in KERNELS:
            raise ValueError(f"kernel: found {kernel!r}; allowed: {', '.join(KERNELS)}")
        if nugget is not None and not nugget > 0.0:
            raise ValueError(f"nugget: found {nugget}; allowed: a number > 0")
        self.dimension = dimension
        self.window = Window(window)
        self._kernel = KERNELS[kernel]
        self._centre_on_vehicle = centre == "vehicle"
        self._centre = np.zeros(dimension)
        if self._centre_on_vehicle and start is not None:
            self._centre = np.asarray(start, dtype=float)
        self._nugget = nugget
        self._prior = self._prior_rows(prior_position, prior_covariance)
        if prior_position is not None:
            self._prior_position = np.array(prior_position, dtype=float)
            self._centre = self._prior_position
        self._prior_time: float | None = None
        self.nugget_retries = 0

        shapes = len(self._kernel.names) - 1
        self._bounds = [
            _log_pair(self.length_scale_bounds if length_scale is None else (length_scale, length_scale)),
            *[_log_pair(SHAPE_BOUNDS)] * shapes,
            _log_pair(self.amplitude_bounds if amplitude is None else (amplitude, amplitude)),
        ]
        # The paper's tuning is plain maximum likelihood; priors come with the amplitude, which it does not tune.
        weak = amplitude is None
        self._priors = [
            self.length_scale_prior if weak else None,
            *[None] * shapes,
            self.amplitude_prior if weak else None,
        ]
        first = [
            length_scale or self.length_scale_prior.median,
            *[1.0] * shapes,
            amplitude or self.amplitude_prior.median,
        ]
        if nugget is None:
            self._bounds.append(_log_pair(self.nugget_bounds))
            self._priors.append(self.nugget_prior)
            first.append(self.nugget_prior.median)
        self._log_theta = np.log(first)
        self._smooth = np.log([*first[:-1], NOISY]) if nugget is None else self._log_theta
        self._posterior: Posterior | None = None

    def _prior_rows(self, position: ArrayLike | None, covariance: ArrayLike | None) -> Measurements | None:
        if position is None:
            return None
        if covariance is None:
            raise ValueError("prior_covariance is needed beside prior_position")
        values, axes = np.linalg.eigh(np.asarray(covariance, dtype=float))
        if not np.all(values > 0.0):
            raise ValueError("prior_covariance must be positive definite")
        # along its own axes the covariance is diagonal, one row each
        return Measurements(np.zeros(len(values)), axes.T, axes.T @ np.asarray(position, dtype=float), values)

    def _measurements(self) -> Measurements:
        """Rows of the window, with those of the prior position while its time is in it."""
        if not len(self.window):
            rows = Measurements(np.zeros(0), np.zeros((0, self.dimension)), np.zeros(0), np.zeros(0))
        else:
            rows = self.window.measurements()
        prior = self._prior
        if prior is None or not self._prior_in_window():
            return rows
        return Measurements(
            np.concatenate([rows.times, prior.times + (self._prior_time or 0.0)]),
            np.concatenate([rows.directions, prior.directions]),
            np.concatenate([rows.values, prior.values]),
            np.concatenate([rows.variances, prior.variances]),
        )

    def _prior_in_window(self) -> bool:
        """Whether the first bearing, to which the prior position belongs, is still in the window."""
        return self._prior_time is None or bool(self.window.times[0] <= self._prior_time)

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing ``(d,)`` measured at ``own_position`` ``(d,)``, tune θ and condition on the window.

        Raises
        ------
        ValueError
            If numbers are not finite, the bearing is no unit vector, or time does not increase; the tracker is then
            unchanged.
        """
        self.window.append(time, bearing, own_position)
        if self._prior_time is None:
            self._prior_time = float(time)
        if self._prior is not None and self._prior_in_window():
            self._centre = self._prior_position
        elif self._centre_on_vehicle:
            self._centre = np.array(own_position, dtype=float)
        else:
            self._centre = np.zeros(self.dimension)
        measurements = self._measurements()
        if any(high > low for low, high in self._bounds):
            likelihood = LogLikelihood(self._kernel, measurements, self._centre, self._nugget)
            self._log_theta = self._tuned(likelihood)
        self._condition(measurements)

    def _tuned(self, likelihood: LogLikelihood) -> Array:
        """log θ of the largest likelihood near the last one, or of a smooth motion with noise."""
        warm = maximise(likelihood, self._log_theta, self._bounds, self._priors)
        if self._nugget is not None or warm[0] > SHORT + np.log(self.length_scale_prior.median):
            return warm
        # Noise can be told as a motion that jitters, and from there no local search comes back: ask the other way too.
        smooth = maximise(likelihood, self._smooth, self._bounds, self._priors)
        return likelier(likelihood, warm, smooth, self._priors)

    def _condition(self, measurements: Measurements) -> Posterior:
        shapes = len(self._kernel.names)
        nugget = float(np.exp(self._log_theta[-1])) if self._nugget is None else self._nugget
        theta = Hyperparameters(self._log_theta[:shapes], float(self._log_theta[shapes]), nugget)
        self._posterior, retries = condition(self._kernel, theta, measurements, self._centre)
        self.nugget_retries += retries
        return self._posterior

    @property
    def posterior(self) -> Posterior:
        """The posterior given the window; before the first bearing, the prior."""
        return self._posterior if self._posterior is not None else self._condition(self._measurements())

    def predict(self, times: ArrayLike) -> Forecast:
        """Posterior mean ``(K, d)`` and covariance ``(K, d, d)`` at the times ``(K,)`` in seconds."""
        return self.posterior.predict(np.asarray(times, dtype=float))

    @property
    def hyperparameters(self) -> Hyperparameters:
        """θ, with the nugget that the last factorisation needed."""
        return self.posterior.hyperparameters

    @property
    def prior_covariance(self) -> Array:
        """Prior covariance of the position at any time under θ ``(d, d)`` in m²."""
        return self.posterior.prior_covariance

    def bound(self, times: ArrayLike, delta: float) -> Array:
        """Bound of theorem 1 on the error at all of the times ``(K,)`` at once, in metres ``(K,)``."""
        theta = self.hyperparameters
        variance = theta.amplitude**2
        lag = np.asarray(times, dtype=float)[:, None] - self.window.times[None, :]
        matrix = self.window.bearing_matrix() if len(self.window) else np.zeros((self.dimension,) * 2)
        return bearing_bound(
            variance * self._kernel(lag, theta.log_kernel),
            variance,
            matrix,
            delta=delta,
            noise_variance=variance * theta.nugget,
        )


def _log_pair(bounds: tuple[float, float]) -> tuple[float, float]:
    low, high = np.log(bounds)
    return float(low), float(high)
