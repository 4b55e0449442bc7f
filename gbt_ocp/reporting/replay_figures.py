"""Figures and the table of a replayed log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from gbt_ocp.reporting import style
from gbt_ocp.reporting.glossary import SCORE_COLUMNS, SENSOR_COLUMNS
from gbt_ocp.reporting.tables import Table
from gbt_ocp.simulation.calibration import region_radius
from gbt_ocp.simulation.replayed_track import BearingLog, ReplayedTrack

ELLIPSES = 6
"""Ellipses drawn along the track of the first tracker."""

UNSETTLED = 0.1
"""Share of the log at its start that does not set the limits of a map, since nothing is known there yet."""


def score_text(summary: Mapping[str, Any]) -> str:
    """The tables of scores and of residuals by sensor in Markdown, with what their columns are."""
    scores, sensors = score_table(summary), sensor_table(summary)
    text = [
        scores.markdown(),
        "",
        *(f"- {head}: {SCORE_COLUMNS[head]}" for head in scores.columns if head in SCORE_COLUMNS),
    ]
    if sensors.rows:
        text += ["", sensors.markdown(), "", *(f"- {head}: {says}" for head, says in SENSOR_COLUMNS.items())]
    return "\n".join(text)


def sensor_table(summary: Mapping[str, Any]) -> Table:
    """Residuals by tracker and sensor."""
    table = Table("residuals by sensor", ["tracker", "sensor", "count", "mean", "std"])
    for name, found in summary["trackers"].items():
        for row in found.get("sensors", []):
            spread = [_listed(row[key], row["unit"]) for key in ("mean", "std")]
            table.add(name, f"{row['sensor']}, {row['kind']}", row["count"], *spread)
    return table


def _listed(values: Sequence[float] | None, unit: str) -> str:
    return "" if values is None else f"{', '.join(f'{value:.3g}' for value in values)} {unit}"


def score_table(summary: Mapping[str, Any]) -> Table:
    """The scores of all trackers. Without a truth in the log, those that need none."""
    scored = any("error_median" in found for found in summary["trackers"].values())
    columns = ["tracker", "range std / range %", "observable %", "residual std deg", "ms a bearing"]
    if scored:
        columns[1:1] = ["median %", "RMS %", "95 % %", "NEES", "cov", "range median %", "ahead median %", "ahead cov"]
    table = Table(f"{summary['log']}: errors in per cent of the true range", columns)
    for name, found in summary["trackers"].items():
        errors = [
            _percent(found.get("error_median")),
            _percent(found.get("error_rms")),
            _percent(found.get("error_q95")),
            _plain(found.get("nees_median")),
            _plain(found.get("coverage")),
            _percent(found.get("range_error_median")),
            _percent(found.get("ahead_error_median")),
            _plain(found.get("ahead_coverage")),
        ]
        table.add(
            name,
            *(errors if scored else []),
            _percent(found.get("range_std_over_range_median")),
            _percent(found.get("observable_share")),
            _plain(found.get("residual_std_deg")),
            _plain(found.get("update_ms_mean")),
        )
    return table


def _plain(value: float | None) -> float | None:
    return None if value is None else round(value, 2)


def _percent(value: float | None) -> float | None:
    return None if value is None else round(100.0 * value, 1)


def draw_replay(log: BearingLog, tracks: Sequence[ReplayedTrack], score_from: float) -> dict[str, Figure]:
    """Figures by name: ``track`` (seen from above), ``range`` (with its spread and the error), ``residuals``.

    Parameters
    ----------
    log
        The log.
    tracks
        The tracks; the first is drawn with its uncertainty.
    score_from
        Time in seconds after the first bearing from which the ranges set the limits of their axis.
    """
    with style.styled():
        return {
            "track": _track(log, tracks),
            "range": _range(log, tracks, score_from),
            "residuals": _residuals(log, tracks),
        }


def _track(log: BearingLog, tracks: Sequence[ReplayedTrack]) -> Figure:
    figure = style.new_figure(4.6)
    axes = figure.add_subplot()
    axes.plot(*log.own[:, :2].T, color=style.GREY, label="own vehicle")
    if log.truth is not None:
        axes.plot(*log.truth[:, :2].T, color=style.BLACK, linewidth=1.8, label="target")
    begin = int(UNSETTLED * len(log.times))
    points = [log.own[:, :2]] + ([log.truth[:, :2]] if log.truth is not None else [])
    for track, (colour, line) in zip(tracks, cycle(style.CURVES), strict=False):
        axes.plot(*track.mean[begin:, :2].T, color=colour, linestyle=line, linewidth=1.0, label=track.name)
        if track is tracks[0]:  # a baseline that diverges does not shrink the others to a dot
            points.append(track.mean[begin:, :2])
    first = tracks[0]
    for k in np.linspace(begin, len(log.times) - 1, ELLIPSES).astype(int):
        _ellipse(axes, first, int(k), style.CURVES[0][0])
    inside = np.concatenate([values[np.isfinite(values).all(axis=1)] for values in points])
    low, high = np.quantile(inside, 0.01, axis=0), np.quantile(inside, 0.99, axis=0)
    margin = 0.12 * max(float(np.max(high - low)), 1.0)
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    style.legend_above(figure, axes, 4)
    return figure


def _ellipse(axes: Axes, track: ReplayedTrack, k: int, colour: str) -> None:
    covariance = track.covariance[k, :2, :2]
    if not np.all(np.isfinite(covariance)):
        return
    values, vectors = np.linalg.eigh(covariance)
    width, height = 2.0 * region_radius(2) * np.sqrt(np.maximum(values[::-1], 0.0))
    angle = float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))
    axes.add_patch(Ellipse(tuple(track.mean[k, :2]), width, height, angle=angle, fill=False, color=colour, alpha=0.6))


def _range(log: BearingLog, tracks: Sequence[ReplayedTrack], score_from: float) -> Figure:
    figure = style.new_figure(5.2 if log.truth is not None else 4.0)
    rows = 3 if log.truth is not None else 2
    upper, middle, *lower = figure.subplots(rows, 1, sharex=True)
    t = log.times - log.times[0]
    if log.truth is not None:
        true = np.linalg.norm(log.truth - log.own, axis=1)
        upper.plot(t, true, color=style.BLACK, linewidth=1.8, label="target")
    for number, (track, (colour, line)) in enumerate(zip(tracks, cycle(style.CURVES), strict=False)):
        distance = np.linalg.norm(track.mean - log.own, axis=1)
        relative = track.range_std_over_range(log.own)
        upper.plot(t, distance, color=colour, linestyle=line, label=track.name)
        if number == 0:
            low, high = distance * np.maximum(1.0 - 2.0 * relative, 0.0), distance * (1.0 + 2.0 * relative)
            upper.fill_between(t, low, high, color=colour, alpha=0.15, linewidth=0.0)
        middle.plot(t, relative, color=colour, linestyle=line)
        if log.truth is not None:
            error = np.linalg.norm(track.mean - log.truth, axis=1) / true
            lower[0].plot(t, 100.0 * error, color=colour, linestyle=line)
    settled = t >= score_from
    shown = [np.linalg.norm(track.mean - log.own, axis=1)[settled] for track in tracks[:1]]
    top = np.nanmax(np.concatenate([*shown, [1.0]]))
    upper.set_ylim(0.0, 2.2 * top)
    middle.set_ylim(0.0, 1.5)
    middle.axhline(0.25, color=style.GREY, linewidth=0.8)
    upper.set_ylabel("range [m]")
    middle.set_ylabel("range std / range")
    if lower:
        lower[0].set_ylim(0.0, 150.0)
        lower[0].set_ylabel("error [% of range]")
    style.time_axis(lower[0] if lower else middle, float(t[-1]))
    style.legend_above(figure, upper, 4)
    return figure


def _residuals(log: BearingLog, tracks: Sequence[ReplayedTrack]) -> Figure:
    figure = style.new_figure(1.2 + 1.1 * len(tracks))
    panels = np.atleast_1d(figure.subplots(len(tracks), 1, sharex=True, sharey=True))
    t = log.times - log.times[0]
    names = np.array([one.sensor for one in log.sightings])
    sensors = list(dict.fromkeys(names.tolist()))
    for axes, track, (colour, _) in zip(panels, tracks, cycle(style.CURVES), strict=False):
        for name, (of_sensor, _) in zip(sensors, cycle(style.CURVES), strict=False):
            single = len(sensors) == 1
            for values in np.rad2deg(track.residual[names == name]).T:
                label = None if single or axes is not panels[0] else name
                axes.plot(
                    t[names == name], values, ".", color=colour if single else of_sensor, markersize=1.5, label=label
                )
        axes.set_title(track.name, loc="left")
        axes.set_ylabel("residual [deg]")
    known = [np.abs(np.rad2deg(track.residual[np.isfinite(track.residual)])) for track in tracks]
    spread = max((float(np.quantile(values, 0.98)) for values in known if values.size), default=1.0)
    panels[0].set_ylim(-1.3 * max(spread, 1e-9), 1.3 * max(spread, 1e-9))
    style.time_axis(panels[-1], float(t[-1]))
    if len(sensors) > 1:
        style.legend_above(figure, panels[0], 4)
    return figure
