"""The online loop without a world: a simulation, any other simulator, a vehicle or a log drive it alike."""

from gbt_ocp.pilot.online_loop import Decided, OnlineLoop
from gbt_ocp.pilot.packets import Packet, SaidBearing
from gbt_ocp.pilot.pilot_command import PilotCommand
from gbt_ocp.pilot.pilot_health import PilotHealth
from gbt_ocp.pilot.pilot_parts import PilotParts
from gbt_ocp.pilot.plan_follower import PlanFollower
from gbt_ocp.pilot.setpoint import Setpoint, setpoint_of
from gbt_ocp.pilot.teamwork import Exchange

__all__ = [
    "Decided",
    "Exchange",
    "OnlineLoop",
    "Packet",
    "PilotCommand",
    "PilotHealth",
    "PilotParts",
    "PlanFollower",
    "SaidBearing",
    "Setpoint",
    "setpoint_of",
]
