"""Figures of a comparison: distributions over the problems, closed loops, and the sweeps of the settings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gbt_ocp.files import whole_file
from gbt_ocp.reporting import style
from gbt_ocp.studies.limits.comparison_tables import CAPTIONS, Row, Tables, column
from gbt_ocp.typing import Array

COLOURS = {
    "penalty": style.VERMILLION,
    "continuation": style.ORANGE,
    "elastic": style.PURPLE,
    "mixed": style.GREY,
    "hard": style.BLUE,
    "exchange": style.SKY,
    "soft": style.GREEN,
    "shooting": style.BLACK,
}
"""One colour a formulation; the line says the solver."""

LINES = {"ipopt": "-", "compiled": (0, (4, 1.5))}

MARKERS = ("o", "s", "^", "D", "v", "P")
"""One marker a case."""


def write_figures(folder: Path, tables: Tables) -> list[str]:
    """Draw what the tables give into ``figures/``; returns the names that were drawn, in the report's order."""
    (folder / "figures").mkdir(exist_ok=True)
    drawn = []
    with style.styled():
        for name in CAPTIONS:
            figure = _DRAW[name](tables)
            if figure is not None:
                with whole_file(folder / "figures" / f"{name}.png") as temporary:
                    figure.savefig(temporary, dpi=style.DPI)
                drawn.append(name)
    return drawn


def _values(rows: Sequence[Row], key: str) -> Array:
    return np.array(column(rows, key))


def _pairs(rows: Sequence[Row]) -> list[tuple[str, str]]:
    return list(dict.fromkeys((row["formulation"], row["solver"]) for row in rows))


def _cases(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row["case"] for row in rows))


def _panels(cases: Sequence[str], height: float, share_y: bool = True) -> tuple[Figure, list[Axes]]:
    """One panel a case, two in a row."""
    columns = min(2, len(cases))
    lines = -(-len(cases) // columns)
    figure = style.new_figure(height * lines + 0.7)
    axes = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=share_y)
    for spare in axes.flat[len(cases) :]:
        spare.set_visible(False)
    for case, panel in zip(cases, axes.flat, strict=False):
        panel.set_title(case)
    return figure, list(axes.flat[: len(cases)])


def _legend(figure: Figure, pairs: Sequence[tuple[str, str]]) -> None:
    handles = [
        figure.axes[0].plot([], [], color=COLOURS[formulation], linestyle=LINES[solver])[0]
        for formulation, solver in pairs
    ]
    figure.legend(handles, [f"{name}, {solver}" for name, solver in pairs], loc="outside upper center", ncols=4)


def _recorded(rows: Sequence[Row], mode: str) -> list[Row]:
    return [row for row in rows if row["origin"] == "recorded" and row["mode"] == mode]


def _distributions(
    rows: Sequence[Row],
    values: Callable[[Sequence[Row]], Array],
    label: str,
    scale: str,
    height: float = 2.2,
    **options: Any,
) -> Figure | None:
    """Empirical distribution functions over the warm recorded problems; what was not solved keeps a line below 1."""
    rows = _recorded(rows, "warm") or _recorded(rows, "cold")
    if not rows:
        return None
    figure, panels = _panels(_cases(rows), height)
    for case, axes in zip(_cases(rows), panels, strict=True):
        for formulation, solver in _pairs(rows):
            mine = [
                row for row in rows if (row["case"], row["formulation"], row["solver"]) == (case, formulation, solver)
            ]
            if not mine:
                continue
            solved = [row for row in mine if row["solved"]]
            x = np.sort(values(solved))
            y = np.arange(1, len(x) + 1) / len(mine)
            axes.step(x, y, where="post", color=COLOURS[formulation], linestyle=LINES[solver])
        axes.set_xscale(scale, **options)
        if scale == "symlog":
            axes.set_xticks([-0.1, 0.0, 1e-2, 1e-1, 1.0], ["-0.1", "0", "0.01", "0.1", "1"])
        axes.set_ylim(0.0, 1.02)
    for axes in panels[-2:]:
        axes.set_xlabel(label)
    figure.supylabel("share of the problems", fontsize=9.0)
    _legend(figure, _pairs(rows))
    return figure


