"""The figure of a run that keeps a range: range with what is believed of it, errors as shares of it, power."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import norm

from gbt_ocp.reporting import style
from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.track_summary import AHEAD_S
from gbt_ocp.typing import Array

BELIEVED = 0.95
"""Probability of the band of ranges."""


def range_figure(history: History, nearest: float, forecast_period: float) -> Figure:
    """Range and standoff, errors in per cent of the range, and the power of the thrusters, over time.

    Parameters
    ----------
    history
        The run.
    nearest
        The standoff, m.
    forecast_period
        Time between two predicted positions, s.
    """
    powered = bool(np.isfinite(history.power[:-1]).any())
    figure = style.new_figure(6.6 if powered else 4.8)
    panels = figure.subplots(3 if powered else 2, 1, sharex=True, height_ratios=[1.5, 1.0, 1.0][: 2 + powered])
    range_ = np.linalg.norm(history.target - history.vehicle_pose[:, : history.dimension], axis=1)
    _ranges(panels[0], history, range_, nearest)
    _errors(panels[1], history, range_, forecast_period)
    if powered:
        _power(panels[2], history)
    style.time_axis(panels[-1], float(history.t[-1]))
    for axes in panels:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.02), handlelength=1.6)
    return figure


def _ranges(axes: Axes, history: History, range_: Array, nearest: float) -> None:
    t = history.t
    line = history.forecast_mean[:, 0] - history.vehicle_pose[:, : history.dimension]
    believed = np.linalg.norm(line, axis=1)
    sight = line / np.maximum(believed, 1e-9)[:, None]
    spread = np.sqrt(np.maximum(np.einsum("ki,kij,kj->k", sight, history.forecast_cov[:, 0], sight), 0.0))
    reach = float(norm.ppf(0.5 + 0.5 * BELIEVED))
    low, high = np.maximum(believed - reach * spread, 0.0), believed + reach * spread
    axes.fill_between(t, low, high, color=style.SKY, alpha=0.5, linewidth=0.0, label="believed, 95 %")
    axes.plot(t, range_, color=style.BLACK, linewidth=0.9, label="true")
    axes.axhline(nearest, color=style.VERMILLION, linestyle="--", linewidth=1.0, label="standoff")
    gave = history.gave_way
    if gave.any():
        marks = np.zeros(np.count_nonzero(gave))
        share = f"a limit gave way,\n{np.count_nonzero(gave)} of {np.count_nonzero(history.planned)} plans"
        axes.plot(t[gave], marks, color=style.PURPLE, marker="|", markersize=7.0, linestyle="", label=share)
    top = max(1.2 * float(np.nanmax(range_)), 1.3 * nearest)
    axes.set_ylim(-0.03 * top, top)
    axes.set_ylabel("range [m]")


def _errors(axes: Axes, history: History, range_: Array, forecast_period: float) -> None:
    ahead = round(AHEAD_S / forecast_period)
    shown = [(0, "now", style.BLUE, "-")]
    if 0 < ahead < history.error.shape[1] and abs(ahead * forecast_period - AHEAD_S) < 1e-6:
        shown.insert(0, (ahead, f"{AHEAD_S:g} s ahead", style.ORANGE, "-"))
    for index, label, color, look in shown:
        share = 100.0 * history.error[:, index] / np.maximum(range_, 1e-9)
        axes.semilogy(
            history.t, np.where(share > 0.0, share, np.nan), color=color, linestyle=look, linewidth=0.9, label=label
        )
    axes.set_ylim(0.1, 200.0)
    axes.set_ylabel("error [% of range]")
    style.plain_log_ticks(axes.yaxis)


def _power(axes: Axes, history: History) -> None:
    power = np.nan_to_num(history.power[:-1], nan=0.0)
    energy = np.concatenate([[0.0], np.cumsum(power * np.diff(history.t))])
    axes.step(history.t[:-1], power, where="post", color=style.GREEN, linewidth=0.7, label="thrusters")
    axes.set_ylabel("power [W]")
    axes.set_ylim(0.0, max(1.1 * float(np.quantile(power, 0.99)), 1e-9))
    axes.plot([], [], color=style.BLACK, linestyle="-.", label=f"energy, to {energy[-1]:.3g} J")
    beside = axes.twinx()
    beside.plot(history.t, energy, color=style.BLACK, linestyle="-.", linewidth=0.9)
    beside.set_ylim(0.0, max(1.05 * float(energy[-1]), 1e-9))
    beside.set_yticks([])
    beside.grid(False)
