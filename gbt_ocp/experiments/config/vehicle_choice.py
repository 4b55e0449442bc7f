"""What the name of a vehicle brings along: its kind, and for one that is not flat the form and limits of its plans."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from gbt_ocp.experiments.config.desired_bearing import DesiredBearingSection
from gbt_ocp.experiments.config.faults import NOTHING, value_at
from gbt_ocp.experiments.config.guidance import PlannerGuidanceSection
from gbt_ocp.experiments.config.overlay import overlaid
from gbt_ocp.experiments.config.vehicle import KNOWN_BY_NAME

CROSSING = {"startup_deviation": 0.12, "startup_leg_s": 20.0}
"""How a slow vehicle crosses the line of sight, where a problem has it do so: its legs are longer, and plans begin when
the standoff leaves them room."""

OPENING = 0.25
"""Speed at which a slow vehicle leads away while it crosses, over the largest of the target.

Farther away less is learnt of the range; but a target that comes nearer does not show until the range is known, and
with none a BlueROV2 was within the standoff in 3 of 6 runs (seeds 100 to 102 and 300 to 302)."""

SURE = 0.08
"""Deviation of the range over it until which a slow vehicle with Fossen's equations crosses. With 0.12 the standoff
leaves it no room yet: it flees along the line of sight, which tells nothing of the range (BlueROV2, seeds 300 and 301
of 120 s: errors of 13 % now, with 0.08 of 9 %)."""

SLOW = 2.0
"""Speed in m/s below which a vehicle has to spend all of it across the line of sight."""

BY_CLOCK: dict[str, Any] = {"speed_mps": "sensor"}
"""Its desired bearing turns by the clock, as fast as it can follow."""

CROSSED = 24.0
"""Metres that a leg across the line of sight has at least: those of the sea's own vehicle, 8 s at 3 m/s."""

CLOCKED_LEG = 12.0
"""Time in s of a leg of a desired bearing that turns by the clock, for a vehicle that goes round at :data:`CIRCLED`."""

CIRCLED = 3.0
"""Speed in m/s round the target for which that time is: 4 about a boat of 1."""

SHARE = 0.97
"""Part of the largest speed at which a slow vehicle crosses: the rest is for turning."""

LEG = 1.5
"""Time of a leg of the desired bearing, after which it turns back, over that of half a turn of the vehicle.

By the posterior bound for a target that turns, short legs tell more than long ones: errors are a fourth of those of a
circle. So does a bearing that asks for all of the speed. Plans begin it at the line of sight, so that what cannot be
reached need not be made up for."""


def choose_vehicle(values: dict[str, Any]) -> None:
    """Complete a layer of a configuration, in place, whose ``vehicle.model`` says which kind of vehicle it is."""
    vehicle = values.get("vehicle")
    name = vehicle.get("model") if isinstance(vehicle, dict) else None
    if not isinstance(name, str) or not isinstance(vehicle, dict):
        return
    if name in KNOWN_BY_NAME:
        vehicle.setdefault("kind", "fossen")
        vehicle["parameters"] = vehicle.pop("model")
    else:
        vehicle.setdefault("kind", "driven")


def driven_defaults(name: str, beneath: Mapping[str, Any], written: Mapping[str, Any]) -> dict[str, Any]:
    """Form of the plans of a vehicle that is not flat, and limits of its own.

    Parameters
    ----------
    name
        One of :data:`gbt_ocp.models.KNOWN_DRIVEN`.
    beneath
        The layers below: its limits join those that are hard there.
    written
        What is written, for the length of a piece.
    """
    from gbt_ocp.guidance.helm import TURN_MARGIN
    from gbt_ocp.models.known_vehicles import KNOWN_DRIVEN  # which loads CasADi

    known, merged = KNOWN_DRIVEN[name], overlaid(beneath, written, ())
    limits: dict[str, Any] = {"input_rate": list(known.rate_max)}
    names = ["input_rate"]
    if known.speed_min > 0.0:
        limits |= {"speed_min": known.speed_min, "turn_radius_m": known.turn_radius}
        names += ["speed_min", "turn_radius"]
    if known.pitch > 0.0:
        limits["pitch_deg"] = round(math.degrees(known.pitch), 6)
        names.append("pitch")
    hard = value_at(beneath, ("limits", "hard"))
    limits["hard"] = [*(hard if isinstance(hard, list | tuple) else ()), *names]
    defaults: dict[str, Any] = {"planner": {"form": "shooting"}, "limits": limits}
    if value_at(beneath, ("guidance", "startup_deviation")) not in (NOTHING, 0.0):
        defaults["guidance"] = CROSSING | _opening(merged) | {"startup_speed": round(SHARE * known.speed, 2)}
    leg = _clocked_leg(beneath)
    if leg is not None:
        desired = defaults["desired_bearing"] = BY_CLOCK | {"reverse_s": leg}
        if known.turn_radius > 0.0:
            turn = math.pi * TURN_MARGIN * known.turn_radius / known.speed
            desired |= {"reverse_s": max(leg, round(LEG * turn)), "target_speed": 0.0}
    return defaults