def _time(tables: Tables) -> Figure | None:
    return _distributions(tables["solves"], lambda rows: _values(rows, "time_ms"), "processor time [ms]", "log")


def _iterations(tables: Tables) -> Figure | None:
    return _distributions(
        tables["solves"], lambda rows: np.maximum(_values(rows, "iterations"), 1.0), "iterations", "log"
    )


def _violation(tables: Tables) -> Figure | None:
    return _distributions(
        tables["solves"],
        lambda rows: _values(rows, "violation_between"),
        "worst violation on the fine grid [its unit]",
        "linear",
    )


def _objective(tables: Tables) -> Figure | None:
    return _distributions(
        tables["solves"],
        lambda rows: _values(rows, "gap"),
        "gap to the best known objective",
        "symlog",
        linthresh=1e-3,
    )


def _success(tables: Tables) -> Figure | None:
    rows = tables["open_loop"]
    sets = list(dict.fromkeys((row["origin"], row["mode"]) for row in rows))
    pairs, cases = _pairs(rows), _cases(rows)
    figure = style.new_figure(0.28 * len(pairs) + 1.2)
    panels = figure.subplots(1, len(sets), sharey=True, squeeze=False)[0]
    for (origin, mode), axes in zip(sets, panels, strict=True):
        for number, case in enumerate(cases):
            mine = {
                (row["formulation"], row["solver"]): row
                for row in rows
                if (row["case"], row["origin"], row["mode"]) == (case, origin, mode)
            }
            offset = 0.16 * (number - 0.5 * (len(cases) - 1))
            for place, pair in enumerate(pairs):
                if pair not in mine:
                    continue
                share, low, high = (mine[pair][f"solved_{name}"] for name in ("share", "low", "high"))
                axes.errorbar(
                    100.0 * share,
                    place + offset,
                    xerr=[[np.nan_to_num(100.0 * (share - low))], [np.nan_to_num(100.0 * (high - share))]],
                    color=COLOURS[pair[0]],
                    marker=MARKERS[number % len(MARKERS)],
                    markersize=3.0,
                    linewidth=0.8,
                )
        axes.set_title(f"{origin}, {mode}")
        axes.set_xlabel("solved [%]")
        axes.set_xlim(right=102.0)
    panels[0].set_yticks(range(len(pairs)), [f"{name}, {solver}" for name, solver in pairs])
    panels[0].invert_yaxis()
    handles = [
        panels[0].plot([], [], color=style.GREY, linestyle="", marker=MARKERS[number % len(MARKERS)], markersize=3.0)[0]
        for number in range(len(cases))
    ]
    figure.legend(handles, cases, loc="outside upper center", ncols=len(cases))
    return figure


def _plain_where_narrow(axes: Axes, values: Array) -> None:
    """Plain numbers on the logarithmic axis of errors that span no two decades."""
    known = values[np.isfinite(values) & (values > 0.0)]
    if known.size and known.max() < 50.0 * known.min():
        style.plain_log_ticks(axes.xaxis)


def _closed_loop(tables: Tables) -> Figure | None:
    rows = tables["runs"]
    if not rows:
        return None
    pairs = _pairs(rows)
    figure, panels = _panels(_cases(rows), 0.16 * len(pairs) + 0.4)
    for case, axes in zip(_cases(rows), panels, strict=True):
        for place, (formulation, solver) in enumerate(pairs):
            mine = [
                row for row in rows if (row["case"], row["formulation"], row["solver"]) == (case, formulation, solver)
            ]
            error = _values(mine, "error_settled")
            axes.plot(
                error, np.full(len(error), place), color=COLOURS[formulation], marker="o", markersize=3.0, linestyle="",
                markerfacecolor="none",
            )  # fmt: skip
            if error.size:
                axes.plot(np.mean(error), place, color=COLOURS[formulation], marker="|", markersize=9.0)
        axes.set_xscale("log")
        _plain_where_narrow(axes, _values(rows, "error_settled"))
        axes.set_yticks(range(len(pairs)), [f"{name}, {solver}" for name, solver in pairs])
        axes.set_ylim(len(pairs) - 0.5, -0.5)
    for axes in panels[-2:]:
        axes.set_xlabel("settled error [m]")
    return figure


