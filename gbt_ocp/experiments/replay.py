"""Replay of a log: recorded own positions and bearings in, the target's track with its uncertainty out."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.bearings import tangent_basis
from gbt_ocp.experiments import run_folder
from gbt_ocp.experiments.build_trackers import build_tracker
from gbt_ocp.experiments.configuration import Configuration
from gbt_ocp.experiments.faults import ConfigurationError
from gbt_ocp.experiments.loading import load_config
from gbt_ocp.experiments.replay_log import BearingLog, read_log
from gbt_ocp.experiments.replay_scores import scores
from gbt_ocp.experiments.summary import installed_versions
from gbt_ocp.tracking.protocol import PositionTracker, Tracker, relative_range_std

Array = NDArray[np.float64]

SHIPPED = "replay"
"""The configuration that is taken where none is given."""


@dataclass(frozen=True)
class ReplayedTrack:
    """What one tracker made of a log, at the time of each of its K bearings.

    Attributes
    ----------
    name
        Of the tracker.
    times
        ``(K,)`` in seconds.
    mean, covariance
        Position after the bearing, ``(K, d)`` in m and ``(K, d, d)`` in m²; NaN where the tracker has none.
    ahead_mean, ahead_covariance
        The same predicted ``ahead_s`` ahead.
    residual
        Measured bearing less the one predicted before it was known, in the tangent plane, ``(K, d-1)`` in radians.
    seconds
        Time the update took ``(K,)``.
    """

    name: str
    times: Array
    mean: Array
    covariance: Array
    ahead_mean: Array
    ahead_covariance: Array
    residual: Array
    seconds: Array

    def range_std_over_range(self, own: Array) -> Array:
        """Posterior deviation of the range over the range, seen from ``own`` ``(K, d)``: ``(K,)``."""
        return relative_range_std(self.mean, self.covariance, own)


@dataclass(frozen=True)
class Replayed:
    """A log with the tracks of all trackers.

    Attributes
    ----------
    configuration
        What was asked for.
    log
        The log.
    tracks
        One a tracker.
    summary
        Of each tracker by name (see :func:`~gbt_ocp.experiments.replay_scores.scores`), and what concerns all.
    """

    configuration: Configuration
    log: BearingLog
    tracks: list[ReplayedTrack]
    summary: dict[str, Any]

    def save(self, folder: str | os.PathLike[str], figures: bool = True) -> Path:
        """Write the folder whole: ``config.yaml``, ``summary.json``, ``scores.md``, ``NAME.csv``, ``figures/*.png``.

        Raises
        ------
        FileExistsError
            If there is something of that name already.
        """
        from gbt_ocp.reporting.replay import draw_replay, score_table  # matplotlib only when something is drawn

        final = Path(folder)
        with run_folder.whole_folder(final) as temporary:
            (temporary / run_folder.CONFIGURATION).write_text(self.configuration.to_yaml(), encoding="utf-8")
            run_folder.write_summary(temporary, self.summary)
            (temporary / "scores.md").write_text(score_table(self.summary).markdown() + "\n", encoding="utf-8")
            for track in self.tracks:
                _write_track(temporary / f"{track.name}.csv", track, self.log)
            if figures:
                (temporary / run_folder.FIGURES).mkdir()
                for name, figure in draw_replay(self).items():
                    figure.savefig(temporary / run_folder.FIGURES / f"{name}.png", dpi=200)
        return final


def replay(
    log: str | os.PathLike[str],
    configuration: str | Path | Mapping[str, Any] = SHIPPED,
    *,
    trackers: Sequence[str] = (),
    bearing_from: str | None = None,
    latency: float | None = None,
    overrides: Sequence[str] = (),
    progress: Callable[[str, int, int], None] | None = None,
) -> Replayed:
    """Run trackers over a recorded log.

    Parameters
    ----------
    log
        CSV file; see :func:`~gbt_ocp.experiments.replay_log.read_log`.
    configuration
        As for :func:`gbt_ocp.run`; its sections ``tracker`` and ``replay`` count.
    trackers
        Names under ``replay.trackers``, or ``tracker.kind`` for the section ``tracker``; by default that one, and all
        of them for ``all``.
    bearing_from, latency
        Replace ``replay.bearing_from`` and ``replay.latency_s``.
    overrides
        ``key.path=value`` strings.
    progress
        Called with the tracker's name, the number of bearings done, and of all.

    Raises
    ------
    ConfigurationError
        If the log, the configuration or a name is wrong; one line a fault.
    """
    changes = list(overrides)
    if bearing_from is not None:
        changes.append(f"replay.bearing_from={bearing_from}")
    if latency is not None:
        changes.append(f"replay.latency_s={latency}")
    # a plane problem stands for all: of the problem nothing but its dimension counts
    config = load_config(configuration, changes)
    section = config.replay
    if section.bearing_from is None:
        allowed = "x (counter-clockwise from +x), north (clockwise from +y)"
        raise ConfigurationError([f"--bearing-from: found nothing, nor replay.bearing_from; allowed: {allowed}"])
    data = read_log(Path(log), section.bearing_from, section.latency_s)
    if data.dimension != config.dimension:
        changes = [*changes, f"problem={'case2' if data.dimension == 2 else 'case5'}"]
        config = load_config(configuration, changes)
    chosen = _trackers(config, configuration, changes, trackers)
    tracks = []
    for name, single in chosen.items():
        single = single.model_copy(update={"sensor": single.sensor.model_copy(update={"period_s": data.period})})
        tracker = build_tracker(single, data.own[0])
        if isinstance(tracker, PositionTracker):
            raise ConfigurationError(
                [f"--tracker: found {name}, which needs positions; allowed: those that take bearings"]
            )
        tracks.append(_followed(name, tracker, data, section.ahead_s, progress))
    summary: dict[str, Any] = {
        "log": str(log),
        "bearings": len(data.times),
        "duration_s": float(data.times[-1] - data.times[0]),
        "versions": installed_versions(),
        "trackers": {
            track.name: scores(
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
        summary["trackers"][f"constant {distance:g} m"] = scores(
            data, data.times, guess, unknown, section.ahead_s, section.score_from_s
        )
    return Replayed(config, data, tracks, run_folder.strict(summary))


def _trackers(
    config: Configuration, source: str | Path | Mapping[str, Any], changes: Sequence[str], names: Sequence[str]
) -> dict[str, Configuration]:
    """A configuration for each tracker that is asked for."""
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
            found[name] = load_config(source, [*changes, f"tracker={section}"])
        else:
            found[name] = config
    return found


def _followed(
    name: str,
    tracker: Tracker,
    log: BearingLog,
    ahead: float,
    progress: Callable[[str, int, int], None] | None,
) -> ReplayedTrack:
    count, d = log.own.shape
    means, covariances = np.empty((2, count, d)), np.empty((2, count, d, d))
    residual, seconds = np.full((count, d - 1), np.nan), np.empty(count)
    for k, t in enumerate(log.times):
        if k:
            residual[k] = _angle_from(tracker.predict([t]).mean[0] - log.own[k], log.bearings[k])
        began = perf_counter()
        tracker.update(t, log.bearings[k], log.own[k])
        seconds[k] = perf_counter() - began
        forecast = tracker.predict([t, t + ahead])
        means[:, k], covariances[:, k] = forecast.mean, forecast.covariance
        if progress is not None:
            progress(name, k + 1, count)
    return ReplayedTrack(name, log.times, means[0], covariances[0], means[1], covariances[1], residual, seconds)


def _angle_from(line: Array, bearing: Array) -> Array:
    """Angle from a line of sight to a bearing, along the tangent plane of the line ``(d-1,)`` in radians."""
    distance = float(np.linalg.norm(line))
    if not distance > 0.0 or not np.isfinite(distance):
        return np.full(len(line) - 1, np.nan)
    unit = line / distance
    tangent = tangent_basis(unit).T @ bearing
    sine = float(np.linalg.norm(tangent))
    return np.asarray(tangent * (np.arctan2(sine, unit @ bearing) / sine if sine > 1e-12 else 1.0))


def _write_track(path: Path, track: ReplayedTrack, log: BearingLog) -> None:
    """One line a bearing: time, position, its covariance, range with deviation, residual in degrees."""
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
    np.savetxt(path, np.column_stack(columns), fmt="%.6g", delimiter=",", header=",".join(names), comments="")