def slow_defaults(beneath: Mapping[str, Any], written: Mapping[str, Any], dimension: int) -> dict[str, Any]:
    """Longer legs, and crossing no faster than it can or may, for a vehicle with Fossen's equations.

    They are those of one whose named coefficients, or ``limits.speed``, keep it below the speed at which the problem
    has it cross the line of sight. Legs have the length in metres that those of the sea's own vehicle have: in the same
    time a slow one sees the target from nearly the same place, and its range is lost. Below :data:`SLOW` it crosses
    until the range is better known, and leads away no faster than it has to.

    Parameters
    ----------
    beneath
        The layers below.
    written
        What is written.
    dimension
        d.
    """
    from gbt_ocp.guidance.pacing import steady_speed
    from gbt_ocp.models.known_vehicles import KNOWN_VEHICLES  # which loads CasADi

    merged = overlaid(beneath, written, ())
    if value_at(merged, ("vehicle", "kind")) not in (NOTHING, "fossen"):
        return {}
    if value_at(beneath, ("guidance", "startup_deviation")) in (NOTHING, 0.0):
        return {}
    name, limit = (value_at(merged, path) for path in (("vehicle", "parameters"), ("limits", "speed")))
    fastest = [float(limit)] if isinstance(limit, int | float) and limit > 0.0 else []
    if isinstance(name, str) and name in KNOWN_VEHICLES:
        keeps_up = steady_speed(KNOWN_VEHICLES[name].make(dimension))
        fastest += [] if keeps_up is None else [keeps_up]
    speed = SHARE * min(fastest, default=math.inf)
    if speed >= PlannerGuidanceSection.model_fields["startup_speed"].default:
        return {}
    crossing: dict[str, Any] = {"startup_speed": round(speed, 3), "startup_leg_s": float(round(CROSSED / speed))}
    if speed < SLOW:
        crossing = CROSSING | _opening(merged) | {"startup_deviation": SURE} | crossing
    defaults: dict[str, Any] = {"guidance": crossing, "desired_bearing": BY_CLOCK}
    leg, target = _clocked_leg(beneath), value_at(merged, ("desired_bearing", "target_speed"))
    target = DesiredBearingSection.model_fields["target_speed"].default if target is NOTHING else target
    if leg is not None and isinstance(target, int | float) and min(fastest) > target:
        longer = round(leg * CIRCLED / (min(fastest) - target))
        defaults["desired_bearing"] = BY_CLOCK | {"reverse_s": max(leg, longer)}
    return defaults


def _clocked_leg(layer: Mapping[str, Any]) -> float | None:
    """Time in s of a leg for a turn by the clock, where there are legs: that of the layer, if they are by it there."""
    reverse, speed = (value_at(layer, ("desired_bearing", key)) for key in ("reverse_s", "speed_mps"))
    if not isinstance(reverse, int | float):
        return None
    return CLOCKED_LEG if isinstance(speed, int | float) else float(reverse)


def _opening(merged: Mapping[str, Any]) -> dict[str, float]:
    """The key of :data:`OPENING`, of what is said about the target."""
    fastest = value_at(merged, ("limits", "range", "target_speed_max"))
    return {"startup_opening": round(OPENING * fastest, 3) if isinstance(fastest, int | float) else 0.0}
