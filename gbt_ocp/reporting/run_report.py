"""``gbt-ocp report``: one page about a run that needs no network: summary, figures, solver ledger, configuration."""

from __future__ import annotations

import base64
import io
import os
from collections import Counter
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gbt_ocp.files import packaged_text, whole_file
from gbt_ocp.reporting.drawable import drawable_history
from gbt_ocp.reporting.figures import draw_figures
from gbt_ocp.reporting.glossary import FALLBACK_NUMBERS, RETRY_NUMBERS, RUN_NUMBERS, TEAM_NUMBERS
from gbt_ocp.simulation import run_folder
from gbt_ocp.simulation.history import History

MOST_FAILURES = 200
"""Failed solves that are listed one by one."""

_CAPTIONS = {
    "vehicles": "Paths of all vehicles and of the target from above, errors of the position now, ranges, and the "
    "distance of the two vehicles nearest to each other. All else on this page is about the first vehicle.",
    "trajectories": "Paths of vehicle and target, and the posterior mean at each step.",
    "error": "Tracking error, mean over the forecast, and its bound by the paper's theorem.",
    "condition_number": "Condition number of the cumulative bearing matrix of the window: 1 is the best.",
    "range": "Range with what is believed of it, the standoff, errors in per cent of the range, power and energy.",
    "hyperparameters": "Hyperparameters of the tracker.",
    "thrust": "Thrust over its limit, with the peak on the fine grid of each executed piece.",
    "solver_time": "Time of tracker and solver at each step.",
    "tracker_time": "Time of the tracker at each step.",
}


def write_report(run_dir: str | os.PathLike[str], out: str | os.PathLike[str]) -> Path:
    """Write the page about a run folder; a file of that name is replaced.

    Raises
    ------
    FileNotFoundError
        If a file of the run folder is missing.
    ValueError
        If one is damaged, or the name does not end in ``.html``.
    """
    target = Path(out)
    if target.suffix.lower() not in (".html", ".htm"):
        raise ValueError(f"found {target}; allowed: a name that ends in .html")
    page = report_page(run_dir)
    with whole_file(target) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return target


def report_page(run_dir: str | os.PathLike[str]) -> str:
    """The page about a run folder, drawn from its own three files.

    Raises
    ------
    FileNotFoundError, ValueError
        See :func:`write_report`.
    """
    folder = Path(run_dir)
    text, configuration = run_folder.read_configuration(folder)
    history = drawable_history(folder)
    summary = run_folder.read_summary(folder)
    title = f"{configuration.get('name', 'run')}, seed {summary.get('seed')}"
    others = {path.name: drawable_history(path) for path in run_folder.others_in(folder)}
    figures = draw_figures(history, configuration, summary, others)
    body = [
        f"<h1>{escape(title)}</h1>",
        f"<p>{escape(_in_a_sentence(history, summary))}</p>",
        *(f"<p class='warning'>{escape(str(line))}</p>" for line in summary.get("warnings") or ()),
        "<h2>Summary</h2>",
        _table(("value", "unit", "meaning", "key"), _summary_rows(summary), "summary"),
        *_team(summary),
        "<p><a href='#glossary'>All keys of <code>summary.json</code></a></p>",
        "<h2>Figures</h2>",
        *(_figure(name, figure) for name, figure in figures.items()),
        "<h2>Solver ledger</h2>",
        *_ledger(history, summary),
        "<h2>Versions</h2>",
        _table(("", ""), [(name, str(value)) for name, value in (summary.get("versions") or {}).items()]),
        "<h2 id='glossary'>Keys of <code>summary.json</code></h2>",
        "<details><summary>Units and meanings, as in docs/glossary.md</summary>",
        _table(("key", "unit", "meaning"), _meanings()),
        "</details>",
        "<h2>Configuration</h2>",
        "<p>Every default written out; <code>gbt-ocp run</code> with it gives the same run.</p>",
        f"<pre>{escape(text)}</pre>",
    ]
    page = packaged_text("gbt_ocp.reporting", "page", "report.html")
    return page.replace("{{title}}", escape(title)).replace("{{body}}", "\n".join(body))


def _in_a_sentence(history: History, summary: dict[str, Any]) -> str:
    violation, fallbacks = summary.get("violation_max"), sum((summary.get("fallbacks") or {}).values())
    kept = "has no thrust to speak of" if violation is None else "kept" if violation <= 1e-9 else "broke"
    thrust = f"the vehicle {kept}" if violation is None else f"the vehicle {kept} its thrust limits"
    planned = int(np.count_nonzero(history.planned))
    solved = f"{planned} plans, {fallbacks} of them a fallback after a failed solve" if planned else "no plans"
    space = "the plane" if history.dimension == 2 else "space"
    return (
        f"{_seconds(history.t[-1])} s in {space}, {len(history.t)} samples; "
        f"settled error {_number(summary.get('error_settled'))} m; {thrust}; {solved}."
    )


