"""Faults between the keys of the vehicle, its plant and how it follows a plan."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import ValidationError

from gbt_ocp.experiments.config.faults import NOTHING, Fault, shown, value_at
from gbt_ocp.experiments.config.plant import PlantSection
from gbt_ocp.experiments.config.tracking_problem import TrackingProblem
from gbt_ocp.experiments.config.vehicle import DRIVEN_DIMENSIONS

LAWS_OF_DRIVEN = ("planner", "static", "constant_force", "random")
"""Values of ``guidance.kind`` that a vehicle which is not flat can follow."""


def vehicle_faults(merged: Mapping[str, Any], problem: TrackingProblem | None) -> Iterator[Fault]:
    """A vehicle that differs from its model, beside ways to move that leave no room for it.

    Parameters
    ----------
    merged
        All layers of the configuration.
    problem
        The problem, ``None`` if it could not be loaded.
    """
    vehicle, follow = value_at(merged, ("vehicle", "kind")), value_at(merged, ("vehicle", "follow"))
    bandwidth = value_at(merged, ("vehicle", "follow_bandwidth"))
    if bandwidth not in (NOTHING, None) and follow != "feedback":
        yield Fault(("vehicle", "follow_bandwidth"), shown(bandwidth), "null without vehicle.follow = feedback")
    known = value_at(merged, ("vehicle", "thrust_lag_s"))
    flat = value_at(merged, ("planner", "form")) in (NOTHING, "flat")
    if known not in (NOTHING, None) and not (follow == "feedback" and flat):
        allowed = "null without vehicle.follow = feedback and planner.form = flat"
        yield Fault(("vehicle", "thrust_lag_s"), shown(known), allowed)
    if vehicle == "driven":
        yield from _driven(merged, problem)
    current = value_at(merged, ("vehicle", "current"))
    if current not in (NOTHING, "none"):
        yield from _current(merged, current, problem)
    setpoint = value_at(merged, ("command",)) == "setpoint"
    lag = value_at(merged, ("plant", "autopilot_s"))
    if not setpoint and lag not in (NOTHING, 1.0):
        yield Fault(("plant", "autopilot_s"), shown(lag), "1.0, the default, without command = setpoint")
    if setpoint and follow not in (NOTHING, "exact"):
        yield Fault(
            ("vehicle", "follow"), shown(follow), "exact, the default, beside command = setpoint, which follows"
        )
    if setpoint and value_at(merged, ("guidance", "kind")) not in (NOTHING, "planner"):
        yield Fault(
            ("command",), "setpoint", "thrust beside a guidance.kind other than planner, which gives no setpoints"
        )
    try:
        plant = PlantSection.model_validate(merged.get("plant", {}))
    except ValidationError:  # said where single keys are checked
        return
    if plant.is_model:
        return
    if follow in (NOTHING, "exact") and not setpoint:
        allowed = "dynamics or feedback beside a plant that differs from its model"
        yield Fault(("vehicle", "follow"), "exact", allowed)
    if value_at(merged, ("guidance", "kind")) == "fim_placement":
        yield Fault(
            ("plant",), shown(merged["plant"]), "nothing beside guidance.kind = fim_placement, which moves no plant"
        )
    if plant.current_shear is not None and len(plant.current_shear) == 2:
        yield Fault(("plant", "current_shear"), shown(list(plant.current_shear)), "null in the plane")
    if vehicle == "driven" and plant.has_push:
        allowed = "thrust, lag_s, dead_time_s and the current alone beside vehicle.kind = driven"
        yield Fault(("plant",), shown(merged["plant"]), allowed)
    if vehicle == "problem" and plant.has_forces:
        allowed = "thrust, lag_s and dead_time_s alone beside vehicle.kind = problem"
        yield Fault(("plant",), shown(merged["plant"]), allowed)


def _driven(merged: Mapping[str, Any], problem: TrackingProblem | None) -> Iterator[Fault]:
    """A vehicle that is not flat, beside what asks for one that is, or in another number of dimensions."""
    name = value_at(merged, ("vehicle", "model"))
    dimension = DRIVEN_DIMENSIONS.get(str(name))
    if problem is not None and dimension not in (None, problem.dimension):
        fitting = [other for other, d in DRIVEN_DIMENSIONS.items() if d == problem.dimension]
        allowed = f"{', '.join(fitting)} (the problem has {problem.dimension} dimensions)"
        yield Fault(("vehicle", "model"), shown(name), allowed)
    if dimension is not None and value_at(merged, ("planner", "form")) != "shooting":
        yield Fault(("planner", "form"), shown(value_at(merged, ("planner", "form"))), "shooting beside vehicle.model")
    law = value_at(merged, ("guidance", "kind"))
    if law not in (NOTHING, *LAWS_OF_DRIVEN):
        yield Fault(("guidance", "kind"), shown(law), f"{', '.join(LAWS_OF_DRIVEN)} beside vehicle.model")
    if value_at(merged, ("command",)) == "setpoint":
        yield Fault(("command",), "setpoint", "thrust beside vehicle.model")


def _current(merged: Mapping[str, Any], current: Any, problem: TrackingProblem | None) -> Iterator[Fault]:
    """A current that is planned for, beside what plans nothing or plans over ground."""
    if value_at(merged, ("guidance", "kind")) not in (NOTHING, "planner"):
        yield Fault(("vehicle", "current"), shown(current), "none beside a guidance.kind other than planner")
    setpoint = value_at(merged, ("command",)) == "setpoint"
    if value_at(merged, ("vehicle", "follow")) in (NOTHING, "exact") and not setpoint:
        yield Fault(("vehicle", "follow"), "exact", "dynamics or feedback beside vehicle.current")
    if problem is not None and problem.objective is not None:
        yield Fault(("vehicle", "current"), shown(current), "none beside an objective of the problem's own")
