"""Tables 2 and 3: GBT beside the methods that the paper compares it with (section 5.4); figure 6 has the same runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gbt_ocp.experiments.sweep.carry_out import Sweep
from gbt_ocp.experiments.sweep.sweep_plan import Variant
from gbt_ocp.experiments.sweep.table import Row
from gbt_ocp.studies.paper import grid_search
from gbt_ocp.studies.paper.methods import (
    FULL_POSITIONS,
    GBT,
    PAPER,
    PLANE,
    POLYNOMIAL,
    POLYNOMIAL_SETTLED,
    SPACE,
    methods,
)
from gbt_ocp.studies.paper.workbench import Finding, Report, Workbench

if TYPE_CHECKING:
    from gbt_ocp.reporting.tables import Table

CURVING = ("case2", "case3", "case5", "case6")
"""Cases in which the target's velocity changes."""

ERROR_ARRAYS = ("t", "mean_error")

Errors = dict[tuple[str, str], tuple[np.ndarray, np.ndarray]]
"""Whole-run and settled errors of the runs, by method and case."""


def table2(workbench: Workbench) -> Report:
    """Run all methods on cases 1 to 3."""
    return conduct_table(workbench, "table2", "Table 2: methods in the plane", PLANE)


def table3(workbench: Workbench) -> Report:
    """Run all methods on cases 4 to 6."""
    return conduct_table(workbench, "table3", "Table 3: methods in space", SPACE)


def compared(
    workbench: Workbench, name: str, cases: Sequence[str]
) -> tuple[Sweep, grid_search.Chosen, list[grid_search.Score]]:
    """Run all methods on these cases with the parameters chosen for them.

    Returns
    -------
    sweep, chosen, scores
        The runs, the parameters, and the scores of the grid where it was searched.
    """
    competing = methods(2 if cases[0] == "case1" else 3)
    chosen, scores = grid_search.shipped(), list[grid_search.Score]()
    if workbench.tune:
        chosen, scores = grid_search.search(workbench, name, competing, cases)
    variants: list[Variant] = []
    for case in cases:
        for method in competing:
            made = grid_search.method_variant(method, case, chosen.get((method.name, case), {}))
            if all(made.configuration != planned.configuration for planned in variants):
                variants.append(made)
    return workbench.sweep(name, variants, arrays=ERROR_ARRAYS), chosen, scores


def rows_of(done: Sweep, case: str, method: str) -> list[Row]:
    """The runs of a method that succeeded; both polynomial rows are one if the search gave them the same parameters."""
    planned = {(entry.overrides["case"], entry.overrides["method"]) for entry in done.plan.variants}
    if method == POLYNOMIAL_SETTLED and (case, method) not in planned:
        method = POLYNOMIAL
    return done.matching(case=case, method=method)


def conduct_table(workbench: Workbench, name: str, title: str, cases: Sequence[str]) -> Report:
    """The table of these cases: whole run and settled, the paper's value, the rank."""
    from gbt_ocp.reporting.tables import Spread, Table

    done, chosen, scores = compared(workbench, name, cases)
    names = [method.name for method in methods(2 if cases[0] == "case1" else 3)]
    errors: Errors = {}
    lost = {}
    for case in cases:
        for method in names:
            rows = rows_of(done, case, method)
            whole, settled = (workbench.column(rows, key) for key in ("error_mean", "error_settled"))
            # An estimate that overflows has no mean; the run is lost as much as one that raises.
            good = np.isfinite(whole) & np.isfinite(settled)
            errors[method, case] = whole[good], settled[good]
            lost[method, case] = len(workbench.seeds) - int(good.sum())
    table = Table(
        f"{title}: tracking error in metres, mean and standard deviation",
        ["case", "method", "whole run", "paper", "rank", "settled", "settled rank", "lost", "parameters"],
    )
    for case in cases:
        ranks = [_ranks({m: _mean(errors[m, case][part]) for m in names}) for part in (0, 1)]
        for method in names:
            whole, settled = errors[method, case]
            paper = PAPER.get(method, {}).get(case)
            table.add(
                case,
                method,
                Spread.of(whole, 4),
                Spread(*paper) if paper else None,
                ranks[0][method],
                Spread.of(settled, 5),
                ranks[1][method],
                lost[method, case],
                ", ".join(f"{key.partition('.')[2]} {value}" for key, value in chosen.get((method, case), {}).items()),
            )
    findings = [finding for case in cases for finding in _findings(case, names, errors)]
    tables = {name: table}
    if scores:
        tables |= _score_tables(name, chosen, scores)
    text = [
        f"{len(workbench.seeds)} runs of 30 s a row, seeds {workbench.seeds[0]} to {workbench.seeds[-1]}, start drawn "
        f"from the box of the default configuration. Every method knows the target's first position to "
        f"{grid_search.PRIOR_STD:g} m. *Whole run* is `error_mean`, *settled* `error_settled` (from 2 s on), the "
        f"paper's value the one of its table. {FULL_POSITIONS} sees full positions; methods with FIM placement move "
        f"without dynamics. {POLYNOMIAL_SETTLED} is PR with the parameters that make the settled error small. *Lost* "
        "runs raised an error or overflowed, and count in no mean.",
        f"Parameters by grid search, {grid_search.searched_on(cases)}, each case by itself"
        + (
            ", in this study; every score is in the table of the grid."
            if scores
            else ", as shipped (`--tune` repeats the search)."
        ),
    ]
    files = {grid_search.TUNED_FILE: grid_search.as_yaml(chosen)} if scores else {}
    return Report(title, text, findings, tables, files=files)


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if values.size else math.inf


