"""The forms of a plan that benchmarks/shooting.py compares: what is held over a period, and how smoothly it joins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.ocp import (
    FlatPoint,
    FlatTrajectory,
    Objective,
    Planner,
    ShootingProblem,
    ThrustLimit,
    TrajectoryProblem,
)
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.check import FINE_POINTS, LimitCheck
from gbt_ocp.ocp.objective_total import point_symbols
from gbt_ocp.ocp.shooting import ShootingPlanner
from gbt_ocp.ocp.transcription import input_scale


class HeldEarthAcceleration(ShootingPlanner):
    """z̈ held in the earth frame: the flat form of degree 2, by other means."""

    bounded = False

    def motion(self, z: Any, dz: Any, held: Any) -> Any:
        """``z̈`` itself, in units of its natural size."""
        return held * ca.DM(self.problem.vehicle.acceleration_scale)


class HalfPeriods(HeldEarthAcceleration):
    """The flat form with two pieces a period."""

    holds = 2


class HeldBodyAcceleration(ShootingPlanner):
    """z̈ turned with the vehicle: held in the body frame, ``z̈ = J(ψ) a``."""

    bounded = False

    def motion(self, z: Any, dz: Any, held: Any) -> Any:
        """``J(ψ) a``."""
        a = held * ca.DM(self.problem.vehicle.acceleration_scale)
        c, s = ca.cos(z[-1]), ca.sin(z[-1])
        return ca.vertcat(c * a[0] - s * a[1], s * a[0] + c * a[1], a[2:])


class HalfThrust(ShootingPlanner):
    """Thrust that may change twice a period."""

    holds = 2


class YawLocked:
    """A Fossen vehicle that something keeps from turning: only position is left of its flat output.

    The motion with ψ = 0 throughout; the moment that this takes is not counted.
    """

    def __init__(self, vehicle: FossenVehicle) -> None:
        self._vehicle = vehicle
        self.position_dimension = self.flat_dimension = vehicle.position_dimension
        self.thrust_max = vehicle.thrust_max[:-1]
        self.acceleration_scale = self.thrust_max / vehicle.parameters.inertia_diagonal[:-1]

    def inputs(self, z: Any, dz: Any, ddz: Any) -> Any:
        """Forces without the yaw moment."""
        return self._vehicle.inputs(*(ca.vertcat(part, 0.0) for part in (z, dz, ddz)))[:-1]


@dataclass(frozen=True)
class Outcome:
    """What one solve gave.

    ``peak`` is the largest ``|τ_i| / τ_max,i`` of the plan; ``used`` is the largest of them at each time, averaged over
    the plan. ``unknowns`` can start another solve of the same form.
    """

    solved: bool
    objective: float
    endpoints: np.ndarray
    peak: float
    used: float
    iterations: int
    unknowns: np.ndarray


class Form:
    """One way to parameterise the plan of a problem, asked for single solves from given unknowns, in scaled units."""

    def __init__(
        self, name: str, problem: TrajectoryProblem, shooting: type[ShootingPlanner] | None, solver: str
    ) -> None:
        self.name = name
        self.problem = problem
        self.binding = Binding(problem)
        self.planner: Planner | ShootingPlanner
        self.planner = problem.compile(solver) if shooting is None else shooting(problem)
        self._check = LimitCheck(problem)
        point = point_symbols(problem.vehicle.flat_dimension)
        self._inputs = ca.Function("inputs", list(point), [problem.vehicle.inputs(*point)])
        holds = 1 if shooting is None else shooting.holds
        held = problem.freedoms if shooting is None else problem.vehicle.flat_dimension
        self.shape = (problem.pieces * holds, held)

    def start(self, state: np.ndarray) -> np.ndarray:
        """The state as this form takes it: derivatives beyond the velocity are zero, a locked yaw is left out."""
        n = self.problem.vehicle.flat_dimension
        out = np.zeros((self.problem.joined, n))
        out[:2] = state[:2, :n]
        return out

    def through(self, state: np.ndarray, endpoints: np.ndarray) -> np.ndarray:
        """Unknowns of the flat form whose trajectory passes through endpoints ``(p, n)``, whatever thrust it takes."""
        trajectory = FlatTrajectory.from_endpoints(self.problem.period, self.start(state), endpoints)
        return trajectory.top / input_scale(self.problem)

    def peak(self, state: np.ndarray, unknowns: np.ndarray) -> float:
        """Largest ``|τ| / τ_max`` of the flat form with these unknowns."""
        top = unknowns * input_scale(self.problem)
        return 1.0 + float(self._check(FlatTrajectory(self.problem.period, self.start(state), top)).max())

    def solve(self, state: np.ndarray, data: Mapping[str, Any], guess: np.ndarray | None = None) -> Outcome:
        """Solve from a guess, from coasting if there is none."""
        start, parameters = self.start(state), self.binding.objective_parameters(data)
        unknowns = np.zeros(self.shape) if guess is None else guess
        planner = self.planner
        if isinstance(planner, ShootingPlanner):
            found = planner.attempt(start[:2], parameters, unknowns)
            knots, peaks = planner.rollout(start[:2], found.variables)
            value = planner.objective(knots, found.variables, parameters)
            state_now, loads = start[:2].ravel(), []
            for held in found.variables:
                state_now, inputs = (np.asarray(part) for part in planner.step(state_now, held))
                loads.append(np.abs(inputs).max(axis=0))
            used = float(np.mean(loads))
            return Outcome(
                found.solved, value, knots[1:, 0], float(peaks.max()), used, found.iterations, found.variables
            )
        found = planner.solver.solve(start, parameters, unknowns, cold=True, tightening=0.0)
        trajectory = FlatTrajectory(self.problem.period, start, found.variables * input_scale(self.problem))
        value, peak = planner.objective(trajectory, parameters), 1.0 + float(self._check(trajectory).max())
        points = [part.reshape(-1, start.shape[1]).T for part in trajectory.sample(FINE_POINTS)]
        loads = np.abs(np.asarray(self._inputs(*points))) / self.problem.vehicle.thrust_max[:, None]
        used = float(loads.max(axis=0).mean())
        return Outcome(found.solved, value, trajectory.endpoints, peak, used, found.iterations, found.variables)


class ShotForm:
    """A plan by integration with the compiled solver, thrust held or linear over each period: for closed loops."""

    def __init__(self, name: str, problem: TrajectoryProblem, thrust: Any) -> None:
        self.name = name
        self.problem = ShootingProblem(
            problem.vehicle, problem.pieces, problem.period, thrust, 1, objectives=problem.objectives, hard=problem.hard
        )
        self.planner = self.problem.compile("compiled")

    def start(self, state: np.ndarray) -> np.ndarray:
        """Flat output and rate."""
        return state[:2]


def falcon(dimension: int) -> FossenVehicle:
    """The vehicle of the six cases."""
    return FossenVehicle(FALCON_2D if dimension == 2 else FALCON_3D, [5000.0] * dimension + [1500.0])


def posed(
    vehicle: Vehicle, pieces: int, objectives: tuple[Objective, ...], degree: int, continuity: int | None, nodes: int
) -> TrajectoryProblem:
    """The problem of the six cases with hard limits."""
    problem = TrajectoryProblem(vehicle, pieces, 0.1, degree, continuity)
    for term in objectives:
        problem = problem.maximize(term)
    return problem.subject_to(ThrustLimit(vehicle, 0.98), nodes=nodes)


@dataclass(frozen=True)
class Reach:
    """How far the last endpoint gets in a direction; ``directions`` ``(p, d)`` is zero for the others."""

    dimension: int

    @property
    def shapes(self) -> dict[str, tuple[int, int]]:
        """The direction."""
        return {"direction": (self.dimension, 1)}

    def value(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """The position's component along it."""
        return ca.dot(parameters["direction"], point.z[: self.dimension])

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """``directions`` of the data."""
        return {"direction": np.asarray(data["directions"], dtype=float)[:pieces, :, None]}


