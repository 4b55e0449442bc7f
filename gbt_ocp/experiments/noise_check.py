"""The warning that bearings disagree with the noise that was configured, of runs and of replays."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gbt_ocp.experiments.build.estimators import configured_noise
from gbt_ocp.experiments.config.tracker import TrackerSection
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.replayed_track import BearingLog, ReplayedTrack
from gbt_ocp.tracking.disagreement import disagreement, standardised_innovations, standardised_kinks
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array

UNSTATED = math.radians(1.0)
"""Deviation in radians that counts as noise for a tracker that has no noise of its own."""

LEAST = math.radians(0.3)
"""Least deviation in radians that counts as noise: lines of sight bend by so much between bearings."""


def _disagreement(
    section: TrackerSection, sensor: BearingSensor, times: Array, own: Array, bearings: Array, before: Forecast
) -> tuple[float | None, BearingNoise]:
    """How far bearings ``(K, d)`` are off, if far, and the noise they were compared with.

    A tracker without a noise of its own says nothing of how far its forecast may be off, so that only the bearings are
    compared with each other.
    """
    configured = configured_noise(section, sensor)
    seen = np.isfinite(bearings).all(axis=1)
    if configured is None:
        noise = BearingNoise(max(UNSTATED, sensor.noise))
        return disagreement([standardised_kinks(times[seen], bearings[seen], noise)]), noise
    noise = replace(configured, std=max(configured.std, LEAST))
    measures = [
        standardised_innovations(before, own, bearings, noise),
        standardised_kinks(times[seen], bearings[seen], noise),
    ]
    return disagreement(measures), noise


def _line(name: str, ratio: float | None, noise: BearingNoise) -> list[str]:
    if ratio is None:
        return []
    times = f"{ratio:.3g}" if math.isfinite(ratio) else "many"
    deviation = math.degrees(math.hypot(noise.std, noise.correlated_std))
    return [
        f"{name}: a quarter of the bearings are off by more than {times} times what the noise of {deviation:.3g} "
        "degrees explains: several contacts, wrong angles or own positions, too little noise configured, or a track "
        "that was lost"
    ]


def replay_noise_warnings(
    track: ReplayedTrack, log: BearingLog, section: TrackerSection, sensor: BearingSensor
) -> list[str]:
    """A line if the bearings of a log disagree with the noise that its tracker was given; else nothing."""
    found = _disagreement(section, sensor, log.times, log.own, log.bearings, track.before)
    return _line(track.name, *found)


def run_noise_warnings(
    history: History, section: TrackerSection, sensor: BearingSensor, forecast_period: float
) -> list[str]:
    """A line if the bearings of a run disagree with the noise that its tracker was given; else nothing.

    What was expected of a bearing is the forecast of the step before, a period ahead.
    """
    own = history.vehicle_pose[:, : history.dimension]
    place = sensor.period / forecast_period
    index, share = int(place), place - int(place)
    before = Forecast(
        np.full_like(history.forecast_mean[:, 0], np.nan), np.full_like(history.forecast_cov[:, 0], np.nan)
    )
    if index + 1 < history.forecast_mean.shape[1]:
        for one, ahead in zip(before, (history.forecast_mean, history.forecast_cov), strict=True):
            one[1:] = (1.0 - share) * ahead[:-1, index] + share * ahead[:-1, index + 1]
    return _line(section.kind, *_disagreement(section, sensor, history.t, own, history.bearing, before))
