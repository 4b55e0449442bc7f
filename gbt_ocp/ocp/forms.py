"""The two forms of a trajectory, as the code generator reads them: what is known at a point of a piece.

A form says which numbers describe a point, and what objectives and constraints are there, in CasADi. The flat form is
that of :class:`~gbt_ocp.ocp.problem_data.ProblemData`, the other one that of
:class:`~gbt_ocp.ocp.problem_data.ShootingData`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from gbt_ocp.models.dynamics import Dynamics, StepDerivatives, differentiated, integrated
from gbt_ocp.ocp.objective_total import stacked_size, unstacked
from gbt_ocp.ocp.problem_data import HardLimit, PenaltyLimit, PosedProblem, ProblemData, ShootingData
from gbt_ocp.ocp.terms import AccumulatedObjective, Constraint, Objective, at_endpoint
from gbt_ocp.ocp.thrust_limits import InputRateLimit, OfChanges, OfInputs, ThrustChange, ThrustLimit
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.ocp.transcription import change_of_thrust, constraint_value, first_free_node, input_scale, limit_size
from gbt_ocp.typing import Array


class LimitGrid(NamedTuple):
    """Where a constraint is imposed in each piece: at k T / intervals, k = first … intervals.

    ``given`` says whether no plan can change it at the start, ``steady`` whether it is never broken more between the
    nodes than at them, ``share`` what part of the trapezoidal rule's weight the nodes miss, as a factor.
    """

    intervals: int
    first: int
    given: bool
    steady: bool
    share: float


class FlatForm:
    """The form of flat trajectories: a point is z, ż, z̈ ``(3n,)``.

    Where changes of the thrust count, z⃛ follows, or where thrust jumps the acceleration of the piece before.
    """

    at_end = False

    def __init__(self, problem: ProblemData) -> None:
        self._problem = problem
        self.seen = 3 + any(isinstance(constraint, ThrustChange) for constraint in problem.constraints)
        self.width = self.seen * problem.vehicle.flat_dimension
        self.point = ca.SX.sym("point", self.width)
        self.objective_point = self.point
        self.scale = input_scale(problem)

    def objective(self, term: Objective | AccumulatedObjective, stacked: Any) -> Any:
        """A term at an endpoint, or what that adds to its sums, of :attr:`objective_point`."""
        return at_endpoint(term, self._split(self.point), unstacked(term.shapes, stacked))

    def at_end_of_state(self, read: Sequence[int]) -> bool:
        """Whether these numbers of :attr:`objective_point` are those that the next piece begins with."""
        return max(read, default=0) < min(self._problem.joined, 3) * self._problem.vehicle.flat_dimension

    def constraint(self, constraint: Constraint, stacked: Any) -> Any:
        """The bounded quantities at :attr:`point`."""
        if isinstance(constraint, ThrustChange):
            motion = ca.vertsplit(self.point, self._problem.vehicle.flat_dimension)
            return change_of_thrust(self._problem, constraint, motion)
        return constraint_value(constraint, self._split(self.point), stacked)

    def at_node(self, constraint: Constraint, stacked: Any) -> Any:
        """The same, as the generated C has it."""
        return self.constraint(constraint, stacked)

    def moves(self, constraint: Constraint) -> bool:
        """Whether the generated C has a constraint as a function of the state at its node, which steps lead to."""
        return False

    def grid(self, limit: HardLimit | PenaltyLimit) -> LimitGrid:
        """Where a limit is imposed; a penalty also at the node where nothing can change it."""
        if isinstance(limit.constraint, ThrustChange):
            # a step between two pieces, seen in the body frames at both ends of the later one
            return LimitGrid(1 if self._problem.remembers else limit.nodes, 0, False, False, 1.0)
        given = first_free_node(self._problem, limit.constraint)
        return LimitGrid(limit.nodes, given if isinstance(limit, HardLimit) else 0, bool(given), False, 1.0)

    def node_tables(self, shares: Array) -> dict[str, Array]:
        """What the kernel reads at the nodes of a limit, at these shares of a piece, by name."""
        orders = np.arange(self._problem.degree + 1)
        powers = (self._problem.period * shares)[:, None] ** orders
        return {"taylor": (powers / np.cumprod(np.maximum(orders, 1))).ravel()}

    @property
    def depends_on_place(self) -> bool:
        """Whether the dynamics depend on the position, as in a current that differs from place to place."""
        vehicle = self._problem.vehicle
        z, dz, ddz = (ca.SX.sym(name, vehicle.flat_dimension) for name in ("z", "dz", "ddz"))
        return bool(ca.depends_on(ca.vertcat(vehicle.inputs(z, dz, ddz)), z[: vehicle.position_dimension]))

    def _split(self, point: ca.SX) -> FlatPoint:
        return FlatPoint(*ca.vertsplit(point, self._problem.vehicle.flat_dimension)[:3])


class ShootingForm:
    """The form of trajectories by integration: a point is state, inputs of the piece and the share of it that is over.

    Where the rates of inputs count, the inputs at the end of the piece before follow the state of the vehicle.

    Attributes
    ----------
    states, held
        Numbers of the state, and unknowns of a piece.
    width
        Both together.
    steps
        Runge-Kutta steps over a piece: those of the problem, or where there are several as few more as it takes for
        the nodes of all limits to lie at their ends.
    at_end
        Whether the objective reads nothing but the state at the end of a piece.
    """

    def __init__(self, problem: ShootingData) -> None:
        self._problem, self.dynamics = problem, Dynamics(problem.vehicle)
        self.states = self.dynamics.states + self.dynamics.inputs * problem.remembers_inputs
        self.held = problem.freedoms
        imposed: list[HardLimit | PenaltyLimit] = [*problem.hard, *problem.penalties]
        nodes = [limit.nodes for limit in imposed if self._reads_state(limit.constraint)]
        steps = problem.runge_kutta_steps
        self.steps = 1 if steps == 1 else steps + -steps % math.lcm(1, *nodes)
        self.width = self.states + self.held
        self.point = ca.SX.sym("point", self.width + 1)
        self.scale = np.tile(problem.vehicle.thrust_max, problem.freedoms // self.dynamics.inputs)
        self.objective_point = self.point[: self.width]
        self.at_end = not any(self._reads_inputs(term) for term in problem.objectives)

    def state_after(self, share: Any) -> Any:
        """The state after a share of the piece ``(states,)``."""
        moved = self.point[: self.dynamics.states]
        for k in range(self.steps):
            begin, end = k / self.steps, (k + 1) / self.steps
            if self.steps == 1:
                end = share
            elif not isinstance(share, float) or share < 1.0:
                begin, end = ca.fmin(begin, share), ca.fmin(end, share)
            moved = self.flow(moved, begin, end)
        return ca.vertcat(moved, self.inputs_after(1.0)) if self._problem.remembers_inputs else moved

    def flow(self, state: Any, begin: Any, end: Any) -> Any:
        """The vehicle's state after one Runge-Kutta step from one share of the piece to another."""
        inputs = self.inputs_after(begin), self.inputs_after(end)
        return integrated(self.dynamics, state, inputs, (end - begin) * self._problem.period, 1)

    def derivatives(self, begin: Any, end: Any, multiplier: ca.SX) -> StepDerivatives:
        """That step from the vehicle's state in :attr:`point`, with its derivatives by the numbers of the piece."""
        own, inputs = self.dynamics.states, (self.inputs_after(begin), self.inputs_after(end))
        duration, piece = (end - begin) * self._problem.period, self.point[: self.width]
        return differentiated(self.dynamics, piece[:own], inputs, duration, piece, multiplier[:own])

    def inputs_after(self, share: Any) -> Any:
        """The inputs after a share of the piece ``(m,)``."""
        first, last = self._ends()
        return first + (last - first) * share if self._problem.thrust == "linear" else first

    def objective(self, term: Objective | AccumulatedObjective, stacked: Any) -> Any:
        """A term at an endpoint, or what that adds to its sums, of :attr:`objective_point`."""
        state = self.point[: self.states] if self.at_end else self.state_after(1.0)
        return at_endpoint(term, self.flat_point(state, self.inputs_after(1.0)), unstacked(term.shapes, stacked))

    def at_end_of_state(self, read: Sequence[int]) -> bool:
        """Whether these numbers of :attr:`objective_point` are those that the next piece begins with."""
        return self.at_end and max(read, default=0) < self.states

    def constraint(self, constraint: Constraint, stacked: Any) -> Any:
        """The bounded quantities at :attr:`point`; the thrust is one of its numbers."""
        return self._bounded(constraint, stacked, self.state_after(self.point[self.width]))

    def at_node(self, constraint: Constraint, stacked: Any) -> Any:
        """The same, as the generated C has it: where :meth:`moves`, the state in the point is that at the node."""
        return (
            self._bounded(constraint, stacked, self.point) if self.steps > 1 else self.constraint(constraint, stacked)
        )

    def moves(self, constraint: Constraint) -> bool:
        """Whether the generated C has a constraint as a function of the state at its node, which steps lead to."""
        return self.steps > 1 and self._reads_state(constraint)

    def _reads_state(self, constraint: Constraint) -> bool:
        return not isinstance(constraint, OfInputs | OfChanges)

    def _bounded(self, constraint: Constraint, stacked: Any, state: Any) -> Any:
        share = self.point[self.width]
        inputs = self.inputs_after(share)
        if isinstance(constraint, OfInputs):
            return constraint.of_inputs(inputs)
        if isinstance(constraint, OfChanges):
            before = self.point[self.dynamics.states : self.states]
            return constraint.of_change(self.inputs_after(1.0) - before, self._problem.period)
        return constraint_value(constraint, self.flat_point(state, inputs), stacked)

    @property
    def box(self) -> int:
        """The number of the hard limit that bounds the unknowns of a piece, each by itself; -1 where there is none."""
        if self._problem.remembers_inputs or any(isinstance(o, AccumulatedObjective) for o in self._problem.objectives):
            return -1
        for number, limit in enumerate(self._problem.hard):
            if isinstance(limit.constraint, ThrustLimit):
                return number
        return -1

    def grid(self, limit: HardLimit | PenaltyLimit) -> LimitGrid:
        """Where a limit is imposed: thrust that is held once a piece, thrust that is linear at both ends."""
        constraint = limit.constraint
        if isinstance(constraint, OfChanges):
            return LimitGrid(1, 1, False, True, 2.0)
        if isinstance(constraint, ThrustLimit):
            if self.held == self.dynamics.inputs:
                return LimitGrid(1, 1, False, True, 2.0)
            return LimitGrid(1 if isinstance(limit, HardLimit) else limit.nodes, 0, False, True, 1.0)
        value = ca.SX(self.constraint(constraint, ca.SX.sym("p", limit_size(constraint))))
        begin = ca.substitute(value, self.point[self.width], ca.SX(0))
        given = not ca.depends_on(ca.simplify(begin), self.point[self.states : self.width])
        return LimitGrid(limit.nodes, int(given) if isinstance(limit, HardLimit) else 0, given, False, 1.0)

    @property
    def depends_on_place(self) -> bool:
        """Whether the dynamics depend on the position, as in a current that differs from place to place."""
        return self.dynamics.depends_on_place

    def _ends(self) -> tuple[Any, Any]:
        """The inputs at the beginning and at the end of the piece."""
        inputs, m = self.point[self.states : self.width], self.dynamics.inputs
        if self._problem.thrust == "linear" and self._problem.remembers_inputs:
            return self.point[self.dynamics.states : self.states], inputs
        return inputs[:m], inputs[-m:]

    def flat_point(self, state: Any, inputs: Any) -> FlatPoint:
        """z and its derivatives at a state under these inputs, as if held."""
        own = self.dynamics.states
        symbols = ca.SX.sym("state", own), ca.SX.sym("inputs", self.dynamics.inputs)
        found = ca.substitute([*self.dynamics.point(*symbols)], [*symbols], [ca.SX(state)[:own], ca.SX(inputs)])
        return FlatPoint(*found)

    @property
    def resort(self) -> Any:
        """Inputs of the last resort ``(m,)`` at the state of :attr:`point`: the vehicle's own, or none at all."""
        own = getattr(self._problem.vehicle, "last_resort", None)
        return ca.SX.zeros(self.dynamics.inputs) if own is None else ca.SX(own(self.point[: self.dynamics.states]))

    @property
    def idle(self) -> Array:
        """Inputs ``(m,)`` with which the vehicle goes on as it does, as near as that is known: a cold guess."""
        return np.asarray(getattr(self._problem.vehicle, "idle", np.zeros(self.dynamics.inputs)), dtype=float)

    @property
    def steps_of_inputs(self) -> Array:
        """How far an input may change over a piece ``(m,)``; infinite where its rate is not limited."""
        most = np.full(self.dynamics.inputs, np.inf)
        for constraint in self._problem.constraints:
            if isinstance(constraint, InputRateLimit):
                most = np.minimum(most, self._problem.period * np.asarray(constraint.rate))
        return most

    def _reads_inputs(self, term: Any) -> bool:
        """Whether a term depends on the inputs beside the state, through a derivative of z."""
        state, inputs = ca.SX.sym("state", self.dynamics.states), ca.SX.sym("inputs", self.dynamics.inputs)
        if not isinstance(term, AccumulatedObjective) and not hasattr(term, "value"):
            return False
        numbers = unstacked(term.shapes, ca.SX.sym("p", stacked_size(term.shapes)))
        value = at_endpoint(term, FlatPoint(*self.dynamics.point(state, inputs)), numbers)
        return bool(ca.depends_on(ca.SX(value), inputs))


def form_of(problem: PosedProblem) -> FlatForm | ShootingForm:
    """The form of a problem's trajectories."""
    if isinstance(problem, ShootingData):
        return ShootingForm(problem)
    assert isinstance(problem, ProblemData), "there are no others"
    return FlatForm(problem)
