"""From the description to CasADi: the objective, the penalties and the limits as functions of the unknowns.

The unknowns u, one piece a column, are the derivatives that a piece does not take over from the one before (with the
continuity of the paper its L-th) over their natural size: the endpoints in better scaled coordinates. Every quantity of
a piece is a function of one point (z, ż, z̈), mapped over the nodes, so the graph stays small however many nodes there
are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gbt_ocp.ocp.constraints import Constraint, MovingConstraint
from gbt_ocp.ocp.objectives import JointObjective, Objective
from gbt_ocp.ocp.penalty import smoothed_hinge, trapezoid_weights
from gbt_ocp.ocp.problem import TrajectoryProblem
from gbt_ocp.ocp.trajectory import FlatPoint, FlatTrajectory, propagate

Array = NDArray[np.float64]


FINE_POINTS = 101
"""Grid points a piece at which a finished trajectory is held against its limits, both ends included."""


def input_scale(problem: TrajectoryProblem) -> Array:
    """Natural sizes of a piece's unknowns ``(freedoms,)``: what changes z̈ by its scale within a period."""
    orders = range(problem.joined, problem.degree + 1)
    return np.concatenate([problem.vehicle.acceleration_scale / problem.period ** (order - 2) for order in orders])


def point_symbols(size: int) -> FlatPoint:
    """Symbols z, ż, z̈ ``(n,)``."""
    return FlatPoint(*(ca.SX.sym(name, size) for name in ("z", "dz", "ddz")))


def limit_size(constraint: Constraint) -> int:
    """How many parameters a constraint has at one time."""
    shapes = constraint.shapes if isinstance(constraint, MovingConstraint) else {}
    return sum(rows * columns for rows, columns in shapes.values())


def constraint_value(constraint: Constraint, point: FlatPoint, stacked: Any) -> Any:
    """The bounded quantities ``(m,)`` as a CasADi expression, parameters (if any) stacked column by column."""
    if not isinstance(constraint, MovingConstraint):
        return constraint.value(point)
    parameters, offset = {}, 0
    for name, (rows, columns) in constraint.shapes.items():
        parameters[name] = ca.reshape(stacked[offset : offset + rows * columns], rows, columns)
        offset += rows * columns
    return constraint.value(point, parameters)


def constraint_function(problem: TrajectoryProblem, constraint: Constraint) -> ca.Function:
    """(z, ż, z̈) -> the bounded quantities ``(m,)``; with the parameters as a fourth input where there are any."""
    point, stacked = point_symbols(problem.vehicle.flat_dimension), ca.SX.sym("p", limit_size(constraint))
    inputs = [*point, stacked] if stacked.numel() else [*point]
    return ca.Function("constraint", inputs, [constraint_value(constraint, point, stacked)])


def between_knots(knots: Any, shares: Array) -> list[Any]:
    """Parameters at these shares of every piece, one a column, from those at the knots ``(size, p+1)``.

    One more argument for :func:`constraint_function`, or none. Works on numbers and on CasADi expressions alike.
    """
    size, columns = knots.shape
    if not size:
        return []
    parts = [(1.0 - s) * knots[:, i] + s * knots[:, i + 1] for i in range(columns - 1) for s in shares]
    return [np.stack(parts, axis=1) if isinstance(knots, np.ndarray) else ca.horzcat(*parts)]


def objective_function(problem: TrajectoryProblem, objective: Objective) -> ca.Function:
    """(z, ż, z̈, parameters) -> the term at one endpoint; the parameters are stacked column by column."""
    point = point_symbols(problem.vehicle.flat_dimension)
    parameters = {name: ca.SX.sym(name, *shape) for name, shape in objective.shapes.items()}
    stacked = ca.vertcat(*(ca.vec(symbol) for symbol in parameters.values()))
    return ca.Function(
        "objective", [*point, stacked], [objective.value(point, parameters)], ["z", "dz", "ddz", "p"], ["value"]
    )


def unstacked(shapes: Mapping[str, tuple[int, int]], stacked: Any) -> dict[str, Any]:
    """Parameters by name out of what :func:`stack_parameters` stacked at one time, as CasADi expressions."""
    found, offset = {}, 0
    for name, (height, width) in shapes.items():
        found[name] = ca.reshape(stacked[offset : offset + height * width], height, width)
        offset += height * width
    return found


