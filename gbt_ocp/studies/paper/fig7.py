"""Figure 7: lengths of the window N_c and of the forecast n, on cases 1 and 5 (section 5.5)."""

from __future__ import annotations

import numpy as np

from gbt_ocp.experiments.sweep.sweep_plan import variant
from gbt_ocp.studies.paper.workbench import Finding, Report, Workbench
from gbt_ocp.typing import Array

CASES = ("case1", "case5")
WINDOW_LENGTHS = (4, 6, 8, 10, 12, 15, 20, 30)
FORECASTS = (6, 12)
SETTINGS = ("planner.formulation=hard",)
SETTLING = 2.0
NEAR_LEAST = 1.5
"""A window is long enough where the error is at most this times the least of all windows."""


def conduct(workbench: Workbench) -> Report:
    """Run every window with every forecast."""
    from gbt_ocp.reporting.tables import Spread, Table
    from gbt_ocp.studies.paper.lengths import draw_lengths

    variants = [
        variant(
            case,
            {"tracker.window": window, "tracker.forecast": ahead},
            SETTINGS,
            {"case": case, "N_c": window, "n": ahead},
        )
        for case in CASES
        for ahead in FORECASTS
        for window in WINDOW_LENGTHS
    ]
    done = workbench.sweep("fig7", variants, arrays=("t", "covariance_norm"))
    table = Table(
        "Settled error and variance norm by lengths of window and forecast",
        ["case", "n", "N_c", "runs", "error (m)", "error, median (m)", "variance norm, median (m^2)"],
    )
    errors: dict[tuple[str, int], dict[int, Array]] = {}
    norms: dict[tuple[str, int], dict[int, Array]] = {}
    for case in CASES:
        for ahead in FORECASTS:
            for window in WINDOW_LENGTHS:
                rows = done.matching(case=case, N_c=window, n=ahead)
                if not rows:
                    continue
                error = workbench.column(rows, "error_settled")
                t = done.arrays(rows, "t")[0]
                norm = done.arrays(rows, "covariance_norm")[:, t >= SETTLING - 1e-6].mean(axis=1)
                errors.setdefault((case, ahead), {})[window] = error
                norms.setdefault((case, ahead), {})[window] = norm
                table.rows.append(
                    (case[-1], ahead, window, len(rows), Spread.of(error, 5), _median(error), _median(norm))
                )
    text = [
        f"{len(workbench.seeds)} runs of 30 s a row, preset `default`, hard limits; means from {SETTLING:g} s on. The "
        "figure shows the median over the runs and the band from the 10 % to the 90 % quantile."
    ]
    findings = _findings(errors, norms)
    figures = {"fig7": draw_lengths(errors, norms)} if errors else {}
    return Report("Figure 7: lengths of window and forecast", text, findings, {"fig7": table}, figures)


def _median(values: Array) -> float:
    return float(np.median(values))


def _enough(errors: dict[int, Array]) -> int:
    """Shortest window from which on the median error is within a factor of the least."""
    medians = {window: _median(values) for window, values in errors.items()}
    least = min(medians.values())
    short = [window for window, value in medians.items() if value > NEAR_LEAST * least]
    return min((window for window in medians if window > max(short, default=0)), default=max(medians))


def _findings(
    errors: dict[tuple[str, int], dict[int, Array]], norms: dict[tuple[str, int], dict[int, Array]]
) -> list[Finding]:
    findings = []
    names = {case: f"Case {case[-1]}" for case in CASES}
    for (case, ahead), by_window in errors.items():
        by_norm = norms[case, ahead]
        first, last = min(by_window), max(by_window)
        falls = [_median(found[last]) < _median(found[first]) for found in (by_window, by_norm)]
        findings.append(
            Finding(
                f"{names[case]}, n = {ahead}: error and variance norm increase as N_c decreases.",
                all(falls),
                f"from N_c = {last} to {first} the error goes from {_median(by_window[last]):.2g} to "
                f"{_median(by_window[first]):.2g} m and the variance norm from {_median(by_norm[last]):.2g} to "
                f"{_median(by_norm[first]):.2g} m^2; within {NEAR_LEAST} times the least error from N_c = "
                f"{_enough(by_window)} on.",
            )
        )
    for case in CASES:
        low, high = (errors.get((case, ahead)) for ahead in FORECASTS)
        if low is None or high is None:
            continue
        shared = [window for window in low if window in high]
        rises = [window for window in shared if _median(high[window]) > _median(low[window])]
        findings.append(
            Finding(
                f"{names[case]}: the error increases with n.",
                len(rises) == len(shared),
                f"at {len(rises)} of {len(shared)} windows; at N_c = {shared[-1]} it goes from "
                f"{_median(low[shared[-1]]):.2g} to {_median(high[shared[-1]]):.2g} m.",
            )
        )
    return findings
