"""What the numbers of a run and of a replay are: unit and meaning of each, in one place for pages, tables and docs."""

from __future__ import annotations

RUN_NUMBERS = {
    "error_mean": ("m", "tracking error ‖μ - P_T‖, mean over the forecast and the run"),
    "error_settled": ("m", "the same from the settling time on"),
    "error_final": ("m", "at the last step"),
    "error_rms": ("m", "root mean square over the run"),
    "error_median": ("m", "median over the run"),
    "error_settled_max": ("m", "its largest value from the settling time on"),
    "settling_s": ("s", "settling time"),
    "distance_min": ("m", "nearest distance from the target"),
    "distance_median": ("m", "median distance"),
    "distance_max_after_10s": ("m", "farthest distance after 10 s"),
    "similarity_second_half": ("", "least cosine between desired and true bearing, second half of the run"),
    "similarity_mean_second_half": ("", "its mean"),
    "range_std_over_range_final": ("of the range", "the tracker's own deviation of the range, at the last step"),
    "range_observable_from_s": ("s", "time from which that stays below a quarter until the end"),
    "violation_max": ("of the limit", "largest thrust above its limit on the executed pieces"),
    "off_plan_median": ("m", "distance from the planned position at the end of a period, median"),
    "off_plan_max": ("m", "its largest value"),
    "current_error_final": ("m/s", "distance of the last estimate of the current from the true one"),
    "energy_j": ("J", "energy of the thrusters, and of what else the vehicle takes"),
    "power_mean_w": ("W", "its mean over time"),
    "thrust_reversals_per_min": ("1/min", "changes of sign of the thrust, all axes together"),
    "speed_ahead_min": ("m/s", "least speed ahead through the water"),
    "turn_radius_min_m": ("m", "tightest turn: speed ahead over yaw rate"),
    "objective_mean": ("", "mean objective of the plans"),
    "solver_success_rate": ("", "share of plans solved at the first try"),
    "solver_iterations_mean": ("", "mean iterations of a plan"),
    "solver_time_median_ms": ("ms", "median time of a plan"),
    "solver_time_max_ms": ("ms", "longest time of a plan"),
    "fallbacks": ("", "answers to failed solves, counted by kind"),
    "retries": ("", "events that needed no fallback, counted by kind"),
    "tracker_time_median_ms": ("ms", "median time of the tracker"),
    "step_time_median_ms": ("ms", "median time of tracker and solver together"),
    "steps_over_period": ("", "steps that took longer than a sampling period"),
    "steps": ("", "sampling periods"),
    "wall_s": ("s", "duration of the computation"),
    "seed": ("", "seed of every random draw"),
    "versions": ("", "of Python, the package, its numerics and the platform"),
    "track_settling_s": ("s", "time from which the track is judged: 60 s, or half of a shorter run"),
    "error_start": ("m", "error of the position now, mean over the first 30 s"),
    "relative_error": ("of the range", "error of the position now over the true range, mean from then on"),
    "relative_error_10s": ("of the range", "error of the position forecast 10 s ahead over the true range now"),
    "nees_mean": ("", "squared error over its covariance, mean; d if the covariance is right"),
    "nees_mean_10s": ("", "the same of the forecast 10 s ahead"),
    "coverage_95": ("", "share of the truth inside the 95 % ellipse; 0.95 if the covariance is right"),
    "coverage_95_10s": ("", "the same of the forecast 10 s ahead"),
    "lost": ("", "whether the median error of the last 10 s is above half of the range"),
    "steps_below_standoff": ("", "samples nearer than the standoff, from when it was first reached"),
    "solver": ("", "what solved the plans"),
    "warnings": ("", "doubts about the settings, and what happened on the way"),
    "thrust_max": ("N, N m", "limits of the thrust"),
    "thrust_min": ("N, N m", "its lower limits"),
    "inputs": ("", "what the inputs of a vehicle that is not flat are called, else null"),
    "vehicles": ("", "of several vehicles, numbers of each by its name; all other keys are the first one's"),
    "team": ("", "of several vehicles, numbers of all together"),
}
"""Keys of the ``summary.json`` of a run, in the order of the file: unit and meaning."""

TEAM_NUMBERS = {
    "error_start": ("m", "error of the position now over the first 30 s, mean over the vehicles"),
    "error_mean": ("m", "tracking error over the run, mean over the vehicles"),
    "separation_min": ("m", "least distance between two vehicles"),
    "separation_median": ("m", "median distance of the two that are nearest to each other"),
    "steps_below_separation": ("", "steps at which two were nearer than `limits.separation_m`"),
    "packets_sent": ("", "packets, counted once for each vehicle that might hear them"),
    "packets_lost": ("", "those that were not heard"),
    "packet_bytes": ("", "size of the largest packet in bytes"),
}
"""Keys below ``team``."""

