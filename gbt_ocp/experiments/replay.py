"""Replay of a log: recorded own positions and bearings in, the target's track with its uncertainty out."""

from __future__ import annotations

import csv
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
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config, load_tracker
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.experiments.config.tracker import TrackerSection
from gbt_ocp.experiments.logs.read import read_log
from gbt_ocp.experiments.noise_check import replay_noise_warnings
from gbt_ocp.files import whole_folder
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.simulation import run_folder
from gbt_ocp.simulation.replay_scores import scores
from gbt_ocp.simulation.replayed_track import BearingLog, ReplayedTrack, _followed
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
    """

    configuration: Configuration
    log: BearingLog
    tracks: list[ReplayedTrack]
    summary: dict[str, Any]

    def save(self, folder: str | os.PathLike[str], figures: bool = True) -> Path:
        """Write the folder: ``config.yaml``, ``summary.json``, ``scores.md``, ``NAME.csv``, ``figures/*.png``.

        Raises
        ------
        FileExistsError
            If there is something of that name already.
        """
        from gbt_ocp.reporting.replay_figures import draw_replay, score_table  # matplotlib only when something is drawn

        final = Path(folder)
        with whole_folder(final) as temporary:
            (temporary / run_folder.CONFIGURATION).write_text(self.configuration.to_yaml(), encoding="utf-8")
            run_folder.write_summary(temporary, self.summary)
            (temporary / "scores.md").write_text(score_table(self.summary).markdown() + "\n", encoding="utf-8")
            for track in self.tracks:
                _write_track(temporary / f"{track.name}.csv", track, self.log)
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
    mapping, topics, origin_deg
        Replace ``replay.mapping``, ``replay.topics`` and ``replay.origin_deg``.
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
    config = load_config(configuration, changes)
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
    )
    for line in data.warnings:
        warnings.warn(line, RuntimeWarning, stacklevel=2)
    # the dimension is the log's, whatever the problem; nothing else of a problem counts
    config = config.model_copy(update={"tracker": load_tracker(configuration, changes, data.dimension)})
    sensor = BearingSensor(data.period, math.radians(config.sensor.noise_deg))
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
    afterwards = [
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
        "bearings": len(data.times),
        "rows_without_bearing": data.own_rows,
        "duration_s": float(data.times[-1] - data.times[0]),
        "warnings": [*data.warnings, *doubts, *afterwards],
        "versions": installed_versions(),
        "trackers": {
            track.name: {"new_tracks": len(track.new_tracks)}
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
    return Replayed(config, data, tracks, run_folder.strict(summary))


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


def _write_track(path: Path, track: ReplayedTrack, log: BearingLog) -> None:
    """One line for each bearing: time, position, its covariance, range with deviation, residual in degrees."""
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
    # the shortest text that reads back as the same number: a map coordinate or an absolute time loses nothing
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(np.column_stack(columns).tolist())
