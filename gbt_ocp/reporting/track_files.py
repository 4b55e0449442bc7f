"""Replayed tracks as files of others: CSV, GeoJSON, GPX, and MCAP for Foxglove."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.files import optional_module
from gbt_ocp.frames import utc_of_seconds
from gbt_ocp.reporting.replay_page import replay_page
from gbt_ocp.simulation.calibration import region_radius
from gbt_ocp.simulation.replayed_track import BearingLog, ReplayedTrack
from gbt_ocp.simulation.run_folder import strict
from gbt_ocp.simulation.sensor_residuals import ANGULAR, track_residuals
from gbt_ocp.typing import Array

OUTLINES = 12
"""Ellipses of a track in GeoJSON."""

CORNERS = 36
"""Corners of an ellipse."""


def write_tracks(
    folder: Path, log: BearingLog, tracks: list[ReplayedTrack], summary: Mapping[str, Any], kinds: Sequence[str]
) -> None:
    """Write the tracks of a log into a folder, in the kinds of files that are asked for.

    Parameters
    ----------
    folder
        Where.
    log, tracks, summary
        The log, its tracks and their scores.
    kinds
        Some of ``csv`` (``NAME.csv``, ``NAME-residuals.csv``), ``geojson``, ``gpx``, ``mcap`` (``tracks.KIND``) and
        ``page`` (``map.html``).

    Raises
    ------
    ValueError
        If MCAP is asked for and its library is not installed.
    """
    if "csv" in kinds:
        for track in tracks:
            write_track_csv(folder / f"{track.name}.csv", track, log)
            write_residuals_csv(folder / f"{track.name}-residuals.csv", track, log)
    if "geojson" in kinds:
        text = json.dumps(strict(geojson(log, tracks)), ensure_ascii=False)
        (folder / "tracks.geojson").write_text(text, encoding="utf-8")
    if "gpx" in kinds:
        (folder / "tracks.gpx").write_bytes(gpx(log, tracks))
    if "mcap" in kinds:
        write_mcap(folder / "tracks.mcap", log, tracks)
    if "page" in kinds:
        (folder / "map.html").write_text(replay_page(log, tracks, summary), encoding="utf-8")


def write_track_csv(path: Path, track: ReplayedTrack, log: BearingLog) -> None:
    """One line for each measurement: time, position, its covariance, range with deviation, residual in degrees.

    Positions are also in latitude and longitude where the log is on the globe.
    """
    d = log.dimension
    axes = "xyz"[:d]
    pairs = [(i, j) for i in range(d) for j in range(i, d)]
    relative = track.range_std_over_range(log.own)
    distance = np.linalg.norm(track.mean - log.own, axis=1)
    columns = [
        track.times,
        *track.mean.T,
        *(track.covariance[:, i, j] for i, j in pairs),
        distance,
        relative * distance,
        *np.rad2deg(track.residual).T,
    ]
    names = ["t", *axes, *(f"cov_{axes[i]}{axes[j]}" for i, j in pairs), "range", "range_std"]
    names += ["residual_deg"] if d == 2 else ["residual_1_deg", "residual_2_deg"]
    if log.plane is not None:
        names += ["lat_deg", "lon_deg", *(["height_m"] if d == 3 else [])]
        columns += [*_geographic(log, track.mean).T]
    # the shortest text that reads back as the same number: a map coordinate or an absolute time loses nothing
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(np.column_stack(columns).tolist())


def write_residuals_csv(path: Path, track: ReplayedTrack, log: BearingLog) -> None:
    """One line for each measurement: time, sensor, kind, and its residual by component in degrees or metres."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["t", "sensor", "kind", "residual_1", "residual_2", "residual_3", "unit"])
        for one, residual in zip(log.sightings, track_residuals(track, log), strict=True):
            angular = one.kind in ANGULAR
            values = (np.rad2deg(residual) if angular else residual).tolist()
            cells = [value if np.isfinite(value) else "" for value in values]
            cells += [""] * (3 - len(cells))
            writer.writerow([one.time, one.sensor, one.kind, *cells, "deg" if angular else "m"])


