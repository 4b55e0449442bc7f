"""The sections ``vehicles`` and ``link``: several vehicles with the same target, and how they talk."""

from __future__ import annotations

from gbt_ocp.experiments.config.keys import Section, key
from gbt_ocp.experiments.config.vehicle import KnownName, StartSection


class TeamVehicleSection(Section):
    """One of several vehicles: what it has that the section ``vehicle`` does not say."""

    name: str = key(
        ..., "Name of one of several vehicles.", "letters, digits and underscores", pattern=r"^[A-Za-z0-9_]+$"
    )
    model: KnownName | None = key(
        None, "Another vehicle with Fossen's equations, by its name, with its limits; null is the one of vehicle."
    )
    start: StartSection | None = key(None, "Where it starts; null is vehicle.start.")


class LinkSection(Section):
    """How vehicles talk: packets of each to all others, some of which are lost."""

    period_s: float = key(
        0.5, "Time in s from one packet of a vehicle to its next; all send at the same times.", gt=0.0
    )
    loss: float = key(0.0, "Probability that a vehicle does not hear a packet that another one sent.", ge=0.0, le=1.0)
    packet_bytes: int = key(
        64,
        "Largest size of a packet in bytes; the rest of it is bearings.",
        "a whole number from 40 in 2 dimensions (9 more for each further bearing), or 56 in 3 (13 more), to 65535",
        ge=1,
        le=65535,
    )
    latency_s: float = key(0.0, "Time in s from sending a packet to hearing it.", ge=0.0)
    average_s: float = key(2.0, "Longest time in s over which the bearings of a packet are averaged.", gt=0.0)