def _ranks(means: dict[str, float]) -> dict[str, int | None]:
    """Place of each method, 1 for the smallest; none where no run succeeded, nor for the second polynomial row."""
    order = sorted((value, name) for name, value in means.items() if name != POLYNOMIAL_SETTLED and value < math.inf)
    places = {name: place for place, (_, name) in enumerate(order, start=1)}
    return {name: places.get(name) for name in means}


def _findings(case: str, names: Sequence[str], errors: Errors) -> list[Finding]:
    """The paper's statements on one case, and those on the settled error."""
    whole = {name: _mean(errors[name, case][0]) for name in names}
    settled = {name: _mean(errors[name, case][1]) for name in names}
    ours, paper = whole[GBT], PAPER[GBT][case][0]
    found = [
        Finding(f"{case}: GBT at most the paper's own {paper:.3f} m (whole run).", ours <= paper, f"{ours:.4f} m.")
    ]
    if case in CURVING:
        rivals = {name: value for name, value in whole.items() if name not in (GBT, FULL_POSITIONS)}
        best = min(rivals, key=rivals.__getitem__)
        found += [
            Finding(
                f"{case}: GBT smallest of all bearing-only methods (whole run).",
                ours < rivals[best],
                f"{ours:.4f} m; the best other, {best}, {rivals[best]:.4f} m.",
            ),
            Finding(
                f"{case}: GBT beats {FULL_POSITIONS} (whole run).",
                ours < whole[FULL_POSITIONS],
                f"{ours:.4f} m against {whole[FULL_POSITIONS]:.4f} m.",
            ),
            Finding(
                f"{case}: GBT no larger than the best polynomial order (settled).",
                settled[GBT] <= settled[POLYNOMIAL_SETTLED],
                f"{settled[GBT]:.5f} m against {settled[POLYNOMIAL_SETTLED]:.5f} m.",
            ),
        ]
    else:
        found.append(
            Finding(f"{case}: GBT below 1 mm (settled).", settled[GBT] < 1e-3, f"{1e3 * settled[GBT]:.4f} mm.")
        )
    for name in names:
        if case in PAPER.get(name, {}) and name in ("PLKF", "IMM-PLKF", FULL_POSITIONS, "PR"):
            ratio = whole[name] / PAPER[name][case][0]
            found.append(
                Finding(
                    f"{case}: {name} within a factor 2 of the paper's cell.", 0.5 <= ratio <= 2.0, f"{ratio:.2g} times."
                )
            )
    return found


def _score_tables(name: str, chosen: grid_search.Chosen, scores: list[grid_search.Score]) -> dict[str, Table]:
    """Every point of the grid with its scores, and which was chosen."""
    from gbt_ocp.reporting.tables import Table

    keys = list(dict.fromkeys(key for score in scores for key in score[2]))
    table = Table(
        f"Grid search, {grid_search.searched_on([scores[0][1]])}: mean errors in metres",
        ["case", "method", *keys, "whole run", "settled", "lost", "chosen"],
    )
    for method, case, point, whole, settled, lost in scores:
        taken = "yes" if chosen[method, case] == point else ""
        table.add(case, method, *(point.get(key) for key in keys), whole, settled, lost, taken)
    return {f"{name}_grid": table}
