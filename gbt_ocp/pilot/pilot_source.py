"""The pilot as C: its hand-written files, and what is generated of the parts of one pilot."""

from __future__ import annotations

import json
import math
from typing import Any

import casadi as ca
import numpy as np

from gbt_ocp.guidance.current import ACCELERATION_SHARE, Current, CurrentObserver
from gbt_ocp.guidance.pacing import PacedBearing
from gbt_ocp.guidance.planned import PlannedMotion
from gbt_ocp.guidance.startup import CrossFirst
from gbt_ocp.guidance.swept import DesiredTurn, SweptBearing
from gbt_ocp.guidance.water import InWater
from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.models.sensors import SimulatedSensor
from gbt_ocp.ocp.codegen.expressions import c_function, c_source
from gbt_ocp.ocp.codegen.problem_source import from_moments
from gbt_ocp.ocp.problem_data import ProblemData, ShootingData
from gbt_ocp.pilot.driven_source import DRIVEN_SETTINGS, DRIVEN_SIZES, driven_in_c
from gbt_ocp.pilot.pilot_parts import PilotParts
from gbt_ocp.pilot.tracker_source import SIZES, c_number, initialiser, pilot_texts, tracker_in_c
from gbt_ocp.tracking.polar import BEARINGS

NAVIGATION_HZ = 50.0
"""Rate in Hz of navigations for which there is memory; where they come faster, those that are too old are fewer."""

COMMANDS_HZ = 50.0
"""Rate in Hz of commands for which there is memory where the current is estimated; it is not learnt from more."""

UNLISTED = 8
"""Numbers of sensors that are not listed in the configuration."""

SPARE = 16
"""Measurements that may wait for a command beside those of a sensor on time."""


def pilot_files(parts: PilotParts) -> dict[str, str]:
    """The C files of a pilot by name, to stand beside those of its planner.

    Parameters
    ----------
    parts
        What the pilot is made of. It has seen nothing yet.

    Raises
    ------
    ValueError
        If a part does not exist in C; one line that names it.
    """
    numbers, sizes = _guidance(parts)
    bearing = BEARINGS[parts.vehicle.position_dimension - 2]
    others = sum(one.kind != bearing for one in parts.sensors.values())
    tracker = tracker_in_c(parts.tracker, lambda width: SPARE + _measured_in(parts, width), others)
    current = parts.guidance.current if isinstance(parts.guidance, InWater) else None
    texts, settings = pilot_texts(), dict(_SETTINGS)
    problem = _planned(parts).planner.problem
    if isinstance(problem, ShootingData):
        driven = driven_in_c(parts, problem)
        numbers, sizes, settings = numbers | driven.numbers, sizes | driven.sizes, settings | DRIVEN_SETTINGS
        texts["gbt_driven.c"] = driven.source
    texts = {
        name: text for name, text in texts.items() if not name.startswith(_OTHER[isinstance(problem, ShootingData)])
    }
    sizes |= tracker.sizes | _memory(parts) | {"CURRENT": _kind_of(current)}
    numbers |= _current(current, parts.vehicle.position_dimension)
    numbers |= {
        "period": parts.period,
        "forecast_period": parts.forecast_period,
        "late": parts.late,
        "navigation_gap": parts.navigation_gap,
        "lead": parts.period if parts.lead is None else parts.lead,
        "bearing_std": parts.bearing_std,
        "follow_bandwidth": parts.follow_bandwidth,
        "thrust_lag": parts.thrust_lag or 0.0,
        "observing": int(parts.thrust_lag is not None),
    }
    defined = (
        f"#define GBT_{name} {value} /* {(_SIZES | SIZES | DRIVEN_SIZES)[name]} */" for name, value in sizes.items()
    )
    fields = (f"    {_kind(name)} {name}{_length(numbers[name])}; /* {says} */" for name, says in settings.items())
    header = _HEADER.format(sizes="\n".join(defined), fields="\n".join(fields))
    sensors = [_sensor(number, one) for number, one in enumerate(parts.sensors.values())]
    source = _SOURCE.format(
        numbers=initialiser({name: numbers[name] for name in settings}, _DOUBLES),
        kind=tracker.name,
        tracker=initialiser(tracker.settings, tracker.doubles),
        sensors=", ".join(sensors or ["{{0, GBT_EARTH, 0, {0}, 0}, 0, 0, 0}"]),
        names=", ".join(json.dumps(name) for name in parts.sensors) or '""',
        model=_model(current, parts.vehicle) if isinstance(current, CurrentObserver) else "",
    )
    return tracker.chosen(texts) | {"gbt_pilot_settings.h": header, "gbt_pilot_settings.c": source}


