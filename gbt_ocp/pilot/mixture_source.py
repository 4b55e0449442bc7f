"""Held turn rates, interacting models, and the mixture of both as C: their settings and sizes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from gbt_ocp.tracking.bins import BearingBins
from gbt_ocp.tracking.filters.binned import BinnedFilter
from gbt_ocp.tracking.filters.ekf import FirstGuess, ImmExtendedTracker
from gbt_ocp.tracking.held.held_turn import (
    AHEAD_STEP,
    COLD_STARTS,
    LONGEST_AHEAD,
    HeldTurnTracker,
)
from gbt_ocp.tracking.mixture import MixtureTracker
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.priors import LogNormal, PositionPrior

MEMBERS_IN_C = ("held_turn", "imm_ekf")
"""Members of a mixture by their numbers in C."""

Source = tuple[dict[str, Any], dict[str, int]]
"""Fields of a struct of settings, and sizes by name."""


def noise_in_c(noise: BearingNoise) -> dict[str, Any]:
    """The struct of the noise of a sensor."""
    return {
        "std": noise.std,
        "correlated_std": noise.correlated_std,
        "correlation_time": noise.correlation_time,
        "own_std": noise.own_std,
        "estimated": int(noise.estimated),
    }


def _binning(bins: BearingBins, noise: BearingNoise) -> dict[str, Any]:
    """The struct of bins: all but the newest are kept for the scatter in them, where the noise is estimated."""
    window = bins.window if noise.estimated else 2.0 * bins.width
    return {"width": bins.width, "window": window, "stray": bins.stray}


def _bins_kept(bins: BearingBins, noise: BearingNoise) -> int:
    return (math.ceil(bins.window / bins.width) if noise.estimated else 2) + 2


def known_position(position: PositionPrior) -> dict[str, Any]:
    """The fields of what is known of the position at the first measurement."""
    d = len(position.start)
    mean, covariance = (np.zeros(d), np.zeros((d, d))) if position.known is None else position.known
    return {"known": int(position.known is not None), "known_mean": mean, "known_covariance": covariance}


def first_guess_in_c(guess: FirstGuess, bearing_std: float) -> dict[str, Any]:
    """The struct of where a filter begins."""
    known = known_position(guess.prior)
    return {
        "bearing_std": bearing_std,
        "range": guess.prior.range,
        "range_std": guess.range_std,
        "speed_std": guess.speed_std,
        "known": known["known"],
        "mean": known["known_mean"],
        "covariance": known["known_covariance"],
    }


def size_in_c(size: LogNormal | None) -> dict[str, Any]:
    """The fields of what is known of the target's size; nothing reads them where it is not estimated."""
    return {
        "log_size": 0.0 if size is None else math.log(size.median),
        "log_size_std": 0.0 if size is None else size.log_std,
    }


def held_turn_in_c(tracker: HeldTurnTracker, samples: Callable[[float], int]) -> Source:
    """A tracker by held turn rates that has seen nothing.

    Parameters
    ----------
    tracker
        The tracker.
    samples
        Bearings for which there is memory in a bin of a width in seconds.
    """
    prior, noise, bins, components, position = tracker.settings
    settings = {
        "prior": {
            "speed": prior.speed.median,
            "log_speed_std": prior.speed.log_std,
            "range": prior.range.median,
            "log_range_std": prior.range.log_std,
            "hold": prior.hold,
            "speed_time": prior.speed_time,
            "climb_std": prior.climb_std,
            **size_in_c(prior.size),
            "turn_std": np.array(prior.turn_stds, dtype=float),
            "speed_std": np.array(prior.speed_stds, dtype=float),
        },
        "noise": noise_in_c(noise),
        "binning": _binning(bins, noise),
        "starts": np.array(COLD_STARTS, dtype=np.int32),
        "components": components,
        **known_position(position),
    }
    sizes = {
        "SIZED": int(prior.size is not None),
        "BINS": _bins_kept(bins, noise),
        "BIN_SAMPLES": samples(bins.width),
        "OTHERS": samples(bins.width),
        "TURN_STDS": len(prior.turn_stds),
        "SPEED_STDS": len(prior.speed_stds),
        "COMPONENTS": max(components, math.prod(COLD_STARTS) * len(prior.turn_stds)),
        "HELD_NODES": math.ceil(LONGEST_AHEAD / AHEAD_STEP) + 1,
    }
    return settings, sizes


def _models(binned: BinnedFilter) -> dict[str, Any]:
    """The settings of interacting models on means of bins."""
    imm, noise, bins = binned.settings
    if not isinstance(imm, ImmExtendedTracker):
        raise ValueError(f"tracker.members: found one that is a {type(imm).__name__}; allowed in C: {_BOTH}")
    guess, models, bearing_std, size = imm.settings
    variance, process, jerk, stay, turn = models.settings
    return {
        "filter": {
            "models": {
                "initial_variance": variance,
                "process_noise": process,
                "jerk_noise": jerk,
                "stay": stay,
                "turn_rate_max": turn,
                **size_in_c(size),
            },
            "guess": first_guess_in_c(guess, bearing_std),
        },
        "noise": noise_in_c(noise),
        "binning": _binning(bins, noise),
    }


_BOTH = "held_turn and imm_ekf, both of them"


def mixture_in_c(tracker: MixtureTracker, samples: Callable[[float], int]) -> Source:
    """A mixture that has seen nothing; as :func:`held_turn_in_c`.

    Raises
    ------
    ValueError
        If there is none of its members in C.
    """
    if sorted(tracker.members) != sorted(MEMBERS_IN_C):
        raise ValueError(f"tracker.members: found {', '.join(tracker.members)}; allowed in C: {_BOTH}")
    noise, bins, forgetting = tracker.settings
    held, binned = (tracker.members[name] for name in MEMBERS_IN_C)
    assert isinstance(held, HeldTurnTracker), "of this name"
    assert isinstance(binned, BinnedFilter), "of this name"
    held_settings, sizes = held_turn_in_c(held, samples)
    settings = {
        "held": held_settings,
        "models": _models(binned),
        "noise": noise_in_c(noise),
        "binning": _binning(bins, noise),
        "forgetting": forgetting,
        "member": np.array([MEMBERS_IN_C.index(name) for name in tracker.members], dtype=np.int32),
    }
    sizes |= {
        "BINS": max(sizes["BINS"], _bins_kept(bins, noise)),
        "BIN_SAMPLES": max(sizes["BIN_SAMPLES"], samples(bins.width)),
        "BLOCKS_OF_STATE": 3,
        "MEMBERS": len(tracker.members),
    }
    return settings, sizes
