"""Trackers as C: which hand-written files one needs, and its settings."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gbt_ocp.ocp.codegen.library import c_texts, kernel_files
from gbt_ocp.pilot.mixture_source import first_guess_in_c, held_turn_in_c, known_position, mixture_in_c, size_in_c
from gbt_ocp.tracking.filters.ekf import ExtendedKalmanFilter, FirstGuess
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker
from gbt_ocp.tracking.gp.tuning import EXACT, TELLTALE
from gbt_ocp.tracking.held.held_turn import HeldTurnTracker
from gbt_ocp.tracking.mixture import MixtureTracker
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.tracking.shape.processes import unit_factors
from gbt_ocp.tracking.shape.tracker import MotionShapeTracker
from gbt_ocp.typing import Array

SIZES = {
    "SIZED": "whether the size of the target is estimated",
    "WINDOW": "bearings that the process keeps",
    "KERNEL": "of the process: 0 se, 1 matern32, 2 matern52, 3 rq",
    "SHAPES": "parameters of the kernel",
    "TUNED_NUGGET": "whether the nugget is tuned",
    "BREAKS": "whether the window is cut where the motion breaks",
    "BINS": "bins of bearings",
    "BIN_SAMPLES": "bearings in the newest of them",
    "OTHERS": "measurements of one number that are no bearings",
    "MEMORIES": "posteriors that are remembered until the window begins after them",
    "TURN_STDS": "standard deviations of the turn rate in the grid",
    "TURN_TIMES": "and its time scales",
    "SPEED_STDS": "standard deviations of the change of log speed in the grid",
    "SLOW": "knots of log speed in the past",
    "BLOCKS": "and ahead",
    "STARTS": "ranges at which a track is begun",
    "HYPOTHESES": "distinct motions that are kept",
    "OWN_NOISE": "whether the own position has an error",
    "BLOCKS_OF_STATE": "derivatives in the state of a filter, from the position on",
    "COMPONENTS": "Gaussians of held turn rates",
    "HELD_NODES": "nodes ahead at which these are forecast",
    "MEMBERS": "trackers of a mixture",
}
"""Sizes of a tracker by name, and what they are."""

_KERNELS = ("se", "matern32", "matern52", "rq")

_BINNED = ("gbt_bins", "gbt_noise", "gbt_mixed", "gbt_nodes", "gbt_polar.")
_SHAPE = ("gbt_singles", "gbt_motions", "gbt_shape_", "gbt_track_memory", "gbt_motion_gp")
_FILTER = ("gbt_first_guess", "gbt_kalman", "gbt_polar")
_HELD = ("gbt_held_", "gbt_lost", "gbt_singles", "gbt_waiting", *_BINNED)

_NEEDED = {
    "ekf": ("gbt_ekf", *_FILTER),
    "gp": ("gbt_gp", "gbt_breaks", "gbt_wide"),
    "motion_gp": (*_BINNED, *_SHAPE),
    "held_turn": _HELD,
    "mixture": ("gbt_mixture", "gbt_imm", "gbt_binned", *_FILTER, *_HELD),
}
"""Beginnings of the names of the files that a tracker needs and not all others do."""

_BASIS = ("gbt_bearing", "gbt_linalg", "gbt_gaps", "gbt_sighting", "gbt_forecast")
_OF_KERNEL = ("gbt_real.h", "gbt_math.h", "gbt_identity.h")

SAMPLES = 256
"""Bearings in a bin for which there is memory, where the rate of the sensor is not known."""

FEW_OTHERS = 16
"""Measurements that are no bearings for which there is memory, where no sensor for them is configured."""


@dataclass(frozen=True)
class TrackerInC:
    """What a tracker is in C.

    Attributes
    ----------
    name
        ``ekf``, ``gp``, ``motion_gp``, ``held_turn`` or ``mixture``.
    settings
        Fields of its struct of settings.
    sizes
        Macros, without their prefix.
    doubles
        Fields that are double in both precisions: times.
    """

    name: str
    settings: Mapping[str, Any]
    sizes: dict[str, int]
    doubles: tuple[str, ...] = ()

    def chosen(self, texts: Mapping[str, str]) -> dict[str, str]:
        """The files without those of other trackers; ``gbt_tracker.h`` is the one that stands for this tracker."""
        mine = (*_NEEDED[self.name], f"gbt_tracker_{self.name}.")
        others = (*(start for starts in _NEEDED.values() for start in starts), "gbt_tracker_")
        found = {name: text for name, text in texts.items() if name.startswith(mine) or not name.startswith(others)}
        found["gbt_tracker.h"] = found.pop(f"gbt_tracker_{self.name}.h")
        return found

    def alone(self, dimension: int, sensors: int) -> dict[str, str]:
        """The C files of the tracker by itself, by name, for so many numbers of sensors."""
        shared, texts = kernel_files(), pilot_texts()
        sources = {name: shared[name] for name in _OF_KERNEL}
        wanted = (*_BASIS, *_NEEDED[self.name])
        sources |= {name: text for name, text in texts.items() if name.startswith(wanted)}
        include = '#include "gbt_real.h"\n'
        sizes = "".join(f"#define GBT_{name} {value}\n" for name, value in (self.sizes | {"SENSORS": sensors}).items())
        sources["gbt_problem.h"] = f"{include}#define GBT_DIMENSION {dimension}\n"
        sources["gbt_pilot_settings.h"] = f"{include}{sizes}"
        return sources


def pilot_texts() -> dict[str, str]:
    """The hand-written C files of the pilot and of all trackers, by name."""
    return dict(c_texts("gbt_ocp.pilot", "c"))


def tracker_in_c(
    tracker: object, samples: Callable[[float], int] = lambda width: SAMPLES, others: int = 2
) -> TrackerInC:
    """A tracker that has seen nothing, as C.

    Parameters
    ----------
    tracker
        The tracker.
    samples
        Bearings for which there is memory in a bin of a width in seconds.
    others
        Sensors that measure no bearings for which there is memory in each bin; without any, there is memory for a few.

    Raises
    ------
    ValueError
        If there is none of it in C.
    """
    if isinstance(tracker, MotionShapeTracker):
        return _motion(tracker, samples(tracker.bins.width), others)
    if isinstance(tracker, MixtureTracker):
        return TrackerInC("mixture", *mixture_in_c(tracker, samples), _MIXTURE_DOUBLES)
    if isinstance(tracker, HeldTurnTracker):
        return TrackerInC("held_turn", *held_turn_in_c(tracker, samples), _MIXTURE_DOUBLES)
    if isinstance(tracker, ExtendedKalmanFilter):
        return _extended(tracker)
    if isinstance(tracker, GaussianProcessTracker):
        return _process(tracker)
    raise ValueError(
        f"tracker.kind: found one that is a {type(tracker).__name__}; allowed: mixture, held_turn, motion_gp, ekf, or "
        "gp for exact bearings"
    )


_MIXTURE_DOUBLES = ("correlation_time", "width", "window", "forgetting")


def _extended(tracker: ExtendedKalmanFilter) -> TrackerInC:
    return extended_in_c(*tracker.settings)


def extended_in_c(guess: FirstGuess, process_noise: float, bearing_std: float, size: LogNormal | None) -> TrackerInC:
    """An extended Kalman filter as C, by its parameters."""
    settings = {
        "process_noise": process_noise,
        **size_in_c(size),
        "guess": first_guess_in_c(guess, bearing_std),
    }
    return TrackerInC("ekf", settings, {"SIZED": int(size is not None), "BLOCKS_OF_STATE": 2})


def _process(tracker: GaussianProcessTracker) -> TrackerInC:
    kernel, tuning, on_vehicle, window, prior, rows, breaks = tracker.settings
    bounds, priors, first, smooth, nugget = tuning.search
    low, high = np.array(bounds).T
    d, shapes = tracker.dimension, 2 if kernel == "rq" else 1
    found = {
        "nugget": 0.0 if nugget is None else nugget,
        "low": low,
        "high": high,
        "median": np.array([0.0 if one is None else math.log(one.median) for one in priors]),
        "spread": np.array([0.0 if one is None else one.log_std for one in priors]),
        "first": first,
        "smooth": smooth,
        "exact": math.log(EXACT),
        "suspect": tuning.suspect,
        "telltale": math.log(TELLTALE),
    }
    settings = {
        "on_vehicle": int(on_vehicle),
        "tuning": found,
        "known": int(rows is not None),
        "known_mean": prior.unseen if rows is not None else np.zeros(d),
        "known_axis": np.zeros((d, d)) if rows is None else rows.directions,
        "known_variance": np.zeros(d) if rows is None else rows.variances,
    }
    sizes = {"SIZED": 0, "WINDOW": window, "KERNEL": _KERNELS.index(kernel)}
    sizes |= {"SHAPES": shapes, "TUNED_NUGGET": int(nugget is None), "BREAKS": int(breaks)}
    return TrackerInC("gp", settings, sizes)


def _motion(tracker: MotionShapeTracker, samples: int, others: int) -> TrackerInC:
    shape, noise, update, starts, hypotheses, memory, iterations, gate, size, position = tracker.settings
    (knot, span, slow, blocks), prior, bins = shape.knots, shape.prior, tracker.bins
    if not update > 0.0:
        raise ValueError("tracker.update_s: found 0; allowed in C: a number > 0")
    factors = unit_factors(prior, knot, slow, blocks)
    known = known_position(position)
    settings = {
        "prior": {
            "knot": knot,
            "span": span,
            "speed": prior.speed.median,
            "log_speed_std": prior.speed.log_std,
            "range": prior.range.median,
            "log_range_std": prior.range.log_std,
            "climb_std": prior.climb_std,
            "climb_change_std": prior.climb_change_std,
            "turn_std": np.array(prior.turn_stds, dtype=float),
            "speed_std": np.array(prior.speed_stds, dtype=float),
            "turn_factor": np.array([_triangle(factors.turn[float(time)]) for time in prior.turn_times]),
            "speed_factor": _triangle(factors.speed),
            "climb_factor": _triangle(factors.climb),
        },
        "noise": {
            "std": noise.std,
            "correlated_std": noise.correlated_std,
            "correlation_time": noise.correlation_time,
            "own_std": noise.own_std,
            **size_in_c(size),
        },
        "binning": {"width": bins.width, "window": bins.window, "stray": bins.stray},
        "update": update,
        "gate": gate,
        "memory": memory,
        "starts": np.asarray(starts, dtype=float),
        "estimated": int(noise.estimated),
        "iterations": iterations,
        "known": known["known"],
        "unused": 0,
        "known_mean": known["known_mean"],
        "known_covariance": known["known_covariance"],
    }
    count = math.ceil(bins.window / bins.width) + 2
    sizes = {
        "SIZED": int(size is not None),
        "BINS": count,
        "BIN_SAMPLES": samples,
        "OTHERS": others * count or FEW_OTHERS,
        "MEMORIES": 3 + math.ceil((bins.window + bins.width) / update) if math.isfinite(memory) else 1,
        "TURN_STDS": len(prior.turn_stds),
        "TURN_TIMES": len(prior.turn_times),
        "SPEED_STDS": len(prior.speed_stds),
        "SLOW": slow,
        "BLOCKS": blocks,
        "STARTS": len(starts),
        "HYPOTHESES": hypotheses,
        "OWN_NOISE": int(noise.own_std > 0.0),
    }
    return TrackerInC("motion_gp", settings, sizes, ("knot", "span", "correlation_time", "width", "window", "update"))


def _triangle(lower: Array) -> Array:
    """The lower triangle of a matrix, row by row."""
    return np.asarray(lower[np.tril_indices(len(lower))])


def c_number(value: Any, doubles: Collection[str] = ()) -> str:
    """A number, an array or a struct as an initialiser in C; fields that are named are double in both precisions."""
    if isinstance(value, Mapping):
        return f"{{{initialiser(value, doubles, ', ')}}}"
    if isinstance(value, np.ndarray):
        return "{" + ", ".join(c_number(one) for one in value) + "}"
    if isinstance(value, int | np.integer):
        return str(value)
    return f"(gbt_real){'HUGE_VAL' if math.isinf(value) else repr(float(value))}"


def initialiser(values: Mapping[str, Any], doubles: Collection[str] = (), between: str = ",\n    ") -> str:
    """Fields of a struct in C; those named are double in both precisions."""
    return between.join(
        f".{name} = {_double(value) if name in doubles else c_number(value, doubles)}" for name, value in values.items()
    )


def _double(value: float) -> str:
    return "HUGE_VAL" if math.isinf(value) else repr(float(value))


def called(function: Any, *given: Any) -> int:
    """What a function of a library answers, 0 for nothing; it is given the addresses of arrays, all else as it is."""
    kept = [np.ascontiguousarray(one, dtype=float) if isinstance(one, np.ndarray) else one for one in given]
    arguments = [ctypes.c_void_p(one.ctypes.data) if isinstance(one, np.ndarray) else one for one in kept]
    return int(function(*arguments) or 0)


def laid_out(settings: Mapping[str, Any]) -> bytes:
    """The struct of settings as a compiler lays it out in double precision."""
    found = b""
    for value in settings.values():
        if isinstance(value, Mapping):
            part = laid_out(value)
        elif isinstance(value, int) or getattr(value, "dtype", None) == np.int32:
            found += np.array(value, dtype=np.int32).tobytes()
            continue
        else:
            part = np.asarray(value, dtype=float).tobytes()
        found += bytes(-len(found) % 8) + part
    return found + bytes(-len(found) % 8)
