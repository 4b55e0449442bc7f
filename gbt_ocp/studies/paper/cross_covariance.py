"""Figure 9: tracking error, the target's coordinates, their correlation, and the model's cross-axis covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gbt_ocp.reporting import style
from gbt_ocp.reporting.bands import QUANTILES
from gbt_ocp.typing import Array


@dataclass
class Panel:
    """One case, a column of the figure.

    Attributes
    ----------
    title
        Over the column.
    t
        Times ``(K,)``, s.
    errors
        Tracking error by model ``(runs, K)``, m; at most three.
    bound
        Of the model whose covariance is shown ``(runs, K)``, m.
    target
        Coordinates ``(K, d)``, m.
    correlation
        True correlation of the coordinates over the window ``(K, d, d)``.
    covariance
        k_f(t, t) ``(runs, K, d, d)``, m².
    """

    title: str
    t: Array = field(default_factory=lambda: np.zeros(0))
    errors: dict[str, Array] = field(default_factory=dict)
    bound: Array | None = None
    target: Array | None = None
    correlation: Array | None = None
    covariance: Array | None = None


def draw_cross_covariance(panels: Sequence[Panel]) -> Figure:
    """Draw four rows of axes, one column a case; curves of many runs are the median and a band between quantiles."""
    with style.styled():
        figure = style.new_figure(7.6)
        grid = figure.subplots(4, len(panels), sharex=True, squeeze=False)
        for column, panel in enumerate(panels):
            top, middle, true, model = grid[:, column]
            top.set_title(panel.title)
            for (color, line), (label, values) in zip(style.CURVES, panel.errors.items(), strict=False):
                _band(top, panel.t, values, color, line, label)
            if panel.bound is not None:
                _band(top, panel.t, panel.bound, style.BLACK, ":", "bound of the last")
            top.set_yscale("log")
            if panel.target is None or panel.correlation is None or panel.covariance is None:
                continue
            pairs = list(combinations(range(panel.target.shape[1]), 2))
            for (color, line), axis, name in zip(style.CURVES, panel.target.T, "xyz", strict=False):
                middle.plot(panel.t, axis, color=color, linestyle=line, label=name)
            for (color, line), (i, j) in zip(style.CURVES, pairs, strict=False):
                name = "xyz"[i] + "xyz"[j]
                true.plot(panel.t, panel.correlation[:, i, j], color=color, linestyle=line, label=f"$\\rho_{{{name}}}$")
                _band(model, panel.t, panel.covariance[:, :, i, j], color, line, f"$R_{{{name}}}$")
            off = np.array([panel.covariance[:, panel.t >= 2.0, i, j] for i, j in pairs])
            if off.size:
                reach = 1.15 * float(np.nanmax(np.abs(np.nanquantile(off, QUANTILES, axis=1))))
                model.set_ylim(-reach, reach)  # not that of the first seconds
            for axes in (true, model):
                axes.axhline(0.0, color=style.BLACK, linewidth=0.6)
            style.time_axis(model, float(panel.t[-1]))
        style.legend_above(figure, grid[0, 0], 4)
        # above the axes, where it covers nothing; the last case has the most curves
        for axes in grid[1:, -1]:
            axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=3, borderaxespad=0.0)
        labels = ("error [m]", "target [m]", "true correlation\nover the window [-]", "covariance\nof the model [m²]")
        for axes, label in zip(grid[:, 0], labels, strict=True):
            axes.set_ylabel(label)
    return figure


def _band(axes: Axes, t: Array, values: Array, color: str, line: str, label: str) -> None:
    low, middle, high = np.nanquantile(values, (QUANTILES[0], 0.5, QUANTILES[1]), axis=0)
    axes.fill_between(t, low, high, color=color, alpha=0.2, linewidth=0.0)
    axes.plot(t, middle, color=color, linestyle=line, label=label)
