"""What a planner does differently for the two forms of a trajectory: its start, its trajectory, its plan."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.ocp.braking import BrakingPlanner
from gbt_ocp.ocp.check import LimitCheck
from gbt_ocp.ocp.objective_total import objective_total
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.ocp.problem_data import PosedProblem, ProblemData, ShootingData
from gbt_ocp.ocp.shot import Shots, ShotTrajectory
from gbt_ocp.ocp.shot_check import ShotCheck
from gbt_ocp.ocp.solvers.base import PlannerStep
from gbt_ocp.ocp.trajectory import FlatTrajectory, led_back, settling
from gbt_ocp.ocp.transcription import input_scale
from gbt_ocp.typing import Array

ASIDE = 1.0e-5
"""Thrust to one side where a cold solve begins, as a share of the full thrust."""

Named = Callable[[Array], dict[str, float]]
"""Amounts of all limits to those that are not zero, by name."""


def _checked(state: ArrayLike, shapes: Sequence[tuple[int, ...]]) -> Array:
    start = np.asarray(state, dtype=float)
    if start.shape not in shapes or not np.all(np.isfinite(start)):
        allowed = " or ".join(str(shape) for shape in shapes)
        raise ValueError(f"state: found shape {start.shape}; allowed: {allowed}, all numbers finite")
    return start


class _Sums:
    """The objectives of a problem on a trajectory, made when they are first asked for."""

    def __init__(self, problem: PosedProblem) -> None:
        self._problem = problem

    @cached_property
    def _totals(self) -> list[ca.Function]:
        return [objective_total(self._problem, term) for term in self._problem.objectives]

    def __call__(self, trajectory: FlatTrajectory | ShotTrajectory, parameters: Sequence[Array]) -> float:
        """The sum over the ends of the pieces, or of the periods."""
        columns = [values[:, -1].T for values in trajectory.sample(2)]
        return float(sum(float(f(*columns, p)) for f, p in zip(self._totals, parameters, strict=True)))


class PlanForm(Protocol):
    """What plans of both forms have; a trajectory is one of the form's own. See :class:`FlatPlans`."""

    scale: Array
    objective: _Sums

    @property
    def check(self) -> Any: ...  # noqa: D102

    def start(self, state: ArrayLike, acting: Array | None = None, expected: Array | None = None) -> Array: ...  # noqa: D102

    def acting(self, piece: Array) -> Array: ...  # noqa: D102

    def trajectory(self, start: Array, top: Array) -> Any: ...  # noqa: D102

    def coasting(self, start: Array) -> Array: ...  # noqa: D102

    def rest(self, previous: Any, start: Array) -> Array: ...  # noqa: D102

    def mended(self, start: Array, top: Array) -> Array | None: ...  # noqa: D102

    def braking(self, start: Array) -> Array: ...  # noqa: D102

    def plan(self, trajectory: Any, step: PlannerStep, named: Named, **rest: Any) -> Any: ...  # noqa: D102


