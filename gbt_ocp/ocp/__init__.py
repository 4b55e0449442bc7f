"""The optimal-control toolbox: trajectory problems of flat vehicles, posed by verbs and solved again and again."""

from gbt_ocp.ocp.constraints import KeepOut, PathConstraint, ThrustLimit
from gbt_ocp.ocp.objectives import BearingSimilarity, Moments, Objective, RangePull
from gbt_ocp.ocp.plan import Plan
from gbt_ocp.ocp.planner import Planner
from gbt_ocp.ocp.problem import TrajectoryProblem
from gbt_ocp.ocp.trajectory import FlatPoint, FlatTrajectory

__all__ = [
    "BearingSimilarity",
    "FlatPoint",
    "FlatTrajectory",
    "KeepOut",
    "Moments",
    "Objective",
    "PathConstraint",
    "Plan",
    "Planner",
    "RangePull",
    "ThrustLimit",
    "TrajectoryProblem",
]
