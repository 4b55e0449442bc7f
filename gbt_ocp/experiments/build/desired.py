"""From the section ``desired_bearing`` to λ*(t), with a turn that the vehicle can follow at its standoff."""

from __future__ import annotations

import math

from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.guidance.pacing import circling_speed, horizontal_radius, turn_period
from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.models.vehicles import Vehicle


def orbit_range(configuration: Configuration) -> float:
    """Range in m at which the vehicle circles: where the pull ends, and not within the standoff."""
    return max(configuration.standoff or 0.0, configuration.planner.range_reference_m)


def reachable_speed(configuration: Configuration, vehicle: Vehicle) -> float:
    """Steady speed in m/s on that circle: what drag and thrust allow, within ``limits.speed``."""
    radius = horizontal_radius(configuration.dimension, orbit_range(configuration))
    speed = circling_speed(vehicle, radius, configuration.planner.gamma)
    return min(speed, configuration.limits.speed or math.inf)


def shortest_turn(configuration: Configuration, vehicle: Vehicle) -> float:
    """Seconds of the fastest turn that the vehicle keeps up around a target at ``desired_bearing.target_speed``.

    Raises
    ------
    ValueError
        If the target may outrun the vehicle.
    """
    speed, target = reachable_speed(configuration, vehicle), configuration.desired_bearing.target_speed
    if not speed > target:
        raise ValueError(
            f"desired_bearing.target_speed: found {target:.3g}; allowed: a number < {speed:.3g} m/s, what the vehicle "
            f"reaches at {orbit_range(configuration):.4g} m from the target"
        )
    return turn_period(horizontal_radius(configuration.dimension, orbit_range(configuration)), speed - target)


def build_desired_bearing(configuration: Configuration, vehicle: Vehicle) -> DesiredBearing:
    """λ*(t): ω = 2π/(T m), one turn in ``period_s``, or the fastest turn that the vehicle keeps up; with reversals.

    Raises
    ------
    ValueError
        If the period is to be chosen and the target may outrun the vehicle.
    """
    section = configuration.desired_bearing
    if section.period_s == "auto":
        turn = shortest_turn(configuration, vehicle)
    elif section.period_s is not None:
        turn = section.period_s
    else:
        assert section.m is not None, "checked when the configuration was read"
        turn = configuration.period_s * section.m
    return DesiredBearing(
        configuration.dimension,
        2.0 * math.pi / turn,
        section.axis or (0.0, 0.0, 1.0),
        reverse=section.reverse_s or math.inf,
    )


def unreachable_bearings(configuration: Configuration, vehicle: Vehicle) -> list[str]:
    """A warning if the desired bearing turns faster than the vehicle can follow at its standoff; else nothing."""
    section = configuration.desired_bearing
    if configuration.standoff is None or section.period_s == "auto" or configuration.guidance.kind != "planner":
        return []
    turn = section.period_s or configuration.period_s * (section.m or 1)
    range_, speed = orbit_range(configuration), reachable_speed(configuration, vehicle)
    radius = horizontal_radius(configuration.dimension, range_)
    needed = 2.0 * math.pi * radius / turn + section.target_speed
    if needed <= speed * (1.0 + 1e-9):
        return []
    advice = ""
    if speed > section.target_speed:
        advice = f"; allowed here: period_s >= {turn_period(radius, speed - section.target_speed):.1f}, or auto"
    return [
        f"desired_bearing: a turn in {turn:.4g} s at {range_:.4g} m from a target of {section.target_speed:.3g} m/s "
        f"needs {needed:.3g} m/s, the vehicle reaches {speed:.3g} m/s{advice}"
    ]
