"""Bearing geometry, vehicles, targets and the bearing sensor."""

from gbt_ocp.models.bearings import (
    DesiredBearing,
    condition_number,
    cumulative_bearing_matrix,
    log_map,
    rotate_bearing,
    tangent_basis,
    unit_bearing,
)
from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenParameters, FossenVehicle
from gbt_ocp.models.known_vehicles import (
    BLUEROV2_HEAVY_2D,
    BLUEROV2_HEAVY_3D,
    KNOWN_DRIVEN,
    KNOWN_VEHICLES,
    KnownDriven,
    KnownVehicle,
)
from gbt_ocp.models.measurements import Measurement, Mounting, Sighting
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.models.targets import MotionTarget, Target, TrackTarget, case_target
from gbt_ocp.models.torpedo import LAUV, Torpedo, TorpedoParameters
from gbt_ocp.models.turning import TurningTarget
from gbt_ocp.models.vehicle_by_rates import VehicleByRates
from gbt_ocp.models.vehicles import PlanarPointMass, Unicycle, Vehicle, acceleration
from gbt_ocp.models.vessel import OTTER, TwinThrusterVessel, VesselParameters

__all__ = [
    "BLUEROV2_HEAVY_2D",
    "BLUEROV2_HEAVY_3D",
    "FALCON_2D",
    "FALCON_3D",
    "KNOWN_DRIVEN",
    "KNOWN_VEHICLES",
    "LAUV",
    "OTTER",
    "BearingSensor",
    "DesiredBearing",
    "DrivenBody",
    "FossenParameters",
    "FossenVehicle",
    "KnownDriven",
    "KnownVehicle",
    "Measurement",
    "MotionTarget",
    "Mounting",
    "PlanarPointMass",
    "Sighting",
    "Target",
    "Torpedo",
    "TorpedoParameters",
    "TrackTarget",
    "TurningTarget",
    "TwinThrusterVessel",
    "Unicycle",
    "Vehicle",
    "VehicleByRates",
    "VesselParameters",
    "acceleration",
    "case_target",
    "condition_number",
    "cumulative_bearing_matrix",
    "log_map",
    "rotate_bearing",
    "tangent_basis",
    "unit_bearing",
]
