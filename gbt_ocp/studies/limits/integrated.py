"""The problem of a comparison as one of trajectories by integration: the same limits, thrust held over each piece."""

from __future__ import annotations

import casadi as ca
import numpy as np

from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.ocp.problem import TrajectoryProblem
from gbt_ocp.ocp.shooting_problem import ShootingProblem
from gbt_ocp.ocp.thrust_limits import ThrustLimit
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.typing import Array


def by_integration(problem: TrajectoryProblem) -> ShootingProblem:
    """The same vehicle, objectives and limits, with as many Runge-Kutta steps as are stable, the default."""
    return ShootingProblem(
        problem.vehicle,
        problem.pieces,
        problem.period,
        "held",
        objectives=problem.objectives,
        hard=problem.hard,
        penalties=problem.penalties,
    )


def held_half_way(trajectory: FlatTrajectory, problem: ShootingProblem) -> Array:
    """The thrust ``(p, m)`` of a flat trajectory half way over each piece, within γ of the limits."""
    middle, vehicle = trajectory.sample(3), problem.vehicle
    point = [ca.SX.sym(name, vehicle.flat_dimension) for name in ("z", "dz", "ddz")]
    inputs = ca.Function("inputs", point, [vehicle.inputs(*point)])  # type: ignore[attr-defined]
    thrust = [np.asarray(inputs(*(order[i, 1] for order in middle))).ravel() for i in range(trajectory.pieces)]
    gammas = [limit.gamma for limit in problem.constraints if isinstance(limit, ThrustLimit)]
    return ThrustRange.of(vehicle).clip(np.array(thrust), min(gammas, default=1.0))
