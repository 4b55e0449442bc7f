"""Numbers of a run at a distance: errors relative to range, calibration of the posterior, and the standoff."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from gbt_ocp.simulation.calibration import squared_errors, within
from gbt_ocp.typing import Array

if TYPE_CHECKING:  # the summary of a history is made beside it
    from gbt_ocp.simulation.history import History

TRACK_SETTLING_S = 60.0
"""Time in seconds from which these numbers are taken: after the start-up of a run of minutes."""

AHEAD_S = 10.0
"""How far ahead the forecast is scored, and how long the end of a run lasts, in seconds."""

START_S = 30.0
"""How long the start of a run lasts, in seconds."""

LOST_SHARE = 0.5
"""A run has lost its target if the median error over its end exceeds this share of the range."""


def track_numbers(history: History, forecast_period: float, standoff: float | None) -> dict[str, Any]:
    """Numbers that a run at sea is judged by. Undefined ones are left out.

    Parameters
    ----------
    history
        The run.
    forecast_period
        Time between two predicted positions, s.
    standoff
        Least range to the target, m, if there is one.

    Returns
    -------
    From 60 s on, or over the second half of a run shorter than two minutes (``track_settling_s``):
    ``relative_error`` and ``relative_error_10s``, mean error of the position now and 10 s ahead over the true range
    now; ``nees_mean`` and ``nees_mean_10s``, mean ``eᵀΣ⁻¹e``, which is d if calibrated; ``coverage_95`` and
    ``coverage_95_10s``, the share of truth inside the 95 % ellipse. Over the end of the run ``lost``, whether the
    median relative error exceeds a half. Over the first 30 s ``error_start``, the mean error in m of the position now.
    Over all of it ``steps_below_standoff``: samples nearer than the standoff,
    from when it was first reached.
    """
    t, d = history.t, history.dimension
    range_ = np.linalg.norm(history.target - history.vehicle_pose[:, :d], axis=1)
    settling = min(TRACK_SETTLING_S, 0.5 * (t[-1] - t[0]))
    settled = (t >= settling - 1e-9) & (range_ > 0.0)
    started = t <= t[0] + START_S + 1e-9
    numbers: dict[str, Any] = {"track_settling_s": settling, "error_start": float(np.mean(history.error[started, 0]))}
    for suffix, ahead in (("", 0.0), ("_10s", AHEAD_S)):
        index = round(ahead / forecast_period)
        if index >= history.error.shape[1] or abs(index * forecast_period - ahead) > 1e-6:
            continue
        error = history.error[:, index]
        if settled.any():
            numbers[f"relative_error{suffix}"] = float(np.mean(error[settled] / range_[settled]))
        truth = history.target if not ahead else _ahead(history, ahead)
        rows = np.flatnonzero(settled & np.isfinite(truth).all(axis=1))
        nees = squared_errors(history.forecast_mean[rows, index] - truth[rows], history.forecast_cov[rows, index])
        if len(nees) and np.isfinite(nees).all():
            numbers[f"nees_mean{suffix}"] = float(np.mean(nees))
            numbers[f"coverage_95{suffix}"] = float(np.mean(within(nees, d)))
    end = (t >= t[-1] - AHEAD_S) & (range_ > 0.0)
    if end.any():
        numbers["lost"] = bool(np.median(history.error[end, 0] / range_[end]) > LOST_SHARE)
    if standoff is not None:
        kept = np.flatnonzero(range_ >= standoff)
        numbers["steps_below_standoff"] = int(np.sum(range_[kept[0] :] < standoff)) if len(kept) else len(t)
    return numbers


def _ahead(history: History, ahead: float) -> Array:
    """True positions ``ahead`` seconds after each sample ``(K, d)``; NaN beyond the end of the run."""
    truth = np.full(history.target.shape, np.nan)
    within = np.flatnonzero(history.t + ahead <= history.t[-1] + 1e-9)
    places = np.minimum(np.searchsorted(history.t, history.t[within] + ahead - 1e-6), len(history.t) - 1)
    truth[within] = history.target[places]
    return truth