class FlatPlans:
    """Plans of flat trajectories."""

    def __init__(self, problem: ProblemData) -> None:
        self._problem = problem
        self.scale = input_scale(problem)
        self.objective = _Sums(problem)

    # a solver that takes whole steps needs neither of these two, which take longer to make than many plans

    @cached_property
    def check(self) -> LimitCheck:
        """The limits on a fine grid."""
        return LimitCheck(self._problem)

    @cached_property
    def _brake(self) -> BrakingPlanner:
        return BrakingPlanner(self._problem)

    def start(self, state: ArrayLike, acting: Array | None = None, expected: Array | None = None) -> Array:
        """Derivatives of the flat output now, as many as are continuous ``(k+1, n)``.

        Where changes of the thrust count and it jumps, the acceleration that acts now follows them, by default none.
        """
        n, joined = self._problem.vehicle.flat_dimension, self._problem.joined
        found = _checked(state, list(dict.fromkeys([(joined, n), (joined + self._problem.remembers, n)])))
        if len(found) < joined + self._problem.remembers:
            found = np.vstack([found, np.zeros((1, n)) if acting is None else acting[None]])
        return found

    def acting(self, piece: Array) -> Array:
        """What the numbers of the first piece of the last plan say of what acts now ``(n,)``: its acceleration."""
        return np.asarray(piece[: self._problem.vehicle.flat_dimension])

    def trajectory(self, start: Array, top: Array) -> FlatTrajectory:
        """The piecewise polynomial."""
        return FlatTrajectory(self._problem.period, start[: self._problem.joined], top)

    def coasting(self, start: Array) -> Array:
        """Constant velocity and a little thrust to one side; :func:`cold_guess`."""
        return cold_guess(self._problem, start[: self._problem.joined])

    def rest(self, previous: FlatTrajectory, start: Array) -> Array:
        """The rest of a plan, the last piece coasting; where the start is off it, that comes to rest.

        A trajectory is linear in its start and in what is free. Without that a small error of the heading turns all
        thrust of the rest, and an error of the rates grows along it.
        """
        top, period = previous.shifted().top, self._problem.period
        start = start[: self._problem.joined]
        d = self._problem.vehicle.position_dimension
        # relative to where both begin, as the kernel has it: the last bits of a guess decide between equal plans
        begin, here = previous.start.copy(), start.copy()
        begin[0, :d] = here[0, :d] = 0.0
        off = here - FlatTrajectory(period, begin, previous.top[:1]).knots[1]
        off[0, :d] += start[0, :d] - previous.start[0, :d]
        off[0, d:] = np.vectorize(math.remainder, otypes=[float])(off[0, d:], 2.0 * math.pi)
        return led_back(off, top, period)

    def mended(self, start: Array, top: Array) -> Array | None:
        """The first piece brought within the thrust and the rest led back to itself; ``None`` where that cannot be."""
        return self._brake.mended(start[: self._problem.joined], top)

    def braking(self, start: Array) -> Array:
        """What is free in a braking trajectory."""
        return self._brake(start[: self._problem.joined]).top

    def plan(self, trajectory: FlatTrajectory, step: PlannerStep, named: Named, **rest: Any) -> Plan:
        """A plan with the trajectory."""
        return Plan(trajectory=trajectory, **_told(step, named), **rest)


