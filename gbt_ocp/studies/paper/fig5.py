"""Figure 5: what the vehicle's motion is worth to the tracker (section 5.3)."""

from __future__ import annotations

import numpy as np

from gbt_ocp.experiments.sweep.sweep_plan import variant
from gbt_ocp.studies.paper.workbench import Finding, Report, Workbench

CASES = ("case2", "case5")
MOTIONS = {"static": "static", "constant_force": "constant force", "random": "random", "planner": "planner"}
COMPARED_PRESETS = ("paper", "default")
SETTINGS = ("planner.formulation=hard",)

Key = tuple[str, str, str]
"""Preset, case, mode."""


def conduct(workbench: Workbench) -> Report:
    """Run the four motion modes with the same tracker, in the paper's settings and in the default ones."""
    from gbt_ocp.reporting.bands import Curve, draw_bands
    from gbt_ocp.reporting.tables import Spread, Table

    keys = [(preset, case, mode) for preset in COMPARED_PRESETS for case in CASES for mode in MOTIONS]
    variants = [
        variant(
            case, {"preset": preset, "guidance.kind": mode}, SETTINGS, {"preset": preset, "case": case, "mode": mode}
        )
        for preset, case, mode in keys
    ]
    done = workbench.sweep("fig5", variants, arrays=("t", "mean_error"))
    table = Table(
        "Tracking error by motion mode, metres",
        ["preset", "case", "motion", "runs", "whole run", "settled", "settled, median", "worst step", "last 5 s"],
    )
    panels: dict[str, dict[str, Curve]] = {}
    settled: dict[Key, float] = {}
    late: dict[Key, float] = {}
    for key in keys:
        preset, case, mode = key
        rows = done.matching(preset=preset, case=case, mode=mode)
        if not rows:
            table.add(preset, case, MOTIONS[mode], 0, *[None] * 5)
            continue
        t, error = done.arrays(rows, "t")[0], done.arrays(rows, "mean_error")
        panels.setdefault(f"case {case[-1]}, preset {preset}", {})[MOTIONS[mode]] = Curve(t, error)
        settled[key] = float(np.median(workbench.column(rows, "error_settled")))
        late[key] = float(np.median(error[:, t >= t[-1] - 5.0]))
        table.add(
            preset,
            case,
            MOTIONS[mode],
            len(rows),
            Spread.of(workbench.column(rows, "error_mean")),
            Spread.of(workbench.column(rows, "error_settled")),
            settled[key],
            Spread.of(workbench.column(rows, "error_settled_max")),
            late[key],
        )
    findings = [
        finding for preset in COMPARED_PRESETS for case in CASES for finding in _findings(preset, case, settled, late)
    ]
    figure = draw_bands(panels, "tracking error [m]", columns=2)
    text = [
        f"{len(workbench.seeds)} runs a row, hard limits, no prior position. *Settled* is from 2 s on, *worst step* "
        "the largest error from there, *last 5 s* the median over steps and runs. The figure shows the median over the "
        "runs and the band from the 10 % to the 90 % quantile."
    ]
    return Report("Figure 5: motion modes", text, findings, {"fig5": table}, {"fig5": figure})


def _findings(preset: str, case: str, settled: dict[Key, float], late: dict[Key, float]) -> list[Finding]:
    if any((preset, case, mode) not in settled for mode in MOTIONS):
        return []
    of = {mode: settled[preset, case, mode] for mode in MOTIONS}
    end = {mode: late[preset, case, mode] for mode in MOTIONS}
    where = f"{case}, preset {preset}"
    return [
        Finding(
            f"{where}: static diverges (above 1 m, and at the end above the other modes).",
            of["static"] > 1.0 and end["static"] == max(end.values()),
            f"settled {of['static']:.3g} m, last 5 s {end['static']:.3g} m.",
        ),
        Finding(
            f"{where}: constant force and random stay in the decimetres (0.05 to 1 m, settled).",
            all(0.05 <= of[mode] <= 1.0 for mode in ("constant_force", "random")),
            f"{of['constant_force']:.3g} and {of['random']:.3g} m.",
        ),
        Finding(
            f"{where}: the planner reaches the centimetres (below 0.1 m, settled).",
            of["planner"] < 0.1,
            f"{of['planner']:.3g} m.",
        ),
    ]