FALLBACK_NUMBERS = {
    "shifted": ("", "the rest of the plan before"),
    "cold": ("", "a solve from coasting"),
    "unfinished": ("", "the solver's last iterate, which keeps the limits"),
    "braking": ("", "thrust that brings the vehicle to rest"),
}
"""Keys below ``fallbacks``."""

RETRY_NUMBERS = {
    "tightened": ("", "times that limits were tightened because the first piece broke one between the nodes"),
    "nugget": ("", "times that the tracker's nugget grew tenfold"),
    "refused_bearings": ("", "bearings that the tracker refused: not finite, not of length 1, or out of order"),
    "held_forecasts": ("", "steps in which the forecast was not finite and the one before was used"),
    "clipped": ("", "steps in which a plan asked for more thrust than there is"),
    "new_tracks": ("", "times that the tracker began a new track after a long gap"),
}
"""Keys below ``retries``."""

REPLAY_NUMBERS = {
    "log": ("", "file of the log"),
    "bearings": ("", "measurements with a direction"),
    "measurements": ("", "measurements, counted by kind"),
    "rows_without_bearing": ("", "rows with an own position alone"),
    "duration_s": ("s", "from the first measurement to the last"),
    "warnings": ("", "doubts about the log and the settings"),
    "versions": ("", "of Python, the package, its numerics and the platform"),
    "trackers": ("", "scores of each tracker, and of constant ranges, by name"),
}
"""Keys of the ``summary.json`` of a replay."""

SCORE_NUMBERS = {
    "new_tracks": ("", "times that the tracker began a new track after a long gap"),
    "sensors": ("", "residuals by sensor and kind: count, mean, std and rms, in the unit that stands beside them"),
    "scored": ("", "measurements after `replay.score_from_s`"),
    "range_std_over_range_median": ("of the range", "the tracker's own deviation of the range, median"),
    "observable_share": ("", "share of the time in which that is below a quarter"),
    "error_median": ("of the range", "distance between track and truth over the true range, median"),
    "error_rms": ("of the range", "its root mean square"),
    "error_q95": ("of the range", "what 95 % of these stay below"),
    "nees_mean": ("", "squared error over its covariance, mean; d if the covariance is right"),
    "nees_median": ("", "its median; about 1.4 in the plane and 2.4 in space if it is right"),
    "coverage": ("", "share of the truth inside the 95 % ellipse"),
    "range_error_median": ("of the range", "error of the range alone, median"),
    "range_error_rms": ("of the range", "its root mean square"),
    "ahead_error_median": ("of the range", "error of the forecast over the range then, median"),
    "ahead_error_rms": ("of the range", "its root mean square"),
    "ahead_error_q95": ("of the range", "what 95 % of these stay below"),
    "ahead_nees_mean": ("", "squared error of the forecast over its covariance, mean"),
    "ahead_nees_median": ("", "its median"),
    "ahead_coverage": ("", "share of the truth inside the 95 % ellipse of the forecast"),
    "residual_std_deg": ("deg", "deviation of bearings from those predicted before they were known"),
    "update_ms_mean": ("ms", "mean time of an update"),
    "update_ms_max": ("ms", "longest time of an update"),
}
"""Keys of a tracker below ``trackers``; errors and calibration need a truth in the log."""

SCORE_COLUMNS = {
    "median %": "median of the distance between track and truth, in per cent of the true range",
    "RMS %": "its root mean square",
    "95 % %": "what 95 % of these distances stay below",
    "NEES": "median of the squared error over its covariance; about 1.4 in the plane and 2.4 in space if it is right",
    "cov": "share of the truth inside the 95 % ellipse; 0.95 if the covariance is right",
    "range median %": "median error of the range alone, in per cent of the true range",
    "ahead median %": "median error of the forecast, in per cent of the range then",
    "ahead cov": "share of the truth inside the 95 % ellipse of the forecast",
    "range std / range %": "half of the time the tracker's own deviation of the range, over the range, is below this",
    "observable %": "share of the time in which that is below 25 %, so that the range counts as known",
    "residual std deg": "deviation of bearings from those that were predicted before they were known, in degrees",
    "ms a bearing": "time that an update takes",
}
"""Columns of the table of scores in ``scores.md``, and what they are."""

SENSOR_COLUMNS = {
    "sensor": "its name in the log, and the kind of its measurements",
    "count": "measurements that are scored",
    "mean": "of the measurements less what the track predicted before they were known: a bias of the sensor",
    "std": "their deviation: the noise of the sensor and what was not foreseen of the target",
}
"""Columns of the table of residuals by sensor in ``scores.md``, and what they are."""
