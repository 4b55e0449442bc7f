"""From the section ``sensor`` to the sensors of the simulated world, and to what trackers know of them."""

from __future__ import annotations

import math

import numpy as np

from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.experiments.config.sensor import ListedSensorSection, SensorSection
from gbt_ocp.models.measurements import Mounting
from gbt_ocp.models.sensors import BearingSensor, SimulatedSensor
from gbt_ocp.simulation.sensing import Sensing


def build_sensor(configuration: Configuration) -> BearingSensor:
    """The bearing sensor; of a list, one with the loop's period and the largest noise of a bearing."""
    section = configuration.sensor
    if not isinstance(section, SensorSection):
        return BearingSensor(configuration.period_s, math.radians(configuration.bearing_noise_deg))
    return BearingSensor(
        section.period_s,
        math.radians(section.noise_deg),
        section.missed_probability,
        math.radians(section.outlier_deg),
        section.outlier_every_s,
        section.latency_s,
    )


def build_sensors(configuration: Configuration, rng: np.random.Generator) -> Sensing | None:
    """The listed sensors, each with random draws of its own; ``None`` if there is one bearing sensor."""
    sections = configuration.sensor
    if isinstance(sections, SensorSection):
        return None
    made = [simulated_sensor(section) for section in sections]
    return Sensing(made, configuration.period_s, rng.spawn(len(made)))


def simulated_sensor(section: ListedSensorSection) -> SimulatedSensor:
    """One of the listed sensors."""
    return SimulatedSensor(
        section.name,
        section.kind,
        section.period_s,
        std=math.radians(section.noise_deg) if section.noise_deg is not None else section.noise_m,
        share=section.noise_share,
        missed_probability=section.missed_probability,
        latency=section.latency_s,
        frame=section.frame,
        heading_std=math.radians(section.heading_std_deg),
        mounting=Mounting(section.mounting or (), math.radians(section.mounting_yaw_deg)),
        size=section.size_m,
    )
