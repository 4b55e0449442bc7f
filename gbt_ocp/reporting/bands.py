"""Curves over time of many runs: the median with a band between quantiles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from gbt_ocp.reporting import style
from gbt_ocp.typing import Array

QUANTILES = (0.1, 0.9)
"""Ends of the band."""

_LOOKS = (
    (style.BLUE, "-"),
    (style.VERMILLION, "--"),
    (style.GREEN, "-."),
    (style.ORANGE, ":"),
    (style.PURPLE, (0, (5, 1, 1, 1, 1, 1))),
    (style.SKY, (0, (8, 2))),
    (style.BLACK, (0, (1, 1))),
    (style.GREY, "-"),
)


@dataclass(frozen=True)
class Curve:
    """One quantity over time in many runs.

    Attributes
    ----------
    t
        Times ``(K,)``, s.
    values
        ``(runs, K)``; NaN is left out.
    """

    t: Array
    values: Array


def draw_bands(
    panels: Mapping[str, Mapping[str, Curve]],
    ylabel: str,
    *,
    logarithmic: bool = True,
    columns: int = 1,
    xlabel: str = "time [s]",
    lowest: float | None = None,
) -> Figure:
    """Draw curves in panels that share both axes. A label has the same look in all of them.

    Parameters
    ----------
    panels
        Title to labelled curves; at most eight labels.
    ylabel
        Quantity and unit.
    logarithmic
        Whether the vertical axis is.
    columns
        Of panels.
    xlabel
        What the curves' ``t`` is, with its unit.
    lowest
        Lower end of the vertical axis, where curves go down to values that do not matter.

    Raises
    ------
    ValueError
        If there are more labels than looks.
    """
    labels = list(dict.fromkeys(label for curves in panels.values() for label in curves))
    if len(labels) > len(_LOOKS):
        raise ValueError(f"found {len(labels)} labels; allowed: at most {len(_LOOKS)}")
    looks = dict(zip(labels, _LOOKS, strict=False))
    rows = -(-len(panels) // columns)
    with style.styled():
        figure = style.new_figure(0.7 + 2.0 * rows)
        grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for axes, (title, curves) in zip(grid.flat, panels.items(), strict=False):
            for label, curve in curves.items():
                color, line = looks[label]
                low, middle, high = _quantiles(curve.values)
                axes.fill_between(curve.t, low, high, color=color, alpha=0.2, linewidth=0.0)
                axes.plot(curve.t, middle, color=color, linestyle=line, label=label)
            axes.set_title(title)
            if logarithmic:
                axes.set_yscale("log")
            axes.set_xlim(0.0, max(float(curve.t[-1]) for curve in curves.values()))
        if lowest is not None:
            grid.flat[0].set_ylim(bottom=lowest)
        for axes in grid.flat[len(panels) :]:
            axes.set_visible(False)
        for axes in grid[-1]:
            axes.set_xlabel(xlabel)
        for axes in grid[:, 0]:
            axes.set_ylabel(ylabel)
        handles = {
            label: handle for axes in grid.flat for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        figure.legend(
            [handles[label] for label in labels], labels, loc="outside upper center", ncols=min(4, len(labels))
        )
    return figure


def _quantiles(values: Array) -> Array:
    found: Array = np.nanquantile(values, (QUANTILES[0], 0.5, QUANTILES[1]), axis=0)
    return found
