"""The vehicle that a problem's file makes."""

from __future__ import annotations

from typing import Any

from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.models.contracts import ContractError, has, made, named
from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.model_checks import check_vehicle
from gbt_ocp.models.vehicle_by_rates import VehicleByRates


def own_vehicle(configuration: Configuration) -> Any:
    """A flat vehicle as it is; one that is known by its rates alone as a :class:`VehicleByRates`.

    Parameters
    ----------
    configuration
        With ``vehicle.kind: problem``.

    Raises
    ------
    gbt_ocp.models.contracts.ContractError
        If the vehicle lacks something, or moves in another number of dimensions than the problem.
    """
    factory = configuration.problem_object.vehicle
    assert factory is not None, "checked when the configuration was read"
    own: Any = made("vehicle", factory)
    vehicle = own
    if not has(own, "inputs") and configuration.planner.form == "shooting":
        vehicle = own if isinstance(own, DrivenBody) else VehicleByRates(own)
    elif not has(own, "inputs") and has(own, "rates") and not isinstance(own, type):
        allowed = "the inverse dynamics, or planner.form: shooting with a vehicle that is not flat"
        raise ContractError(f"{named(own, 'inputs')}: found nothing of this name; allowed: {allowed}")
    else:
        check_vehicle(own)
    if vehicle.position_dimension != configuration.dimension:
        found = f"{named(own, 'position_dimension')}: found {vehicle.position_dimension}"
        raise ContractError(f"{found}; allowed: {configuration.dimension}, the problem's")
    return vehicle
