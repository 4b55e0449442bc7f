"""Which class a tracker is of: the one in numpy, or that with the arithmetic of a pilot in C."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import TypeVar

from gbt_ocp.ocp.codegen.library import CompilerError, find_compiler
from gbt_ocp.tracking.filters.ekf import ExtendedKalmanFilter
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker
from gbt_ocp.tracking.held.held_turn import HeldTurnTracker
from gbt_ocp.tracking.mixture import MixtureTracker
from gbt_ocp.tracking.shape.tracker import MotionShapeTracker

_Made = TypeVar("_Made")


def by_engine(
    engine: str, in_numpy: type[_Made], in_c: Callable[[], type[_Made]], made: Callable[[type[_Made]], _Made]
) -> _Made:
    """A tracker of a class in numpy, or of the one that a function imports.

    Warns
    -----
    RuntimeWarning
        If ``auto`` finds a compiler that does not work.
    """
    if engine == "numpy" or (engine == "auto" and find_compiler() is None):
        return made(in_numpy)
    try:
        return made(in_c())
    except CompilerError as reason:
        if engine == "compiled":
            raise
        warnings.warn(f"tracker.engine: auto takes numpy, which is slower: {reason}", RuntimeWarning, stacklevel=2)
        return made(in_numpy)


def gp_in_c() -> type[GaussianProcessTracker]:
    """The Gaussian process for exact bearings."""
    from gbt_ocp.pilot.compiled_gp import CompiledGaussianProcessTracker

    return CompiledGaussianProcessTracker


def extended_in_c() -> type[ExtendedKalmanFilter]:
    """The extended Kalman filter."""
    from gbt_ocp.pilot.compiled_ekf import CompiledExtendedKalmanFilter

    return CompiledExtendedKalmanFilter


def motion_in_c() -> type[MotionShapeTracker]:
    """The Gaussian process on the motion."""
    from gbt_ocp.pilot.compiled_motion import CompiledMotionTracker

    return CompiledMotionTracker


def mixture_in_c() -> type[MixtureTracker]:
    """The mixture."""
    from gbt_ocp.pilot.compiled_bank import CompiledMixtureTracker

    return CompiledMixtureTracker


def held_turn_in_c() -> type[HeldTurnTracker]:
    """The bank of held turn rates."""
    from gbt_ocp.pilot.compiled_bank import CompiledHeldTurnTracker

    return CompiledHeldTurnTracker
