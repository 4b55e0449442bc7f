"""Scores of a replayed track: errors as shares of the range where the truth is known, and residuals."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.simulation.calibration import squared_errors, within
from gbt_ocp.simulation.replay import BearingLog
from gbt_ocp.tracking.protocol import RANGE_OBSERVABLE, relative_range_std
from gbt_ocp.typing import Array


def scores(
    log: BearingLog,
    times: Array,
    mean: Array,
    covariance: Array,
    ahead_s: float,
    score_from: float,
    *,
    ahead: tuple[Array, Array] | None = None,
    residual: Array | None = None,
    seconds: Array | None = None,
) -> dict[str, Any]:
    """Numbers of one track, from ``score_from`` seconds after the first bearing.

    Parameters
    ----------
    log
        The log, with or without the truth.
    times, mean, covariance
        The track: ``(K,)``, ``(K, d)``, ``(K, d, d)``.
    ahead_s, ahead
        Time in seconds by which it forecasts, and mean and covariance of the forecast.
    score_from
        In seconds.
    residual
        ``(K, d-1)`` in radians.
    seconds
        Time of each update ``(K,)``.

    Returns
    -------
    ``error_median``, ``error_rms``, ``error_q95`` (of the distance from the truth over the true range), two of the
    range alone (``range_error_median``, ``range_error_rms``), ``nees_mean``, ``nees_median``, ``coverage`` (share of
    the truth inside the 95 % ellipse), the same with the prefix ``ahead_``; ``range_std_over_range_median``,
    ``observable_share``, ``residual_std_deg``, ``update_ms_mean``, ``update_ms_max``.
    ``None`` where there is no truth or covariance.
    """
    scored = times >= times[0] + score_from
    found: dict[str, Any] = {"scored": int(np.sum(scored))}
    line = mean - log.own
    distance = np.maximum(np.linalg.norm(line, axis=1), 1e-9)
    relative = relative_range_std(mean, covariance, log.own)
    found["range_std_over_range_median"] = _of(np.median, relative[scored])
    found["observable_share"] = _of(np.mean, (relative < RANGE_OBSERVABLE)[scored & np.isfinite(relative)])
    if log.truth is not None:
        true_range = np.linalg.norm(log.truth - log.own, axis=1)
        found |= _errors("", mean, covariance, log.truth, true_range, scored)
        share = np.abs(distance - true_range) / true_range
        found["range_error_median"] = _of(np.median, share[scored])
        found["range_error_rms"] = _of(_root_mean_square, share[scored])
        if ahead is not None:
            later = times + ahead_s
            there = np.stack([np.interp(later, times, values, right=np.nan) for values in log.truth.T], axis=-1)
            # from the own position of that time
            own = np.stack([np.interp(later, times, values) for values in log.own.T], axis=-1)
            found |= _errors("ahead_", *ahead, there, np.linalg.norm(there - own, axis=1), scored)
    if residual is not None:
        found["residual_std_deg"] = _of(np.std, np.rad2deg(residual)[scored].ravel())
    if seconds is not None:
        found["update_ms_mean"] = _of(np.mean, 1e3 * seconds)
        found["update_ms_max"] = _of(np.max, 1e3 * seconds)
    return found


def _errors(
    prefix: str, mean: Array, covariance: Array, truth: Array, true_range: Array, scored: NDArray[np.bool_]
) -> dict[str, Any]:
    offset = mean - truth
    share = np.linalg.norm(offset, axis=1) / true_range
    nees = squared_errors(offset, covariance)
    inside = within(nees, mean.shape[1])[scored & ~np.isnan(nees)]
    return {
        f"{prefix}error_median": _of(np.median, share[scored]),
        f"{prefix}error_rms": _of(_root_mean_square, share[scored]),
        f"{prefix}error_q95": _of(lambda values: np.quantile(values, 0.95), share[scored]),
        f"{prefix}nees_mean": _of(np.mean, nees[scored]),
        f"{prefix}nees_median": _of(np.median, nees[scored]),
        f"{prefix}coverage": _of(np.mean, inside),
    }


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _of(statistic: Any, values: NDArray[Any]) -> float | None:
    """Statistic of the finite values, ``None`` without any."""
    finite = values[np.isfinite(values)]
    return float(statistic(finite)) if finite.size else None
