"""Error and variance norm against the length of the window, one curve a forecast length (figure 7)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from gbt_ocp.reporting import style
from gbt_ocp.reporting.bands import QUANTILES
from gbt_ocp.typing import Array

Curves = Mapping[tuple[str, int], Mapping[int, Array]]

_MARKED = ((style.BLUE, "o-"), (style.VERMILLION, "s--"), (style.GREEN, "^-."))


def draw_lengths(errors: Curves, norms: Curves) -> Figure:
    """Draw two rows of panels, one column a case.

    Parameters
    ----------
    errors, norms
        Case and n to window length to the value of every run ``(runs,)``, in m and m²; at most three n.
    """
    cases = list(dict.fromkeys(case for case, _ in errors))
    ahead = list(dict.fromkeys(n for _, n in errors))
    with style.styled():
        figure = style.new_figure(4.4)
        grid = figure.subplots(2, len(cases), sharex=True, sharey="row", squeeze=False)
        for row, (curves, label) in enumerate(((errors, "settled error [m]"), (norms, "variance norm [m²]"))):
            for column, case in enumerate(cases):
                axes = grid[row, column]
                for n, (color, line) in zip(ahead, _MARKED, strict=False):
                    found = curves.get((case, n), {})
                    values = np.array(
                        [np.nanquantile(found[window], (QUANTILES[0], 0.5, QUANTILES[1])) for window in found]
                    )
                    if len(values):
                        axes.fill_between(
                            list(found), values[:, 0], values[:, 2], color=color, alpha=0.2, linewidth=0.0
                        )
                        axes.plot(list(found), values[:, 1], line, color=color, label=f"n = {n}")
                axes.set_yscale("log")
                if row == 0:
                    axes.set_title(f"case {case.removeprefix('case')}")
                else:
                    axes.set_xlabel("length of the window $N_c$")
                if column == 0:
                    axes.set_ylabel(label)
        style.legend_above(figure, grid[0, 0], len(ahead))
    return figure