def objective_total(problem: TrajectoryProblem, objective: Objective | JointObjective) -> ca.Function:
    """(Z, Ż, Z̈, parameters), one endpoint a column, -> the term of all endpoints together."""
    if not isinstance(objective, JointObjective):
        single = objective_function(problem, objective).map(problem.pieces)
        columns = [ca.MX.sym(single.name_in(k), *single.size_in(k)) for k in range(4)]
        return ca.Function("objective", columns, [ca.sum2(single(*columns))])
    n, p = problem.vehicle.flat_dimension, problem.pieces
    size = sum(height * width for height, width in objective.shapes.values())
    ends = [ca.SX.sym(name, n, p) for name in ("z", "dz", "ddz")]
    stacked = ca.SX.sym("p", size, p)
    points, parameters = [], []
    for k in range(p):
        points.append(FlatPoint(*(values[:, k] for values in ends)))
        parameters.append(unstacked(objective.shapes, stacked[:, k]))
    return ca.Function("objective", [*ends, stacked], [objective.total(points, parameters)])


def stack_parameters(term: Objective | JointObjective | MovingConstraint, bound: Mapping[str, Array]) -> Array:
    """Numbers for the parameters of a term, one time a column ``(size, p)``, or ``(size, p+1)`` of a constraint."""
    columns = [np.asarray(bound[name]).transpose(0, 2, 1).reshape(len(bound[name]), -1) for name in term.shapes]
    return np.hstack(columns).T


def first_free_node(problem: TrajectoryProblem, constraint: Constraint) -> int:
    """The first node of a piece at which the piece's own unknown moves the constraint: 0 or 1.

    Where only z and ż are continuous the acceleration jumps at a boundary, so what depends on z̈ counts on both sides
    of it. Everything else is continuous there: at its first node a piece repeats the last one of the piece before, and
    the first piece what is given.
    """
    point, stacked = point_symbols(problem.vehicle.flat_dimension), ca.SX.sym("p", limit_size(constraint))
    value = ca.SX(constraint_value(constraint, point, stacked))
    return 0 if problem.joined == 2 and ca.depends_on(value, point.ddz) else 1


@dataclass(frozen=True)
class Transcription:
    """The nonlinear program ``min objective + penalty`` subject to ``lower <= limits <= upper``.

    ``variables`` is u, piece by piece ``(freedoms p,)``; ``parameters`` stacks the start, the parameters of the
    objectives and of the constraints, and (ϖ, w_p, tightening) of each penalty. The penalty is ``Σ cost g(excess)``
    with g of half width ``width``.
    """

    variables: ca.MX
    parameters: ca.MX
    objective: ca.MX
    penalty: ca.MX
    excess: ca.MX
    cost: ca.MX
    width: ca.MX
    limits: ca.MX
    lower: Array
    upper: Array
    scale: Array

    @property
    def nlp(self) -> dict[str, ca.MX]:
        """The program in CasADi's form."""
        return {"x": self.variables, "p": self.parameters, "f": -self.objective + self.penalty, "g": self.limits}

    @property
    def elastic_nlp(self) -> dict[str, ca.MX]:
        """The same program with the kinks of the penalty told as constraints, which Newton's method can follow.

        The smoothed hinge is the infimal convolution of a hinge and a square:
        ``g(y) = min s + e²/(4ϖ)`` over ``s >= 0, e`` with ``s + e >= y + ϖ``. So with s and e as further unknowns
        (after u, in this order) and those inequalities after the limits, the minimisers u are the same.
        """
        size = self.excess.numel()
        s, e = ca.MX.sym("s", size), ca.MX.sym("e", size)
        return {
            "x": ca.vertcat(self.variables, s, e),
            "p": self.parameters,
            "f": -self.objective + ca.dot(self.cost, s + e**2 / (4.0 * self.width)),
            "g": ca.vertcat(self.limits, s + e - self.excess - self.width),
        }


