"""The online loop without a world: a simulation, any other simulator, a vehicle or a log drive it alike."""

from gbt_ocp.pilot.online_loop import Decided, OnlineLoop
from gbt_ocp.pilot.plan_follower import PlanFollower

__all__ = ["Decided", "OnlineLoop", "PlanFollower"]
