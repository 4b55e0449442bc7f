"""The numbers of a run, and the versions they were made with."""

from __future__ import annotations

import importlib.metadata
import platform
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.simulation import run_folder
from gbt_ocp.simulation.effort import effort_numbers
from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.steering_numbers import steering_numbers
from gbt_ocp.simulation.track_summary import track_numbers

FALLBACKS = ("shifted", "cold", "unfinished", "braking")
"""The answers to a failed solve, in the order in which they are tried; a summary always counts all of them."""


def summarise(
    history: History,
    *,
    period: float,
    seed: int,
    settling: float = 2.0,
    wall_s: float,
    solver_first_try: NDArray[np.bool_],
    retries: Mapping[str, int],
    versions: Mapping[str, str],
    forecast_period: float | None = None,
    standoff: float | None = None,
    hotel_w: float = 0.0,
) -> dict[str, Any]:
    """Numbers of a run for ``summary.json``: those of the paper's tables 2 and 3, and what explains them.

    Parameters
    ----------
    history
        The run.
    period
        Sampling period T, s.
    seed
        Of the run.
    settling
        Time from which errors count as settled, s.
    wall_s
        Time the run took, s.
    solver_first_try
        Whether the first solve of each step succeeded, ``(K,)``; read only where a solver was asked.
    retries
        Counts of events that needed no fallback, for example nugget retries of the tracker.
    versions
        See `installed_versions`.
    forecast_period
        Time between two predicted positions, s; by default T.
    standoff
        Least range to the target, m, if there is one.
    hotel_w
        Power in W that the vehicle takes besides its thrusters.

    Returns
    -------
    A mapping of strict JSON values. ``None`` stands for what does not exist (no solver, a run that ends before the
    settling time) and for what is not finite. Errors are the mean over T_k per step: ``error_mean``, ``error_median``,
    ``error_rms`` are over all steps, ``error_settled`` and ``error_settled_max`` over t_k >= settling, ``error_final``
    is the last step's. Distances are ‖P_A - P_T‖ at t_k. ``off_plan_median`` and ``off_plan_max`` are over the periods
    in which a plan was followed, at their ends, in m. ``current_error_final`` is the distance of the last estimate of
    the current from the true one in m/s. ``energy_j`` is that of the thrusters and of ``hotel_w``, ``power_mean_w`` its
    mean over time, and ``thrust_reversals_per_min`` counts how often the thrust of an axis changes its sign, thrusts
    below a hundredth of its largest left out. ``speed_ahead_min`` and ``turn_radius_min_m`` are those of
    :func:`~gbt_ocp.simulation.steering_numbers.steering_numbers`. ``steps`` counts the sampling periods, K - 1.
    Similarities are of desired and true bearing, over the second half of the run. ``range_observable_from_s`` is the
    time from which on the range is known to a quarter until the end. ``steps_over_period`` counts the steps in which
    tracker and solver together took longer than T. To these come the numbers of
    :func:`gbt_ocp.simulation.track_summary.track_numbers`, as far as they are defined.

    Raises
    ------
    ValueError
        If ``solver_first_try`` is not of shape (K,).
    """
    first_try = np.asarray(solver_first_try, dtype=bool)
    if first_try.shape != history.t.shape:
        raise ValueError(f"solver_first_try has shape {first_try.shape}; allowed: {history.t.shape}")
    t, error, planned = history.t, history.mean_error, history.planned
    slack = 1e-6 * period  # t_k = k T is rounded
    settled = t >= settling - slack
    second_half = t >= 0.5 * (t[0] + t[-1]) - slack

    line = history.target - history.vehicle_pose[:, : history.dimension]
    distance = np.linalg.norm(line, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):  # NaN where the vehicle sits on the target
        similarity = np.sum(history.desired_bearing * line, axis=1) / distance

    executed = history.piece_thrust_peak
    if len(executed) > 1 and np.isnan(executed[-1]).all():  # no piece is executed from the last sample
        executed = executed[:-1]
    followed = history.off_plan[np.isfinite(history.off_plan)]
    step_time = history.tracker_time + np.where(planned, history.solver_time, 0.0)
    answers = Counter(str(word) for word in history.fallback if word)

    summary = {
        "error_mean": error.mean(),
        "error_settled": _of(np.mean, error[settled]),
        "error_final": error[-1],
        "error_rms": np.sqrt(np.mean(error**2)),
        "error_median": np.median(error),
        "error_settled_max": _of(np.max, error[settled]),
        "settling_s": settling,
        "distance_min": distance.min(),
        "distance_median": np.median(distance),
        "distance_max_after_10s": _of(np.max, distance[t >= 10.0 - slack]),
        "similarity_second_half": _of(np.min, similarity[second_half]),
        "similarity_mean_second_half": _of(np.mean, similarity[second_half]),
        "range_std_over_range_final": history.range_std_over_range[-1],
        "range_observable_from_s": _of(np.min, t[_for_good(history.range_observable)]),
        "violation_max": np.maximum(0.0, executed.max() - 1.0) if executed.size else None,
        "off_plan_median": _of(np.median, followed),
        "off_plan_max": _of(np.max, followed),
        "current_error_final": _current_error(history),
        **effort_numbers(history, period, hotel_w),
        **steering_numbers(history),
        "objective_mean": _of(np.mean, history.objective[planned]),
        "solver_success_rate": _of(np.mean, first_try[planned]),
        "solver_iterations_mean": _of(np.mean, history.solver_iterations[planned]),
        "solver_time_median_ms": _of(np.median, 1e3 * history.solver_time[planned]),
        "solver_time_max_ms": _of(np.max, 1e3 * history.solver_time[planned]),
        "fallbacks": {word: answers[word] for word in dict.fromkeys([*FALLBACKS, *sorted(answers)])},
        "retries": dict(retries),
        "tracker_time_median_ms": np.median(1e3 * history.tracker_time),
        "step_time_median_ms": np.median(1e3 * step_time),
        "steps_over_period": np.count_nonzero(step_time > period),
        "steps": t.size - 1,
        "wall_s": wall_s,
        "seed": seed,
        "versions": dict(versions),
    }
    summary |= track_numbers(history, forecast_period or period, standoff)
    strict: dict[str, Any] = run_folder.strict(summary)
    return strict


def installed_versions() -> dict[str, str]:
    """Versions that decide whether a run repeats bit by bit: Python, this package, its numerics, the platform."""
    versions = {"python": platform.python_version()}
    for package in ("gbt_ocp", "casadi", "numpy", "scipy"):
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:  # a checkout that is not installed
            versions[package] = "not installed"
    versions["platform"] = platform.platform()
    return versions


def _current_error(history: History) -> Any:
    """Distance in m/s of the last estimate of the current from the true one; None where none is estimated."""
    water = np.nan_to_num(history.current[-1], nan=0.0)  # NaN where it stands still
    wrong = float(np.linalg.norm(history.current_estimate[-1] - water))
    return wrong if np.isfinite(wrong) else None


def _for_good(holds: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The steps from which on something holds until the end, ``(K,)``."""
    return np.asarray(np.logical_and.accumulate(holds[::-1])[::-1])


def _of(statistic: Any, values: NDArray[Any]) -> Any:
    """Statistic of the values, None without values."""
    return statistic(values) if values.size else None
