"""What a run begins with: its random draws, the target's motion, and where the vehicle starts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.experiments.config.target import TrackTargetSection, TurningTargetSection
from gbt_ocp.experiments.config.vehicle import DrivenVehicleSection, StartSection
from gbt_ocp.models.contracts import made
from gbt_ocp.models.known_vehicles import KNOWN_DRIVEN
from gbt_ocp.models.model_checks import check_target
from gbt_ocp.models.targets import Target, TrackTarget, case_target
from gbt_ocp.models.turning import TurningTarget
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.ocp.problem_data import joined_derivatives
from gbt_ocp.typing import Array

MOST_STARTS = 1000
"""Starts that are drawn for one of several vehicles until it is far enough from those before it."""


@dataclass(frozen=True)
class Streams:
    """Independent random streams of one seed: a change of the sensor's noise does not move the start."""

    start: np.random.Generator
    sensor: np.random.Generator
    guidance: np.random.Generator
    target: np.random.Generator
    plant: np.random.Generator

    @classmethod
    def of(cls, seed: int, vehicle: int = 0) -> Streams:
        """The streams of a seed, for one of several vehicles."""
        root = np.random.SeedSequence(seed, spawn_key=(5, vehicle)) if vehicle else np.random.SeedSequence(seed)
        return cls(*(np.random.default_rng(child) for child in root.spawn(5)))


def build_target(configuration: Configuration, rng: np.random.Generator | None = None) -> Target:
    """The target's motion; ``rng`` for one that is drawn, by default that of the configuration's seed.

    Raises
    ------
    ValueError
        If the problem's own target lacks something, or its motion cannot be drawn or read.
    """
    section = configuration.target
    if isinstance(section, TurningTargetSection):
        return TurningTarget(
            configuration.dimension,
            Streams.of(configuration.seed).target if rng is None else rng,
            duration=configuration.duration_s + configuration.tracker.forecast * configuration.forecast_period,
            start=section.start_m or np.zeros(configuration.dimension),
            speed=section.speed,
            speed_std=section.speed_std,
            turn_rate_max=section.turn_rate_max,
            hold=section.hold_s,
            climb_rate_max=section.climb_rate_max,
        )
    if isinstance(section, TrackTargetSection):
        return TrackTarget.from_csv(
            section.path,
            configuration.dimension,
            length_scale=section.length_scale,
            time_scale=section.time_scale,
            start=section.start_m,
            start_time=section.start_time_s,
        )
    if section.kind == "problem":
        factory = configuration.problem_object.target
        assert callable(factory), "checked when the configuration was read"
        target: Target = made("target", factory)
        check_target(target, configuration.dimension)
        return target
    step = getattr(section, "turn_rate_step", 0.0)
    return case_target(int(section.kind[-1]), turn_rate_step=step, every_s=getattr(section, "every_s", 10.0))


def build_start(
    configuration: Configuration,
    vehicle: Vehicle,
    rng: np.random.Generator,
    target: Array,
    taken: Sequence[Array] = (),
) -> Array:
    """The continuous derivatives of the flat output at the start ``(k+1, n)``: at rest, at a given place.

    Or somewhere in the box, or at a given distance from where the target starts, ``target`` ``(d,)``; in space within
    30° of its level. A speed is ahead, along the yaw; a vehicle that is not flat has one of its own. What is drawn is
    drawn again until it keeps ``limits.separation_m`` from places ``(d,)`` that are ``taken``.

    Raises
    ------
    ValueError
        If a place that is given does not keep that distance, or none is found.
    """
    section, d = configuration.vehicle.start, configuration.dimension
    least = configuration.limits.separation_m or 0.0
    for _ in range(MOST_STARTS):
        place = _drawn_place(section, d, rng, target)
        if all(np.linalg.norm(place - other) >= least for other in taken):
            break
    else:
        raise ValueError(
            f"start: found no place {least:g} m from the vehicles before it; allowed: starts that keep "
            "limits.separation_m"
        )
    plan = configuration.planner
    joined = 2 if plan.form == "shooting" else joined_derivatives(plan.degree, plan.continuity)
    flat = np.zeros((joined, vehicle.flat_dimension))
    flat[0, :d] = place
    if vehicle.flat_dimension > configuration.dimension:
        flat[0, configuration.dimension] = math.radians(section.yaw_deg)
    speed = section.speed
    if speed is None and isinstance(configuration.vehicle, DrivenVehicleSection):
        speed = KNOWN_DRIVEN[configuration.vehicle.model].cruise
    yaw = math.radians(section.yaw_deg)
    flat[1, :2] = (speed or 0.0) * np.array([math.cos(yaw), math.sin(yaw)])
    return flat


def _drawn_place(section: StartSection, dimension: int, rng: np.random.Generator, target: Array) -> Array:
    """Where the vehicle starts ``(d,)``; the same is drawn whether or not it is given."""
    place = rng.uniform(-section.box_m, section.box_m, dimension)
    if section.range_m is not None:
        azimuth, elevation = rng.uniform(-math.pi, math.pi), rng.uniform(-0.5, 0.5) if dimension == 3 else 0.0
        level = math.sqrt(1.0 - elevation**2)
        away = [level * math.cos(azimuth), level * math.sin(azimuth), elevation]
        place = target + section.range_m * np.array(away[:dimension])
    return place if section.position_m is None else np.array(section.position_m)
