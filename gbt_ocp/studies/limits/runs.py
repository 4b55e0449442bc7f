"""The same seeds in closed loop under each treatment."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.guidance.startup import planned_of
from gbt_ocp.simulation.loop import simulate
from gbt_ocp.simulation.summary import FALLBACKS, installed_versions, summarise
from gbt_ocp.simulation.track_summary import TRACK_SETTLING_S
from gbt_ocp.studies.limits.comparison_tables import Row
from gbt_ocp.studies.limits.formulations import limits_in
from gbt_ocp.studies.limits.problems import Check, unasked
from gbt_ocp.studies.limits.treatments import Pair, kept_planner, treated

SETTLING_S = 2.0
"""Time from which errors and condition numbers count as settled, where bearings are exact."""


def run_treated(configuration: Configuration, pair: Pair, check: Check = unasked) -> Row:
    """One run, in which the planner answers for its solver as in any run: it checks, tightens and falls back.

    ``check`` is called after each step.

    Returns
    -------
    Its row: errors and distance in m, the largest thrust over its limit that was executed, and what the planner had
    to do for it.
    """
    exact = configuration.bearing_noise_deg == 0.0
    settling = SETTLING_S if exact else min(TRACK_SETTLING_S, 0.5 * configuration.duration_s)
    loop, start = build_loop(treated(configuration, "hard"))
    planned = planned_of(loop.guidance)
    assert planned is not None, "checked before anything runs"
    planned.planner = kept_planner(configuration, pair)
    began = perf_counter()
    recording = simulate(loop, start, configuration.duration_s, lambda *_: check())
    history = recording.history
    summary = summarise(
        history,
        period=configuration.period_s,
        seed=configuration.seed,
        settling=settling,
        wall_s=perf_counter() - began,
        solver_first_try=history.answered_first,
        retries={"tightened": recording.tightened, "nugget": recording.nugget_retries, "clipped": recording.clipped},
        versions=installed_versions(),
        forecast_period=configuration.forecast_period,
        standoff=configuration.standoff,
        hotel_w=configuration.vehicle.hotel_w,
    )
    settled = history.condition_number[history.t >= settling - 1e-9]
    times = 1e3 * history.solver_time[history.planned]
    kept = (
        "error_mean", "error_settled", "error_final", "distance_median", "distance_min",
        "similarity_mean_second_half", "violation_max", "objective_mean", "solver_success_rate",
        "solver_iterations_mean", "solver_time_median_ms", "solver_time_max_ms", "steps", "wall_s",
    )  # fmt: skip
    fallbacks = {word: summary["fallbacks"].get(word, 0) for word in FALLBACKS}
    others = sum(summary["fallbacks"].values()) - sum(fallbacks.values())
    distant: Row = {}
    if limits_in(configuration):
        distant = {key: summary.get(key) for key in ("relative_error", "relative_error_10s", "steps_below_standoff")}
        distant["lost"] = int(summary.get("lost", False))
        distant["plans"] = int(np.sum(history.planned))
        distant["answered_first"] = int(np.sum(history.planned & history.answered_first))
        distant["given_up"] = int(np.sum(history.gave_way))
        distant["solver_time_99_ms"] = float(np.percentile(times, 99)) if times.size else None
    return {
        "case": configuration.name,
        "run": configuration.seed,
        "formulation": pair.formulation,
        "solver": pair.solver,
        **{key: summary[key] for key in kept},
        "condition_median": float(np.median(settled)) if settled.size else None,
        "tightened": recording.tightened,
        "clipped": recording.clipped,
        **{f"fallbacks_{word}": count for word, count in fallbacks.items()},
        "fallbacks_other": others,
        **distant,
    }