class ShotPlans:
    """Plans of trajectories by integration."""

    def __init__(self, problem: ShootingData) -> None:
        self._problem, self._shots = problem, Shots(problem)
        self.scale = self._shots.form.scale
        self.objective = _Sums(problem)
        form = self._shots.form
        self._resort = ca.Function("resort", [form.point], [form.resort])
        self._range = ThrustRange.of(problem.vehicle)

    @cached_property
    def check(self) -> ShotCheck:
        """The limits on a fine grid."""
        return ShotCheck(self._shots)

    def start(self, state: ArrayLike, acting: Array | None = None, expected: Array | None = None) -> Array:
        """The state of the vehicle, from itself or from z and ż ``(2, n)``.

        What these do not tell is as near to the ``expected`` state ``(states,)`` as they allow, where the vehicle can
        say that. Where the rates of the inputs are limited, those that act now follow it, ``acting`` ``(m,)``, by
        default none; or they follow the state already.
        """
        form, dynamics = self._shots.form, self._shots.form.dynamics
        shapes = dict.fromkeys([(dynamics.states,), (2, self._problem.vehicle.flat_dimension), (form.states,)])
        found = _checked(state, [*shapes])
        if found.ndim == 2:
            found = dynamics.state(found[0], found[1], expected)
        if len(found) < form.states:
            found = np.concatenate([found, np.zeros(dynamics.inputs) if acting is None else acting])
        return found

    def trajectory(self, start: Array, top: Array) -> ShotTrajectory:
        """Integrated from the start."""
        return self._shots.trajectory(start, top)

    def acting(self, piece: Array) -> Array:
        """The inputs at the end of the first piece of the last plan ``(m,)``."""
        return np.asarray(piece[-len(self._problem.vehicle.thrust_max) :])

    def coasting(self, start: Array) -> Array:
        """As good as no thrust, or what the vehicle calls idle, and a little to one side."""
        form, upper = self._shots.form, np.asarray(self._problem.vehicle.thrust_max, dtype=float)
        m = form.dynamics.inputs
        aside = ASIDE / np.sqrt(np.arange(1, m + 1))
        return np.tile(form.idle / upper + aside, (self._problem.pieces, self._problem.freedoms // m))

    def rest(self, previous: ShotTrajectory, start: Array) -> Array:
        """The rest of a plan, wherever it starts; in the last piece the inputs stay as they are at the end."""
        top, m = previous.top, self._shots.form.dynamics.inputs
        return np.vstack([top[1:], np.tile(top[-1, -m:], top.shape[1] // m)])

    def mended(self, start: Array, top: Array) -> Array | None:
        """None: the inputs are what is planned, and keep within their limits between nodes where they do at these."""
        return None

    def braking(self, start: Array) -> Array:
        """The vehicle's last resort, or else no thrust, as near as the inputs and their rates may be."""
        form, m = self._shots.form, self._shots.form.dynamics.inputs
        top, state = np.zeros((self._problem.pieces, self._problem.freedoms)), np.array(start, dtype=float)
        for piece in top:
            inputs = np.asarray(self._resort(np.concatenate([state, np.zeros(form.held + 1)]))).ravel()
            if form.states > form.dynamics.states:
                before, most = state[form.dynamics.states :], form.steps_of_inputs
                inputs = np.clip(inputs, before - most, before + most)
            piece[:] = np.tile(self._range.clip(inputs), len(piece) // m)
            state = self._shots.end(np.concatenate([state, piece]))
        return top

    def plan(self, trajectory: ShotTrajectory, step: PlannerStep, named: Named, **rest: Any) -> ShootingPlan:
        """A plan with the inputs of each period."""
        thrust = trajectory.thrust([0.0, 1.0])
        return ShootingPlan(
            thrust=thrust[:, 0],
            thrust_end=None if self._problem.thrust == "held" else thrust[:, 1],
            period=self._problem.period,
            knots=trajectory.knots,
            held=trajectory.top / np.tile(self._problem.vehicle.thrust_max, trajectory.top.shape[1] // thrust.shape[2]),
            **_told(step, named),
            **rest,
        )


def _told(step: PlannerStep, named: Named) -> dict[str, Any]:
    """What plans of both forms say of the step."""
    return {
        "status": step.status,
        "violation": float(step.piece_violation.max()),
        "piece_violation": step.piece_violation,
        "iterations": step.iterations,
        "fallback": step.fallback,
        "tightened": step.tightened,
        "given_up": named(step.given_up),
        "broken_at_start": named(step.broken_at_start),
    }


def cold_guess(problem: ProblemData, start: Array) -> Array:
    """Where a cold solve begins, u ``(p, freedoms)``: constant velocity, and a little thrust to one side.

    From a start that is symmetric, as dead ahead of an obstacle, Newton's steps are so too, and may end on a ridge
    between two plans. Inherited accelerations settle there. The generated C has the same (``gbt_coast``).
    """
    top, n, knot = np.zeros((problem.pieces, problem.freedoms)), start.shape[1], start
    aside = ASIDE / np.sqrt(np.arange(1, n + 1)) * problem.vehicle.acceleration_scale
    for piece in top:
        piece[:n] = settling(knot, 2, aside, problem.period)
        knot = FlatTrajectory(problem.period, knot, piece[None]).knots[1]
    return top / input_scale(problem)


def plan_form(problem: PosedProblem) -> PlanForm:
    """:class:`FlatPlans` or :class:`ShotPlans`, which have the same members."""
    if isinstance(problem, ShootingData):
        return ShotPlans(problem)
    assert isinstance(problem, ProblemData), "there are no others"
    return FlatPlans(problem)
