"""The page of a replayed log: one HTML file that needs no network, with a map, the range and the residuals."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np

from gbt_ocp.files import packaged_text
from gbt_ocp.frames import utc_of_seconds
from gbt_ocp.reporting import style
from gbt_ocp.reporting.replay_figures import score_table, sensor_table
from gbt_ocp.reporting.tables import Table
from gbt_ocp.simulation.calibration import region_radius
from gbt_ocp.simulation.replayed_track import BearingLog, ReplayedTrack
from gbt_ocp.simulation.run_folder import strict
from gbt_ocp.simulation.sensor_residuals import ANGULAR, track_residuals
from gbt_ocp.typing import Array


def replay_page(log: BearingLog, tracks: Sequence[ReplayedTrack], summary: Mapping[str, Any]) -> str:
    """The page, complete: markup, style, script and data.

    Parameters
    ----------
    log, tracks
        The log and its tracks; the residuals of the first are drawn.
    summary
        Of the replay, for the tables.
    """
    # "</" would end the script element in the middle of a text
    data = json.dumps(strict(_data(log, tracks)), ensure_ascii=False).replace("</", "<\\/")
    pieces = {
        "title": html.escape(f"Tracks of {summary['log']}"),
        "style": packaged_text("gbt_ocp.reporting", "map_page", "map.css"),
        "scores": _html(score_table(summary)) + _html(sensor_table(summary)),
        "script": packaged_text("gbt_ocp.reporting", "map_page", "map.js"),
        "data": data,
    }
    # in one go, so that a mark in a name of the log is left as it is
    page = packaged_text("gbt_ocp.reporting", "map_page", "map.html")
    return re.sub(r"\{\{(\w+)\}\}", lambda mark: pieces[mark[1]], page)


def _html(table: Table) -> str:
    """A table with a row for each column, since there are more of these than of trackers."""
    heads = zip(table.columns, *table.rows, strict=True)
    rows = [
        f"<tr><th>{html.escape(head)}</th>{''.join(f'<td>{html.escape(_shown(cell))}</td>' for cell in cells)}</tr>"
        for head, *cells in heads
    ]
    return f"<table>{''.join(rows)}</table>"


def _shown(cell: Any) -> str:
    return "" if cell is None else f"{cell:g}" if isinstance(cell, float) else str(cell)


def _data(log: BearingLog, tracks: Sequence[ReplayedTrack]) -> dict[str, Any]:
    names = [f"{one.sensor}, {one.kind}" for one in log.sightings]
    sensors = list(dict.fromkeys(names))
    colours = [colour for colour, _ in style.CURVES]
    residuals = [
        float(np.rad2deg(residual[0])) if one.kind in ANGULAR else None
        for one, residual in zip(log.sightings, track_residuals(tracks[0], log), strict=True)
    ]
    seen = log.bearings
    return {
        "times": log.times,
        "clock": [utc_of_seconds(time) for time in log.times.tolist()] if log.since_epoch else None,
        "own": log.own,
        "truth": log.truth,
        "trueRange": None if log.truth is None else np.linalg.norm(log.truth - log.own, axis=1),
        "azimuth": np.arctan2(seen[:, 1], seen[:, 0]),
        "kinds": [one.kind for one in log.sightings],
        "sensors": [{"name": name, "colour": colour} for name, colour in zip(sensors, cycle(colours), strict=False)],
        "sensorOf": [sensors.index(name) for name in names],
        "residuals": residuals,
        "tracks": [_track(log, track, colour) for track, colour in zip(tracks, cycle(colours), strict=False)],
    }


def _track(log: BearingLog, track: ReplayedTrack, colour: str) -> dict[str, Any]:
    distance = np.linalg.norm(track.mean - log.own, axis=1)
    geographic = None
    if log.plane is not None:
        geographic = np.full((len(track.times), 2), np.nan)
        known = np.isfinite(track.mean).all(axis=1)
        latitude, longitude, _ = log.plane.from_plane(track.mean[known])
        geographic[known] = np.rad2deg(np.column_stack([latitude, longitude]))
    return {
        "name": track.name,
        "colour": colour,
        "mean": track.mean,
        "geographic": geographic,
        "range": distance,
        "rangeStd": distance * track.range_std_over_range(log.own),
        "ellipse": _ellipses(track),
    }


def _ellipses(track: ReplayedTrack) -> Array:
    """Half axes in metres and angle of the longer one in radians, of the 95 % ellipses from above ``(K, 3)``."""
    found = np.full((len(track.times), 3), np.nan)
    known = np.isfinite(track.covariance).all(axis=(1, 2))
    values, vectors = np.linalg.eigh(track.covariance[known][:, :2, :2])
    found[known, :2] = region_radius(2) * np.sqrt(np.maximum(values[:, ::-1], 0.0))
    found[known, 2] = np.arctan2(vectors[:, 1, 1], vectors[:, 0, 1])
    return found
