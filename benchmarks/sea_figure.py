"""The figure of a run at sea: python benchmarks/sea_figure.py RUN_DIR [--out FILE.png], after `gbt-ocp run sea2d`."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse
from scipy.stats import chi2

from gbt_ocp.experiments.result import Result
from gbt_ocp.reporting import style
from gbt_ocp.simulation.history import History

EVERY_S = 20.0
"""Time between two ellipses in seconds."""


def draw(history: History, standoff: float) -> Figure:
    """Paths with ellipses and standoff, range with what is believed of it, and the error over time."""
    figure = style.new_figure(6.2)
    grid = figure.add_gridspec(2, 2, height_ratios=[1.7, 1.0])
    paths, range_axes, errors = (figure.add_subplot(place) for place in (grid[0, :], grid[1, 0], grid[1, 1]))
    own, target, mean = history.vehicle_pose[:, :2], history.target[:, :2], history.forecast_mean[:, 0, :2]
    t = history.t
    paths.plot(*own.T, color=style.BLUE, linewidth=0.9, label="vehicle")
    paths.plot(*target.T, color=style.BLACK, linestyle="--", label="target")
    size = np.sqrt(chi2.ppf(0.95, 2))
    for number, second in enumerate(np.arange(EVERY_S, t[-1] + 1e-9, EVERY_S)):
        k = int(np.searchsorted(t, second - 1e-9))
        values, vectors = np.linalg.eigh(history.forecast_cov[k, 0, :2, :2])
        turn = float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))
        label = "95 % ellipse, every 20 s" if number == 0 else None
        paths.add_patch(
            Ellipse(
                tuple(mean[k]),
                2.0 * size * float(np.sqrt(values[1])),
                2.0 * size * float(np.sqrt(values[0])),
                angle=turn,
                fill=False,
                color=style.VERMILLION,
                label=label,
            )
        )
        paths.plot(*mean[k], ".", color=style.VERMILLION)
    paths.add_patch(
        Circle(tuple(target[-1]), standoff, fill=False, color=style.GREY, linestyle=":", label="standoff, at the end")
    )
    paths.plot(*own[0], "o", color=style.BLUE, markersize=4)
    paths.plot(*own[-1], "s", color=style.BLUE, markersize=4)
    paths.set_aspect("equal", adjustable="datalim")
    paths.set_xlabel("x [m]")
    paths.set_ylabel("y [m]")
    style.legend_above(figure, paths, columns=4)

    distance = np.linalg.norm(target - own, axis=1)
    line = mean - own
    believed = np.linalg.norm(line, axis=1)
    sight = line / believed[:, None]
    spread = np.sqrt(np.einsum("ki,kij,kj->k", sight, history.forecast_cov[:, 0, :2, :2], sight))
    range_axes.fill_between(
        t,
        believed - 1.96 * spread,
        believed + 1.96 * spread,
        color=style.SKY,
        alpha=0.5,
        linewidth=0,
        label="believed, 95 %",
    )
    range_axes.plot(t, distance, color=style.BLACK, linewidth=0.9, label="true")
    range_axes.axhline(standoff, color=style.GREY, linestyle=":", label="standoff")
    range_axes.set_ylim(0.0, 1.2 * float(distance.max()))
    range_axes.set_ylabel("range [m]")
    range_axes.legend(loc="lower right", fontsize=7)
    style.time_axis(range_axes, float(t[-1]))

    ten = int(np.argmin(np.abs(np.arange(history.error.shape[1]) - 10)))
    errors.semilogy(t, 100.0 * history.error[:, ten] / distance, color=style.ORANGE, linewidth=0.8, label="10 s ahead")
    errors.semilogy(t, 100.0 * history.error[:, 0] / distance, color=style.BLUE, linewidth=0.8, label="now")
    errors.set_ylim(0.1, 200.0)
    errors.set_ylabel("error [% of range]")
    errors.legend(loc="lower right", fontsize=7)
    style.time_axis(errors, float(t[-1]))
    return figure


def main() -> None:
    """Read the run and write the figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path)
    parser.add_argument("--out", type=Path, default=Path("sea2d.png"))
    chosen = parser.parse_args()
    result = Result.load(chosen.run)
    with style.styled():
        figure = draw(result.history, float(result.configuration.limits.range.nearest_m))  # type: ignore[attr-defined]
        figure.savefig(chosen.out, dpi=style.DPI)


if __name__ == "__main__":
    main()
