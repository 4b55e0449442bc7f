"""Figure 9: the linear model of coregionalization on cases 2 and 6 (section 5.7)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from time import perf_counter

import numpy as np

from gbt_ocp.experiments.build.sensors import build_sensor
from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.experiments.sweep.carry_out import Sweep
from gbt_ocp.experiments.sweep.sweep_plan import Variant, variant
from gbt_ocp.experiments.sweep.table import Row
from gbt_ocp.studies.paper.measures import Interval, mean_interval, rank_correlation, same_sign, window_correlation
from gbt_ocp.studies.paper.workbench import Finding, Report, Workbench
from gbt_ocp.tracking.gp.lmc import CoregionalizedTracker
from gbt_ocp.typing import Array

CASES = ("case2", "case6")
SETTINGS = ("planner.formulation=hard",)
PLAIN, TUNED, LOCAL = "gp", "lmc", "lmc, 1 s"
MODELS: dict[str, Mapping[str, object]] = {
    PLAIN: {"tracker.kind": "gp"},
    TUNED: {"tracker.kind": "lmc"},
    LOCAL: {"tracker.kind": "lmc", "tracker.length_scale": 1.0},
}
ARRAYS = (
    "t",
    "mean_error",
    "error",
    "bound",
    "prior_cov",
    "target",
    "bearing",
    "detected",
    "vehicle_pose",
    "condition_number",
)
SETTLING = 2.0
CLEAR = (0.5, 0.8, 0.9)
"""Sizes of the true coordinates' sample correlation over the window; it counts as clear above the last."""
REPLAYED = 3
"""Runs a row whose trackers are fed once more, to time them side by side and for the bound as printed."""


@dataclass(frozen=True)
class Shown:
    """What the runs of one case with one model show; shares are ``(runs, pairs)`` for each of :data:`CLEAR`."""

    runs: int
    settled: Array
    kept: tuple[int, int]
    correlation: Interval
    clear: Array
    shares: Sequence[Array]


@dataclass(frozen=True)
class ReplayOutcome:
    """Time of a step over the plain process's on the same bearings, and how often theorem 2 as printed was kept."""

    ratio: float
    kept: tuple[int, int]


def conduct(workbench: Workbench) -> Report:
    """Run both cases with the plain process and with the coregionalised one, tuned and with a short length scale."""
    from gbt_ocp.reporting.tables import Spread, Table
    from gbt_ocp.studies.paper.cross_covariance import Panel, draw_cross_covariance

    variants = {
        (case, model): variant(case, keys, SETTINGS, {"case": case, "model": model})
        for case in CASES
        for model, keys in MODELS.items()
    }
    done = workbench.sweep("fig9", list(variants.values()), arrays=ARRAYS)
    table = Table(
        "Coregionalised and plain process",
        [
            "case",
            "model",
            "runs",
            "settled error (m)",
            "worst run (m)",
            "steps with the bound kept",
            "the printed one kept",
            "rank correlation with the condition number",
            "time of a step over the plain one's",
        ],
    )
    signs = Table(
        "Sign of R_ij right, share of the settled steps in which the coordinates' correlation is clear",
        ["case", "model", "pair", "clear steps a run", *(f"above {level:g}" for level in CLEAR), "worst run"],
    )
    shown: dict[tuple[str, str], Shown] = {}
    replays: dict[tuple[str, str], ReplayOutcome] = {}
    panels = []
    for case in CASES:
        panel = Panel(f"case {case[-1]}")
        for model in MODELS:
            rows = done.matching(case=case, model=model)
            if not rows:
                continue
            found = shown[case, model] = _shown(workbench, done, rows, variants[case, model].configuration)
            panel.t = done.arrays(rows, "t")[0]
            panel.errors[model] = done.arrays(rows, "mean_error")
            replay = None
            if model != PLAIN:
                replay = replays[case, model] = _replayed(done, rows[:REPLAYED], variants, case, model)
                for pair, name in _pairs(done.arrays(rows, "target").shape[2]).items():
                    worst = float(found.shares[-1][:, pair].min())
                    means = [float(np.mean(shares[:, pair])) for shares in found.shares]
                    signs.add(case[-1], model, name, float(np.mean(found.clear[:, pair])), *means, worst)
            if model == LOCAL:
                panel.bound = done.arrays(rows, "bound").mean(axis=2)
                panel.target = done.arrays(rows, "target")[0]
                panel.covariance = done.arrays(rows, "prior_cov")
                panel.correlation = window_correlation(panel.target, variants[case, model].configuration.tracker.window)
            table.add(
                case[-1],
                model,
                found.runs,
                Spread.of(found.settled, 5),
                float(np.max(found.settled)),
                "{} of {}".format(*found.kept),
                "{} of {}".format(*replay.kept) if replay else None,
                str(found.correlation),
                replay.ratio if replay else 1.0,
            )
        if panel.covariance is not None:
            panels.append(panel)
    text = [
        f"{len(workbench.seeds)} runs of 30 s a row, preset `default`, hard limits, d latent functions with squared "
        f"exponential kernels. *{PLAIN}* is the process with one kernel for all axes, *{TUNED}* the coregionalised "
        f"one with all its hyperparameters tuned, *{LOCAL}* the same with the length scales kept at 1 s. Settled is "
        f"from {SETTLING:g} s on. The bound is the one that holds for all kernels and weights (δ = 0.05), kept at a "
        "step if at every time of T_k; the printed one is theorem 2's. R is the off-diagonal part of k_f(t, t). The "
        "coordinates' correlation is the sample correlation of the target's true coordinates over the window (2 s in "
        f"the plane, 1.2 s in space); it is clear above {CLEAR[-1]:g} in size. Times of a step and the printed bound "
        f"are from {REPLAYED} runs a row, whose bearings both trackers were fed once more, step by step in turn."
    ]
    figures = {"fig9": draw_cross_covariance(panels)} if panels else {}
    tables = {"fig9": table, "fig9_signs": signs}
    return Report("Figure 9: coregionalization", text, _findings(shown, replays), tables, figures)


