"""The figure of the paths: in the plane, or in space beside its projection from above."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse
from matplotlib.ticker import MaxNLocator

from gbt_ocp.reporting import style
from gbt_ocp.reporting.smooth_paths import vehicle_path
from gbt_ocp.simulation.calibration import region_radius
from gbt_ocp.simulation.history import History
from gbt_ocp.typing import Array

ELLIPSES = 6
"""Ellipses of the belief along a path."""

_PATHS: dict[str, dict[str, Any]] = {
    "vehicle": {"color": style.BLUE, "linestyle": "-", "linewidth": 0.9},
    "target": {"color": style.BLACK, "linestyle": "--", "linewidth": 1.3},
    "estimate": {"color": style.VERMILLION, "linestyle": "", "marker": ".", "markersize": 2.5},
}


def trajectories(history: History, nearest: float | None = None) -> Figure:
    """Paths of vehicle and target, with the posterior mean μ_k(t_k), in metres and at equal scales.

    With a standoff (`nearest`, m) ellipses of the belief, and the standoff around the target at the end, are drawn in
    the plane and from above. Estimates far outside the paths, as in the first steps when range is not observable, do
    not stretch the view.
    """
    paths = {
        "vehicle": vehicle_path(history),
        "target": history.target,
        "estimate": history.forecast_mean[:, 0],
    }
    shown = [paths["vehicle"], paths["target"]]
    if nearest is not None:
        shown += [history.target[-1:] - nearest, history.target[-1:] + nearest]
    low, high = _view(np.concatenate(shown))
    if history.dimension == 2:
        # The page has the shape of the paths, within limits: a long straight run leaves no white above and below it.
        shape = float(np.clip((high[0] - low[0]) / (high[1] - low[1]), 1.0, 2.5))
        figure = style.new_figure(0.9 + 5.3 / max(shape, 1.4))
        plane = figure.add_subplot()
    else:
        shape = 1.0
        figure = style.new_figure(3.5 if _flat(low, high) else 4.5)
        # The layout engine ignores the labels of 3D axes: the gap keeps the z label off its neighbour.
        grid = figure.add_gridspec(1, 2, width_ratios=[1.2, 1.0], wspace=0.24)
        space: Any = figure.add_subplot(grid[0], projection="3d", computed_zorder=False)
        _draw_space(space, paths, low, high)
        plane = figure.add_subplot(grid[1])
        plane.set_title("from above")
    _draw_plane(plane, paths, low, high, shape)
    if nearest is not None:
        _draw_beliefs(plane, history, nearest)
    style.legend_above(figure, plane, columns=5)
    return figure


def _view(points: Array) -> tuple[Array, Array]:
    """Corners of the view around the finite points, with a margin; never thinner than a quarter of its width."""
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return -np.ones(points.shape[1]), np.ones(points.shape[1])
    low, high = points.min(axis=0), points.max(axis=0)
    widest = max(float(np.max(high - low)), 1e-3)
    half = np.maximum(0.5 * (high - low) + 0.06 * widest, 0.125 * widest)
    middle = 0.5 * (low + high)
    return middle - half, middle + half


def _flat(low: Array, high: Array) -> bool:
    """Whether the view in space is no taller than wide."""
    return bool(high[2] - low[2] <= np.max(high[:2] - low[:2]))


def _draw_plane(axes: Axes, paths: dict[str, Array], low: Array, high: Array, shape: float) -> None:
    """Plot the paths from above; ``shape`` is the width of the plot over its height, filled at equal scales."""
    width, height = high[:2] - low[:2]
    width, height = max(width, shape * height), max(height, width / shape)
    for name, points in paths.items():
        label = "posterior mean" if name == "estimate" else name
        axes.plot(points[:, 0], points[:, 1], label=label, zorder=3 if name == "target" else 2, **_PATHS[name])
    for name in ("vehicle", "target"):
        ends = {"color": _PATHS[name]["color"], "linestyle": "", "zorder": 4, "markersize": 5.5}
        # Labelled once, in grey: the shape shows start or end, the colour shows which path.
        axes.plot(*paths[name][0, :2], marker="o", markerfacecolor="white", **ends)
        axes.plot(*paths[name][-1, :2], marker="s", **ends)
    axes.plot([], [], marker="o", markerfacecolor="white", color=style.GREY, linestyle="", label="start")
    axes.plot([], [], marker="s", color=style.GREY, linestyle="", label="end")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    x, y = 0.5 * (low[:2] + high[:2])
    axes.set_xlim(x - 0.5 * width, x + 0.5 * width)
    axes.set_ylim(y - 0.5 * height, y + 0.5 * height)
    axes.set_aspect("equal", adjustable="box")


def _draw_beliefs(axes: Axes, history: History, nearest: float) -> None:
    """Ellipses of what is believed of the target, evenly over time, and the standoff around where it was at the end."""
    times = np.linspace(history.t[0], history.t[-1], ELLIPSES + 1)[1:]
    for number, k in enumerate(np.minimum(np.searchsorted(history.t, times - 1e-9), len(history.t) - 1)):
        covariance = history.forecast_cov[k, 0, :2, :2]
        if not np.isfinite(covariance).all():
            continue
        values, vectors = np.linalg.eigh(covariance)
        width, height = 2.0 * region_radius(2) * np.sqrt(np.maximum(values[::-1], 0.0))
        turn = float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))
        look: dict[str, Any] = {"fill": False, "color": style.VERMILLION, "linewidth": 0.8, "zorder": 5}
        label = "95 % ellipse" if number == 0 else None
        centre = tuple(history.forecast_mean[k, 0, :2])
        axes.add_patch(Ellipse(centre, float(width), float(height), angle=turn, label=label, **look))
    place = (float(history.target[-1, 0]), float(history.target[-1, 1]))
    axes.add_patch(Circle(place, nearest, fill=False, color=style.GREY, linestyle=":", label="standoff, at the end"))


def _draw_space(axes: Any, paths: dict[str, Array], low: Array, high: Array) -> None:
    for name, points in paths.items():
        inside = np.all((points >= low) & (points <= high), axis=1)  # 3D axes do not clip
        shown = np.where(inside[:, None], points, np.nan)
        axes.plot(shown[:, 0], shown[:, 1], shown[:, 2], zorder=3 if name == "target" else 2, **_PATHS[name])
    for name in ("vehicle", "target"):
        start, end = paths[name][0], paths[name][-1]
        colour = _PATHS[name]["color"]
        axes.plot(*start[:, None], marker="o", markerfacecolor="white", color=colour, markersize=5.0, zorder=4)
        axes.plot(*end[:, None], marker="s", color=colour, markersize=5.0, zorder=4)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_zlim(low[2], high[2])
    # The labels of a tall box stand far below it, and must fit as well.
    axes.set_box_aspect(tuple(high - low), zoom=0.85 if _flat(low, high) else 0.75)
    widest = float(np.max(high - low))
    for axis, ticks in ((axes.xaxis, 3), (axes.yaxis, 3), (axes.zaxis, 4 if 3.0 * (high[2] - low[2]) > widest else 2)):
        axis.set_major_locator(MaxNLocator(ticks))
    axes.tick_params(pad=0)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_zlabel("z [m]", labelpad=-2.0)
