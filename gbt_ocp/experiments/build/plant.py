"""From the section ``plant`` to the vehicle that moves."""

from __future__ import annotations

import numpy as np

from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.models.fossen import FossenVehicle
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.simulation.flow import Flow
from gbt_ocp.simulation.plant import Plant, scaled


def build_plant(configuration: Configuration, vehicle: Vehicle, rng: np.random.Generator) -> Plant | None:
    """The vehicle that moves, or ``None`` where it is the model itself.

    Raises
    ------
    ValueError
        If its mass minus its added mass is not positive, or thrust factors do not fit the vehicle.
    """
    section = configuration.plant
    if section.is_model:
        return None
    thrust = np.asarray(section.thrust, dtype=float)
    if thrust.shape not in ((), vehicle.thrust_max.shape):
        raise ValueError(f"plant.thrust: found {thrust.size} numbers; allowed: one, or {vehicle.thrust_max.size}")
    moving = vehicle
    if isinstance(vehicle, FossenVehicle):
        try:
            parameters = scaled(vehicle.parameters, mass=section.mass, added_mass=section.added_mass, drag=section.drag)
        except ValueError as fault:
            raise ValueError(f"plant: {fault}") from fault
        moving = FossenVehicle(parameters, vehicle.thrust_max, vehicle.thrust_min)
    force = None
    if any(section.force or ()):
        force = np.zeros(configuration.dimension + 1)
        force[: len(section.force or ())] = section.force
    flow = None
    if section.flows:
        flow = Flow(
            section.current or np.zeros(configuration.dimension),
            section.current_shear,
            section.current_std,
            section.current_time_s,
            rng.spawn(1)[0],  # of its own: the force does not change with the water
        )
    return Plant(
        moving,
        thrust=thrust,
        lag=section.lag_s,
        dead_time=section.dead_time_s,
        force=force,
        force_std=section.force_std,
        flow=flow,
        rng=rng,
    )
