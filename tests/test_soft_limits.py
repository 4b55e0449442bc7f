"""Soft limits with exact l1 slacks."""

import casadi as ca
import numpy as np
import pytest

from gbt_ocp.models.vehicles import PlanarPointMass
from gbt_ocp.ocp import KeepOut, ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.check import LimitCheck
from gbt_ocp.ocp.solvers.compiled import CompiledSolver
from gbt_ocp.ocp.solvers.ipopt import IpoptSolver
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.ocp.transcription import input_scale
from gbt_ocp.studies.limits.soft import LIMIT_WEIGHT, SoftCompiledSolver, SoftIpoptSolver

PERIOD = 0.5


class Goal:
    """Minus the squared distance to a goal at every endpoint."""

    shapes = {"goal": (2, 1)}  # noqa: RUF012

    def value(self, point, parameters):
        return -ca.sumsqr(point.z - parameters["goal"])

    def bind(self, pieces, data):
        return {"goal": np.tile(np.reshape(data["goal"], (2, 1)), (pieces, 1, 1))}


def posed(pieces=4, radius=0.5):
    vehicle = PlanarPointMass(mass=1.0, drag=0.2, thrust_max=(2.0, 2.0))
    problem = TrajectoryProblem(vehicle, pieces, PERIOD).maximize(Goal())
    problem = problem.subject_to(ThrustLimit(vehicle, 1.0), nodes=2)
    return problem.subject_to(KeepOut((1.0, 0.1), radius), nodes=2)


def asked(problem, goal=(2.0, 0.0), start=(0.0, 0.0)):
    state = np.zeros((2, 2))
    state[0] = start
    return state, Binding(problem).objective_parameters({"goal": goal})


@pytest.mark.parametrize("soft", [SoftIpoptSolver, SoftCompiledSolver])
def test_where_the_limits_can_be_kept_the_solution_is_that_of_hard_limits(soft):
    problem = posed()
    state, parameters = asked(problem)
    guess = np.zeros((4, 2))
    guess[0, 1] = 0.3  # off the axis on which both ways around the circle look alike
    hard = IpoptSolver(problem, {}).solve(state, parameters, guess, cold=True)
    found = soft(problem).solve(state, parameters, guess, cold=True)
    assert hard.solved
    assert found.solved
    assert found.variables == pytest.approx(hard.variables, abs=2e-3)
    trajectory = FlatTrajectory(PERIOD, state, found.variables * input_scale(problem))
    assert LimitCheck(problem, 3)(trajectory).max() < 1e-5


def cost(problem, state, goal, accelerations):
    """-J + ρ Σ s of single pieces ``(N, 2)``, written down anew for a point mass."""
    total = np.zeros(len(accelerations))
    for s in (0.0, 0.5 * PERIOD, PERIOD):
        position = state[0] + s * state[1] + 0.5 * s**2 * accelerations
        thrust = accelerations + 0.2 * (state[1] + s * accelerations)
        total += LIMIT_WEIGHT * np.maximum(np.abs(thrust) / 2.0 - 1.0, 0.0).sum(axis=1)
        if s > 0.0:  # where the vehicle starts is given
            squared = ((position - [1.0, 0.1]) ** 2).sum(axis=1) / 0.5**2
            total += LIMIT_WEIGHT * np.maximum(1.0 - squared, 0.0) / 2.0
    return total + ((position - goal) ** 2).sum(axis=1)


@pytest.mark.parametrize("soft", [SoftIpoptSolver, SoftCompiledSolver])
def test_where_the_limits_cannot_be_kept_the_cost_is_the_least_of_a_fine_grid(soft):
    problem = posed(pieces=1)
    goal = (2.0, 0.0)
    state, parameters = asked(problem, goal, start=(0.9, 0.05))  # inside the circle, too deep to leave in one piece
    guess = np.array([[-0.3, -0.3]])
    assert CompiledSolver(problem, {}).solve(state, parameters, guess, cold=True).status == "given up"
    found = soft(problem).solve(state, parameters, guess, cold=True)
    assert found.solved
    axis = np.linspace(-4.0, 4.0, 401)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    best = grid[np.argmin(cost(problem, state, goal, grid))]
    found_cost = cost(problem, state, goal, found.variables * input_scale(problem))[0]
    near = cost(problem, state, goal, best + 0.03 * np.random.default_rng(0).normal(size=(2000, 2))).min()
    assert found_cost <= near + 2e-3


@pytest.mark.parametrize("soft", [SoftIpoptSolver, SoftCompiledSolver])
def test_a_problem_with_a_penalty_or_without_limits_is_refused(soft):
    vehicle = PlanarPointMass(mass=1.0, drag=0.2, thrust_max=(2.0, 2.0))
    bare = TrajectoryProblem(vehicle, 2, PERIOD).maximize(Goal())
    with pytest.raises(ValueError, match="no hard limit"):
        soft(bare)
    with pytest.raises(ValueError, match="found a penalty"):
        soft(bare.subject_to_penalty(ThrustLimit(vehicle)))