def _geographic(log: BearingLog, positions: Array) -> Array:
    """Latitude and longitude in degrees, and in space the height in metres ``(K, d)``; NaN stays."""
    assert log.plane is not None, "asked for only where it is known"
    found = np.full(positions.shape, np.nan)
    known = np.isfinite(positions).all(axis=1)
    latitude, longitude, height = log.plane.from_plane(positions[known])
    columns = [np.rad2deg(latitude), np.rad2deg(longitude), height][: positions.shape[1]]
    found[known] = np.column_stack(columns)
    return found


def _lines(log: BearingLog, tracks: Iterable[ReplayedTrack]) -> Iterator[tuple[str, Array, Array]]:
    """Name, times and positions of every line on the map; only those that are known."""
    lines = [("own vehicle", log.times, log.own)]
    if log.truth is not None:
        lines.append(("target, true", log.times, log.truth))
    lines += [(track.name, track.times, track.mean) for track in tracks]
    for name, times, positions in lines:
        known = np.isfinite(positions).all(axis=1)
        if known.any():
            yield name, times[known], positions[known]


def geojson(log: BearingLog, tracks: list[ReplayedTrack]) -> dict[str, Any]:
    """Tracks, the own vehicle's way and 95 % ellipses as a FeatureCollection (RFC 7946, WGS 84).

    Each line has ``times`` in seconds, one for each of its points. The log is one on the globe.
    """

    def feature(kind: str, coordinates: Any, properties: dict[str, Any]) -> dict[str, Any]:
        return {
            "type": "Feature",
            "geometry": {"type": kind, "coordinates": coordinates},
            "properties": properties,
        }

    def swapped(positions: Array) -> list[list[float]]:
        """Longitude first."""
        places = _geographic(log, positions)
        places[:, :2] = places[:, 1::-1]
        return [list(place) for place in places.tolist()]

    features = []
    for name, times, positions in _lines(log, tracks):
        if len(positions) > 1:
            features.append(feature("LineString", swapped(positions), {"name": name, "times": times.tolist()}))
    for track in tracks:
        for k in _outlined(track):
            ring = swapped(_ellipse(track, k))
            properties = {"name": f"{track.name}, 95 %", "time": float(track.times[k])}
            features.append(feature("Polygon", [[*ring, ring[0]]], properties))
    return {"type": "FeatureCollection", "features": features}


def _outlined(track: ReplayedTrack) -> list[int]:
    """Numbers of the measurements at which an ellipse is drawn."""
    known = np.flatnonzero(np.isfinite(track.covariance).all(axis=(1, 2)) & np.isfinite(track.mean).all(axis=1))
    if not len(known):
        return []
    chosen: list[int] = np.unique(known[np.linspace(0, len(known) - 1, OUTLINES).astype(int)]).tolist()
    return chosen


def _ellipse(track: ReplayedTrack, k: int) -> Array:
    """Corners of the 95 % ellipse from above ``(C, d)``."""
    values, vectors = np.linalg.eigh(track.covariance[k, :2, :2])
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    corners = np.tile(track.mean[k], (CORNERS, 1))
    corners[:, :2] += region_radius(2) * (circle * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    return corners


GPX = "http://www.topografix.com/GPX/1/1"
"""Name space of GPX 1.1."""


def gpx(log: BearingLog, tracks: list[ReplayedTrack]) -> bytes:
    """Tracks and the own vehicle's way as GPX 1.1, with times where those of the log are dates."""
    root = ElementTree.Element("gpx", {"version": "1.1", "creator": "gbt_ocp", "xmlns": GPX})
    for name, times, positions in _lines(log, tracks):
        line = ElementTree.SubElement(root, "trk")
        ElementTree.SubElement(line, "name").text = name
        segment = ElementTree.SubElement(line, "trkseg")
        for time, place in zip(times.tolist(), _geographic(log, positions).tolist(), strict=True):
            point = ElementTree.SubElement(segment, "trkpt", {"lat": repr(place[0]), "lon": repr(place[1])})
            if len(place) == 3:
                ElementTree.SubElement(point, "ele").text = repr(place[2])
            if log.since_epoch:
                ElementTree.SubElement(point, "time").text = utc_of_seconds(time)
    ElementTree.indent(root)
    text: str = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


_STAMP = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}


def _object(**properties: Any) -> dict[str, Any]:
    return {"type": "object", "properties": {"timestamp": _STAMP, **properties}}


