"""Tuning of the isotropic process on a window (algorithm 1): what is tuned, within which bounds, under which priors."""

from __future__ import annotations

import numpy as np

from gbt_ocp.tracking.gp.kernels import KERNELS, Kernel
from gbt_ocp.tracking.gp.likelihood import LogLikelihood, likelier, maximise
from gbt_ocp.tracking.gp.posterior import Hyperparameters
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.tracking.window import Measurements
from gbt_ocp.typing import Array

Bounds = tuple[float, float]

SHORT = -1.0
"""Logarithm of the share of its prior median below which a length scale is suspected of telling noise."""

TELLTALE = 1.0e-12
"""Nugget below which it is not: the motion explains the bearings as far as rounding lets it. Of ten thousand second
searches on drawn motions with bearings or positions that were noisy or rounded, 160 found something likelier, none of
seven thousand from below."""

NOISY = 1.0e-4
"""Nugget from which the search for a smooth motion with noise starts."""

EXACT = 1.0e-8
"""Nugget below which that search has left what it was started for: bearings are exact then, or nearly so."""

SHAPE_BOUNDS = (0.05, 100.0)
"""Range of a kernel's further parameters (α of the rational quadratic)."""

LENGTH_SCALE_PRIOR = LogNormal(3.0, 1.0)
LENGTH_SCALE_BOUNDS = (0.3, 200.0)
AMPLITUDE_PRIOR = LogNormal(3.0, 1.0)
AMPLITUDE_BOUNDS = (0.5, 200.0)
NUGGET_PRIOR = LogNormal(1e-11, 4.0)
NUGGET_BOUNDS = (1e-14, 1e-2)


def kernel_named(name: str) -> Kernel:
    """A kernel by its name in a configuration.

    Raises
    ------
    ValueError
        If there is none.
    """
    if name not in KERNELS:
        raise ValueError(f"kernel: found {name!r}; allowed: {', '.join(KERNELS)}")
    return KERNELS[name]


def checked_nugget(nugget: float | None) -> float | None:
    """A nugget, positive or ``None``.

    Raises
    ------
    ValueError
        If it is neither.
    """
    if nugget is not None and not nugget > 0.0:
        raise ValueError(f"nugget: found {nugget}; allowed: a number > 0")
    return nugget


def log_bounds(bounds: Bounds, fixed: float | None = None) -> Bounds:
    """Logarithms of the bounds, or of a value that is kept, twice."""
    low, high = np.log(bounds if fixed is None else (fixed, fixed))
    return float(low), float(high)


class IsotropicTuning:
    """Maximises the likelihood of ``P_T(t) ~ GP(centre, a² k I)``, each time from where the last search ended.

    Parameters
    ----------
    kernel
        k.
    length_scale, amplitude
        A value to keep (s, m), or ``None`` to tune it.
    nugget
        Variance of a measurement relative to the amplitude squared, or ``None`` to tune it too.
    """

    def __init__(
        self, kernel: Kernel, length_scale: float | None, amplitude: float | None, nugget: float | None
    ) -> None:
        self._kernel = kernel
        self._nugget = nugget
        shapes = len(kernel.names) - 1
        self._bounds = [
            log_bounds(LENGTH_SCALE_BOUNDS, length_scale),
            *[log_bounds(SHAPE_BOUNDS)] * shapes,
            log_bounds(AMPLITUDE_BOUNDS, amplitude),
        ]
        # The paper's tuning is plain maximum likelihood; priors come with the amplitude, which it does not tune.
        weak = amplitude is None
        self._priors = [
            LENGTH_SCALE_PRIOR if weak else None,
            *[None] * shapes,
            AMPLITUDE_PRIOR if weak else None,
        ]
        first = [
            length_scale or LENGTH_SCALE_PRIOR.median,
            *[1.0] * shapes,
            amplitude or AMPLITUDE_PRIOR.median,
        ]
        if nugget is None:
            self._bounds.append(log_bounds(NUGGET_BOUNDS))
            self._priors.append(NUGGET_PRIOR)
            first.append(NUGGET_PRIOR.median)
        self._log_theta = np.log(first)
        self._smooth = np.log([*first[:-1], NOISY]) if nugget is None else self._log_theta

    def tune(self, measurements: Measurements, centre: Array) -> None:
        """Go from the last θ to that of the largest likelihood near it, or of a smooth motion with noise."""
        if not any(high > low for low, high in self._bounds):
            return
        likelihood = LogLikelihood(self._kernel, measurements, centre, self._nugget)
        warm = maximise(likelihood, self._log_theta, self._bounds, self._priors)
        self._log_theta = warm
        if self._nugget is not None or warm[0] > self.suspect or warm[-1] < np.log(TELLTALE):
            return
        # Noise can be taken for a motion that jitters, and no local search leaves that: try the other start too.
        smooth = maximise(likelihood, self._smooth, self._bounds, self._priors, EXACT)
        self._log_theta = likelier(likelihood, warm, smooth, self._priors)

    @property
    def search(self) -> tuple[list[Bounds], list[LogNormal | None], Array, Array, float | None]:
        """Bounds of log θ and their priors, where the search is, where one for a smooth motion begins, the nugget."""
        return self._bounds, self._priors, self._log_theta, self._smooth, self._nugget

    @property
    def rounding(self) -> float:
        """The part of a tuned nugget that stands for the rounding of a covariance; 0 of one that is given."""
        return NUGGET_BOUNDS[0] if self._nugget is None else 0.0

    @property
    def suspect(self) -> float:
        """Logarithm of the length scale in s below which it is suspected of telling noise."""
        return float(SHORT + np.log(LENGTH_SCALE_PRIOR.median))

    def found(self, log_theta: Array) -> None:
        """Take log θ from a search that was made elsewhere."""
        self._log_theta = log_theta

    @property
    def hyperparameters(self) -> Hyperparameters:
        """θ."""
        shapes = len(self._kernel.names)
        nugget = float(np.exp(self._log_theta[-1])) if self._nugget is None else self._nugget
        return Hyperparameters(self._log_theta[:shapes], float(self._log_theta[shapes]), nugget)
