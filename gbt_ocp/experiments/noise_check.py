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

UNSTATED = math.radians(1.0)
"""Deviation in radians that counts as noise for a tracker that has no noise of its own."""

LEAST = math.radians(0.3)
"""Least deviation in radians that counts as noise: lines of sight bend by so much between bearings."""


def _noise(section: TrackerSection, sensor: BearingSensor) -> BearingNoise:
    noise = configured_noise(section, sensor)
    return BearingNoise(max(UNSTATED, sensor.noise)) if noise is None else replace(noise, std=max(noise.std, LEAST))


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
    noise = _noise(section, sensor)
    ratio = disagreement(
        [
            standardised_innovations(track.before, log.own, log.bearings, noise),
            standardised_kinks(log.times, log.bearings, noise),
        ]
    )
    return _line(track.name, ratio, noise)


def run_noise_warnings(
    history: History, section: TrackerSection, sensor: BearingSensor, forecast_period: float
) -> list[str]:
    """A line if the bearings of a run disagree with the noise that its tracker was given; else nothing.

    What was expected of a bearing is the forecast of the step before, a period ahead.
    """
    d = history.dimension
    noise = _noise(section, sensor)
    bearings, own = history.bearing, history.vehicle_pose[:, :d]
    seen = np.isfinite(bearings).all(axis=1)
    measures = [standardised_kinks(history.t[seen], bearings[seen], noise)]
    place = sensor.period / forecast_period
    index, share = int(place), place - int(place)
    if index + 1 < history.forecast_mean.shape[1]:
        mean, covariance = (
            (1.0 - share) * values[:-1, index] + share * values[:-1, index + 1]
            for values in (history.forecast_mean, history.forecast_cov)
        )
        measures.append(standardised_innovations(Forecast(mean, covariance), own[1:], bearings[1:], noise))
    return _line(section.kind, disagreement(measures), noise)
