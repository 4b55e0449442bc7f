"""The figure of a run with several vehicles: their paths, errors and ranges, and how far they kept apart."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gbt_ocp.reporting import style
from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.team_summary import separations


def team_figure(histories: Mapping[str, History], nearest: float | None, separation: float | None) -> Figure:
    """Paths from above, and over time the errors of the position now, the ranges and the least separation.

    Parameters
    ----------
    histories
        Of each vehicle by its name, all with the same times.
    nearest
        The standoff, m, if there is one.
    separation
        Distance that vehicles keep from each other, m, if there is one.
    """
    figure = style.new_figure(7.6)
    grid = figure.add_gridspec(4, 1, height_ratios=[2.6, 1.0, 1.0, 1.0])
    panels = [figure.add_subplot(grid[0])]
    for row in range(1, 4):
        panels.append(figure.add_subplot(grid[row], sharex=panels[1] if row > 1 else None))
    first = next(iter(histories.values()))
    _paths(panels[0], histories)
    for (name, history), (color, dashes) in zip(histories.items(), style.CURVES, strict=False):
        line = history.target - history.vehicle_pose[:, : history.dimension]
        error = np.where(history.error[:, 0] > 0.0, history.error[:, 0], np.nan)
        panels[1].semilogy(history.t, error, color=color, linestyle=dashes, linewidth=0.9, label=name)
        panels[2].plot(history.t, np.linalg.norm(line, axis=1), color=color, linestyle=dashes, linewidth=0.9)
    panels[1].set_ylabel("error now [m]")
    style.plain_log_ticks(panels[1].yaxis)
    panels[2].set_ylabel("range [m]")
    panels[3].plot(first.t, separations(histories), color=style.BLACK, linewidth=0.9)
    panels[3].set_ylabel("apart [m]")
    for axes, limit, label in ((panels[2], nearest, "standoff"), (panels[3], separation, "separation")):
        axes.set_ylim(bottom=0.0)
        if limit is not None:
            axes.axhline(limit, color=style.BLACK, linestyle=":", linewidth=1.2, label=label)
            axes.legend(loc="lower right" if axes is panels[2] else "upper right")
    for axes in panels[1:3]:
        axes.tick_params(labelbottom=False)
    style.time_axis(panels[3], float(first.t[-1]))
    style.legend_above(figure, panels[0], columns=5)
    return figure


def _paths(axes: Axes, histories: Mapping[str, History]) -> None:
    """Paths of the vehicles and of the target from above; a circle is where one starts, a square where it ends."""
    target = next(iter(histories.values())).target
    shown = [("target", target, style.GREY, "-")]
    for (name, history), (color, dashes) in zip(histories.items(), style.CURVES, strict=False):
        shown.append((name, history.vehicle_pose[:, : history.dimension], color, dashes))
    for name, places, color, dashes in shown:
        axes.plot(places[:, 0], places[:, 1], color=color, linestyle=dashes, linewidth=0.9, label=name)
        axes.plot(*places[0, :2], marker="o", markerfacecolor="white", color=color, linestyle="")
        axes.plot(*places[-1, :2], marker="s", color=color, linestyle="")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_aspect("equal", adjustable="datalim")