def transcribe(problem: TrajectoryProblem) -> Transcription:
    """Build the nonlinear program symbolically (MX, with map over the nodes)."""
    n, p, joined = problem.vehicle.flat_dimension, problem.pieces, problem.joined
    variables = ca.MX.sym("u", problem.freedoms * p)
    start = ca.MX.sym("start", n, joined)
    scaled = variables * ca.repmat(ca.DM(input_scale(problem)), p, 1)
    free = [ca.horzsplit(ca.reshape(own, n, -1)) for own in ca.vertsplit(scaled, problem.freedoms)]
    knots = [ca.horzsplit(start)]
    for i in range(p):
        knots.append(propagate(knots[-1], free[i], problem.period)[:joined])

    def at(times: Array) -> list[ca.MX]:
        """z, ż, z̈ at these times of every piece, one a column."""
        points = [propagate(knots[i], free[i], float(s)) for i in range(p) for s in times]
        return [ca.horzcat(*(point[order] for point in points)) for order in range(3)]

    parameters, objective = [ca.vec(start)], ca.MX(0)
    for term in problem.objectives:
        function = objective_total(problem, term)
        values = ca.MX.sym("p", function.size1_in(3), p)
        parameters.append(ca.vec(values))
        objective += function(*at(np.array([problem.period])), values)

    moving = {}
    for number, constraint in enumerate(problem.constraints):
        moving[number] = ca.MX.sym("limit", limit_size(constraint), p + 1)
        parameters.append(ca.vec(moving[number]))

    excesses, costs, widths = [], [], []
    for number, soft in enumerate(problem.penalties, start=len(problem.hard)):
        settings = ca.MX.sym("penalty", 3)
        parameters.append(settings)
        width, weight, tightening = ca.vertsplit(settings)
        c = soft.constraint
        function = constraint_function(problem, c)
        shares = np.linspace(0.0, 1.0, soft.nodes + 1)
        columns = [*at(problem.period * shares), *between_knots(moving[number], shares)]
        values = function.map(p * len(shares))(*columns)
        inside = ca.DM(c.backoff) + tightening * ca.DM(c.scale)
        step = problem.period / soft.nodes
        weights = ca.DM(np.tile(trapezoid_weights(soft.nodes) * step, p))
        for bound, sign in ((c.upper, 1.0), (c.lower, -1.0)):
            rows = np.flatnonzero(np.isfinite(bound)).tolist()
            if rows:
                # no broadcasting of columns in CasADi: the bound is repeated for every node
                excess = sign * (values[rows, :] - ca.repmat(ca.DM(bound[rows]), 1, values.size2()))
                excess += ca.repmat(inside[rows], 1, values.size2())
                excesses.append(ca.vec(excess))
                costs.append(weight * ca.vec(ca.repmat(weights.T, len(rows), 1)))
                widths.append(ca.repmat(width, excess.numel(), 1))
    excess, cost, width = (ca.vertcat(*parts) if parts else ca.MX(0, 1) for parts in (excesses, costs, widths))

    limits, lower, upper, scale = [], [], [], []
    for number, limit in enumerate(problem.hard):
        c = limit.constraint
        shares = np.linspace(0.0, 1.0, limit.nodes + 1)[first_free_node(problem, c) :]
        function = constraint_function(problem, c)
        columns = [*at(problem.period * shares), *between_knots(moving[number], shares)]
        limits.append(ca.vec(function.map(p * len(shares))(*columns)))
        lower.append(np.tile(c.lower + c.backoff, p * len(shares)))
        upper.append(np.tile(c.upper - c.backoff, p * len(shares)))
        scale.append(np.tile(c.scale, p * len(shares)))
    empty = [np.zeros(0)]
    return Transcription(
        variables,
        ca.vertcat(*parameters),
        objective,
        ca.dot(cost, smoothed_hinge(excess, width)),
        excess,
        cost,
        width,
        ca.vertcat(*limits) if limits else ca.MX(0, 1),
        np.concatenate(lower or empty),
        np.concatenate(upper or empty),
        np.concatenate(scale or empty),
    )


