"""What the pilot of a vehicle that is not flat has in C beside that of a flat one: its regulator and its helm."""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from gbt_ocp.guidance.helm import Helm
from gbt_ocp.guidance.startup import CrossFirst
from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.vehicle_by_rates import VehicleByRates
from gbt_ocp.ocp.codegen.expressions import c_function, c_source
from gbt_ocp.ocp.problem_data import ShootingData
from gbt_ocp.pilot.pilot_parts import PilotParts
from gbt_ocp.pilot.shot_follower import ShotFollower

DRIVEN_SIZES = {
    "PARTS": "parts of a piece between which a plan is known to its follower",
    "REACHED": "pieces over which the follower looks ahead",
    "PUSHES": "speeds at which the push is known",
}
"""Sizes of such a pilot by name, and what they are."""

DRIVEN_SETTINGS = {
    "input_rate": "largest rates of the inputs, in their units a second; 0: not limited",
    "regulator_weight": "of the square of a deviation of each number of the state",
    "helm_push": "share of the push that keeps each of the speeds from 0 to the fastest",
    "helm_fastest": "m/s",
    "helm_slowest": "least speed ahead, m/s",
    "helm_radius": "least radius of its turns, m",
    "helm_tightest": "radius of the tightest circle, m",
}
"""Settings of such a pilot by name, and what they are."""

_MOVING = """/* Generated: how one vehicle moves, and how it is steered. */
#include "gbt_helm.h"
#include "gbt_math.h"
#include "gbt_regulator.h"

{functions}"""


class DrivenInC(NamedTuple):
    """Numbers and sizes for the settings, and a file of C."""

    numbers: dict[str, Any]
    sizes: dict[str, int]
    source: str


def driven_in_c(parts: PilotParts, problem: ShootingData) -> DrivenInC:
    """The part of a pilot in C that is its vehicle's.

    Raises
    ------
    ValueError
        If the vehicle is flat, or a user's by its rates alone.
    """
    vehicle = parts.vehicle
    if not isinstance(vehicle, DrivenBody):
        raise ValueError("planner.form: found shooting with a flat vehicle; allowed in C: flat")
    if isinstance(vehicle, VehicleByRates):
        raise ValueError(
            f"vehicle: found {vehicle.name}, by its rates alone; allowed in C: flat ones and vehicle.model"
        )
    follower, m = ShotFollower(vehicle, parts.follow_bandwidth, parts.input_rate), len(vehicle.thrust_max)
    grid, reached = follower.grid(problem.period, problem.pieces)
    helm = parts.guidance.helm if isinstance(parts.guidance, CrossFirst) else None
    numbers: dict[str, Any] = {
        "input_rate": np.zeros(m) if parts.input_rate is None else np.array(parts.input_rate),
        "regulator_weight": follower.weights,
    }
    numbers |= helm.numbers if isinstance(helm, Helm) else dict.fromkeys(list(DRIVEN_SETTINGS)[2:], 1.0)
    if not isinstance(helm, Helm):
        numbers["helm_push"] = np.zeros(2)
    n = vehicle.flat_dimension
    z, dz, shares = (ca.SX.sym(name, size) for name, size in (("z", n), ("dz", n), ("shares", 2)))
    functions = [
        c_function("gbt_driven_state", [z, dz], vehicle.symbolic_state(z, dz)),
        c_function("gbt_grid_slopes", *follower.rows(problem.period / grid)),
        c_function("gbt_steering", [shares], vehicle.steered(shares[0], shares[1])),
    ]
    sizes = {"PARTS": grid, "REACHED": reached, "PUSHES": len(numbers["helm_push"])}
    return DrivenInC(numbers, sizes, _MOVING.format(functions=c_source(functions)))
