"""The distribution of a sweep: how a few numbers of its runs scatter, variant by variant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import shorten
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gbt_ocp.reporting import style
from gbt_ocp.typing import Array

DISTRIBUTED = {
    "error_settled": ("settled error [m]", 1.0),
    "relative_error": ("error now [% of range]", 100.0),
    "relative_error_10s": ("error in 10 s [% of range]", 100.0),
}
"""Columns of ``runs.csv``, what their axes say, and the factor to its unit."""

MOST_VARIANTS = 40
"""Variants above which the figure would be longer than a page; the first ones are drawn."""

LONGEST_LABEL = 44


def distribution(variants: Mapping[str, Sequence[Mapping[str, Any]]]) -> Figure | None:
    """A panel a number: every run a point, the median and the middle four fifths a bar.

    Parameters
    ----------
    variants
        Rows of ``runs.csv`` by the name of their variant, in the order of the plan.

    Returns
    -------
    ``None`` if no run has one of the numbers in :data:`DISTRIBUTED`.
    """
    drawn = dict(list(variants.items())[:MOST_VARIANTS])
    found = {key: {name: _finite(rows, key) for name, rows in drawn.items()} for key in DISTRIBUTED}
    panels = [key for key in DISTRIBUTED if any(values.size for values in found[key].values())]
    if not panels:
        return None
    with style.styled():
        figure = style.new_figure(1.0 + 0.28 * len(drawn))
        for axes, key in zip(np.ravel(figure.subplots(1, len(panels), sharey=True)), panels, strict=True):
            label, factor = DISTRIBUTED[key]
            _draw(axes, [factor * values for values in found[key].values()])
            axes.set_xlabel(label)
        first = figure.axes[0]
        names = [shorten(name, LONGEST_LABEL, placeholder=" …") for name in drawn]
        first.set_yticks(range(len(names)), names)
        first.invert_yaxis()
        first.set_ylim(len(names) - 0.5, -0.5)
        if len(variants) > len(drawn):
            figure.suptitle(f"the first {len(drawn)} of {len(variants)} variants", fontsize=8.0)
        return figure


def _finite(rows: Sequence[Mapping[str, Any]], key: str) -> Array:
    values = np.array([row[key] for row in rows if isinstance(row.get(key), int | float)], dtype=float)
    return np.asarray(values[np.isfinite(values)])


def _draw(axes: Axes, values: Sequence[Array]) -> None:
    """One row of points a variant, from the top."""
    every = np.concatenate(values)
    if every.min() > 0.0 and every.max() > 5.0 * every.min():
        axes.set_xscale("log")
        if every.max() <= 100.0 * every.min():
            style.plain_log_ticks(axes.xaxis)
    for row, of_variant in enumerate(values):
        if not of_variant.size:
            continue
        low, middle, high = np.percentile(of_variant, [10.0, 50.0, 90.0])
        axes.plot([low, high], [row, row], color=style.SKY, linewidth=5.0, solid_capstyle="butt", alpha=0.6, zorder=2)
        axes.plot(of_variant, np.full(of_variant.size, row), "|", color=style.GREY, markersize=7.0, zorder=3)
        axes.plot(middle, row, "o", color=style.BLUE, zorder=4)
    axes.grid(axis="y", visible=False)
