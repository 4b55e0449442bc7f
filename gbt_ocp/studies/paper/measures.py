"""What the studies read out of the arrays of a run: calibration, rank correlation, recovery, and their intervals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import binomtest, bootstrap, spearmanr

from gbt_ocp.simulation.calibration import squared_errors, within
from gbt_ocp.typing import Array

RESAMPLES = 2000
"""Of the bootstrap."""


class Interval(NamedTuple):
    """An estimate with its interval."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.2f} [{self.low:.2f}, {self.high:.2f}]"


def squared_forecast_errors(mean: ArrayLike, covariance: ArrayLike, target: ArrayLike) -> Array:
    """:func:`~gbt_ocp.simulation.calibration.squared_errors` of the forecasts of a run.

    Parameters
    ----------
    mean, covariance
        μ and Σ at T_k of the steps of a run, ``(K, n+1, d)`` in m and ``(K, n+1, d, d)`` in m².
    target
        P_T at the steps ``(K, d)`` in m: the truth at t_{k+i} is that of step k + i.

    Returns
    -------
    ``(K-n, n+1)``: the last n steps predict beyond the run.
    """
    mu = np.asarray(mean, dtype=float)
    windows = np.lib.stride_tricks.sliding_window_view(np.asarray(target, dtype=float), mu.shape[1], axis=0)
    truth = np.swapaxes(windows, 1, 2)
    return squared_errors(mu[: len(truth)] - truth, np.asarray(covariance)[: len(truth)])


def share_within(squared: ArrayLike, dimension: int, probability: float) -> Array:
    """Share of squared errors within the posterior's region of a probability, over all axes but the last."""
    inside = within(squared, dimension, probability)
    return np.asarray(np.mean(inside.reshape(-1, inside.shape[-1]), axis=0))


def proportion(good: int, count: int, level: float = 0.95) -> Interval:
    """A share with its Clopper-Pearson interval."""
    interval = binomtest(good, count).proportion_ci(level, method="exact")
    return Interval(good / count, float(interval.low), float(interval.high))


def rank_correlation(error: ArrayLike, condition: ArrayLike) -> float:
    """Spearman's ρ of the tracking error and the condition number over the steps ``(K,)`` of a run.

    Ranks do not change under the logarithm, and infinite condition numbers are the largest. NaN where either is
    constant.
    """
    e, c = np.asarray(error, dtype=float), np.asarray(condition, dtype=float)
    if len(np.unique(e)) < 2 or len(np.unique(c)) < 2:
        return float("nan")
    return float(spearmanr(e, np.minimum(c, np.finfo(float).max)).statistic)


def mean_interval(values: ArrayLike, level: float = 0.95) -> Interval:
    """Mean over runs with its bootstrap interval (percentile): runs are independent, steps of one run are not."""
    found = np.asarray(values, dtype=float)
    found = found[np.isfinite(found)]
    if len(found) < 2 or np.ptp(found) == 0.0:
        value = float(found.mean()) if len(found) else float("nan")
        return Interval(value, value, value)
    resampled = bootstrap((found,), np.mean, confidence_level=level, n_resamples=RESAMPLES, method="percentile", rng=0)
    return Interval(
        float(found.mean()), float(resampled.confidence_interval.low), float(resampled.confidence_interval.high)
    )


def window_correlation(positions: ArrayLike, window: int) -> Array:
    """Sample correlation of the coordinates over the latest ``window`` steps.

    Parameters
    ----------
    positions
        ``(K, d)`` in m.
    window
        Steps, at least 2.

    Returns
    -------
    ``(K, d, d)``; NaN before the window is full, and where a coordinate does not move.
    """
    path = np.asarray(positions, dtype=float)
    found = np.full((len(path), path.shape[1], path.shape[1]), np.nan)
    if len(path) < window:
        return found
    views = np.lib.stride_tricks.sliding_window_view(path, window, axis=0)
    centred = views - views.mean(axis=2, keepdims=True)
    covariance = centred @ np.swapaxes(centred, 1, 2)
    spread = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    scale = spread[:, :, None] * spread[:, None, :]
    found[window - 1 :] = np.divide(covariance, scale, out=np.full(scale.shape, np.nan), where=scale > 0.0)
    return found


def same_sign(values: ArrayLike, reference: ArrayLike, level: float) -> Array:
    """Share of the steps with ``|reference| > level`` in which a value has the reference's sign.

    Parameters
    ----------
    values, reference
        ``(runs, K, ...)``; a NaN reference does not count.

    Returns
    -------
    ``(runs, ...)``; NaN where no step counts.
    """
    v, r = np.asarray(values, dtype=float), np.asarray(reference, dtype=float)
    clear = np.abs(r) > level
    right, count = np.sum(clear & (v * r > 0.0), axis=1), np.sum(clear, axis=1)
    return np.asarray(np.divide(right, count, out=np.full(right.shape, np.nan), where=count > 0))


def after_events(t: ArrayLike, values: ArrayLike, events: Sequence[float], first: float, last: float) -> Array:
    """Values of the steps from ``first`` to before ``last`` seconds after any of the events.

    Parameters
    ----------
    t
        Times ``(K,)`` in s.
    values
        ``(..., K)``.
    """
    elapsed = np.asarray(t, dtype=float)[:, None] - np.asarray(events, dtype=float)
    used = np.any((elapsed >= first - 1e-6) & (elapsed < last - 1e-6), axis=1)
    return np.asarray(np.asarray(values, dtype=float)[..., used])
