"""From the description to CasADi: the objective, the penalties and the limits as functions of the unknowns.

The unknowns u ``(n, p)`` are the L-th derivatives of the pieces over their natural size: the endpoints in better
scaled coordinates. Every quantity of a piece is a function of one point (z, ż, z̈), mapped over the nodes, so the
graph stays small however many nodes there are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gbt_ocp.ocp.constraints import PathConstraint
from gbt_ocp.ocp.objectives import Objective
from gbt_ocp.ocp.penalty import smoothed_hinge, trapezoid_weights
from gbt_ocp.ocp.problem import TrajectoryProblem
from gbt_ocp.ocp.trajectory import FlatPoint, FlatTrajectory, propagate

Array = NDArray[np.float64]


FINE_POINTS = 101
"""Grid points a piece at which a finished trajectory is held against its limits, both ends included."""


def input_scale(problem: TrajectoryProblem) -> Array:
    """Natural size of the L-th derivative ``(n,)``: one that changes z̈ by its scale within a period."""
    return problem.vehicle.acceleration_scale / problem.period ** (problem.degree - 2)


def point_symbols(size: int) -> FlatPoint:
    """Symbols z, ż, z̈ ``(n,)``."""
    return FlatPoint(*(ca.SX.sym(name, size) for name in ("z", "dz", "ddz")))


def constraint_function(problem: TrajectoryProblem, constraint: PathConstraint) -> ca.Function:
    """(z, ż, z̈) -> the bounded quantities ``(m,)``."""
    point = point_symbols(problem.vehicle.flat_dimension)
    return ca.Function("constraint", list(point), [constraint.value(point)], ["z", "dz", "ddz"], ["value"])


def objective_function(problem: TrajectoryProblem, objective: Objective) -> ca.Function:
    """(z, ż, z̈, parameters) -> the term at one endpoint; the parameters are stacked column by column."""
    point = point_symbols(problem.vehicle.flat_dimension)
    parameters = {name: ca.SX.sym(name, *shape) for name, shape in objective.shapes.items()}
    stacked = ca.vertcat(*(ca.vec(symbol) for symbol in parameters.values()))
    return ca.Function(
        "objective", [*point, stacked], [objective.value(point, parameters)], ["z", "dz", "ddz", "p"], ["value"]
    )


def stack_parameters(objective: Objective, bound: Mapping[str, Array]) -> Array:
    """Numbers for the parameters of :func:`objective_function`, one endpoint a column ``(size, p)``."""
    columns = [np.asarray(bound[name]).transpose(0, 2, 1).reshape(len(bound[name]), -1) for name in objective.shapes]
    return np.hstack(columns).T


def first_free_node(problem: TrajectoryProblem, constraint: PathConstraint) -> int:
    """The first node of a piece at which the piece's own unknown moves the constraint: 0 or 1.

    With L = 2 the acceleration jumps at a boundary, so what depends on z̈ counts on both sides of it. Everything else
    is continuous there: at its first node a piece repeats the last one of the piece before, and the first piece what
    is given.
    """
    point = point_symbols(problem.vehicle.flat_dimension)
    return 0 if problem.degree == 2 and ca.depends_on(ca.SX(constraint.value(point)), point.ddz) else 1


@dataclass(frozen=True)
class Transcription:
    """The nonlinear program ``min objective + penalty`` subject to ``lower <= limits <= upper``.

    ``variables`` is u, column by column ``(n p,)``; ``parameters`` stacks the start, the parameters of the objectives,
    and (ϖ, w_p, tightening) of each penalty. The penalty is ``Σ cost g(excess)`` with g of half width ``width``.
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
    n, p, degree = problem.vehicle.flat_dimension, problem.pieces, problem.degree
    variables = ca.MX.sym("u", n * p)
    start = ca.MX.sym("start", n, degree)
    top = ca.mtimes(ca.diag(ca.DM(input_scale(problem))), ca.reshape(variables, n, p))
    knots = [ca.horzsplit(start)]
    for i in range(p):
        knots.append(propagate(knots[-1], top[:, i], problem.period)[:degree])

    def at(times: Array) -> list[ca.MX]:
        """z, ż, z̈ at these times of every piece, one a column."""
        points = [propagate(knots[i], top[:, i], float(s)) for i in range(p) for s in times]
        return [ca.horzcat(*(point[order] for point in points)) for order in range(3)]

    parameters, objective = [ca.vec(start)], ca.MX(0)
    for term in problem.objectives:
        function = objective_function(problem, term)
        values = ca.MX.sym("p", function.size1_in(3), p)
        parameters.append(ca.vec(values))
        objective += ca.sum2(function.map(p)(*at(np.array([problem.period])), values))

    excesses, costs, widths = [], [], []
    for soft in problem.penalties:
        settings = ca.MX.sym("penalty", 3)
        parameters.append(settings)
        width, weight, tightening = ca.vertsplit(settings)
        c = soft.constraint
        function = constraint_function(problem, c)
        values = function.map(p * (soft.nodes + 1))(*at(np.linspace(0.0, problem.period, soft.nodes + 1)))
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
    for limit in problem.hard:
        c = limit.constraint
        times = np.linspace(0.0, problem.period, limit.nodes + 1)[first_free_node(problem, c) :]
        function = constraint_function(problem, c)
        limits.append(ca.vec(function.map(p * len(times))(*at(times))))
        lower.append(np.tile(c.lower + c.backoff, p * len(times)))
        upper.append(np.tile(c.upper - c.backoff, p * len(times)))
        scale.append(np.tile(c.scale, p * len(times)))
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
        bound = []
        for term in self.problem.objectives:
            values = term.bind(self.problem.pieces, data)
            for name, shape in term.shapes.items():
                found = np.shape(values[name])
                if found != (self.problem.pieces, *shape):
                    raise ValueError(
                        f"{type(term).__name__}.{name}: shape {found}; allowed: {(self.problem.pieces, *shape)}"
                    )
                if not np.all(np.isfinite(values[name])):
                    raise ValueError(f"{type(term).__name__}.{name} is not finite")
            bound.append(stack_parameters(term, values))
        return bound

    def vector(
        self, start: Array, objectives: list[Array], penalties: list[tuple[float, float]], tightening: float
    ) -> Array:
        """The parameter vector, for these (ϖ, w_p) of each penalty."""
        parts = [start.ravel(), *(values.T.ravel() for values in objectives)]
        parts += [np.array([width, weight, tightening]) for width, weight in penalties]
        return np.concatenate(parts)


