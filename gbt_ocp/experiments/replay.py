"""Replay of a log: recorded own positions and bearings in, the target's track with its uncertainty out."""

from __future__ import annotations

import json
import math
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gbt_ocp.experiments.build.far_priors import far_priors
from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.config import yaml_dialect as dialect
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config, load_tracker
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.experiments.config.tracker import TrackerSection
from gbt_ocp.experiments.logs.read import read_log
from gbt_ocp.experiments.noise_check import replay_noise_warnings
from gbt_ocp.files import optional_module, whole_folder
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.simulation import run_folder
from gbt_ocp.simulation.replay_scores import scores
from gbt_ocp.simulation.replayed_track import BearingLog, ReplayedTrack, _followed
from gbt_ocp.simulation.sensor_residuals import by_sensor
from gbt_ocp.simulation.summary import installed_versions
from gbt_ocp.tracking.gaps import gap_warning
from gbt_ocp.tracking.protocol import PositionTracker

DEFAULT_REPLAY = "replay"
"""The default configuration."""


@dataclass(frozen=True)
class Replayed:
    """A log with the tracks of all trackers.

    Attributes
    ----------
    configuration
        The resolved configuration.
    log
        The log.
    tracks
        One for each tracker.
    summary
        Scores of each tracker by name (see :func:`~gbt_ocp.simulation.replay_scores.scores`), and numbers of the log.
    exports
        Files of the tracks that :meth:`save` writes.
    """

    configuration: Configuration
    log: BearingLog
    tracks: list[ReplayedTrack]
    summary: dict[str, Any]
    exports: tuple[str, ...] = ()

    def save(self, folder: str | os.PathLike[str], figures: bool = True) -> Path:
        """Write the folder: ``config.yaml``, ``summary.json``, ``scores.md``, tracks, ``figures/*.png``.

        Tracks are ``NAME.csv`` and ``NAME-residuals.csv``, ``tracks.geojson``, ``tracks.gpx``, ``tracks.mcap`` and
        ``map.html``, as far as ``replay.export`` asks for them.

        Raises
        ------
        FileExistsError
            If there is something of that name already.
        """
        from gbt_ocp.reporting.replay_figures import draw_replay, score_text  # matplotlib only when something is drawn
        from gbt_ocp.reporting.track_files import write_tracks

        final = Path(folder)
        with whole_folder(final) as temporary:
            (temporary / run_folder.CONFIGURATION).write_text(_without_problem(self.configuration), encoding="utf-8")
            run_folder.write_summary(temporary, self.summary)
            (temporary / "scores.md").write_text(score_text(self.summary) + "\n", encoding="utf-8")
            write_tracks(temporary, self.log, self.tracks, self.summary, self.exports)
            if figures:
                (temporary / run_folder.FIGURES).mkdir()
                for name, figure in draw_replay(self.log, self.tracks, self.configuration.replay.score_from_s).items():
                    figure.savefig(temporary / run_folder.FIGURES / f"{name}.png", dpi=200)
        return final


