"""Cold starts exactly on a symmetry: an obstacle dead ahead is a ridge between two ways round it."""

from functools import cache

import casadi as ca
import numpy as np
import pytest

from gbt_ocp.models.fossen import FALCON_3D, FossenVehicle
from gbt_ocp.models.vehicles import PlanarPointMass
from gbt_ocp.ocp import KeepOut, Planner, ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.codegen.library import find_compiler

VEHICLES = {
    2: PlanarPointMass(drag=0.2, thrust_max=(2.0, 2.0)),
    3: FossenVehicle(FALCON_3D, (400.0, 400.0, 400.0, 50.0)),
}
RADIUS = 0.5


class Nearness:
    def __init__(self, dimension):
        self.dimension, self.shapes = dimension, {"goal": (dimension, 1)}

    def value(self, point, parameters):
        return -ca.sqrt(ca.sumsqr(point.z[: self.dimension] - parameters["goal"]) + 1e-4)

    def bind(self, pieces, data):
        return {"goal": np.tile(np.reshape(data["goal"], (self.dimension, 1)), (pieces, 1, 1))}


@cache
def planner(solver, dimension):
    vehicle = VEHICLES[dimension]
    problem = TrajectoryProblem(vehicle, pieces=20, period=0.2).maximize(Nearness(dimension))
    problem = problem.subject_to(ThrustLimit(vehicle), nodes=1).subject_to(KeepOut((0.0,) * dimension, RADIUS), nodes=1)
    return Planner(problem, solver)


@pytest.mark.parametrize("speed", [0.0, 0.5])
@pytest.mark.parametrize("ahead", [(1, 0), (3, 2), (-1, -1), (1, 0, 0), (0, 0, 1), (1, 1, 1)])
@pytest.mark.parametrize("solver", ["compiled", "ipopt"])
@pytest.mark.long
def test_a_cold_plan_goes_round_what_is_dead_ahead(solver, ahead, speed):
    if solver == "compiled" and find_compiler() is None:
        pytest.skip("no C compiler")
    dimension, line = len(ahead), np.array(ahead) / np.linalg.norm(ahead)
    asked = planner(solver, dimension)
    asked.reset()
    state = np.zeros((2, asked.problem.vehicle.flat_dimension))
    state[:, :dimension] = -line, speed * line
    plan = asked.solve(state, goal=line)
    assert plan.status in ("solved", "given up")
    assert plan.fallback == ""
    place = plan.endpoints[:, :dimension]
    beside = np.linalg.norm(place - np.outer(place @ line, line), axis=1)
    assert beside.max() > 0.9 * RADIUS
    assert place[-1] @ line > 0.5
