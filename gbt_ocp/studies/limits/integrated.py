"""The problem of a comparison as one of trajectories by integration: the same limits, thrust held over each piece."""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np

from gbt_ocp.models.dynamics import Dynamics, integrated
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.models.vehicles import DrivenVehicle, Vehicle
from gbt_ocp.ocp.problem import TrajectoryProblem
from gbt_ocp.ocp.shooting_problem import ShootingProblem
from gbt_ocp.ocp.thrust_limits import ThrustLimit
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.typing import Array

PUSHES = (0.2, -0.2)
"""Shares of the limit of each input at which the step size is tried."""

STEP_ERROR = 0.01
"""Error over a piece, over what the state changes, that is allowed."""

MOST_TRIED = 16
"""Largest number of Runge-Kutta steps of a piece that is tried."""

LONG_DRIVE = 8
"""Pieces over which a push is held before the step size is tried again, at the speed that it gives."""


def by_integration(problem: TrajectoryProblem) -> ShootingProblem:
    """The same vehicle, objectives and limits, with as many Runge-Kutta steps as the vehicle's motion needs."""
    steps = resolving_steps(problem.vehicle, problem.period)
    return ShootingProblem(
        problem.vehicle,
        problem.pieces,
        problem.period,
        "held",
        steps,
        objectives=problem.objectives,
        hard=problem.hard,
        penalties=problem.penalties,
    )


def resolving_steps(vehicle: DrivenVehicle | Vehicle, period: float) -> int:
    """The fewest classical Runge-Kutta steps over a period that err by less than :data:`STEP_ERROR`.

    Compared with four times as many, from rest and from the speed that each push ends in, under the push and under its
    reverse.

    Parameters
    ----------
    vehicle
        Flat or not.
    period
        In seconds.
    """
    dynamics, limits = Dynamics(vehicle), ThrustRange.of(vehicle)
    state, inputs, duration = ca.SX.sym("state", dynamics.states), ca.SX.sym("inputs", dynamics.inputs), ca.SX.sym("s")
    step = ca.Function("step", [state, inputs, duration], [integrated(dynamics, state, (inputs, inputs), duration, 1)])

    several = cache(lambda steps: step.mapaccum(steps))

    def after(x: Array, held: Array, steps: int) -> Array:
        given = np.tile(held[:, None], steps), np.full((1, steps), period / steps)
        return np.asarray(several(steps)(x, *given))[:, -1]

    tried = []
    for axis in range(dynamics.inputs):
        for share in PUSHES:
            held = np.zeros(dynamics.inputs)
            held[axis] = abs(share) * (limits.upper if share > 0.0 else limits.lower)[axis]
            moving = np.zeros(dynamics.states)
            tried.append((moving, held))
            for _ in range(LONG_DRIVE):
                moving = after(moving, held, 4 * MOST_TRIED)
            tried += [(moving, held), (moving, -held)]
    tried = [(x, held) for x, held in tried if np.all(np.isfinite(x))]
    for steps in range(1, MOST_TRIED):
        ends = [(x, after(x, held, steps), after(x, held, 4 * steps)) for x, held in tried]
        if all(np.max(np.abs(end - fine)) <= STEP_ERROR * max(np.max(np.abs(fine - x)), 1.0) for x, end, fine in ends):
            return steps
    return MOST_TRIED


def held_half_way(trajectory: FlatTrajectory, problem: ShootingProblem) -> Array:
    """The thrust ``(p, m)`` of a flat trajectory half way over each piece, within γ of the limits."""
    middle, vehicle = trajectory.sample(3), problem.vehicle
    point = [ca.SX.sym(name, vehicle.flat_dimension) for name in ("z", "dz", "ddz")]
    inputs = ca.Function("inputs", point, [vehicle.inputs(*point)])  # type: ignore[attr-defined]
    thrust = [np.asarray(inputs(*(order[i, 1] for order in middle))).ravel() for i in range(trajectory.pieces)]
    gammas = [limit.gamma for limit in problem.constraints if isinstance(limit, ThrustLimit)]
    return ThrustRange.of(vehicle).clip(np.array(thrust), min(gammas, default=1.0))
