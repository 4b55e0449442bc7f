"""Instances of the trajectory problem for the solver benchmarks: closed-loop steps, cold random starts, pursuits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull
from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.models.targets import case_target
from gbt_ocp.ocp import Planner, ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.solvers.base import Solution
from gbt_ocp.ocp.solvers.compiled import CompiledSolver
from gbt_ocp.simulation.loop import simulate


@dataclass(frozen=True)
class Instance:
    """What one call of a solver gets."""

    start: np.ndarray
    parameters: list[np.ndarray]
    guess: np.ndarray
    cold: bool
    tightening: float = 0.0


class Recorder:
    """A solver that keeps what it was asked."""

    name = "recorder"

    def __init__(self, solver: CompiledSolver) -> None:
        self._solver = solver
        self.check = solver.check
        self.asked: list[Instance] = []

    def solve(
        self, start: Any, objectives: Any, guess: Any, *, cold: bool, tightening: float, limits: Any = ()
    ) -> Solution:
        """Solve, and remember."""
        self.asked.append(Instance(start.copy(), list(objectives), guess.copy(), cold, tightening))
        return self._solver.solve(start, objectives, guess, cold=cold, tightening=tightening)


def fossen_problem(dimension: int, formulation: str, nodes: int, pieces: int = 5) -> TrajectoryProblem:
    """The paper's problem with the weak pull of the default configuration."""
    vehicle = FossenVehicle(FALCON_2D if dimension == 2 else FALCON_3D, [5000.0] * dimension + [1500.0])
    problem = TrajectoryProblem(vehicle, pieces, 0.1).maximize(BearingSimilarity(dimension))
    problem = problem.maximize(RangePull(dimension))
    limit = ThrustLimit(vehicle, 0.98)
    return (
        problem.subject_to(limit, nodes=nodes)
        if formulation == "hard"
        else problem.subject_to_penalty(limit, nodes=nodes)
    )


def cold_instances(problem: TrajectoryProblem, count: int) -> Iterator[Instance]:
    """Random states, forecasts and desired bearings."""
    rng = np.random.default_rng(0)
    d, p = problem.vehicle.position_dimension, problem.pieces
    desired, binding = DesiredBearing(d, 2.0 * np.pi / (1.0 if d == 2 else 0.4)), Binding(problem)
    for number in range(count):
        start = np.zeros((2, d + 1))
        start[0, :d] = rng.uniform(-5.0, 5.0, d)
        start[1] = rng.normal(size=d + 1) * ([1.0] * d + [0.5])
        mean = rng.normal(size=d) + 0.1 * np.arange(1, p + 1)[:, None] * rng.normal(size=d)
        root = 0.2 * rng.normal(size=(d, d))
        forecast = SimpleNamespace(mean=mean, covariance=np.tile(root @ root.T, (p, 1, 1)))
        data = {"forecast": forecast, "desired": desired(number + 0.1 * np.arange(1, p + 1))}
        yield Instance(start, binding.objective_parameters(data), np.zeros((p, d + 1)), True)


def closed_loop_instances(
    case: str, formulation: str, nodes: int, seed: int, seconds: float, pieces: int
) -> tuple[TrajectoryProblem, list[Instance]]:
    """What the planner's solver was asked in a run of a shipped configuration."""
    overrides = [f"planner.formulation={formulation}", f"planner.nodes={nodes}", "planner.solver=compiled"]
    overrides.append(f"planner.pieces={pieces}")
    loop, start = build_loop(load_config(case, overrides=overrides, seed=seed))
    guidance: Any = loop.guidance  # the configurations plan
    problem, recorder = guidance.planner.problem, Recorder(guidance.planner.solver)
    guidance.planner = Planner(problem, recorder)
    simulate(loop, start, seconds)
    return problem, recorder.asked


def pursuit_instances(problem: TrajectoryProblem, steps: int) -> list[Instance]:
    """What the solver is asked when the vehicle follows its plans and the forecast is the true motion (cases 2 and 5).

    The first solve, which is cold, is left out. With forecasts that come true the horizon can be as long as one
    likes; a tracker's would be worthless after a few seconds.
    """
    d, p, period = problem.vehicle.position_dimension, problem.pieces, problem.period
    plane = d == 2
    target, desired = case_target(2 if plane else 5), DesiredBearing(d, 2.0 * np.pi / (1.0 if plane else 0.4))
    recorder = Recorder(CompiledSolver(problem, {}))
    planner = Planner(problem, recorder)
    state = np.zeros((2, d + 1))
    state[0, 0] = 3.0
    for step in range(steps + 1):
        times = period * (step + np.arange(1, p + 1))
        forecast = SimpleNamespace(mean=target.position(times), covariance=np.tile(1e-4 * np.eye(d), (p, 1, 1)))
        state = planner.solve(state, forecast, desired(times)).trajectory.knots[1]
    return [item for item in recorder.asked if not item.cold]
