"""The Gaussian process that generated pilots have, in the place of the one in numpy."""

from __future__ import annotations

import ctypes
import math
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.ocp.codegen.library import load_library
from gbt_ocp.pilot.tracker_source import called, laid_out, tracker_in_c
from gbt_ocp.tracking.gp.breaks import Break
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker
from gbt_ocp.tracking.priors import PositionPrior
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.tracking.window import Measurements
from gbt_ocp.typing import Array

_WAITS, _BROKEN = 2, 3  # gbt_gp_taken


class CompiledGaussianProcessTracker(GaussianProcessTracker):
    """:class:`~gbt_ocp.tracking.gp.gp.GaussianProcessTracker` that is tuned, and predicts, by the C of a pilot.

    The window is kept on both sides; what is reported of the posterior beside forecasts comes from numpy. The library
    is compiled once and kept in the user's cache.

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
        self._memory = np.zeros(0)
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
        made = tracker_in_c(self)
        self._library = load_library(made.alone(dimension, 1))
        self._library.gbt_gp_bytes.restype = ctypes.c_size_t
        self._library.gbt_gp_begin.restype = self._library.gbt_gp_predict.restype = None
        self._numbers = np.frombuffer(laid_out(made.settings), dtype=float).copy()
        self._memory = np.zeros(self._library.gbt_gp_bytes() // 8)
        self._call("begin", self._prior.start)

    def _call(self, name: str, *given: Any) -> int:
        """A function of the library on the memory and the settings."""
        return called(getattr(self._library, f"gbt_gp_{name}"), self._memory, self._numbers, *given)

    def _judged(self, time: float, bearing: Array, own: Array) -> tuple[Break | None, bool]:
        answer = self._call("add", ctypes.c_double(time), bearing, own)
        self._added = True
        if answer != _BROKEN:
            return None, answer == _WAITS
        d = self.dimension
        # known_mean, known_axis, known_variance, start, centre, log_theta are the last numbers of the memory
        known = self._memory[: -2 * d - len(self._tuning.search[2])][-d * (d + 2) :]
        return Break(known[:d].copy(), math.sqrt(known[-1])), False

    def _tune(self, measurements: Measurements) -> None:
        if not self._added:
            time, bearing, own = self.window.latest
            self._call("add", ctypes.c_double(time), bearing, own)
        self._added = False
        self._tuning.found(self._memory[-len(self._tuning.search[2]) :].copy())

    def predict(self, times: ArrayLike) -> Forecast:
        """As :meth:`GaussianProcessTracker.predict`."""
        asked = np.asarray(times, dtype=float)
        d = self.dimension
        mean, covariance = np.empty((len(asked), d)), np.empty((len(asked), d, d))
        self._call("predict", asked, ctypes.c_int(len(asked)), mean, covariance)
        return Forecast(mean, covariance)
