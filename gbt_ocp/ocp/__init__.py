"""The optimal-control toolbox: trajectory problems, posed by verbs and solved again and again."""

from gbt_ocp.ocp.codegen.options import CompiledOptions
from gbt_ocp.ocp.export.folder import write_c
from gbt_ocp.ocp.follower import Follower
from gbt_ocp.ocp.limits import DepthLimits, KeepOut, KeepOutPolygon, SpeedLimit, YawRateLimit
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.ocp.planner import AnyPlanner, Planner, ShotPlanner
from gbt_ocp.ocp.problem import TrajectoryProblem
from gbt_ocp.ocp.shooting import ShootingPlanner
from gbt_ocp.ocp.shooting_problem import ShootingProblem
from gbt_ocp.ocp.shot import ShotTrajectory
from gbt_ocp.ocp.solvers.base import Solution, Solver
from gbt_ocp.ocp.terms import (
    AccumulatedObjective,
    AnyObjective,
    Constraint,
    FromMoments,
    JointObjective,
    LimitFromMoments,
    LimitFromMotion,
    Moments,
    MovingConstraint,
    Objective,
    PathConstraint,
)
from gbt_ocp.ocp.thrust_limits import InputRateLimit, ThrustChange, ThrustEffort, ThrustLimit
from gbt_ocp.ocp.trajectory import FlatPoint, FlatTrajectory

__all__ = [
    "AccumulatedObjective",
    "AnyObjective",
    "AnyPlanner",
    "CompiledOptions",
    "Constraint",
    "DepthLimits",
    "FlatPoint",
    "FlatTrajectory",
    "Follower",
    "FromMoments",
    "InputRateLimit",
    "JointObjective",
    "KeepOut",
    "KeepOutPolygon",
    "LimitFromMoments",
    "LimitFromMotion",
    "Moments",
    "MovingConstraint",
    "Objective",
    "PathConstraint",
    "Plan",
    "Planner",
    "ShootingPlan",
    "ShootingPlanner",
    "ShootingProblem",
    "ShotPlanner",
    "ShotTrajectory",
    "Solution",
    "Solver",
    "SpeedLimit",
    "ThrustChange",
    "ThrustEffort",
    "ThrustLimit",
    "TrajectoryProblem",
    "YawRateLimit",
    "write_c",
]
