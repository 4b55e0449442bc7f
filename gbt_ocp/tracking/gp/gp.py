"""The Gaussian-process tracker (algorithm 1): window, tuning, posterior, and the numbers that explain them."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.tracking.gp.bounds import bearing_bound
from gbt_ocp.tracking.gp.kernels import KERNELS
from gbt_ocp.tracking.gp.posterior import Hyperparameters, Posterior, condition
from gbt_ocp.tracking.gp.tuning import IsotropicTuning, checked_nugget, kernel_named
from gbt_ocp.tracking.gp.windowed import WindowedTracker
from gbt_ocp.tracking.priors import PositionPrior
from gbt_ocp.tracking.window import Measurements
from gbt_ocp.typing import Array


class GaussianProcessTracker(WindowedTracker[Posterior]):
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
    prior
        What is known of the position when the first bearing is taken; by default nothing, with the vehicle at the
        origin. It counts as a measurement for as long as that bearing is in the window.
    breaks
        Whether the window is cut where the motion breaks; see :mod:`~gbt_ocp.tracking.gp.breaks`.

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
        kernel: str = "se",
        centre: Literal["origin", "vehicle"] = "vehicle",
        length_scale: float | None = None,
        amplitude: float | None = None,
        nugget: float | None = None,
        prior: PositionPrior | None = None,
        breaks: bool = False,
    ) -> None:
        self._kernel = kernel_named(kernel)
        self._fixed = length_scale, amplitude, checked_nugget(nugget)
        super().__init__(dimension, window=window, centre=centre, prior=prior, breaks=breaks)

    @property
    def settings(self) -> tuple[str, IsotropicTuning, bool, int, PositionPrior, Measurements | None, bool]:
        """Kernel, search at its beginning, whether the vehicle is the centre, N_c, prior and its rows, whether cut."""
        name = next(name for name, kernel in KERNELS.items() if kernel is self._kernel)
        fresh = IsotropicTuning(self._kernel, *self._fixed)
        return name, fresh, self._centre_on_vehicle, self._capacity, self._prior, self._prior_rows, self._breaks

    def _forget_tuning(self) -> None:
        self._tuning = IsotropicTuning(self._kernel, *self._fixed)

    def _tune(self, measurements: Measurements) -> None:
        self._tuning.tune(measurements, self._centre)

    def _conditioned(self, measurements: Measurements) -> tuple[Posterior, int]:
        theta, rounding = self._tuning.hyperparameters, self._tuning.rounding
        return condition(self._kernel, theta, measurements, self._centre, rounding)

    @property
    def hyperparameters(self) -> Hyperparameters:
        """θ, with the nugget that the last factorisation needed."""
        return self.posterior.hyperparameters

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
