"""Trackers as C: which hand-written files one needs, and its settings."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np

from gbt_ocp.tracking.filters.ekf import ExtendedKalmanFilter
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker

SIZES = {
    "SIZED": "whether the size of the target is estimated",
    "WINDOW": "bearings that the process keeps",
    "KERNEL": "of the process: 0 se, 1 matern32, 2 matern52, 3 rq",
    "SHAPES": "parameters of the kernel",
    "TUNED_NUGGET": "whether the nugget is tuned",
    "BREAKS": "whether the window is cut where the motion breaks",
}
"""Sizes of a tracker by name, and what they are."""

_KERNELS = ("se", "matern32", "matern52", "rq")

_ALONE = {
    "ekf": ("gbt_ekf", "gbt_kalman", "gbt_polar", "gbt_polar_update", "gbt_tracker_ekf"),
    "gp": ("gbt_gp", "gbt_breaks", "gbt_wide", "gbt_tracker_gp"),
}
"""Beginnings of the names of the files that one tracker alone needs."""


@dataclass(frozen=True)
class TrackerInC:
    """What a tracker is in C.

    Attributes
    ----------
    name
        ``ekf`` or ``gp``.
    settings
        Fields of its struct of settings.
    sizes
        Macros, without their prefix.
    """

    name: str
    settings: Mapping[str, Any]
    sizes: dict[str, int]

    def chosen(self, texts: Mapping[str, str]) -> dict[str, str]:
        """The files without those of other trackers; ``gbt_tracker.h`` is the one that stands for this tracker."""
        others = tuple(start for name, starts in _ALONE.items() if name != self.name for start in starts)
        found = {name: text for name, text in texts.items() if not name.startswith(others)}
        found["gbt_tracker.h"] = found.pop(f"gbt_tracker_{self.name}.h")
        return found


def pilot_texts() -> dict[str, str]:
    """The hand-written C files of the pilot and of all trackers, by name."""
    folder = files("gbt_ocp.pilot") / "c"
    return {
        entry.name: entry.read_text(encoding="utf-8")
        for entry in sorted(folder.iterdir(), key=lambda entry: entry.name)
        if entry.name.endswith((".c", ".h"))
    }


def tracker_in_c(tracker: object) -> TrackerInC:
    """A tracker that has seen nothing, as C.

    Raises
    ------
    ValueError
        If there is none of it in C.
    """
    if isinstance(tracker, ExtendedKalmanFilter):
        return _extended(tracker)
    if isinstance(tracker, GaussianProcessTracker):
        return _process(tracker)
    raise ValueError(
        f"tracker.kind: found one that is a {type(tracker).__name__}; allowed: ekf, or gp for exact bearings"
    )


def _extended(tracker: ExtendedKalmanFilter) -> TrackerInC:
    guess, process_noise, bearing_std, size = tracker.settings
    d = len(guess.prior.start)
    mean, covariance = (np.zeros(d), np.zeros((d, d))) if guess.prior.known is None else guess.prior.known
    settings = {
        "process_noise": process_noise,
        "bearing_std": bearing_std,
        "range": guess.prior.range,
        "range_std": guess.range_std,
        "speed_std": guess.speed_std,
        "log_size": 0.0 if size is None else math.log(size.median),
        "log_size_std": 1.0 if size is None else size.log_std,
        "known": int(guess.prior.known is not None),
        "known_mean": mean,
        "known_covariance": covariance,
    }
    return TrackerInC("ekf", settings, {"SIZED": int(size is not None)})


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
        "suspect": tuning.suspect,
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


def c_number(value: Any) -> str:
    """A number, an array or a struct as an initialiser in C."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f".{name} = {c_number(one)}" for name, one in value.items()) + "}"
    if isinstance(value, np.ndarray):
        return "{" + ", ".join(c_number(one) for one in value) + "}"
    return str(value) if isinstance(value, int) else f"(gbt_real){float(value)!r}"


def initialiser(values: Mapping[str, Any], doubles: Collection[str] = ()) -> str:
    """Fields of a struct in C, a line each; those named are double in both precisions."""
    return ",\n    ".join(
        f".{name} = {repr(float(value)) if name in doubles else c_number(value)}" for name, value in values.items()
    )
