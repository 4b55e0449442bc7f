"""The optimal-control toolbox: trajectory problems of flat vehicles, posed by verbs and solved again and again."""

from gbt_ocp.ocp.constraints import Constraint, MovingConstraint, PathConstraint, ThrustLimit
from gbt_ocp.ocp.information import FisherInformation, NearInformation, PosteriorVariance
from gbt_ocp.ocp.motion_limits import SpeedLimit, YawRateLimit
from gbt_ocp.ocp.objectives import BearingSimilarity, JointObjective, Moments, Objective, RangePull
from gbt_ocp.ocp.plan import Plan
from gbt_ocp.ocp.planner import Planner
from gbt_ocp.ocp.problem import TrajectoryProblem
from gbt_ocp.ocp.regions import DepthLimits, KeepOut, KeepOutPolygon
from gbt_ocp.ocp.target_limits import FieldOfView, RangeLimits
from gbt_ocp.ocp.trajectory import FlatPoint, FlatTrajectory

__all__ = [
    "BearingSimilarity",
    "Constraint",
    "DepthLimits",
    "FieldOfView",
    "FisherInformation",
    "FlatPoint",
    "FlatTrajectory",
    "JointObjective",
    "KeepOut",
    "KeepOutPolygon",
    "Moments",
    "MovingConstraint",
    "NearInformation",
    "Objective",
    "PathConstraint",
    "Plan",
    "Planner",
    "PosteriorVariance",
    "RangeLimits",
    "RangePull",
    "SpeedLimit",
    "ThrustLimit",
    "TrajectoryProblem",
    "YawRateLimit",
]
