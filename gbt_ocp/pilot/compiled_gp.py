"""The Gaussian process that generated pilots have, in the place of the one in numpy."""

from __future__ import annotations

import ctypes
import math
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.pilot.state_in_c import StateInC
from gbt_ocp.pilot.tracker_source import tracker_in_c
from gbt_ocp.tracking.gp.breaks import Break
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker
from gbt_ocp.tracking.gp.posterior import Hyperparameters, Posterior, raised
from gbt_ocp.tracking.priors import PositionPrior
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.tracking.window import Measurements
from gbt_ocp.typing import Array

_WAITS, _BROKEN = 2, 3  # gbt_gp_taken


class CompiledGaussianProcessTracker(GaussianProcessTracker):
    """:class:`~gbt_ocp.tracking.gp.gp.GaussianProcessTracker` that is tuned, and predicts, by the C of a pilot.

    The window is kept on both sides. The posterior in numpy is made where it is asked for, which the loop does not do.
    The library is compiled once and kept in the user's cache.

    Parameters
    ----------
    dimension, window, kernel, centre, length_scale, amplitude, nugget, prior, breaks
        As for the tracker in numpy.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    gbt_ocp.ocp.codegen.library.CompilerError
        If there is no working C compiler.
    """

    _theta: Hyperparameters | None

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
        self._added = False  # whether C has taken the latest bearing already
        super().__init__(
            dimension,
            window=window,
            kernel=kernel,
            centre=centre,
            length_scale=length_scale,
            amplitude=amplitude,
            nugget=nugget,
            prior=prior,
            breaks=breaks,
        )
        self._c = StateInC(tracker_in_c(self), dimension, 1, ("begin",), works=True)
        self._tunable = len(self._tuning.search[2])
        self._c.call("begin", self._prior.start)

    def _judged(self, time: float, bearing: Array, own: Array) -> tuple[Break | None, bool]:
        answer = self._c.call_working("add", ctypes.c_double(time), bearing, own)
        self._added = True
        if answer != _BROKEN:
            return None, answer == _WAITS
        d = self.dimension
        # known_mean, known_axis, known_variance, start, centre, log_theta are the last numbers of the memory
        known = self._c.state[: -2 * d - self._tunable][-d * (d + 2) :]
        return Break(known[:d].copy(), math.sqrt(known[-1])), False

    def _fit(self) -> None:
        if not self._added:
            time, bearing, own = self.window.latest
            self._c.call_working("add", ctypes.c_double(time), bearing, own)
        self._added = False
        self._tuning.found(self._c.state[-self._tunable :].copy())
        self._posterior, self._theta = None, None

    def _forget_tuning(self) -> None:
        super()._forget_tuning()
        self._theta = None

    def _condition(self, measurements: Measurements) -> Posterior:
        self._posterior, _ = self._conditioned(measurements)  # C has counted its own retries
        return self._posterior

    def predict(self, times: ArrayLike) -> Forecast:
        """As :meth:`GaussianProcessTracker.predict`."""
        asked = np.asarray(times, dtype=float)
        d = self.dimension
        mean, covariance = np.empty((len(asked), d)), np.empty((len(asked), d, d))
        retries = self._c.call_working("predict", asked, ctypes.c_int(len(asked)), mean, covariance)
        if self._theta is None:
            self._theta = self._needed(retries)
        return Forecast(mean, covariance)

    @property
    def hyperparameters(self) -> Hyperparameters:
        """θ, with the nugget that the last factorisation needed."""
        if self._theta is None:
            self.predict(())
            assert self._theta is not None, "a prediction sets it"
        return self._theta

    def _needed(self, retries: int) -> Hyperparameters:
        """θ with a nugget that was raised so often."""
        self.nugget_retries += retries
        theta = self._tuning.hyperparameters
        nugget = theta.nugget
        for _ in range(retries):
            nugget = raised(nugget)
        return replace(theta, nugget=nugget) if retries else theta

    @property
    def prior_covariance(self) -> Array:
        """Prior covariance of the position at any time under θ ``(d, d)`` in m²."""
        return np.asarray(math.exp(2.0 * self.hyperparameters.log_amplitude) * np.eye(self.dimension))
