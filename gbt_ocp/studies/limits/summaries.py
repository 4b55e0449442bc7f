"""From the rows of single solves and runs to the tables of the report."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gbt_ocp.ocp.limit_classes import LimitClass
from gbt_ocp.simulation.summary import FALLBACKS
from gbt_ocp.studies.limits.comparison_tables import Row, column, grouped
from gbt_ocp.studies.limits.solves import KEPT
from gbt_ocp.studies.limits.statistics import interval
from gbt_ocp.studies.limits.tasks import Task
from gbt_ocp.studies.limits.treatments import Pair

EQUAL = 1.0e-3
"""Difference of the objective up to which two solutions count as equally good; the objective is of the order of p."""

KEYS = ("case", "origin", "mode")
"""What makes a set of problems: warm and cold starts, recorded and random problems are not mixed."""


def with_gaps(solves: list[Row], bests: list[Row]) -> list[Row]:
    """The solves with the best known objective of their problem and their gap to it.

    The best known solution is the best of all flat trajectories found that keep the true limits on the fine grid: by
    the multi-start, and by any pair. Multiple shooting, whose trajectories are of another kind, is held against it but
    is not part of it; its gap can be negative.
    """
    best = {(row["case"], row["problem"]): _number(row["best"]) for row in bests}
    for row in solves:
        if row["formulation"] != "shooting" and row["solved"] and _number(row["violation_between"]) <= KEPT:
            key = row["case"], row["problem"]
            best[key] = np.fmax(best.get(key, np.nan), _number(row["objective"]))
    for row in solves:
        top = best.get((row["case"], row["problem"]), np.nan)
        row["best_known"] = float(top)
        row["gap"] = float(top - _number(row["objective"])) if row["solved"] else np.nan
        row["kept"] = int(bool(row["solved"]) and _number(row["violation_between"]) <= KEPT)
    return solves


def open_loop(solves: list[Row]) -> list[Row]:
    """Table ``open_loop``: each pair on each set of problems."""
    table = []
    for key, rows in grouped(solves, *KEYS, "formulation", "solver").items():
        runs = [row["run"] for row in rows]
        done = [row for row in rows if row["solved"]]
        share, low, high = interval(column(rows, "solved"), runs, "mean")
        gap, gap_low, gap_high = interval(column(done, "gap"), [row["run"] for row in done], "mean")
        times, iterations = np.array(column(rows, "time_ms")), np.array(column(rows, "iterations"))
        between, nodes = column(done, "violation_between"), column(done, "violation_nodes")
        table.append(
            {
                **dict(zip((*KEYS, "formulation", "solver"), key, strict=True)),
                "problems": len(rows),
                "solved": len(done),
                "solved_share": share,
                "solved_low": low,
                "solved_high": high,
                "kept": sum(row["kept"] for row in rows),
                "time_median_ms": float(np.median(times)),
                "time_99_ms": float(np.percentile(times, 99)),
                "iterations_median": float(np.median(iterations)),
                "iterations_99": float(np.percentile(iterations, 99)),
                "gap_mean": gap,
                "gap_mean_low": gap_low,
                "gap_mean_high": gap_high,
                "gap_median": _of(np.nanmedian, column(done, "gap")),
                "gap_99": _of(lambda values: np.nanpercentile(values, 99), column(done, "gap")),
                "violation_nodes_max": max(nodes, default=np.nan),
                "violation_between_max": max(between, default=np.nan),
                "broken_between": sum(value > KEPT for value in between),
            }
        )
    return table


CLASSES = tuple(one.name.lower() for one in LimitClass)
"""Words for the classes of limits, the last to give first."""


def classes(solves: list[Row]) -> list[Row]:
    """Table ``classes``: which limits the solutions keep between their nodes, where there are others than on thrust.

    ``broken`` counts solutions that break a limit of the class; ``worst`` and ``mean`` are the violations of these, in
    units of the limit.
    """
    table = []
    several = [row for row in solves if row.get("violation_thrust") is not None]
    for key, rows in grouped(several, *KEYS, "formulation", "solver").items():
        done = [row for row in rows if row["solved"]]
        line = {**dict(zip((*KEYS, "formulation", "solver"), key, strict=True)), "problems": len(rows)}
        line |= {"solved": len(done), "kept": sum(row["kept"] for row in rows)}
        for name in CLASSES:
            broken = [value for value in column(done, f"violation_{name}") if value > KEPT]
            line[f"{name}_broken"] = len(broken)
            line[f"{name}_mean"], line[f"{name}_worst"] = _of(np.mean, broken), _of(np.max, broken)
        table.append(line)
    return table


def contrasts(pairs: Sequence[Pair]) -> list[tuple[Pair, Pair]]:
    """Who is compared with whom: everybody with the first pair; hard, exchange and soft limits with the penalty that
    the same solver solves best (elastic); and trajectories by integration with flat ones under the same limits.
    """
    found = [(pair, pairs[0]) for pair in pairs[1:]]
    for pair in pairs:
        other = Pair("elastic", pair.solver)
        if pair.formulation in ("hard", "exchange", "soft") and other in pairs and (pair, other) not in found:
            found.append((pair, other))
        if pair.formulation == "shooting":
            flat = [one for one in pairs if one.solver == pair.solver and one.formulation in ("soft", "hard")]
            found += [(pair, one) for one in flat[-1:] if (pair, one) not in found]
    return found


def paired(solves: list[Row], pairs: Sequence[Pair]) -> list[Row]:
    """Table ``paired``: differences on the same problem; ratios and objectives where both solved it."""
    table = []
    for key, rows in grouped(solves, *KEYS).items():
        by_pair = _by_pair(rows, "problem")
        for pair, other in contrasts(pairs):
            mine = by_pair.get((pair.formulation, pair.solver), {})
            theirs = by_pair.get((other.formulation, other.solver), {})
            same = [(mine[k], theirs[k]) for k in mine if k in theirs]
            if same:
                head = {**dict(zip(KEYS, key, strict=True)), "pair": pair.name, "against": other.name}
                table.append({**head, **_differences(same)})
    return table


def _differences(same: list[tuple[Row, Row]]) -> Row:
    runs = [a["run"] for a, _ in same]
    both = [(a, b) for a, b in same if a["solved"] and b["solved"]]
    both_runs = [a["run"] for a, _ in both]
    faster = [math.log(b["time_ms"] / a["time_ms"]) for a, b in same]
    better = [a["objective"] - b["objective"] for a, b in both]
    found: Row = {"problems": len(same), "both_solved": len(both)}
    for name, values, labels, statistic in (
        ("times_faster", faster, runs, "median"),
        ("iterations_fewer", [b["iterations"] - a["iterations"] for a, b in same], runs, "median"),
        ("solved_more", [float(a["solved"] - b["solved"]) for a, b in same], runs, "mean"),
        ("objective_more", better, both_runs, "mean"),
        ("violation_more", [a["violation_between"] - b["violation_between"] for a, b in both], both_runs, "mean"),
    ):
        numbers = interval(values, labels, statistic)
        if name == "times_faster":
            numbers = tuple(math.exp(value) for value in numbers)  # type: ignore[assignment]
        found |= dict(zip((name, f"{name}_low", f"{name}_high"), numbers, strict=True))
    return found | {
        "better": sum(value > EQUAL for value in better),
        "equal": sum(abs(value) <= EQUAL for value in better),
        "worse": sum(value < -EQUAL for value in better),
    }


_LOOP_NUMBERS = (
    "error_settled", "error_mean", "distance_median", "condition_median", "similarity_mean_second_half",
    "solver_success_rate", "solver_iterations_mean", "solver_time_median_ms",
)  # fmt: skip
_LOOP_SUMS = ("tightened", *(f"fallbacks_{word}" for word in FALLBACKS), "fallbacks_other")


def closed_loop(loops: list[Row]) -> list[Row]:
    """Table ``closed_loop``: each pair over its seeds; means but for maxima and counts.

    Seeds whose error is not a number are counted as ``astray``; means are over the others.
    """
    table = []
    for key, rows in grouped(loops, "case", "formulation", "solver").items():
        error, low, high = interval(column(rows, "error_settled"), [row["run"] for row in rows], "mean")
        table.append(
            {
                **dict(zip(("case", "formulation", "solver"), key, strict=True)),
                "runs": len(rows),
                "astray": sum(not math.isfinite(value) for value in column(rows, "error_settled")),
                **{name: _of(np.nanmean, column(rows, name)) for name in _LOOP_NUMBERS},
                "error_settled": error,
                "error_settled_low": low,
                "error_settled_high": high,
                "error_settled_worst": _worst(column(rows, "error_settled")),
                "violation_max": _worst(column(rows, "violation_max")),
                "steps": sum(row["steps"] + 1 for row in rows),
                **{name: sum(row.get(name) or 0 for row in rows) for name in _LOOP_SUMS},
            }
        )
    return table


_DISTANT_SUMS = ("steps_below_standoff", "lost", "plans", "answered_first", "given_up")


def at_a_distance(loops: list[Row]) -> list[Row]:
    """Table ``at_a_distance``: closed loops with limits besides thrust, each pair over its seeds.

    Errors are relative to the range. A plan is answered first if the first solve of its step gave it, be it that a
    limit had to give.
    """
    table = []
    several = [row for row in loops if row.get("plans") is not None]
    for key, rows in grouped(several, "case", "formulation", "solver").items():
        error, low, high = interval(column(rows, "relative_error"), [row["run"] for row in rows], "mean")
        sums = {name: sum(row[name] or 0 for row in rows) for name in _DISTANT_SUMS}
        table.append(
            {
                **dict(zip(("case", "formulation", "solver"), key, strict=True)),
                "runs": len(rows),
                "relative_error": error,
                "relative_error_low": low,
                "relative_error_high": high,
                "relative_error_10s": _of(np.mean, column(rows, "relative_error_10s")),
                "distance_min": _of(np.min, column(rows, "distance_min")),
                **sums,
                "answered_share": sums["answered_first"] / sums["plans"] if sums["plans"] else np.nan,
                **{f"fallbacks_{word}": sum(row[f"fallbacks_{word}"] for row in rows) for word in FALLBACKS},
                "solver_time_median_ms": _of(np.mean, column(rows, "solver_time_median_ms")),
                "solver_time_99_ms": _of(np.mean, column(rows, "solver_time_99_ms")),
                "solver_time_max_ms": _of(np.max, column(rows, "solver_time_max_ms")),
            }
        )
    return table


def closed_loop_paired(loops: list[Row], pairs: Sequence[Pair]) -> list[Row]:
    """Table ``closed_loop_paired``: differences of the error on the same seeds, against the fast penalty."""
    reference = next(
        (pair for name in ("compiled", "ipopt") for pair in pairs if pair == Pair("elastic", name)), pairs[0]
    )
    table = []
    for (case,), rows in grouped(loops, "case").items():
        by_pair = _by_pair(rows, "run")
        base = by_pair.get((reference.formulation, reference.solver), {})
        for pair in pairs:
            mine = by_pair.get((pair.formulation, pair.solver), {})
            seeds = sorted(set(mine) & set(base))
            if pair != reference and seeds:
                more = [_number(mine[k]["error_settled"]) - _number(base[k]["error_settled"]) for k in seeds]
                mean, low, high = interval(more, seeds, "mean")
                head = {"case": case, "pair": pair.name, "against": reference.name, "runs": len(seeds)}
                table.append({**head, "error_more": mean, "error_more_low": low, "error_more_high": high})
    return table


def sensitivity(sweeps: list[Row]) -> list[Row]:
    """Table ``sensitivity``: each setting over its sample, cold and warm."""
    return _settings(sweeps, ("case", "swept", "formulation", "solver", "value", "mode"))


def settings(sweeps: list[Row]) -> list[Row]:
    """Table ``settings``: the same over all configurations, cold and warm starts together."""
    return _settings(sweeps, ("swept", "formulation", "solver", "value"))


def _settings(sweeps: list[Row], keys: tuple[str, ...]) -> list[Row]:
    table = []
    for key, rows in grouped(sweeps, *keys).items():
        done = [row for row in rows if row["solved"]]
        between = column(done, "violation_between")
        table.append(
            {
                **dict(zip(keys, map(str, key), strict=True)),
                "kink_mm": _of(np.min, column(rows, "kink_mm")),
                "stiffness": _of(np.max, column(rows, "stiffness")),
                "problems": len(rows),
                "solved": len(done),
                "iterations_mean": _of(np.mean, column(rows, "iterations")),
                "time_median_ms": _of(np.median, column(rows, "time_ms")),
                "objective_mean": _of(np.mean, column(done, "objective")),
                "violation_between_max": max(between, default=np.nan),
                "broken_between": sum(value > KEPT for value in between),
            }
        )
    return table


_WORK = {
    "record": "problems recorded",
    "loop": "closed loops",
    "sweep": "sweeps",
    "solve": "open loop",
    "best": "best known solutions",
}
"""What the kinds of tasks are called, in the order in which they begin."""


def costs(tasks: Sequence[Task], seconds: Mapping[str, float]) -> list[Row]:
    """Table ``costs``: processor time of the tasks, compilation of solvers left out (it is done by other processes)."""
    found: dict[tuple[str, str, str], list[float]] = {}
    for task in tasks:
        pair = (task.pair.formulation, task.pair.solver) if task.pair else ("", "")
        found.setdefault((task.kind, *pair), []).append(seconds.get(task.name, math.nan))
    return [
        {"work": _WORK[kind], "formulation": name, "solver": solver, "tasks": len(each), "core_s": float(np.sum(each))}
        for (kind, name, solver), each in sorted(found.items(), key=lambda item: list(_WORK).index(item[0][0]))
    ]


def _by_pair(rows: list[Row], key: str) -> dict[tuple[str, str], dict[int, Row]]:
    """Rows of each pair by a column that numbers them."""
    found = grouped(rows, "formulation", "solver").items()
    return {(name[0], name[1]): {row[key]: row for row in mine} for name, mine in found}


def _number(value: Any) -> float:
    return np.nan if value is None else float(value)


def _worst(values: list[float]) -> float:
    """The largest, which is no number if any is none: a run that went astray must not make the others' the worst."""
    return max(values) if all(map(math.isfinite, values)) else math.nan


def _of(statistic: Any, values: list[float]) -> float:
    finite = [value for value in values if math.isfinite(value)]
    return float(statistic(finite)) if finite else np.nan
