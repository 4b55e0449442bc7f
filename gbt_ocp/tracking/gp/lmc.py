"""The coregionalised Gaussian-process tracker (section 3.3): algorithm 1 for axes that move together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import dct

from gbt_ocp.tracking.gp.bounds import coregionalized_bound, weighted_bearing_bound
from gbt_ocp.tracking.gp.coregionalization import (
    CoregionalizedHyperparameters,
    CoregionalizedLikelihood,
    CoregionalizedPosterior,
)
from gbt_ocp.tracking.gp.likelihood import likelier, maximise
from gbt_ocp.tracking.gp.posterior import Hyperparameters, with_raised_nugget
from gbt_ocp.tracking.gp.tuning import (
    AMPLITUDE_BOUNDS,
    AMPLITUDE_PRIOR,
    LENGTH_SCALE_BOUNDS,
    LENGTH_SCALE_PRIOR,
    NUGGET_BOUNDS,
    NUGGET_PRIOR,
    SHAPE_BOUNDS,
    IsotropicTuning,
    checked_nugget,
    kernel_named,
    log_bounds,
)
from gbt_ocp.tracking.gp.windowed import WindowedTracker
from gbt_ocp.tracking.priors import LogNormal, PositionPrior
from gbt_ocp.tracking.window import Measurements
from gbt_ocp.typing import Array


class CoregionalizedTracker(WindowedTracker[CoregionalizedPosterior]):
    """Tracks a target whose motion is a priori ``P_T(t) ~ GP(centre, A diag(k_1, …, k_Q) Aᵀ)``.

    At every update A, the length scales and the nugget maximise the likelihood, under the weak priors of
    :class:`~gbt_ocp.tracking.gp.gp.GaussianProcessTracker`: on every length scale, on the nugget, and on the amplitude
    ``√(tr(A Aᵀ)/d)`` alone, so that nothing but the data says how the axes go together. The likelihood has several
    maxima; the search starts from the last θ and from the best isotropic process, and the likelier answer is taken.

    Parameters
    ----------
    dimension
        d.
    window
        N_c, capacity of the window.
    kernels
        k_q by name, one a latent function, at least d of them; ``None`` for d times ``se``.
    centre
        Prior mean: the earth-fixed ``origin`` as in the paper, or the ``vehicle``'s latest position.
    length_scale
        A value to keep for all latent functions (s), or ``None`` to tune one for each.
    nugget
        Variance of a measurement relative to the amplitude squared, or ``None`` to tune it too.
    prior
        As of :class:`~gbt_ocp.tracking.gp.windowed.WindowedTracker`.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """

    def __init__(
        self,
        dimension: int,
        *,
        window: int = 20,
        kernels: Sequence[str] | None = None,
        centre: Literal["origin", "vehicle"] = "vehicle",
        length_scale: float | None = None,
        nugget: float | None = None,
        prior: PositionPrior | None = None,
    ) -> None:
        names = ["se"] * dimension if kernels is None else list(kernels)
        if len(names) < dimension:
            raise ValueError(f"kernels: found {len(names)}; allowed: at least {dimension}")
        self._kernels = [kernel_named(name) for name in names]
        self._nugget = checked_nugget(nugget)
        self._directions = _frame(dimension, len(names))
        self._length_scale = length_scale
        super().__init__(dimension, window=window, centre=centre, prior=prior)

    def _forget_tuning(self) -> None:
        self._isotropic = IsotropicTuning(self._kernels[0], self._length_scale, None, self._nugget)
        self._theta = self._spread_out(self._isotropic.hyperparameters)

    def _spread_out(self, theta: Hyperparameters) -> CoregionalizedHyperparameters:
        """The isotropic process as a coregionalised one, whose latent functions are alike."""
        log_kernels = tuple(
            np.concatenate([theta.log_kernel[:1], np.zeros(len(kernel.names) - 1)]) for kernel in self._kernels
        )
        return CoregionalizedHyperparameters(log_kernels, theta.amplitude * self._directions, theta.nugget)

    def _tune(self, measurements: Measurements) -> None:
        self._isotropic.tune(measurements, self._centre)
        unit = self._theta.amplitude
        likelihood = CoregionalizedLikelihood(
            self._kernels, measurements, self._centre, self._nugget, unit=unit, amplitude_prior=AMPLITUDE_PRIOR
        )
        bounds, priors = self._limits(unit)
        alike = self._spread_out(self._isotropic.hyperparameters)
        warm, fresh = (maximise(likelihood, likelihood.pack(start), bounds, priors) for start in (self._theta, alike))
        self._theta = likelihood.unpack(likelier(likelihood, warm, fresh, priors))

    def _limits(self, unit: float) -> tuple[list[tuple[float, float]], list[LogNormal | None]]:
        """Bounds and priors of the packed parameters, A in metres times ``unit``."""
        bounds: list[tuple[float, float]] = []
        priors: list[LogNormal | None] = []
        for kernel in self._kernels:
            shapes = len(kernel.names) - 1
            bounds += [log_bounds(LENGTH_SCALE_BOUNDS, self._length_scale), *[log_bounds(SHAPE_BOUNDS)] * shapes]
            priors += [LENGTH_SCALE_PRIOR, *[None] * shapes]
        largest = AMPLITUDE_BOUNDS[1] / unit
        bounds += [(-largest, largest)] * self._directions.size
        priors += [None] * self._directions.size
        if self._nugget is None:
            bounds.append(log_bounds(NUGGET_BOUNDS))
            priors.append(NUGGET_PRIOR)
        return bounds, priors

    def _conditioned(self, measurements: Measurements) -> tuple[CoregionalizedPosterior, int]:
        theta = self._theta
        return with_raised_nugget(
            lambda nugget: CoregionalizedPosterior(
                self._kernels, replace(theta, nugget=nugget), measurements, self._centre, self._isotropic.rounding
            ),
            theta.nugget,
        )

    @property
    def hyperparameters(self) -> CoregionalizedHyperparameters:
        """θ, with the nugget that the last factorisation needed."""
        return self.posterior.hyperparameters

    def bound(self, times: ArrayLike, delta: float) -> Array:
        """Bound on the error at all of the times ``(K,)`` at once, in metres ``(K,)``.

        :func:`~gbt_ocp.tracking.gp.bounds.weighted_bearing_bound`, which holds for all kernels and weights.
        """
        return weighted_bearing_bound(*self._seen_from(times), delta=delta, noise_variance=self._noise)

    def printed_bound(self, times: ArrayLike, delta: float) -> Array:
        """Bound of theorem 2 as printed, which does not hold for every process, in metres ``(K,)``."""
        return coregionalized_bound(*self._seen_from(times), delta=delta, noise_variance=self._noise)

    @property
    def _noise(self) -> float:
        theta = self.hyperparameters
        return theta.amplitude**2 * theta.nugget

    def _seen_from(self, times: ArrayLike) -> tuple[Array, Array, Array]:
        """k_f between the times and the window, k_f(t, t), and the window's bearings ``(N, d)``."""
        posterior = self.posterior
        bearings = self.window.bearings.reshape(-1, self.dimension)
        cross = posterior.covariances(np.asarray(times, dtype=float), self.window.times)
        return cross, posterior.prior_covariance, bearings


def _frame(dimension: int, count: int) -> Array:
    """Weights ``(d, Q)`` with A Aᵀ = I: the identity, or rows of a cosine transform, in which no column is zero."""
    if count == dimension:
        return np.eye(dimension)
    return np.asarray(dct(np.eye(count), norm="ortho", axis=0)[:dimension])