def _pairs(dimension: int) -> dict[int, str]:
    """Names of the pairs of axes, by their order."""
    return {number: f"{i}{j}" for number, (i, j) in enumerate(combinations("xyz"[:dimension], 2))}


def _off_diagonal(matrices: Array) -> Array:
    """Entries above the diagonal ``(..., pairs)``, in the order of :func:`_pairs`."""
    return np.asarray(matrices[..., *np.triu_indices(matrices.shape[-1], 1)])


def _shown(workbench: Workbench, done: Sweep, rows: Sequence[Row], configuration: Configuration) -> Shown:
    t = done.arrays(rows, "t")[0]
    settled = t >= SETTLING - 1e-6
    kept = np.all(done.arrays(rows, "error") <= done.arrays(rows, "bound"), axis=2)[:, settled]
    mean_error, condition = done.arrays(rows, "mean_error"), done.arrays(rows, "condition_number")
    truth = [window_correlation(path, configuration.tracker.window) for path in done.arrays(rows, "target")]
    correlation = _off_diagonal(np.array(truth))[:, settled]
    covariance = _off_diagonal(done.arrays(rows, "prior_cov"))[:, settled]
    return Shown(
        len(rows),
        workbench.column(rows, "error_settled"),
        (int(kept.sum()), kept.size),
        mean_interval([rank_correlation(e, c) for e, c in zip(mean_error, condition, strict=True)]),
        np.sum(np.abs(correlation) > CLEAR[-1], axis=1),
        [same_sign(covariance, correlation, level) for level in CLEAR],
    )


def _replayed(
    done: Sweep, rows: Sequence[Row], variants: Mapping[tuple[str, str], Variant], case: str, model: str
) -> ReplayOutcome:
    """Feed the bearings of runs to the model's tracker and to the plain one, in turn."""
    configuration, plain = (variants[case, name].configuration for name in (model, PLAIN))
    names = ("t", "bearing", "detected", "vehicle_pose", "error")
    times: list[tuple[float, float]] = []
    kept = count = 0
    for t, bearing, detected, pose, error in zip(*(done.arrays(rows, name) for name in names), strict=True):
        own = pose[:, : configuration.dimension]
        trackers = tuple(build_tracker(one.tracker, own[0], build_sensor(one)) for one in (configuration, plain))
        period, steps = configuration.period_s, np.arange(error.shape[1])
        for k in range(len(t)):
            elapsed = []
            for tracker in trackers:
                began = perf_counter()
                if detected[k]:
                    tracker.update(float(t[k]), bearing[k], own[k])  # type: ignore[union-attr]  # both take bearings
                tracker.predict(t[k] + period * steps)
                elapsed.append(perf_counter() - began)
            times.append((elapsed[0], elapsed[1]))
            first = trackers[0]
            if isinstance(first, CoregionalizedTracker) and t[k] >= SETTLING - 1e-6:
                bound = first.printed_bound(t[k] + period * steps, configuration.tracker.bound_delta)  # type: ignore[attr-defined]
                kept, count = kept + bool(np.all(error[k] <= bound)), count + 1
    ratio = np.median([one for one, _ in times]) / np.median([other for _, other in times])
    return ReplayOutcome(float(ratio), (kept, count))


def _findings(
    shown: Mapping[tuple[str, str], Shown], replays: Mapping[tuple[str, str], ReplayOutcome]
) -> list[Finding]:
    findings = []
    for (case, model), found in shown.items():
        if model == PLAIN:
            continue
        name, replay = f"Case {case[-1]}, {model}", replays[case, model]
        names = _pairs(3 if found.clear.shape[1] == 3 else 2)
        means = {pair: [float(np.mean(shares[:, i])) for shares in found.shares] for i, pair in names.items()}
        seen = "; ".join(
            f"R_{pair} {values[-1]:.3f} (above {', '.join(f'{level:g}' for level in CLEAR[:-1])}: "
            f"{', '.join(f'{value:.3f}' for value in values[:-1])})"
            for pair, values in means.items()
        )
        findings += [
            Finding(
                f"{name}: settled error below 0.1 m.",
                float(np.max(found.settled)) < 0.1,
                f"{np.mean(found.settled):.5f} m, worst run {np.max(found.settled):.5f} m "
                f"({np.mean(shown[case, PLAIN].settled):.5f} m with the plain process)."
                if (case, PLAIN) in shown
                else f"{np.mean(found.settled):.5f} m.",
            ),
            Finding(
                f"{name}: the error is within the bound at every settled step.",
                found.kept[0] == found.kept[1] and replay.kept[0] == replay.kept[1],
                f"{found.kept[0]} of {found.kept[1]}; theorem 2 as printed {replay.kept[0]} of {replay.kept[1]}.",
            ),
            Finding(
                f"{name}: error and condition number are positively correlated.",
                found.correlation.low > 0.0,
                f"rank correlation {found.correlation} over the whole run.",
            ),
            Finding(
                f"{name}: the sign of R is right in 90 % of the steps in which the coordinates' correlation is clear.",
                min(values[-1] for values in means.values()) >= 0.9,
                f"{seen}.",
            ),
        ]
    return findings