class Kind(NamedTuple):
    """What a form is: degree and continuity of a flat one, nodes a piece, a planner if not the package's own."""

    degree: int = 2
    continuity: int | None = None
    nodes: int = 4
    planner: type[ShootingPlanner] | None = None


FORMS = {
    "flat": Kind(),
    "flat, degree 3": Kind(3),
    "flat, degree 4": Kind(4),
    "flat, degree 5": Kind(5),
    "flat, degree 3, C1": Kind(3, 1, 6),
    "flat, degree 4, C1": Kind(4, 1, 8),
    "flat, half pieces": Kind(planner=HalfPeriods),
    "body acceleration": Kind(planner=HeldBodyAcceleration),
    "thrust": Kind(planner=ShootingPlanner),
    "thrust, half periods": Kind(planner=HalfThrust),
}
"""By name. Pieces of a higher degree move more between two nodes, so they have more of them where they are free to."""

INTEGRATED = {"held, compiled": "held", "linear, compiled": "linear"}
"""Forms of closed loops alone: thrust over a period of :class:`ShotForm`."""


def make_in_loop(name: str, vehicle: Vehicle, pieces: int, objectives: tuple[Objective, ...]) -> Form | ShotForm:
    """A form of :data:`FORMS` or :data:`INTEGRATED` for closed loops, with the compiled solver where it has one."""
    if name in INTEGRATED:
        return ShotForm(name, posed(vehicle, pieces, objectives, 2, None, 4), INTEGRATED[name])
    return make(name, vehicle, pieces, objectives, solver="compiled")


def make(name: str, vehicle: Vehicle, pieces: int, objectives: tuple[Objective, ...], solver: str = "ipopt") -> Form:
    """A form of :data:`FORMS`; with ``, yaw locked`` behind its name for a vehicle that cannot turn.

    ``solver`` is the flat forms'; IPOPT, so that a difference is not one of tolerances (the compiled solver stops about
    0.0005 short of these objectives).
    """
    base, locked, _ = name.partition(", yaw locked")
    kind = FORMS[base]
    own: Any = YawLocked(vehicle) if locked and isinstance(vehicle, FossenVehicle) else vehicle
    problem = posed(own, pieces, objectives, kind.degree, kind.continuity, kind.nodes)
    return Form(name, problem, kind.planner, solver)