class Binding:
    """Turns the start and the data of a solve into the parameter vector of a :class:`Transcription`."""

    def __init__(self, problem: TrajectoryProblem) -> None:
        self.problem = problem

    def objective_parameters(self, data: Mapping[str, Any]) -> list[Array]:
        """Parameters of each objective, one endpoint a column ``(size, p)``.

        Raises
        ------
        ValueError
            If something is missing, too short, or not finite.
        """
        return [self._bound(term, self.problem.pieces, data) for term in self.problem.objectives]

    def limit_parameters(self, data: Mapping[str, Any]) -> list[Array]:
        """Parameters of each constraint, one knot a column ``(size, p+1)``; an empty list if none has any.

        Raises
        ------
        ValueError
            As :meth:`objective_parameters`.
        """
        knots = self.problem.pieces + 1
        if not any(limit_size(constraint) for constraint in self.problem.constraints):
            return []
        return [
            self._bound(constraint, knots, data) if isinstance(constraint, MovingConstraint) else np.zeros((0, knots))
            for constraint in self.problem.constraints
        ]

    def _bound(self, term: Objective | JointObjective | MovingConstraint, count: int, data: Mapping[str, Any]) -> Array:
        values = term.bind(self.problem.pieces, data)
        for name, shape in term.shapes.items():
            found = np.shape(values[name])
            if found != (count, *shape):
                raise ValueError(f"{type(term).__name__}.{name}: shape {found}; allowed: {(count, *shape)}")
            if not np.all(np.isfinite(values[name])):
                raise ValueError(f"{type(term).__name__}.{name} is not finite")
        return stack_parameters(term, values)

    def vector(
        self,
        start: Array,
        objectives: Sequence[Array],
        penalties: Sequence[tuple[float, float]],
        tightening: float,
        limits: Sequence[Array] = (),
    ) -> Array:
        """The parameter vector, for these (ϖ, w_p) of each penalty."""
        parts = [start.ravel(), *(values.T.ravel() for values in (*objectives, *limits))]
        parts += [np.array([width, weight, tightening]) for width, weight in penalties]
        return np.concatenate(parts)


class LimitCheck:
    """Evaluates the true limits of a trajectory on a fine grid.

    What is given at the start, and no plan can change, is left out, and so is what is not judged
    (:attr:`~gbt_ocp.ocp.problem.TrajectoryProblem.judged`).

    Parameters
    ----------
    points
        Grid points a piece, both ends included.
    """

    def __init__(self, problem: TrajectoryProblem, points: int = FINE_POINTS) -> None:
        self.points = points
        judged = [number for number, counts in enumerate(problem.judged) if counts]
        self._numbers = judged
        self._constraints = [problem.constraints[number] for number in judged]
        self._given = [first_free_node(problem, c) == 1 for c in self._constraints]
        self._functions = [constraint_function(problem, c) for c in self._constraints]
        self._mapped: dict[int, list[ca.Function]] = {}

    def __call__(self, trajectory: FlatTrajectory, limits: Sequence[Array] = ()) -> Array:
        """Largest violation of each piece ``(p,)`` in units of the limits.

        Negative inside them, ``-inf`` without any; the trajectory may have any number of pieces.

        Parameters
        ----------
        trajectory
            What to check.
        limits
            Parameters of the constraints from the first knot of the trajectory on; see
            :meth:`Binding.limit_parameters`. Needed where constraints have any.
        """
        return np.asarray(self.profile(trajectory, limits).max(axis=1))

    def profile(self, trajectory: FlatTrajectory, limits: Sequence[Array] = ()) -> Array:
        """Largest violation at each point of the grid ``(p, points)``, likewise."""
        pieces = trajectory.pieces
        if pieces not in self._mapped:
            self._mapped[pieces] = [function.map(pieces * self.points) for function in self._functions]
        worst = np.full((pieces, self.points), -np.inf)
        point = trajectory.sample(self.points)
        columns = [values.reshape(-1, values.shape[-1]).T for values in point]
        shares = np.linspace(0.0, 1.0, self.points)
        for number, constraint, given, function in zip(
            self._numbers, self._constraints, self._given, self._mapped[pieces], strict=True
        ):
            moving = between_knots(limits[number][:, : pieces + 1], shares) if limits else []
            values = np.asarray(function(*columns, *moving))
            over = np.maximum(values - constraint.upper[:, None], constraint.lower[:, None] - values)
            over = (over / constraint.scale[:, None]).max(axis=0).reshape(pieces, self.points)
            if given:
                over[0, 0] = -np.inf
            worst = np.maximum(worst, over)
        return worst
