"""The figures of one run: what the paper's figure 4 shows, with thrust against its limits and solver time.

They need the three files of a run folder and nothing else. Figures are objects made without pyplot, so several runs
may draw at the same time.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.reporting import style
from gbt_ocp.reporting.drawable import drawable_history
from gbt_ocp.reporting.range_figure import range_figure
from gbt_ocp.reporting.team_figure import team_figure
from gbt_ocp.reporting.trajectories import trajectories
from gbt_ocp.simulation import run_folder
from gbt_ocp.simulation.history import History
from gbt_ocp.typing import Array

_AXIS_NAMES = {3: ("surge", "sway", "yaw"), 4: ("surge", "sway", "heave", "yaw")}
_ANSWERS: dict[str, dict[str, Any]] = {
    "shifted": {"marker": "^", "color": style.PURPLE},
    "cold": {"marker": "s", "color": style.ORANGE},
    "unfinished": {"marker": "D", "color": style.ORANGE},
    "braking": {"marker": "X", "color": style.BLACK},
}


def draw_figures(
    history: History,
    configuration: Mapping[str, Any],
    summary: Mapping[str, Any],
    others: Mapping[str, History] | None = None,
) -> dict[str, Figure]:
    """Draw all figures of a run.

    Parameters
    ----------
    history
        The run.
    configuration
        The mapping of ``config.yaml``; read are ``sensor.period_s`` (of a list the shortest) and, if the summary
        lacks it, ``vehicle.thrust_max``.
    summary
        The mapping of ``summary.json``; read are ``settling_s`` and ``thrust_max``.
    others
        Of several vehicles, the histories of all but the first by their names.

    Returns
    -------
    Figures by name: ``vehicles`` (if there are others), ``trajectories``, ``error``, ``condition_number``, ``range``
    (if the configuration has a standoff, ``limits.range.nearest_m``), ``hyperparameters`` (if the tracker has any),
    ``thrust``, and ``solver_time``, or ``tracker_time`` for a guidance without a solver.

    Raises
    ------
    ValueError
        If a value is missing in the configuration, or does not fit the history.
    """
    sensors = configuration.get("sensor")
    if isinstance(sensors, list) and sensors:
        period: Any = min((_value({"sensor": one}, "sensor", "period_s") for one in sensors), default=None)
    else:
        period = _value(configuration, "sensor", "period_s")
    if not isinstance(period, int | float) or not 0.0 < period < np.inf:
        raise ValueError(f"{run_folder.CONFIGURATION}: sensor.period_s: found {period!r}; allowed: a number > 0")
    # of a problem's own vehicle, only the summary has the limits
    known = summary.get("thrust_max")
    limits = known or _value(configuration, "vehicle", "thrust_max")
    axes_count = history.thrust.shape[1]
    if not _are_numbers(limits, axes_count):
        where = f"{run_folder.SUMMARY}: thrust_max" if known else f"{run_folder.CONFIGURATION}: vehicle.thrust_max"
        raise ValueError(f"{where}: found {limits!r}; allowed: {axes_count} numbers")
    thrust_max = np.asarray(limits, dtype=float)
    lower = summary.get("thrust_min")
    thrust_range = ThrustRange(-thrust_max if lower is None else np.asarray(lower, dtype=float), thrust_max)
    settling = summary.get("settling_s")
    nearest = _nearest(configuration)
    figures: dict[str, Figure] = {}
    with style.styled():
        if others:
            name = next((name for name in summary.get("vehicles") or {} if name not in others), "first")
            apart = _positive_number(configuration, "limits", "separation_m")
            figures["vehicles"] = team_figure({name: history, **others}, nearest, apart)
        figures |= {
            "trajectories": trajectories(history, nearest),
            "error": _error(history, 2.0 if settling is None else float(settling)),
            "condition_number": _condition_number(history),
        }
        if nearest is not None:
            figures["range"] = range_figure(history, nearest, _forecast_period(configuration, float(period)))
        if np.isfinite(history.length_scale).any() or np.isfinite(history.amplitude).any():
            figures["hyperparameters"] = _hyperparameters(history)
        figures["thrust"] = _thrust(history, thrust_range, summary.get("inputs"))
        if history.planned.any():
            figures["solver_time"] = _times(history, period)
        elif np.isfinite(history.tracker_time).any():
            figures["tracker_time"] = _times(history, period)
    return figures


def write_figures(run_dir: str | os.PathLike[str]) -> list[Path]:
    """Draw a run folder's figures from its own files into ``figures/*.png`` and return their paths.

    Raises
    ------
    FileNotFoundError
        If a file of the run folder is missing.
    ValueError
        If one is damaged, or lacks a value the figures need.
    """
    folder = Path(run_dir)
    _, configuration = run_folder.read_configuration(folder)
    history = drawable_history(folder)
    others = {path.name: drawable_history(path) for path in run_folder.others_in(folder)}
    figures = draw_figures(history, configuration, run_folder.read_summary(folder), others)
    place = folder / run_folder.FIGURES
    place.mkdir(exist_ok=True)
    paths = []
    for name, figure in figures.items():
        paths.append(place / f"{name}.png")
        figure.savefig(paths[-1], dpi=style.DPI)
    return paths


def _value(configuration: Mapping[str, Any], section: str, key: str) -> Any:
    found = configuration.get(section)
    value = found.get(key) if isinstance(found, dict) else None
    if value is None:
        raise ValueError(f"{run_folder.CONFIGURATION}: {section}.{key}: found nothing; the figures need its value")
    return value


def _nearest(configuration: Mapping[str, Any]) -> float | None:
    """The standoff in m, if the configuration has one."""
    limits = configuration.get("limits")
    range_ = limits.get("range") if isinstance(limits, dict) else None
    found = range_.get("nearest_m") if isinstance(range_, dict) else None
    return float(found) if isinstance(found, int | float) and found > 0.0 else None


def _forecast_period(configuration: Mapping[str, Any], period: float) -> float:
    """Time between two predicted positions in s: `period` where the configuration says nothing else."""
    return _positive_number(configuration, "tracker", "forecast_period_s") or period


def _positive_number(configuration: Mapping[str, Any], section: str, key: str) -> float | None:
    """A number above 0 in a section, if it is there."""
    found = configuration.get(section)
    value = found.get(key) if isinstance(found, dict) else None
    return float(value) if isinstance(value, int | float) and value > 0.0 else None


def _are_numbers(values: Any, count: int) -> bool:
    return (
        isinstance(values, list | tuple)
        and len(values) == count
        and all(isinstance(value, int | float) and value > 0.0 for value in values)
    )


def _error(history: History, settling: float) -> Figure:
    figure = style.new_figure(3.0)
    axes = figure.add_subplot()
    error = _positive(history.mean_error)
    with np.errstate(invalid="ignore"):  # a bound that is infinite at one forecast time is infinite in the mean
        bound = _positive(history.bound.mean(axis=1))
    axes.semilogy(history.t, error, color=style.BLUE, label="mean error over the forecast")
    if np.isfinite(bound).any():
        axes.semilogy(history.t, bound, color=style.VERMILLION, linestyle="--", label="its bound")
    if history.t[0] < settling < history.t[-1]:
        label = f"settling time, {settling:g} s"
        axes.axvline(settling, color=style.GREY, linestyle=":", linewidth=1.0, label=label)
    _log_limits(axes, error, bound)
    axes.set_ylabel("error [m]")
    style.time_axis(axes, history.t[-1])
    style.legend_above(figure, axes, columns=3)
    return figure


def _condition_number(history: History) -> Figure:
    figure = style.new_figure(2.7)
    axes = figure.add_subplot()
    finite = np.isfinite(history.condition_number)
    values = np.full(history.t.shape, np.nan)
    values[finite] = np.log10(np.maximum(history.condition_number[finite], 1.0))
    axes.plot(history.t, values, color=style.BLUE, label="cumulative bearing matrix")
    top = max(1.0, 1.15 * float(np.nanmax(values)) if finite.any() else 1.0)
    singular = np.isinf(history.condition_number)
    if singular.any():
        marks = np.full(np.count_nonzero(singular), 0.96 * top)
        axes.plot(
            history.t[singular],
            marks,
            color=style.VERMILLION,
            marker="^",
            linestyle="",
            clip_on=False,
            label="singular: position not observable",
        )
    axes.set_ylim(0.0, top)
    axes.set_ylabel("log$_{10}$ of the condition number")
    style.time_axis(axes, history.t[-1])
    style.legend_above(figure, axes, columns=2)
    return figure


def _hyperparameters(history: History) -> Figure:
    figure = style.new_figure(3.6)
    upper, lower = figure.subplots(2, 1, sharex=True)
    upper.semilogy(history.t, _positive(history.length_scale), color=style.BLUE)
    upper.set_ylabel("length scale [s]")
    lower.semilogy(history.t, _positive(history.amplitude), color=style.GREEN, linestyle="--")
    lower.set_ylabel("amplitude [m]")
    for axes, values in ((upper, history.length_scale), (lower, history.amplitude)):
        _log_limits(axes, _positive(values))
        style.plain_log_ticks(axes.yaxis)
    style.time_axis(lower, history.t[-1])
    return figure


def _thrust(history: History, limits: ThrustRange, inputs: Any = None) -> Figure:
    count = limits.upper.size
    figure = style.new_figure(0.6 + 1.15 * count)
    panels = np.atleast_1d(figure.subplots(count, 1, sharex=True))
    names = _AXIS_NAMES.get(count, tuple(f"axis {index + 1}" for index in range(count)))
    if isinstance(inputs, list) and len(inputs) == count:
        names = tuple(str(name) for name in inputs)
    relative = np.sign(history.thrust) * limits.used(history.thrust)
    peak = history.piece_thrust_peak
    largest = max(1.0, *(float(np.max(part[np.isfinite(part)], initial=0.0)) for part in (np.abs(relative), peak)))
    for index, (axes, name) in enumerate(zip(panels, names, strict=True)):
        known = np.isfinite(peak[:, index])
        band = np.where(known, peak[:, index], 0.0)
        axes.fill_between(
            history.t,
            -band,
            band,
            step="post",
            color=style.SKY,
            alpha=0.45,
            linewidth=0.0,
            label="± peak over the piece",
        )
        axes.plot(history.t, relative[:, index], color=style.BLUE, linewidth=0.8, label="at the start of the piece")
        for limit in (-1.0, 1.0):
            axes.axhline(limit, color=style.VERMILLION, linestyle="--", linewidth=1.0, label="limit")
        # Solvers stop at about 1e-8 of their limits, which is not marked as a violation.
        above = known & (peak[:, index] > 1.0 + 1e-6)
        if above.any():
            axes.plot(
                history.t[above], band[above], color=style.BLACK, marker="x", linestyle="", label="above the limit"
            )
        axes.set_ylim(-1.2 * largest, 1.2 * largest)
        axes.set_ylabel(f"{name} [–]")
        axes.set_xlim(history.t[0], history.t[-1])
    style.time_axis(panels[-1], history.t[-1])
    figure.supylabel("thrust / limit", fontsize=9.0)
    crossed = [axes for axes in panels if "above the limit" in axes.get_legend_handles_labels()[1]]
    style.legend_above(figure, (crossed or list(panels))[0], columns=4)
    return figure


def _times(history: History, period: float) -> Figure:
    figure = style.new_figure(3.2)
    axes = figure.add_subplot()
    planned = history.planned
    failed = planned & ~history.answered
    solver = 1e3 * history.solver_time
    tracker = 1e3 * history.tracker_time
    series = [np.array([1e3 * period])]
    if planned.any():
        good = planned & (history.fallback == "") & ~failed
        axes.plot(
            history.t[good], solver[good], color=style.BLUE, marker="o", markersize=2.0, linestyle="", label="solver"
        )
        other = failed & (history.fallback == "")
        if other.any():
            axes.plot(
                history.t[other], solver[other], color=style.VERMILLION, marker="x", linestyle="", label="not solved"
            )
        for word, look in _ANSWERS.items():
            chosen = history.fallback == word
            if chosen.any():
                axes.plot(history.t[chosen], solver[chosen], linestyle="", label=f"fallback: {word}", **look)
        median = float(np.median(solver[planned]))
        axes.axhline(median, color=style.BLUE, linestyle="--", linewidth=1.0, label=f"solver median, {median:.3g} ms")
        series.append(solver[planned])
    if np.isfinite(tracker).any():
        axes.plot(
            history.t, tracker, color=style.GREEN, marker="+", markersize=3.0, linewidth=0.5, label="tracker", zorder=1
        )
        series.append(tracker)
    axes.axhline(1e3 * period, color=style.BLACK, linestyle="-", linewidth=1.0, label="sampling period")
    axes.set_yscale("log")
    _log_limits(axes, *(_positive(values) for values in series))
    style.plain_log_ticks(axes.yaxis)
    axes.set_ylabel("time per step [ms]")
    style.time_axis(axes, history.t[-1])
    style.legend_above(figure, axes, columns=4)
    return figure


def _positive(values: Array) -> Array:
    """Values that a logarithmic axis can show; NaN for zero, negative and infinite ones."""
    return np.where(np.isfinite(values) & (values > 0.0), values, np.nan)


def _log_limits(axes: Axes, first: Array, *others: Array) -> None:
    """Show all of the first series. Others, such as a bound, widen the view by at most three decades on either side."""
    finite = first[np.isfinite(first)]
    if not finite.size:
        return
    low, high = float(finite.min()), float(finite.max())
    for values in others:
        within = values[np.isfinite(values)]
        if within.size:
            low = min(low, max(float(within.min()), 1e-3 * low))
            high = max(high, min(float(within.max()), 1e3 * high))
    if high < 10.0 * low:  # at least a decade, which the ticks of a logarithmic axis need
        middle = np.sqrt(low * high)
        low, high = middle / np.sqrt(10.0), middle * np.sqrt(10.0)
    axes.set_ylim(low / 1.4, high * 1.4)
