"""From a checked configuration to the parts of a pilot."""

from __future__ import annotations

import numpy as np

from gbt_ocp.experiments.build.desired import build_desired_bearing, paced
from gbt_ocp.experiments.build.loop import build_guidance, build_vehicle
from gbt_ocp.experiments.build.sensors import build_sensor, simulated_sensor
from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.build.world import Streams
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.experiments.config.sensor import SensorSection
from gbt_ocp.ocp.follower import BANDWIDTH
from gbt_ocp.pilot.pilot_parts import PilotParts


def build_pilot(configuration: Configuration) -> PilotParts:
    """The parts of a pilot: those of the closed loop without target, sensor and plant.

    Raises
    ------
    ValueError
        If there are several vehicles, which a pilot does not hear, or the parts do not go together.
    """
    if configuration.vehicles:
        raise ValueError(f"vehicles: found {len(configuration.vehicles)}; allowed: none for a pilot")
    vehicle, sensor = build_vehicle(configuration), build_sensor(configuration)
    desired = paced(configuration, build_desired_bearing(configuration, vehicle), vehicle)
    tracker = build_tracker(configuration.tracker, np.zeros(configuration.dimension), sensor)
    listed = () if isinstance(configuration.sensor, SensorSection) else configuration.sensor
    return PilotParts(
        tracker=tracker,
        guidance=build_guidance(configuration, vehicle, desired, Streams.of(configuration.seed).guidance, tracker),
        vehicle=vehicle,
        period=configuration.period_s,
        forecast=configuration.tracker.forecast,
        forecast_period=configuration.forecast_period,
        follow_bandwidth=configuration.vehicle.follow_bandwidth or BANDWIDTH,
        thrust_lag=getattr(configuration.vehicle, "thrust_lag_s", None),
        lead=configuration.setpoint_lead,
        late=configuration.pilot.late_s,
        navigation_gap=configuration.pilot.navigation_gap_s,
        bearing_std=sensor.noise,
        tracker_at=lambda own: build_tracker(configuration.tracker, own, sensor),
        input_rate=configuration.limits.input_rate,
        sensors={section.name: simulated_sensor(section) for section in listed},
    )
