"""The warning that bearings disagree with the noise that was configured, of runs and of replays."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.experiments.build.noise import configured_noise
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


def _at_least(noise: BearingNoise) -> BearingNoise:
    return replace(noise, std=max(noise.std, LEAST))


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
    """A line if the bearings of a log disagree with the noise that its tracker was given; else nothing.

    A tracker without a noise of its own says nothing of how far its forecast may be off, so that only the bearings are
    compared with each other.
    """
    configured = configured_noise(section, sensor)
    for chosen, noise in _noises(log, configured, sensor):
        measures = [standardised_kinks(log.times[chosen], log.bearings[chosen], noise)]
        if configured is not None:
            before = Forecast(track.before.mean[chosen], track.before.covariance[chosen])
            measures.append(standardised_innovations(before, log.own[chosen], log.bearings[chosen], noise))
        lines = _line(track.name, disagreement(measures), noise)
        if lines:
            return lines
    return []


def _noises(
    log: BearingLog, configured: BearingNoise | None, sensor: BearingSensor
) -> Iterator[tuple[NDArray[np.bool_], BearingNoise]]:
    """Which bearings have which noise: those that do not say theirs the configured one, each sensor its own."""
    seen = np.isfinite(log.bearings).all(axis=1)
    stds = np.array([np.nanmax(one.std) if np.isfinite(one.std).any() else np.nan for one in log.sightings])
    silent = seen & np.isnan(stds)
    if silent.any():
        yield silent, BearingNoise(max(UNSTATED, sensor.noise)) if configured is None else _at_least(configured)
    names = np.array([one.sensor for one in log.sightings])
    for name in dict.fromkeys(names[seen & ~silent].tolist()):
        of_sensor = seen & ~silent & (names == name)
        yield of_sensor, _at_least(BearingNoise(float(np.median(stds[of_sensor]))))


def run_noise_warnings(
    history: History,
    section: TrackerSection,
    sensor: BearingSensor,
    forecast_period: float,
    each_its_own: bool = False,
) -> list[str]:
    """A line if the bearings of a run disagree with the noise that its tracker was given; else nothing.

    What was expected of a bearing is the forecast of the step before, a period ahead. A tracker without a noise of its
    own has none that could differ from the sensor's. The bearings are not compared with each other: they are of one
    target, which a vehicle may pass so near that its direction jumps. Where each measurement says its own noise, as of
    several sensors, the largest of them counts if it is above that of the tracker.
    """
    configured = configured_noise(section, sensor)
    if configured is None:
        return []
    noise = _at_least(configured)
    if each_its_own:
        noise = replace(noise, std=max(noise.std, sensor.noise))
    own = history.vehicle_pose[:, : history.dimension]
    place = sensor.period / forecast_period
    index, share = int(place), place - int(place)
    before = Forecast(
        np.full_like(history.forecast_mean[:, 0], np.nan), np.full_like(history.forecast_cov[:, 0], np.nan)
    )
    if index + 1 < history.forecast_mean.shape[1]:
        for one, ahead in zip(before, (history.forecast_mean, history.forecast_cov), strict=True):
            one[1:] = (1.0 - share) * ahead[:-1, index] + share * ahead[:-1, index + 1]
    measures = [standardised_innovations(before, own, history.bearing, noise)]
    return _line(section.kind, disagreement(measures), noise)
