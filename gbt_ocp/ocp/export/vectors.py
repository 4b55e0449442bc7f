"""Recorded steps of a planner: what goes in and what comes out, for the generated code to be held against."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.codegen.expressions import c_array
from gbt_ocp.ocp.codegen.problem_source import from_moments
from gbt_ocp.ocp.planner import AnyPlanner
from gbt_ocp.ocp.problem_data import PosedProblem
from gbt_ocp.ocp.solvers.compiled import STATUSES
from gbt_ocp.ocp.solvers.kernel_arrays import MomentsOfStep
from gbt_ocp.typing import Array

STEPS = 20
"""How many steps are recorded, at most."""

OFFERED = 30
"""How many steps to bring for that, since some hang on rounding."""

SHAKE = 1.0e-11
"""Relative change of the state under which a step must keep its plan to be recorded."""

LEAST_MOVE = 1.0e-6
"""How far an endpoint may move for that (m, rad): rounding, far smaller, then moves none by 1e-9."""


@dataclass(frozen=True)
class Vectors:
    """Inputs and plans of single steps.

    Only steps are recorded whose plan does not hang on rounding: the problem is not convex, and here and there the
    last bit decides between two plans that are equally good.

    Attributes
    ----------
    arrays
        One step a row: ``state``, ``warm``, ``previous`` and ``begin`` (what the planner remembers), ``mean``,
        ``covariance`` and ``desired`` or ``parameters``, and the ``endpoints`` of the plan.
    statuses
        Exit codes of the kernel ``(K,)``.
    """

    arrays: dict[str, Array]
    statuses: list[int]

    @property
    def header(self) -> str:
        """As a C header."""
        parts = ["/* Generated: recorded steps of the planner. */\n", f"#define VECTORS {len(self.statuses)}\n\n"]
        for name, values in self.arrays.items():
            kind = "double" if name == "parameters" else "gbt_real"
            parts.append(c_array(kind, f"vector_{name}", values))
        parts.append(c_array("int", "vector_status", self.statuses))
        return "".join(parts)


def record(planner: AnyPlanner, steps: Sequence[Mapping[str, Any]] | None = None) -> Vectors:
    """Plan for these steps, one after the other, as the planner does; its memory is left as it is.

    Parameters
    ----------
    planner
        With the compiled solver.
    steps
        Arguments of :meth:`AnyPlanner.solve` for each step. ``None`` for a vehicle that follows its own plans around a
        drifting forecast, which any objective from the moments of a forecast understands.

    Raises
    ------
    ValueError
        If there are no steps and the objective needs data of its own.
    """
    problem = planner.problem
    planner = type(planner)(problem, planner.solver)
    moments = from_moments(problem)
    if steps is None and not moments:
        raise ValueError("steps: found None; allowed: arguments of solve(), since the objective needs data of its own")
    drill = _Drill(problem)
    rng = np.random.default_rng(0)
    rows: dict[str, list[Array]] = {}
    statuses: list[int] = []
    for number in range(2 * STEPS if steps is None else len(steps)):
        step = drill.step() if steps is None else steps[number]
        before = planner.previous
        row = _inputs(planner, step, moments)
        shaken = [_shaken(planner, step, rng) for _ in range(2)]
        planner.previous = before
        plan = planner.solve(**step)
        drill.state = plan.knots[1]
        if max(np.abs(other - plan.endpoints).max() for other in shaken) > LEAST_MOVE:
            continue
        row["endpoints"] = plan.endpoints
        row["warm"] = np.array([before is not None])
        row["previous"] = np.zeros((problem.pieces, problem.freedoms)) if before is None else before.top
        row["begin"] = np.zeros(row["state"].size)
        if before is not None:
            row["begin"][: before.start.size] = before.start.ravel()
        for name, values in row.items():
            rows.setdefault(name, []).append(np.asarray(values, dtype=float).ravel())
        statuses.append(STATUSES.index(plan.status))
        if len(statuses) == STEPS:
            break
    if not statuses:
        raise ValueError(f"steps: found {number + 1}, all of them with plans that rounding decides; allowed: others")
    return Vectors({name: np.array(values) for name, values in rows.items()}, statuses)


def _inputs(planner: AnyPlanner, step: Mapping[str, Any], moments: bool) -> dict[str, Array]:
    problem = planner.problem
    data = {name: value for name, value in step.items() if name != "state"}
    row = {"state": planner.start(step["state"])}
    if moments:
        given = MomentsOfStep(problem)
        given.take(data)
        return row | given.arrays
    binding = Binding(problem)
    blocks = [binding.objective_parameters(data), binding.limit_parameters(data)]
    return row | {"parameters": np.concatenate([np.vstack(block).T.ravel() for block in blocks if block])}


def _shaken(planner: AnyPlanner, step: Mapping[str, Any], rng: np.random.Generator) -> Array:
    """Endpoints of the plan from a state that rounding might have changed."""
    before = planner.previous
    state = np.asarray(step["state"], dtype=float)
    state = state + SHAKE * (1.0 + np.abs(state)) * rng.normal(size=state.shape)
    plan = planner.solve(**{**step, "state": state})
    planner.previous = before
    return plan.endpoints


class _Drill:
    """A vehicle at rest that meets a target drifting by, whose forecast sharpens."""

    def __init__(self, problem: PosedProblem) -> None:
        self._problem = problem
        d = problem.vehicle.position_dimension
        self._rng = np.random.default_rng(0)
        self._velocity = self._rng.normal(size=d) * 0.5
        self._desired = DesiredBearing(d, 2.0 * np.pi / (10.0 * problem.period))
        self._count = 0
        self.state = np.zeros((problem.joined, problem.vehicle.flat_dimension))
        self.state[0, :d] = self._rng.uniform(-3.0, 3.0, d)

    def step(self) -> dict[str, Any]:
        d, p, period = self._problem.vehicle.position_dimension, self._problem.pieces, self._problem.period
        times = (self._count + 1 + np.arange(p)) * period
        spread = 0.02 + np.exp(-self._count / 5.0)
        root = spread * self._rng.normal(size=(p, d, d))
        error = 0.3 * spread * self._rng.normal(size=d)
        covariance = root @ np.swapaxes(root, 1, 2)
        forecast = SimpleNamespace(mean=times[:, None] * self._velocity + error, covariance=covariance)
        # what a limit on the target asks for besides; the covariance of the first endpoint serves
        now = SimpleNamespace(mean=self._count * period * self._velocity + error, covariance=covariance[0])
        self._count += 1
        return {"state": self.state, "forecast": forecast, "desired": self._desired(times), "present": now}