def _planned(parts: PilotParts) -> PlannedMotion:
    """What plans, sooner or later."""
    guidance = parts.guidance.inner if isinstance(parts.guidance, InWater) else parts.guidance
    planned = guidance.planned if isinstance(guidance, CrossFirst) else guidance
    if not isinstance(planned, PlannedMotion):
        found = type(planned).__name__
        raise ValueError(f"guidance: found {found}; allowed in C: a planner")
    return planned


def _guidance(parts: PilotParts) -> tuple[dict[str, Any], dict[str, int]]:
    """Numbers and sizes of the guidance."""
    guidance = parts.guidance.inner if isinstance(parts.guidance, InWater) else parts.guidance
    crossing, planned = (guidance if isinstance(guidance, CrossFirst) else None), _planned(parts)
    planner = planned.planner
    if not from_moments(planner.problem):
        raise ValueError(
            "planner: found an objective or a limit with data of its own; allowed in C: those that the mean and the "
            "covariance of a forecast are enough for"
        )
    if parts.vehicle.flat_dimension != parts.vehicle.position_dimension + 1 and isinstance(
        planner.problem, ProblemData
    ):
        found = f"{parts.vehicle.flat_dimension} flat outputs"
        raise ValueError(f"vehicle: found {found}; allowed in C: position and yaw")
    steps, stride, begin_at_sight = planned.schedule
    desired = planned.desired
    turn = _turn_of(desired)
    numbers = {
        "desired_rate": turn.rate,
        "desired_phase": turn.phase,
        "desired_reverse": 0.0 if math.isinf(turn.reverse) else turn.reverse,
        "desired_leg_start": turn.leg_start,
        "desired_axis": np.asarray(turn.axis, dtype=float) / np.linalg.norm(turn.axis),
        "desired_speed": desired.speed if isinstance(desired, PacedBearing) else 0.0,
        "desired_across": desired.speed if isinstance(desired, SweptBearing) else 0.0,
        "begin_at_sight": int(begin_at_sight),
        "startup_deviation": 0.0 if crossing is None else crossing.crossing.deviation,
        "startup_speed": 0.0 if crossing is None else crossing.crossing.speed,
        "startup_opening": 0.0 if crossing is None else crossing.crossing.opening,
        "startup_leg": 1.0 if crossing is None else crossing.crossing.leg,
        "startup_nearest": 0.0 if crossing is None else crossing.crossing.nearest,
        "axis": np.array([0.0, 0.0, 1.0]) if crossing is None else crossing.crossing.axis,
    }
    return numbers, {"AHEAD": parts.forecast, "PERIODS": steps, "STRIDE": stride}


def _turn_of(desired: DesiredTurn) -> DesiredBearing:
    """The turn by the clock."""
    if isinstance(desired, PacedBearing):
        return desired.at_full_pace
    return desired.turn if isinstance(desired, SweptBearing) else desired


def _kind_of(current: Current | None) -> int:
    """0 in still water, 1 where the current is given, 2 where it is estimated."""
    return 0 if current is None else 2 if isinstance(current, CurrentObserver) else 1


def _current(current: Current | None, dimension: int) -> dict[str, Any]:
    """Numbers of what is known of the water."""
    std, drift = current.settings[:2] if isinstance(current, CurrentObserver) else (0.0, 0.0)
    return {
        "current": np.zeros(dimension) if current is None else current.velocity,
        "current_std": 0.0 if current is None else math.sqrt(current.covariance[0, 0]),
        "current_drift": drift,
        "acceleration_std": std,
        "acceleration_share": ACCELERATION_SHARE,
    }


def _model(current: CurrentObserver, vehicle: Any) -> str:
    """The function of the observer."""
    d, n, m = vehicle.position_dimension, vehicle.flat_dimension, len(vehicle.thrust_max)
    point, water, inputs = ca.SX.sym("point", 3 * n), ca.SX.sym("water", d), ca.SX.sym("inputs", m)
    off, slope, mass = current.settings[2](*ca.vertsplit(point, n), water, inputs)
    out = ca.vertcat(off, ca.vec(slope.T), ca.vec(mass.T))
    return "\n" + c_source([c_function("gbt_current_model", [point, water, inputs], out)])


def _memory(parts: PilotParts) -> dict[str, int]:
    """How much is remembered of inputs."""
    measurements = SPARE + _measured_in(parts, parts.late)
    return {
        "LISTED": len(parts.sensors),
        "SENSORS": len(parts.sensors) + UNLISTED,
        "MEASUREMENTS": measurements,
        "KNOWN": 2 * measurements,
        "NAVIGATIONS": 8 + math.ceil(NAVIGATION_HZ * (parts.late + parts.navigation_gap)),
        "COMMANDS": 8 + math.ceil(COMMANDS_HZ * (parts.period + parts.navigation_gap)),
    }


def _measured_in(parts: PilotParts, seconds: float) -> int:
    """How many measurements may come in a time."""
    periods = [sensor.period for sensor in parts.sensors.values()] or [parts.period]
    return sum(math.ceil(1.25 * seconds / period) for period in periods)