def _summary_rows(summary: dict[str, Any]) -> Iterable[tuple[str, ...]]:
    for key, value in summary.items():
        if key in ("versions", "warnings", "fallbacks", "retries", "vehicles", "team"):
            continue  # shown elsewhere
        unit, meaning = RUN_NUMBERS.get(key, ("", ""))
        yield _number(value), unit, meaning, key


def _team(summary: dict[str, Any]) -> list[str]:
    """The numbers of several vehicles, each in a column, and those of all together."""
    each, team = summary.get("vehicles"), summary.get("team")
    if not (isinstance(each, dict) and all(isinstance(one, dict) for one in each.values())):
        return []
    keys = dict.fromkeys(key for one in each.values() for key in one)
    rows = [(key, *(_number(one.get(key)) for one in each.values()), RUN_NUMBERS.get(key, ("", ""))[1]) for key in keys]
    lines = ["<h2>Vehicles</h2>", _table(("key", *map(str, each), "meaning"), rows)]
    if isinstance(team, dict):
        found = [(_number(value), *TEAM_NUMBERS.get(key, ("", "")), key) for key, value in team.items()]
        lines.append(_table(("all together", "unit", "meaning", "key"), found))
    return lines


def _meanings() -> Iterable[tuple[str, ...]]:
    parts = (("", RUN_NUMBERS), ("fallbacks.", FALLBACK_NUMBERS), ("retries.", RETRY_NUMBERS), ("team.", TEAM_NUMBERS))
    for above, keys in parts:
        for key, (unit, meaning) in keys.items():
            yield f"{above}{key}", unit, meaning


def _ledger(history: History, summary: dict[str, Any]) -> list[str]:
    planned = history.planned
    if not planned.any():
        return ["<p>Nothing was solved: the guidance law has no solver.</p>"]
    count = int(np.count_nonzero(planned))
    words = Counter(str(word) for word in history.solver_status[planned])
    statuses = [(word, str(number), f"{100.0 * number / count:.3g} %") for word, number in words.most_common()]
    answers = [(word, str(number)) for word, number in (summary.get("fallbacks") or {}).items()]
    answers += [(f"retries: {word}", str(number)) for word, number in (summary.get("retries") or {}).items()]
    spread = ("", "least", "median", "90 %", "99 %", "most")
    lines = [
        _table(("status of the solve", "steps", "share"), statuses),
        _table(("answer to a failed solve", "steps"), answers),
        _table(
            spread,
            [
                ("iterations", *_quantiles(history.solver_iterations[planned].astype(float))),
                ("time of the solver, ms", *_quantiles(1e3 * history.solver_time[planned])),
                ("time of the tracker, ms", *_quantiles(1e3 * history.tracker_time)),
            ],
        ),
    ]
    failed = np.flatnonzero(planned & (~history.answered | (history.fallback != "")))
    if not len(failed):
        return [*lines, "<p>Every plan was solved at the first try.</p>"]
    shown = failed[:MOST_FAILURES]
    rows = [
        (
            _seconds(history.t[k]),
            str(history.solver_status[k]),
            str(history.fallback[k]) or "none",
            str(history.solver_iterations[k]),
            _number(1e3 * float(history.solver_time[k])),
        )
        for k in shown
    ]
    head = f"The {len(shown)} first of {len(failed)}" if len(shown) < len(failed) else f"All {len(failed)}"
    names = ("t, s", "status", "answer", "iterations", "ms")
    return [*lines, f"<h3>{head} plans that were not solved at the first try</h3>", _table(names, rows)]


def _quantiles(values: NDArray[np.float64]) -> tuple[str, ...]:
    known = values[np.isfinite(values)]
    if not known.size:
        return ("none",) * 5
    return tuple(_number(float(value)) for value in np.quantile(known, (0.0, 0.5, 0.9, 0.99, 1.0)))


def _number(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, list):
        return ", ".join(map(_number, value))
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _seconds(time: float) -> str:
    """A time to a microsecond, however long the run."""
    return f"{time:.6f}".rstrip("0").rstrip(".")


def _table(head: Sequence[str], rows: Iterable[Sequence[str]], kind: str = "") -> str:
    def line(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    top = line(head, "th") if any(head) else ""
    return f"<table class='{kind}'>{top}{''.join(line(row, 'td') for row in rows)}</table>"


def _figure(name: str, figure: Figure) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=150)
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    caption = _CAPTIONS.get(name, name)
    return (
        f"<figure><img alt='{escape(caption)}' src='data:image/png;base64,{data}'>"
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )
