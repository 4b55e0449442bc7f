"""The noise of bearings that a tracker is built with."""

from __future__ import annotations

import math

from gbt_ocp.experiments.config import tracker as sections
from gbt_ocp.experiments.config.noise import NoiseSection, NoisyBearingsSection, filter_std
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.tracking.noise import BearingNoise


def noise_of(section: sections.GaussianProcessSection, sensor: BearingSensor) -> NoisyBearingsSection | None:
    """How the tracker treats noise; ``None`` if it takes bearings for exact."""
    if section.noise == "sensor":
        return NoisyBearingsSection() if sensor.noise > 0.0 else None
    return section.noise


def bearing_noise(section: NoiseSection, sensor: BearingSensor) -> BearingNoise:
    """Noise of a section; the sensor's white part where it has none."""
    return BearingNoise(
        sensor.noise if section.std_deg is None else math.radians(section.std_deg),
        math.radians(section.correlated_deg),
        section.correlation_s,
        section.own_std_m,
        section.estimated,
    )


def configured_noise(section: sections.TrackerSection, sensor: BearingSensor) -> BearingNoise | None:
    """The noise of bearings that a tracker is given; ``None`` if it takes them for exact or has no model of it."""
    if isinstance(section, sections.ShapeSection | sections.HeldTurnSection):
        return bearing_noise(section.noise, sensor)
    if isinstance(section, sections.GaussianProcessSection):
        noisy = noise_of(section, sensor)
        return None if noisy is None else bearing_noise(noisy, sensor)
    if not hasattr(section, "bearing_std_deg"):
        return None
    return BearingNoise(filter_std(section.bearing_std_deg, sensor.noise))