def _sensor(number: int, sensor: SimulatedSensor) -> str:
    mounting = sensor.mounting
    position = mounting.position or (0.0,)
    frame = "GBT_BOW" if sensor.frame == "bow" else "GBT_EARTH"
    pose = f"{{{number}, {frame}, 1, {c_number(np.array(position))}, {c_number(mounting.yaw)}}}"
    numbers = (sensor.std or 0.0, sensor.share or 0.0, sensor.heading_std)
    return f"{{{pose}, {', '.join(c_number(value) for value in numbers)}}}"


def _kind(name: str) -> str:
    """The type of a number: times are double in both precisions."""
    if name in ("begin_at_sight", "observing"):
        return "int"
    return "double" if name in _DOUBLES else "gbt_real"


def _length(value: Any) -> str:
    return f"[{len(value)}]" if isinstance(value, np.ndarray) else ""


_OTHER = {False: ("gbt_regulator", "gbt_helm"), True: ("gbt_trajectory",)}
"""Beginnings of the names of the files that a pilot does without, by whether it plans by integration."""

_SIZES = {
    "AHEAD": "positions predicted ahead",
    "PERIODS": "sampling periods that a piece of a plan lasts",
    "STRIDE": "predicted positions that it lasts",
    "LISTED": "sensors of which something is configured",
    "SENSORS": "numbers of sensors",
    "MEASUREMENTS": "measurements that can wait for a command",
    "KNOWN": "measurements remembered to find duplicates",
    "NAVIGATIONS": "navigations remembered",
    "COMMANDS": "commands remembered where the current is estimated",
    "CURRENT": "of the water: 0 none, 1 given, 2 estimated",
}

_SETTINGS = {
    "period": "s between two decisions of the guidance",
    "forecast_period": "s between two predicted positions",
    "late": "s by which inputs may be late",
    "navigation_gap": "longest time between two navigations that is bridged, s",
    "lead": "how far ahead on the plan setpoints are taken, s",
    "bearing_std": "deviation of bearings that do not state one, rad",
    "follow_bandwidth": "of the follower, rad/s",
    "thrust_lag": "time constant of the thrusters that is made up for, s",
    "observing": "whether what the vehicle needs of thrust beyond its model is estimated and added",
    "desired_rate": "of the turn of the desired bearing, rad/s",
    "desired_phase": "its angle at time 0, rad",
    "desired_reverse": "s after which its sense changes; 0 for never",
    "desired_leg_start": "time at which it begins to go in the sense of the rate, s",
    "desired_axis": "of its circle in space",
    "desired_across": "of the vehicle that it asks for whatever the target does, m/s; 0: a turn by the clock",
    "desired_speed": "that it may ask for, over the radius of the circle, m/s; 0: whatever the range",
    "begin_at_sight": "whether each plan turns it on from the line of sight",
    "startup_deviation": "deviation of the range over the range below which is planned; 0: always",
    "startup_speed": "m/s at which the line of sight is crossed",
    "startup_opening": "part of it that leads away, m/s",
    "startup_leg": "s after which it is crossed the other way",
    "startup_nearest": "m to be kept from the target, as far as the range is known; 0: none",
    "axis": "about which it is crossed in space",
    "current": "of the water over ground, m/s; before anything is known where it is estimated",
    "current_std": "its deviation on each axis then, m/s",
    "current_drift": "deviation in m/s by which it wanders in a second",
    "acceleration_std": "of what neither thrust nor drag explains, m/s^2",
    "acceleration_share": "part of the acceleration that is added to that",
}

_DOUBLES = (
    *("period", "forecast_period", "late", "navigation_gap", "lead"),
    *("desired_rate", "desired_phase", "desired_reverse", "desired_leg_start", "desired_speed", "desired_across"),
)

_HEADER = """/* Generated: sizes and settings of one pilot. */
#ifndef GBT_PILOT_SETTINGS_H
#define GBT_PILOT_SETTINGS_H

#include "gbt_real.h"

GBT_BEGIN_C

{sizes}

typedef struct {{
{fields}
}} gbt_pilot_settings;

extern const gbt_pilot_settings gbt_pilot_numbers;

GBT_END_C

#endif
"""

_SOURCE = """/* Generated: settings of one pilot. */
#include "gbt_pilot_settings.h"

#include <math.h>

#include "gbt_current.h"
#include "gbt_math.h"
#include "gbt_sighting.h"
#include "gbt_tracker.h"

const gbt_pilot_settings gbt_pilot_numbers = {{
    {numbers}}};

const gbt_{kind}_settings gbt_tracker_settings = {{
    {tracker}}};

const gbt_sensor gbt_listed_sensors[] = {{{sensors}}};

const char *const gbt_sensor_names[] = {{{names}}};
{model}"""