class LimitCheck:
    """Evaluates the true limits of a trajectory on a fine grid.

    What is given at the start, and no plan can change, is left out.

    Parameters
    ----------
    points
        Grid points a piece, both ends included.
    """

    def __init__(self, problem: TrajectoryProblem, points: int = FINE_POINTS) -> None:
        self.points = points
        self._constraints = problem.constraints
        self._given = [first_free_node(problem, c) == 1 for c in self._constraints]
        self._functions = [constraint_function(problem, c) for c in self._constraints]
        self._mapped: dict[int, list[ca.Function]] = {}

    def __call__(self, trajectory: FlatTrajectory) -> Array:
        """Largest violation of each piece ``(p,)`` in units of the limits.

        Negative inside them, ``-inf`` without any; the trajectory may have any number of pieces.
        """
        pieces = trajectory.pieces
        if pieces not in self._mapped:
            self._mapped[pieces] = [function.map(pieces * self.points) for function in self._functions]
        worst = np.full(trajectory.pieces, -np.inf)
        point = trajectory.sample(self.points)
        columns = [values.reshape(-1, values.shape[-1]).T for values in point]
        for constraint, given, function in zip(self._constraints, self._given, self._mapped[pieces], strict=True):
            values = np.asarray(function(*columns))
            over = np.maximum(values - constraint.upper[:, None], constraint.lower[:, None] - values)
            over = (over / constraint.scale[:, None]).max(axis=0).reshape(trajectory.pieces, self.points)
            if given:
                over[0, 0] = -np.inf
            worst = np.maximum(worst, over.max(axis=1))
        return worst