def replay(
    log: str | os.PathLike[str],
    configuration: str | Path | Mapping[str, Any] = DEFAULT_REPLAY,
    *,
    trackers: Sequence[str] = (),
    bearing_from: str | None = None,
    latency: float | None = None,
    where: Mapping[str, str | float] | None = None,
    mapping: str | os.PathLike[str] | None = None,
    topics: Sequence[str] = (),
    origin_deg: tuple[float, float] | None = None,
    export: Sequence[str] = (),
    overrides: Sequence[str] = (),
    progress: Callable[[str, int, int], None] | None = None,
) -> Replayed:
    """Run trackers over a recorded log.

    Parameters
    ----------
    log
        A log of any format; see :func:`~gbt_ocp.experiments.logs.read.read_log`.
    configuration
        As for :func:`gbt_ocp.run`; its sections ``tracker`` and ``replay`` count.
    trackers
        Names under ``replay.trackers``, or ``tracker.kind`` for the section ``tracker``; by default that one, and all
        of them for ``all``.
    bearing_from, latency
        Replace ``replay.bearing_from`` and ``replay.latency_s``.
    where
        Values by column, added to ``replay.where``.
    mapping, topics, origin_deg, export
        Replace ``replay.mapping``, ``replay.topics``, ``replay.origin_deg`` and ``replay.export``.
    overrides
        ``key.path=value`` strings.
    progress
        Called with the tracker's name, the number of bearings done, and of all.

    Raises
    ------
    ConfigurationError
        If the log, the configuration or a name is wrong; one line a fault.

    Warns
    -----
    RuntimeWarning
        If the log seems to hold several contacts, a prior is centred on the origin far from the vehicle, a tracker
        began a new track after a long gap, or the bearings disagree with the noise that it was given; the summary has
        the same under ``warnings``.
    """
    changes = list(overrides)
    if bearing_from is not None:
        changes.append(f"replay.bearing_from={bearing_from}")
    if latency is not None:
        changes.append(f"replay.latency_s={latency}")
    if where:
        changes.append(f"replay.where={json.dumps(dict(where))}")
    if mapping is not None:
        changes.append(f"replay.mapping={json.dumps(os.fspath(mapping))}")
    if topics:
        changes.append(f"replay.topics={json.dumps(list(topics))}")
    if origin_deg is not None:
        changes.append(f"replay.origin_deg={json.dumps(list(origin_deg))}")
    if export:
        changes.append(f"replay.export={json.dumps(list(export))}")
    config = load_config(configuration, changes, of_log=True)
    section = config.replay
    data = read_log(
        Path(log),
        section.bearing_from,
        section.latency_s,
        section.where,
        mapping=section.mapping,
        topics=section.topics,
        origin_deg=section.origin_deg,
        in_plane=section.in_plane,
        heading_std=math.radians(section.heading_std_deg),
        stds={
            "range": section.range_std_m,
            "size": None if section.size_std_deg is None else math.radians(section.size_std_deg),
        },
    )
    exports = _possible_exports(section.export, data)
    for line in data.warnings:
        warnings.warn(line, RuntimeWarning, stacklevel=2)
    # the dimension is the log's, whatever the problem; nothing else of a problem counts
    config = config.model_copy(update={"tracker": load_tracker(configuration, changes, data.dimension)})
    sensor = BearingSensor(data.period, math.radians(config.bearing_noise_deg))
    tracks = []
    chosen = _trackers(config, configuration, changes, trackers, data.dimension)
    doubts = [f"{name}: {line}" for name, single in chosen.items() for line in far_priors(single, data.own[0], sensor)]
    for line in doubts:
        warnings.warn(f"{log}: {line}", RuntimeWarning, stacklevel=2)
    for name, single in chosen.items():
        tracker = build_tracker(single, data.own[0], sensor)
        if isinstance(tracker, PositionTracker):
            raise ConfigurationError(
                [f"--tracker: found {name}, which needs positions; allowed: those that take bearings"]
            )
        tracks.append(_followed(name, tracker, data, section.ahead_s, progress))
        if not np.isfinite(tracks[-1].mean).any():
            raise ConfigurationError(
                [f"{log}: {name}: {line}; allowed: another tracker" for line in tracks[-1].left_out]
            )
    afterwards = [f"{track.name}: {line}" for track in tracks for line in track.left_out]
    afterwards += [
        gap_warning(", ".join(track.name for track in tracks if track.new_tracks == times), times)
        for times in dict.fromkeys(track.new_tracks for track in tracks)
        if times
    ]
    for track in tracks:
        afterwards.extend(replay_noise_warnings(track, data, chosen[track.name], sensor))
    for line in afterwards:
        warnings.warn(f"{log}: {line}", RuntimeWarning, stacklevel=2)
    summary: dict[str, Any] = {
        "log": str(log),
        "bearings": int(np.sum(np.isfinite(data.bearings).all(axis=1))),
        "measurements": data.kinds,
        "rows_without_bearing": data.own_rows,
        "duration_s": float(data.times[-1] - data.times[0]),
        "warnings": [*data.warnings, *doubts, *afterwards],
        "versions": installed_versions(),
        "trackers": {
            track.name: {
                "new_tracks": len(track.new_tracks),
                "sensors": by_sensor(track, data, section.score_from_s),
            }
            | scores(
                data,
                track.times,
                track.mean,
                track.covariance,
                section.ahead_s,
                section.score_from_s,
                ahead=(track.ahead_mean, track.ahead_covariance),
                residual=track.residual,
                seconds=track.seconds,
            )
            for track in tracks
        },
    }
    for distance in section.constant_range_m:
        guess = data.own + distance * data.bearings
        unknown = np.full((*guess.shape, data.dimension), np.nan)
        summary["trackers"][f"constant {distance:.15g} m"] = scores(
            data, data.times, guess, unknown, section.ahead_s, section.score_from_s
        )
    return Replayed(config, data, tracks, run_folder.strict(summary), exports)


LAST_STAMP = 1.8e10
"""Seconds that a stamp of MCAP holds: 64 bits of nanoseconds."""

EXPORTS = ("csv", "geojson", "gpx", "mcap", "page")
"""Files of the tracks."""


def _possible_exports(asked: Sequence[str], log: BearingLog) -> tuple[str, ...]:
    """Files of the tracks that are written: those that are asked for, or all that can be.

    Raises
    ------
    ConfigurationError
        If one that is asked for cannot be.
    """
    hindrances = {}
    if log.plane is None:
        allowed = "a log with latitude and longitude, or --origin LAT,LON"
        line = f"found positions without a place on the globe; allowed: {allowed}"
        hindrances = {"geojson": line, "gpx": line}
    try:
        optional_module("mcap.writer", "mcap", "MCAP files")
        outside = [time for time in (log.times[0], log.times[-1]) if not 0.0 <= time < LAST_STAMP]
        if outside:
            hindrances["mcap"] = f"found a time of {outside[0]:.15g} s; allowed: those from 0 to {LAST_STAMP:.3g} s"
    except ValueError as fault:
        hindrances["mcap"] = str(fault)
    faults = [f"--export: {name}: {hindrances[name]}" for name in asked if name in hindrances]
    if faults:
        raise ConfigurationError(faults)
    return tuple(asked) or tuple(name for name in EXPORTS if name not in hindrances)


def _without_problem(configuration: Configuration) -> str:
    """The sections that count for a log as a file; loading it again replays the same."""
    resolved = configuration.to_mapping()
    return dialect.dump({name: resolved[name] for name in ("name", "sensor", "tracker", "replay")})


def _trackers(
    config: Configuration,
    source: str | Path | Mapping[str, Any],
    changes: Sequence[str],
    names: Sequence[str],
    dimension: int,
) -> dict[str, TrackerSection]:
    """The section of each of the named trackers."""
    own, further = config.tracker.kind, config.replay.trackers
    allowed = list(dict.fromkeys([own, *further]))
    if list(names) == ["all"]:
        names = allowed
    wrong = [name for name in names if name not in allowed]
    if wrong:
        raise ConfigurationError([f"--tracker: found {name}; allowed: {', '.join(allowed)}" for name in wrong])
    found = {}
    for name in dict.fromkeys(names or [own]):
        if name in further:
            section = json.dumps({"kind": own, **further[name]})
            found[name] = load_tracker(source, [*changes, f"tracker={section}"], dimension)
        else:
            found[name] = config.tracker
    return found