_OF_NUMBER = {"type": "number"}
_OF_NUMBERS = {"type": "array", "items": _OF_NUMBER}
_POSE = {
    "type": "object",
    "properties": {
        "position": {"type": "object", "properties": dict.fromkeys("xyz", _OF_NUMBER)},
        "orientation": {"type": "object", "properties": dict.fromkeys("xyzw", _OF_NUMBER)},
    },
}
SCHEMAS = {
    "foxglove.PoseInFrame": _object(frame_id={"type": "string"}, pose=_POSE),
    "foxglove.LocationFix": _object(
        frame_id={"type": "string"}, latitude=_OF_NUMBER, longitude=_OF_NUMBER, altitude=_OF_NUMBER,
        position_covariance=_OF_NUMBERS, position_covariance_type={"type": "integer"},
    ),
    "gbt_ocp.Range": _object(range=_OF_NUMBER, range_std=_OF_NUMBER, residual_deg=_OF_NUMBERS),
}  # fmt: skip
"""JSON schemas of the messages; Foxglove draws the first two by their names."""


def write_mcap(path: Path, log: BearingLog, tracks: list[ReplayedTrack]) -> None:
    """Positions, places on the globe and ranges with their deviations as MCAP with messages in JSON.

    Times are from 0 on and fit into 64 bits as nanoseconds.

    Raises
    ------
    ValueError
        If mcap is not installed.
    """
    writing = optional_module("mcap.writer", "mcap", "MCAP files")
    with path.open("wb") as stream:
        writer = writing.Writer(stream)
        writer.start(profile="", library="gbt_ocp")
        schemas = {
            name: writer.register_schema(name=name, encoding="jsonschema", data=json.dumps(schema).encode())
            for name, schema in SCHEMAS.items()
        }
        messages = [message for line in _mcap_lines(log, tracks) for message in line]
        channels: dict[str, int] = {}
        for time, topic, kind, content in sorted(messages, key=lambda one: one[0]):
            if topic not in channels:
                channels[topic] = writer.register_channel(topic=topic, message_encoding="json", schema_id=schemas[kind])
            seconds = int(time)
            nano = min(round(1e9 * (time - seconds)), 999_999_999)
            content = {"timestamp": {"sec": seconds, "nsec": nano}, **content}
            stamp = seconds * 10**9 + nano
            data = json.dumps(content).encode()
            writer.add_message(channel_id=channels[topic], log_time=stamp, data=data, publish_time=stamp)
        writer.finish()


Message = tuple[float, str, str, dict[str, Any]]


def _mcap_lines(log: BearingLog, tracks: list[ReplayedTrack]) -> Iterator[Iterator[Message]]:
    for name, times, positions in _lines(log, tracks):
        topic = f"/{name.replace(', ', '_').replace(' ', '_')}"
        yield _poses(f"{topic}/pose", times, positions)
        if log.plane is not None:
            yield _fixes(f"{topic}/fix", times, _geographic(log, positions))
    for track in tracks:
        yield _ranges(f"/{track.name.replace(' ', '_')}/range", track, log)


def _poses(topic: str, times: Array, positions: Array) -> Iterator[Message]:
    level = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    for time, place in zip(times.tolist(), positions.tolist(), strict=True):
        position = dict(zip("xyz", [*place, 0.0], strict=False))
        yield time, topic, "foxglove.PoseInFrame", {
            "frame_id": "map", "pose": {"position": position, "orientation": level},
        }  # fmt: skip


def _fixes(topic: str, times: Array, places: Array) -> Iterator[Message]:
    for time, place in zip(times.tolist(), places.tolist(), strict=True):
        yield time, topic, "foxglove.LocationFix", {
            "frame_id": "map", "latitude": place[0], "longitude": place[1], "altitude": [*place, 0.0][2],
            "position_covariance": [0.0] * 9, "position_covariance_type": 0,
        }  # fmt: skip


def _ranges(topic: str, track: ReplayedTrack, log: BearingLog) -> Iterator[Message]:
    distance = np.linalg.norm(track.mean - log.own, axis=1)
    deviation = distance * track.range_std_over_range(log.own)
    known: NDArray[np.bool_] = np.isfinite(distance) & np.isfinite(deviation)
    for k in np.flatnonzero(known).tolist():
        residual = [value for value in np.rad2deg(track.residual[k]).tolist() if np.isfinite(value)]
        content = {"range": float(distance[k]), "range_std": float(deviation[k]), "residual_deg": residual}
        yield float(track.times[k]), topic, "gbt_ocp.Range", content
