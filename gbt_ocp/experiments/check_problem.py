"""What ``gbt-ocp check`` does: the parts of an experiment evaluated once, and one plan, without a run."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gbt_ocp.experiments.build.far_priors import far_priors
from gbt_ocp.experiments.build.team import build_team
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.guidance.planned import PlannedMotion
from gbt_ocp.guidance.startup import planned_of
from gbt_ocp.models.contracts import array, called, finite, named
from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.model_checks import dynamics_gap
from gbt_ocp.models.targets import Target
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.ocp.codegen.library import CompilerError
from gbt_ocp.ocp.codegen.problem_source import from_moments
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.ocp.planner import AnyPlanner
from gbt_ocp.ocp.problem_data import HardLimit, PenaltyLimit, PosedProblem
from gbt_ocp.ocp.terms import AnyObjective, Constraint, JointObjective, MovingConstraint
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array

INSTANTS = 201
"""Times between the start and the end of a run at which the target is asked for its position."""

WIDEST_GAP = 1.0e-3
"""Difference of forward and inverse dynamics, over the acceleration's scale, above which one of them is doubtful."""


@dataclass(frozen=True)
class Remark:
    """One line of what was found.

    Attributes
    ----------
    topic
        The part it is about.
    text
        What was found.
    doubtful
        Whether it is accepted, but likely not what was meant.
    """

    topic: str
    text: str
    doubtful: bool = False


def check_problem(configuration: Configuration) -> list[Remark]:
    """Build an experiment, evaluate its parts and make one plan.

    Parameters
    ----------
    configuration
        Of the experiment.

    Raises
    ------
    ConfigurationError
        If a part lacks something or does not fit the others; one line that names class and member.
    """
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always", RuntimeWarning)
            return [*_remarks(configuration), *(Remark("warning", str(one.message), True) for one in warned)]
    except (ValueError, CompilerError) as fault:
        raise ConfigurationError([f"{configuration.name}: {fault}"]) from fault


def _remarks(configuration: Configuration) -> list[Remark]:
    problem = configuration.problem_object
    found = [Remark("problem", f"{problem.name}: {problem.description}; {configuration.dimension} dimensions")]
    members, channel = build_team(configuration)
    loop, start = members[0].loop, members[0].start
    if channel is not None:
        found.append(Remark("vehicles", ", ".join(member.name for member in members)))
    forecast_times = configuration.forecast_period * np.arange(configuration.tracker.forecast + 1)
    found.append(_of_target(loop.target, configuration.duration_s + forecast_times[-1]))
    found.extend(_of_vehicle(loop.vehicle))
    begins = start[0, : configuration.dimension]
    found.extend(Remark("tracker", line, True) for line in far_priors(configuration.tracker, begins, loop.sensor))
    guidance = planned_of(loop.guidance)
    if guidance is None:
        return [*found, Remark("guidance", f"{type(loop.guidance).__name__}, which plans nothing")]
    # a planner of one of several vehicles is not written
    found.extend(one for one in _of_terms(guidance.planner.problem) if channel is None or one.topic != "codegen")
    if isinstance(guidance.planner, AnyPlanner) and not any(map(_is_joint, guidance.planner.problem.objectives)):
        mean = np.asarray(loop.target.position(forecast_times))
        known = Forecast(mean, np.tile(1e-4 * np.eye(configuration.dimension), (len(mean), 1, 1)))
        found.append(_of_plan(guidance, guidance.planner, start, known))
    return found


def _of_target(target: Target, until: float) -> Remark:
    """The target over the time that a run asks for."""
    times = np.linspace(0.0, until, INSTANTS)
    where = f"{named(target, 'position')} from 0 to {until:.6g} s"
    shape = (INSTANTS, target.dimension)
    given = called(target, "position", {"times": times}, f"positions of shape {shape}")
    path = finite(where, array(where, given, shape))
    speed = np.linalg.norm(np.diff(path, axis=0), axis=1).max() / times[1]
    return Remark("target", f"{type(target).__name__}: starts at {_numbers(path[0])} m, at most {speed:.3g} m/s")


def _of_vehicle(vehicle: Vehicle | DrivenBody) -> list[Remark]:
    if isinstance(vehicle, DrivenBody):
        limits, names = ThrustRange.of(vehicle), ", ".join(vehicle.input_names[vehicle.position_dimension])
        text = f"not flat, inputs {names} from {_numbers(limits.lower)} to {_numbers(limits.upper)}"
        return [Remark("vehicle", f"{vehicle.name}: {text}")]
    n, gap = vehicle.flat_dimension, dynamics_gap(vehicle)
    size = f"{n} flat outputs, {n} inputs up to {_numbers(vehicle.thrust_max)}"
    difference = f"forward and inverse dynamics differ by {gap:.2g} of a typical acceleration"
    return [
        Remark("vehicle", f"{type(vehicle).__name__}: {size}"),
        Remark("vehicle", difference, not gap <= WIDEST_GAP),
    ]


def _of_terms(problem: PosedProblem) -> list[Remark]:
    found = [Remark("objective", _described(term)) for term in problem.objectives]
    limits: Sequence[HardLimit | PenaltyLimit] = (*problem.hard, *problem.penalties)
    for limit in limits:
        size, how = len(limit.constraint.lower), "hard" if isinstance(limit, HardLimit) else "penalised"
        text = f"bounds {size} number{'s' * (size > 1)}, {how} at {limit.nodes} intervals a piece"
        found.append(Remark("limit", f"{_described(limit.constraint)}; {text}"))
    if not any(map(_is_joint, problem.objectives)):
        step = (
            "the complete step" if from_moments(problem) else "from recorded steps, since a term needs data of its own"
        )
        found.append(Remark("codegen", step))
    return found


def _of_plan(guidance: PlannedMotion, planner: AnyPlanner, start: Array, known: Forecast) -> Remark:
    """One plan for a target that is known."""
    guidance.see(None)
    plan = guidance.decide(0.0, start, known)
    assert isinstance(plan, Plan | ShootingPlan)
    guidance.restart()
    text = f"one plan with {planner.solver.name}: {plan.status} in {plan.iterations} iterations"
    text += f", answered by {plan.fallback}" if plan.fallback else ""
    return Remark("plan", f"{text}; objective {plan.objective:.4g}, violation {plan.violation:.2g}", not plan.solved)


def _described(term: AnyObjective | Constraint) -> str:
    """Class of a term and the numbers that it needs."""
    shapes = {} if hasattr(term, "lower") and not isinstance(term, MovingConstraint) else term.shapes
    numbers = ", ".join(f"{name} {tuple(shape)}" for name, shape in shapes.items())
    return f"{type(term).__name__}: needs {numbers or 'no numbers'}"


def _is_joint(term: object) -> bool:
    return isinstance(term, JointObjective)


def _numbers(values: Sequence[float] | Array) -> str:
    return f"({', '.join(f'{value:.4g}' for value in values)})"
