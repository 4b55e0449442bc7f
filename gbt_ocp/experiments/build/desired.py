"""From the section ``desired_bearing`` to λ*(t), with a turn that the vehicle can follow at its standoff."""

from __future__ import annotations

import math

from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.guidance.pacing import PacedBearing, circling_speed, horizontal_radius, steady_speed, turn_period
from gbt_ocp.guidance.swept import DesiredTurn, SweptBearing
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


def paced(configuration: Configuration, desired: DesiredBearing, vehicle: Vehicle) -> DesiredTurn:
    """λ*(t) as the planner follows it: slowed down for a far target if that is asked for, or bearings are noisy.

    Where each plan begins it at the line of sight nothing needs slowing down: a speed is that of the vehicle then.
    """
    section = configuration.desired_bearing
    speed = section.speed_mps
    if configuration.guidance.kind != "planner":
        return desired
    if section.phase == "measured":
        return SweptBearing(desired, speed) if isinstance(speed, float) else desired
    if speed == "sensor":
        speed = steady_speed(vehicle) if configuration.bearing_noise_deg > 0.0 else None
    return desired if speed is None else PacedBearing(desired, speed)


def unreachable_bearings(configuration: Configuration, vehicle: Vehicle) -> list[str]:
    """A warning if the desired bearing turns faster than the vehicle can follow at its standoff; else nothing."""
    section = configuration.desired_bearing
    if configuration.standoff is None or configuration.guidance.kind != "planner":
        return []
    if section.phase == "measured" and isinstance(section.speed_mps, float):
        return _too_fast(section.speed_mps, reachable_speed(configuration, vehicle))
    if section.period_s == "auto":
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


def _too_fast(asked: float, reached: float) -> list[str]:
    """A warning if the vehicle does not reach the speed that it is asked for."""
    if asked <= reached * (1.0 + 1e-9):
        return []
    return [f"desired_bearing.speed_mps: found {asked:.3g}; the vehicle reaches {reached:.3g} m/s"]
