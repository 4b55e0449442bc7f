"""What a section of a tracker knows of the target's speed, range and size."""

from __future__ import annotations

from typing import TypeAlias

from gbt_ocp.experiments.config import tracker as sections
from gbt_ocp.tracking.priors import LogNormal

NoisySection: TypeAlias = sections.ShapeSection | sections.HeldTurnSection


def speed_prior(section: NoisySection) -> LogNormal:
    """Of the speed in m/s."""
    return LogNormal(section.speed.median, section.speed.log_std)


def range_prior(section: NoisySection) -> LogNormal:
    """Of the range in metres at the first bearing."""
    return LogNormal(section.range.median_m, section.range.log_std)


def size_prior(size: tuple[float, ...] | None) -> LogNormal | None:
    """Of the true size in metres, from its median and the share by which it may differ."""
    return None if size is None else LogNormal(*size)