def _sensitivity(tables: Tables) -> Figure | None:
    rows = [
        row
        for row in tables["sensitivity"]
        if row["swept"] in ("width", "weight", "units") and row["kink_mm"] is not None
    ]
    if not rows:
        return None
    figure = style.new_figure(2.9)
    left, right = figure.subplots(1, 2)
    markers = {"width": "o", "weight": "s", "units": "^"}
    for formulation in dict.fromkeys(row["formulation"] for row in rows):
        for swept, marker in markers.items():
            mine = [row for row in rows if (row["formulation"], row["swept"]) == (formulation, swept)]
            x = _values(mine, "stiffness")
            look = {"color": COLOURS[formulation], "marker": marker, "linestyle": "", "markerfacecolor": "none"}
            label = f"{formulation}, {swept} swept"
            left.plot(x, 100.0 * _values(mine, "solved") / _values(mine, "problems"), label=label, **look)
            right.plot(x, _values(mine, "iterations_mean"), **look)
    for axes in (left, right):
        axes.set_xscale("log")
        axes.set_xlabel("stiffness of the kink, w_p T/n_c / (2ϖ)")
        axes.set_xticks([10.0**k for k in range(1, 9, 2)])
        axes.set_xticks([], minor=True)
    left.set_ylabel("solved [%]")
    left.set_ylim(-3.0, 103.0)
    right.set_yscale("log")
    right.set_ylabel("iterations, mean")
    style.legend_above(figure, left, columns=3)
    return figure


def _nodes(tables: Tables) -> Figure | None:
    rows = [row for row in tables["sensitivity"] if row["swept"] in ("gamma", "nodes") and row["mode"] == "cold"]
    if not rows:
        return None
    figure = style.new_figure(4.6)
    panels = figure.subplots(2, 2, sharex="col", sharey="row")
    cases = _cases(rows)
    for place, (swept, label) in enumerate((("gamma", "γ"), ("nodes", "n_c"))):
        for formulation in dict.fromkeys(row["formulation"] for row in rows):
            for number, case in enumerate(cases):
                mine = [
                    row for row in rows if (row["swept"], row["formulation"], row["case"]) == (swept, formulation, case)
                ]
                if not mine:
                    continue
                x, value = _values(mine, "value"), _values(mine, "objective_mean")
                # the configurations' objectives differ by far more than a setting changes them
                look = {"color": COLOURS[formulation], "marker": MARKERS[number % len(MARKERS)], "linewidth": 0.8}
                panels[0, place].plot(x, value - value[-1], label=f"{formulation}", **look)
                panels[1, place].plot(x, _values(mine, "violation_between_max"), **look)
        panels[1, place].axhline(0.0, color=style.BLACK, linewidth=0.8)
        panels[1, place].set_xlabel(label)
    panels[1, 1].set_xscale("log")
    values = sorted({row["value"] for row in rows if row["swept"] == "nodes"})
    panels[1, 1].set_xticks(values, [f"{value:g}" for value in values])
    panels[1, 1].set_xticks([], minor=True)
    panels[0, 0].set_ylabel("mean objective,\nminus that of the last value")
    panels[1, 0].set_ylabel("worst |τ|/τ_max - 1\nbetween the nodes")
    names = list(dict.fromkeys(row["formulation"] for row in rows))
    lines = [panels[0, 0].plot([], [], color=COLOURS[name])[0] for name in names]
    points = [
        panels[0, 0].plot([], [], color=style.GREY, linestyle="", marker=MARKERS[number % len(MARKERS)])[0]
        for number in range(len(cases))
    ]
    # a row of formulations and one of cases: a legend is filled column by column
    blank = panels[0, 0].plot([], [], linestyle="")[0]
    both = list(zip_longest(zip(lines, names, strict=True), zip(points, cases, strict=True), fillvalue=(blank, "")))
    handles, labels = zip(*[entry for column in both for entry in column], strict=True)
    figure.legend(handles, labels, loc="outside upper center", ncols=len(both))
    return figure


_DRAW: dict[str, Callable[[Tables], Figure | None]] = {
    "success": _success,
    "objective": _objective,
    "violation": _violation,
    "time": _time,
    "iterations": _iterations,
    "closed_loop": _closed_loop,
    "sensitivity": _sensitivity,
    "nodes": _nodes,
}
