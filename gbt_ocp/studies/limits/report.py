"""The report of a comparison folder: Markdown and the same as HTML, from its tables alone."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from markdown import markdown

from gbt_ocp.files import whole_file
from gbt_ocp.simulation.summary import FALLBACKS
from gbt_ocp.studies.limits.comparison_tables import CAPTIONS, Row, Tables
from gbt_ocp.studies.limits.summaries import CLASSES

_PAGE_STYLE = (
    "body{font-family:sans-serif;max-width:70em;margin:2em auto;padding:0 1em;line-height:1.4}"
    "table{border-collapse:collapse;font-size:.85em;display:block;overflow-x:auto}"
    "th,td{border-bottom:1px solid #ddd;padding:.25em .6em;text-align:right}"
    "th:first-child,td:first-child{text-align:left}"
    "img{max-width:100%}"
)

_SETS = {
    ("recorded", "warm"): "recorded problems, warm starts",
    ("recorded", "cold"): "recorded problems, cold starts",
    ("random", "cold"): "random problems, cold starts",
}


def write_report(folder: Path, tables: Tables) -> None:
    """Write figures, ``report.md`` and ``report.html`` of a comparison folder from its tables."""
    from gbt_ocp.studies.limits.comparison_figures import write_figures

    drawn = write_figures(folder, tables)
    text = report(folder, tables, drawn)
    with whole_file(folder / "report.md") as temporary:
        temporary.write_text(text, encoding="utf-8")
    body = markdown(text, extensions=["tables"])
    head = f'<meta charset="utf-8"><title>Comparison</title><style>{_PAGE_STYLE}</style>'
    page = f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head>\n<body>\n{body}\n</body></html>\n'
    with whole_file(folder / "report.html") as temporary:
        temporary.write_text(page, encoding="utf-8")


def report(folder: Path, tables: Tables, drawn: Sequence[str] = ()) -> str:
    """The report as Markdown; ``drawn`` names the figures that are there."""
    plan = json.loads((folder / "comparison.json").read_text(encoding="utf-8"))
    names = ", ".join(entry["name"] for entry in plan["configurations"])
    lines = [
        f"# Treatments of the limits: {names}",
        "",
        f"The pairs of formulation and solver solved the same problems: at least {plan['problems']} of each "
        f"configuration recorded in {plan['runs']} closed-loop runs, and random ones beside them. Slow pairs solved a "
        "random sample of them, and pairs are compared on the problems that both solved; how many these "
        "are stands in every row. Cold starts begin with coasting, warm ones with the rest of the plan of the step "
        "before. Times are processor time of the thread. Objectives leave out every penalty, and violations are those "
        "of the true limits, in units of the limit (negative: inside). Intervals are 95 % bootstrap intervals in which "
        "runs are drawn, not steps. Not rounded, and solve by solve, the tables are in `tables/`.",
        "",
        "## Verdict",
        "",
        *(f"- {line}" for line in (folder / "verdict.txt").read_text(encoding="utf-8").splitlines()),
        "",
        "## Formulations",
        "",
        *table(
            tables["formulations"],
            {"formulation": "formulation", "solver": "solver", "meaning": "what it is, or why there is none"},
        ),
        "",
        "## Table open_loop",
        "",
    ]
    for (origin, mode), title in _SETS.items():
        rows = [row for row in tables["open_loop"] if (row["origin"], row["mode"]) == (origin, mode)]
        if rows:
            lines += [f"### Open loop: {title}", "", *table(list(map(_open_loop_row, rows)), _OPEN_LOOP), ""]
    lines += ["## Table paired", "", "Medians of ratios and differences, means of objective and violation.", ""]
    for (origin, mode), title in _SETS.items():
        rows = [row for row in tables["paired"] if (row["origin"], row["mode"]) == (origin, mode)]
        if rows:
            lines += [f"### Paired: {title}", "", *table(list(map(_paired_row, rows)), _PAIRED), ""]
    if tables["classes"]:
        lines += ["## Table classes", "", "Solutions that break a limit of a class between its nodes, by how much.", ""]
        for (origin, mode), title in _SETS.items():
            rows = [row for row in tables["classes"] if (row["origin"], row["mode"]) == (origin, mode)]
            if rows:
                lines += [f"### Classes: {title}", "", *table(map(_class_row, rows), _CLASSES), ""]
    lines += ["## Table closed_loop", "", *table(list(map(_loop_row, tables["closed_loop"])), _LOOP), ""]
    if tables["at_a_distance"]:
        lines += ["## Table at_a_distance", "", *table(map(_distant_row, tables["at_a_distance"]), _DISTANT), ""]
    lines += ["## Table closed_loop_paired", ""]
    lines += [
        *table(
            [row | {"more": _interval(row, "error_more")} for row in tables["closed_loop_paired"]],
            _LOOP_PAIRED,
        ),
        "",
    ]
    if tables["sensitivity"]:
        pooled = {key: name for key, name in _SENSITIVITY.items() if key not in ("case", "mode")}
        lines += ["## Table settings", "", "All configurations, cold and warm starts together; the narrowest kink.", ""]
        lines += [*table(tables["settings"], pooled), ""]
        lines += ["## Table sensitivity", "", *table(tables["sensitivity"], _SENSITIVITY), ""]
    costs = tables["costs"]
    total = sum(row["core_s"] for row in costs)
    lines += [
        "## Table costs",
        "",
        f"Processor time of all tasks: {total / 60.0:.1f} minutes of one core. The C compiler's time, where "
        "solvers were not in the cache, comes on top.",
        "",
        *table(costs, {key: key for key in ("work", "formulation", "solver", "tasks")} | {"core_s": "seconds"}),
        "",
    ]
    for name in drawn:
        lines += [f"## Figure {name}", "", CAPTIONS[name], "", f"![{CAPTIONS[name]}](figures/{name}.png)", ""]
    return "\n".join(lines)


def table(rows: Iterable[Row], columns: dict[str, str]) -> list[str]:
    """Lines of a Markdown table with these columns (key to heading), numbers to three digits."""
    lines = [f"| {' | '.join(columns.values())} |", "|" + "---|" * len(columns)]
    return lines + [f"| {' | '.join(short(row.get(key)) for key in columns)} |" for row in rows]


def short(value: Any) -> str:
    """A number with three significant digits, and nothing for one that is not finite; a word as it is."""
    if isinstance(value, str) or value is None:
        return value or ""
    if not math.isfinite(value):
        return ""
    whole = value == round(value) and abs(value) < 1e6
    return f"{value:.0f}" if whole else f"{value:.3g}"


def _interval(row: Row, name: str) -> str:
    low, high = short(row[f"{name}_low"]), short(row[f"{name}_high"])
    return f"{short(row[name])} [{low}, {high}]" if low else short(row[name])


_OPEN_LOOP = {
    "case": "case", "formulation": "formulation", "solver": "solver", "success": "solved", "kept": "and limits kept",
    "time_median_ms": "median ms", "time_99_ms": "99 % ms", "iterations_median": "iterations", "iterations_99": "99 %",
    "gap": "mean gap to best known", "gap_99": "99 %", "violation_nodes_max": "worst violation at nodes",
    "violation_between_max": "between nodes",
}  # fmt: skip
_PAIRED = {
    "case": "case", "pair": "pair", "against": "against", "faster": "times faster", "fewer": "iterations fewer",
    "solved": "solved more", "objective": "objective more", "counts": "better, equal, worse",
    "violation": "violation between nodes more",
}  # fmt: skip
_LOOP = {
    "case": "case", "formulation": "formulation", "solver": "solver", "runs": "seeds", "astray": "astray",
    "error": "settled error m", "error_settled_worst": "worst seed", "error_mean": "error m, whole run",
    "distance_median": "distance m", "condition_median": "condition number", "violation_max": "violation executed",
    "tightened": "tightened", "fallbacks": "fallbacks shifted, cold, unfinished, braking, other",
    "unsolved": "first solves failed %", "solver_time_median_ms": "planner ms",
}  # fmt: skip
_CLASSES = {
    "case": "case", "formulation": "formulation", "solver": "solver", "success": "solved", "kept": "and all kept",
    **{name: f"{name} broken (mean, worst)" for name in CLASSES},
}  # fmt: skip
_DISTANT = {
    "case": "case", "formulation": "formulation", "solver": "solver", "runs": "seeds", "error": "error % of range",
    "ahead": "10 s ahead", "lost": "lost", "steps_below_standoff": "samples below standoff",
    "distance_min": "least range m", "plans": "plans", "answered": "first solve answered %",
    "given_up": "limit given up", "fallbacks": "fallbacks shifted, cold, unfinished, braking",
    "solver_time_median_ms": "planner ms", "solver_time_99_ms": "99 %", "solver_time_max_ms": "most",
}  # fmt: skip
_LOOP_PAIRED = {"case": "case", "pair": "pair", "against": "against", "runs": "seeds", "more": "settled error more, m"}
_SENSITIVITY = {
    "case": "case", "swept": "swept", "value": "value", "formulation": "formulation", "solver": "solver",
    "mode": "mode", "kink_mm": "kink mm", "stiffness": "stiffness", "problems": "problems", "solved": "solved",
    "iterations_mean": "iterations", "time_median_ms": "median ms", "objective_mean": "objective",
    "violation_between_max": "worst violation between nodes", "broken_between": "broken",
}  # fmt: skip


def _open_loop_row(row: Row) -> Row:
    return row | {"success": f"{row['solved']} of {row['problems']}", "gap": _interval(row, "gap_mean")}


def _paired_row(row: Row) -> Row:
    return row | {
        "faster": _interval(row, "times_faster"),
        "fewer": _interval(row, "iterations_fewer"),
        "solved": _interval(row, "solved_more"),
        "objective": _interval(row, "objective_more"),
        "violation": _interval(row, "violation_more"),
        "counts": f"{row['better']}, {row['equal']}, {row['worse']} of {row['both_solved']}",
    }


def _class_row(row: Row) -> Row:
    cells = {}
    for name in CLASSES:
        count = row[f"{name}_broken"]
        cells[name] = f"{count} ({short(row[f'{name}_mean'])}, {short(row[f'{name}_worst'])})" if count else "0"
    return row | cells | {"success": f"{row['solved']} of {row['problems']}"}


def _distant_row(row: Row) -> Row:
    percent = {name: 100.0 * row[name] for name in row if name.startswith("relative_error") and row[name] is not None}
    return row | {
        "error": _interval(row | percent, "relative_error"),
        "ahead": percent.get("relative_error_10s"),
        "answered": f"{math.floor(1e4 * row['answered_share']) / 100.0:g}",
        "fallbacks": ", ".join(str(row[f"fallbacks_{word}"]) for word in FALLBACKS),
    }


def _loop_row(row: Row) -> Row:
    share = row["solver_success_rate"]
    return row | {
        "error": _interval(row, "error_settled"),
        "fallbacks": ", ".join(str(row[f"fallbacks_{word}"]) for word in (*FALLBACKS, "other")),
        "unsolved": None if share is None else f"{100.0 * (1.0 - share):.3g}",
    }
