"""From a checked configuration to the closed loops of several vehicles, and what lies between them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from gbt_ocp.experiments.build.loop import build_loop, build_member, build_vehicle
from gbt_ocp.experiments.build.world import Streams, build_start, build_target
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.experiments.config.team import TeamVehicleSection
from gbt_ocp.guidance.apart import sides_of
from gbt_ocp.guidance.others import OtherVehicles
from gbt_ocp.models.known_vehicles import KNOWN_VEHICLES
from gbt_ocp.pilot.teamwork import Exchange
from gbt_ocp.simulation.channel import Channel
from gbt_ocp.simulation.closed_loop import ClosedLoop
from gbt_ocp.typing import Array

LEAST_SAID_STD = 1.0e-4
"""Deviation in radians of a bearing from a sensor without noise: what a packet rounds it to."""


@dataclass(frozen=True)
class TeamMember:
    """One of several vehicles.

    Attributes
    ----------
    name
        Its name; empty for one alone.
    configuration
        That of the run with its own section ``vehicle``.
    loop
        Its parts.
    start
        Where it starts ``(L, n)``.
    """

    name: str
    configuration: Configuration
    loop: ClosedLoop
    start: Array


def build_team(configuration: Configuration) -> tuple[list[TeamMember], Channel | None]:
    """The vehicles of a run, and the channel between them if there are several.

    The first has the random draws of a vehicle alone.

    Raises
    ------
    ValueError
        If the parts of one do not go together, or starts do not keep ``limits.separation_m``.
    """
    if not configuration.vehicles:
        return [TeamMember("", configuration, *build_loop(configuration))], None
    target = build_target(configuration, Streams.of(configuration.seed).target)
    names, d = tuple(one.name for one in configuration.vehicles), configuration.dimension
    all_own = [of_member(configuration, section) for section in configuration.vehicles]
    all_streams = [Streams.of(configuration.seed, number) for number in range(len(names))]
    starts: list[Array] = []
    for number, (own, streams) in enumerate(zip(all_own, all_streams, strict=True)):
        with _naming(number):
            taken = [start[0, :d] for start in starts]
            starts.append(build_start(own, build_vehicle(own), streams.start, target.position(0.0), taken))
    sides = sides_of([start[0, :d] for start in starts])
    members: list[TeamMember] = []
    for number, (own, streams, start) in enumerate(zip(all_own, all_streams, starts, strict=True)):
        others = OtherVehicles(sides[number])
        exchange = _exchange(own, number, names, others)
        with _naming(number):
            loop = build_member(own, streams, target, start, exchange, others)
        members.append(TeamMember(names[number], own, loop, start))
    link = configuration.link
    rng = np.random.default_rng(np.random.SeedSequence(configuration.seed, spawn_key=(len(names), 1)))
    return members, Channel(link.period_s, link.loss, link.latency_s, rng)


@contextmanager
def _naming(number: int) -> Iterator[None]:
    """Say of a fault which of the vehicles has it."""
    try:
        yield
    except ValueError as fault:
        raise ValueError(f"vehicles.{number}: {fault}") from fault


def of_member(configuration: Configuration, section: TeamVehicleSection) -> Configuration:
    """The configuration with the section ``vehicle`` of one of several."""
    changed: dict[str, object] = {}
    if section.start is not None:
        changed["start"] = section.start
    if section.model is not None:
        lower, upper = KNOWN_VEHICLES[section.model].limits(configuration.dimension)
        changed |= {
            "parameters": section.model,
            "thrust_max": tuple(upper),
            "thrust_min": None if lower is None else tuple(lower),
        }
    return configuration.model_copy(update={"vehicle": configuration.vehicle.model_copy(update=changed)})


def _exchange(configuration: Configuration, number: int, names: tuple[str, ...], others: OtherVehicles) -> Exchange:
    link = configuration.link
    noise = getattr(configuration.tracker, "noise", None)
    # what a tracker counts a bearing with is what it says of its own to others
    deviation = getattr(noise, "std_deg", None)
    degrees = deviation if isinstance(deviation, float) else configuration.bearing_noise_deg
    return Exchange(
        number,
        names,
        configuration.dimension,
        packet_bytes=link.packet_bytes,
        period=link.period_s,
        average=link.average_s,
        bearing_std=max(math.radians(degrees), LEAST_SAID_STD),
        others=others,
        delay=link.latency_s + getattr(configuration.sensor, "latency_s", 0.0),
    )
