"""From the description to CasADi: the objective, the penalties and the limits as functions of the unknowns.

The unknowns u, one piece a column, are the derivatives that a piece does not take over from the one before (with the
continuity of the paper its L-th) over their natural size: the endpoints in better scaled coordinates. Every quantity of
a piece is a function of one point (z, ż, z̈), mapped over the nodes, so the graph stays small however many nodes there
are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.ocp.limit_classes import LIMIT_WEIGHT, LimitClass, hard_weights, limit_class
from gbt_ocp.ocp.objective_total import objective_total, point_symbols, stacked_size, unstacked
from gbt_ocp.ocp.problem_data import HardLimit, PenaltyLimit, PosedProblem, ProblemData
from gbt_ocp.ocp.terms import Constraint, MovingConstraint
from gbt_ocp.ocp.thrust_limits import ThrustChange
from gbt_ocp.ocp.trajectory import FlatPoint, propagate
from gbt_ocp.typing import Array


def input_scale(problem: ProblemData) -> Array:
    """Natural sizes of a piece's unknowns ``(freedoms,)``: what changes z̈ by its scale within a period."""
    orders = range(problem.joined, problem.degree + 1)
    return np.concatenate([problem.vehicle.acceleration_scale / problem.period ** (order - 2) for order in orders])


def limit_size(constraint: Constraint) -> int:
    """How many parameters a constraint has at one time."""
    return stacked_size(constraint.shapes) if isinstance(constraint, MovingConstraint) else 0


def constraint_value(constraint: Constraint, point: FlatPoint, stacked: Any) -> Any:
    """The bounded quantities ``(m,)`` as a CasADi expression, parameters (if any) stacked column by column."""
    if not isinstance(constraint, MovingConstraint):
        return constraint.value(point)
    return constraint.value(point, unstacked(constraint.shapes, stacked))


def change_of_thrust(problem: ProblemData, constraint: ThrustChange, motion: Sequence[Any]) -> Any:
    """τ̇ over the limits ``(m,)`` of z, ż, z̈ and z⃛, or where thrust jumps the acceleration of the piece before."""
    z, dz, ddz, more = motion
    if problem.remembers:
        return constraint.of_jump(z, dz, ddz, more, problem.period)
    return constraint.of_motion(z, dz, ddz, more)


def constraint_function(problem: ProblemData, constraint: Constraint) -> ca.Function:
    """(z, ż, z̈) -> the bounded quantities ``(m,)``; with the parameters as a fourth input where there are any.

    Of changes of the thrust the fourth input is z⃛, or where thrust jumps the acceleration of the piece before.
    """
    point, stacked = point_symbols(problem.vehicle.flat_dimension), ca.SX.sym("p", limit_size(constraint))
    if isinstance(constraint, ThrustChange):
        motion = [*point, ca.SX.sym("dddz", problem.vehicle.flat_dimension)]
        return ca.Function("constraint", motion, [change_of_thrust(problem, constraint, motion)])
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


def first_free_node(problem: ProblemData, constraint: Constraint) -> int:
    """The first node of a piece at which the piece's own unknown moves the constraint: 0 or 1.

    Where only z and ż are continuous the acceleration jumps at a boundary, so what depends on z̈ counts on both sides
    of it. Everything else is continuous there: at its first node a piece repeats the last one of the piece before, and
    the first piece what is given.
    """
    if isinstance(constraint, ThrustChange):
        return 0
    point, stacked = point_symbols(problem.vehicle.flat_dimension), ca.SX.sym("p", limit_size(constraint))
    value = ca.SX(constraint_value(constraint, point, stacked))
    return 0 if problem.joined == 2 and ca.depends_on(value, point.ddz) else 1


@dataclass(frozen=True)
class Transcription:
    """The nonlinear program ``min objective + penalty`` subject to ``lower <= limits <= upper``.

    ``variables`` is u, piece by piece ``(freedoms p,)``. ``inner`` are further unknowns that follow from u where
    ``defects`` are zero, the states of multiple shooting; ``led_to`` gives them from the start and u. ``parameters``
    stacks the start, the parameters of the objectives and of the constraints, and (ϖ, w_p, tightening) of each penalty.
    The penalty is ``Σ cost g(excess)`` with g of half width ``width``. ``weight`` is the price of a violation of one
    unit of each limit that may give for others, infinite of those that may not; ``rows`` says how many rows of
    ``limits`` each hard limit has, as many in each of the ``pieces``.
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
    weight: Array
    rows: tuple[int, ...]
    pieces: int
    inner: ca.MX
    defects: ca.MX
    led_to: ca.Function | None

    def inward(self, tightening: ArrayLike) -> Array:
        """By how much a tightening of the first piece moves the bound of each row of ``limits``.

        ``tightening`` is one number a constraint, hard ones first, or one for all, in units of the limits.
        """
        each = np.asarray(tightening, dtype=float)
        per_limit = each[: len(self.rows)] if each.ndim else np.full(len(self.rows), float(each))
        first = [np.arange(rows) < rows // self.pieces for rows in self.rows]
        return np.asarray(np.repeat(per_limit, self.rows) * np.concatenate([np.zeros(0), *first]) * self.scale)

    @property
    def giving(self) -> list[int]:
        """Rows of ``limits`` that may give for others."""
        return np.flatnonzero(np.isfinite(self.weight)).tolist()

    @property
    def nlp(self) -> dict[str, ca.MX]:
        """The program in CasADi's form.

        Limits that may give for others have slacks ``l >= 0`` as further unknowns, the last ones, at an exact l1 price:
        ``limits - l <= upper`` in their place among the limits, ``limits + l >= lower`` after everything else.
        """
        plain = {"f": -self.objective + self.penalty, "x": ca.vertcat(self.variables, self.inner)}
        return self._with_slacks(plain | {"p": self.parameters, "g": ca.vertcat(self.limits, self.defects)})

    def _with_slacks(self, nlp: dict[str, ca.MX]) -> dict[str, ca.MX]:
        rows = self.giving
        if not rows:
            return nlp
        slack = ca.MX.sym("l", len(rows))
        scaled = ca.DM(self.scale[rows]) * slack
        full = ca.MX.zeros(self.limits.numel())
        full[rows] = scaled
        rest = nlp["g"][self.limits.numel() :]
        return {
            "x": ca.vertcat(nlp["x"], slack),
            "p": nlp["p"],
            "f": nlp["f"] + ca.dot(ca.DM(self.weight[rows]), slack),
            "g": ca.vertcat(self.limits - full, rest, self.limits[rows] + scaled),
        }

    @property
    def elastic_nlp(self) -> dict[str, ca.MX]:
        """The same program with the kinks of the penalty as constraints, which Newton's method can follow.

        The smoothed hinge is the infimal convolution of a hinge and a square:
        ``g(y) = min s + e²/(4ϖ)`` over ``s >= 0, e`` with ``s + e >= y + ϖ``. So with s and e as further unknowns
        (after u, in this order) and those inequalities after the limits, the minimisers u are the same.
        """
        size = self.excess.numel()
        s, e = ca.MX.sym("s", size), ca.MX.sym("e", size)
        elastic = {
            "x": ca.vertcat(self.variables, self.inner, s, e),
            "p": self.parameters,
            "f": -self.objective + ca.dot(self.cost, s + e**2 / (4.0 * self.width)),
            "g": ca.vertcat(self.limits, self.defects, s + e - self.excess - self.width),
        }
        return self._with_slacks(elastic)


@dataclass(frozen=True)
class Layout:
    """The unknowns of a form, and what objectives and constraints are of them.

    ``ends`` are z, ż, z̈ at the endpoints, one a column; ``values`` gives a constraint, by its number, at these shares
    of every piece, one a column, for its numbers at the knots; ``grid`` gives the intervals of a limit, the first node
    of them that counts, and a factor of its weight. For the rest see :class:`Transcription`.
    """

    variables: ca.MX
    inner: ca.MX
    defects: ca.MX
    start: ca.MX
    ends: Sequence[ca.MX]
    values: Callable[[int, Array, ca.MX], ca.MX]
    grid: Callable[[HardLimit | PenaltyLimit], tuple[int, int, float]]


def transcribe(problem: ProblemData) -> Transcription:
    """Build the nonlinear program symbolically (MX, with map over the nodes)."""
    n, p, joined = problem.vehicle.flat_dimension, problem.pieces, problem.joined
    variables = ca.MX.sym("u", problem.freedoms * p)
    start = ca.MX.sym("start", n, joined + problem.remembers)
    scaled = variables * ca.repmat(ca.DM(input_scale(problem)), p, 1)
    free = [ca.horzsplit(ca.reshape(own, n, -1)) for own in ca.vertsplit(scaled, problem.freedoms)]
    knots = [ca.horzsplit(start)[:joined]]
    for i in range(p):
        knots.append(propagate(knots[-1], free[i], problem.period)[:joined])

    def at(times: Array, orders: int = 3) -> list[ca.MX]:
        """z, ż, z̈ and so on at these times of every piece, one a column."""
        before = [[start[:, joined]], *free[:-1]] if problem.remembers else [[]] * p
        points = [[*propagate(knots[i], free[i], float(s)), *before[i][:1]] for i in range(p) for s in times]
        return [ca.horzcat(*(point[order] for point in points)) for order in range(orders)]

    def values(number: int, shares: Array, moving: ca.MX) -> ca.MX:
        function = constraint_function(problem, problem.constraints[number])
        orders = 4 if isinstance(problem.constraints[number], ThrustChange) else 3
        return function.map(p * len(shares))(*at(problem.period * shares, orders), *between_knots(moving, shares))

    def grid(limit: HardLimit | PenaltyLimit) -> tuple[int, int, float]:
        hard = isinstance(limit, HardLimit)
        # a step of the thrust is one between two pieces
        steps = problem.remembers and isinstance(limit.constraint, ThrustChange)
        return 1 if steps else limit.nodes, first_free_node(problem, limit.constraint) if hard else 0, 1.0

    none, ends = ca.MX(0, 1), at(np.array([problem.period]))
    return assembled(problem, Layout(variables, none, none, start, ends, values, grid), None)


def assembled(problem: PosedProblem, layout: Layout, led_to: ca.Function | None) -> Transcription:
    """The nonlinear program of a problem in any form."""
    p = problem.pieces
    parameters, objective = [ca.vec(layout.start)], ca.MX(0)
    for term in problem.objectives:
        function = objective_total(problem, term)
        values = ca.MX.sym("p", function.size1_in(3), p)
        parameters.append(ca.vec(values))
        objective += function(*layout.ends, values)

    moving = {}
    for number, constraint in enumerate(problem.constraints):
        moving[number] = ca.MX.sym("limit", limit_size(constraint), p + 1)
        parameters.append(ca.vec(moving[number]))

    excesses, costs, widths = [], [], []
    for number, soft in enumerate(problem.penalties, start=len(problem.hard)):
        settings = ca.MX.sym("penalty", 3)
        parameters.append(settings)
        width, w_p, tightening = ca.vertsplit(settings)
        c, (intervals, first, share) = soft.constraint, layout.grid(soft)
        shares = np.linspace(0.0, 1.0, intervals + 1)[first:]
        values = layout.values(number, shares, moving[number])
        nodes = p * len(shares)
        executed = ca.DM(np.arange(nodes) < len(shares)).T
        inside = ca.repmat(ca.DM(c.backoff), 1, nodes) + tightening * ca.mtimes(ca.DM(c.scale), executed)
        step = share * problem.period / intervals
        weights = ca.DM(np.tile(trapezoid_weights(intervals)[first:] * step, p))
        for bound, sign in ((c.upper, 1.0), (c.lower, -1.0)):
            rows = np.flatnonzero(np.isfinite(bound)).tolist()
            if rows:
                # no broadcasting of columns in CasADi: the bound is repeated for every node
                excess = sign * (values[rows, :] - ca.repmat(ca.DM(bound[rows]), 1, values.size2()))
                excess += inside[rows, :]
                excesses.append(ca.vec(excess))
                costs.append(w_p * ca.vec(ca.repmat(weights.T, len(rows), 1)))
                widths.append(ca.repmat(width, excess.numel(), 1))
    excess, cost, width = (ca.vertcat(*parts) if parts else ca.MX(0, 1) for parts in (excesses, costs, widths))

    limits, lower, upper, scale, weight = [], [], [], [], []
    for number, (limit, price) in enumerate(zip(problem.hard, hard_weights(problem), strict=True)):
        c, (intervals, first, _) = limit.constraint, layout.grid(limit)
        shares = np.linspace(0.0, 1.0, intervals + 1)[first:]
        limits.append(ca.vec(layout.values(number, shares, moving[number])))
        lower.append(np.tile(c.lower + c.backoff, p * len(shares)))
        upper.append(np.tile(c.upper - c.backoff, p * len(shares)))
        scale.append(np.tile(c.scale, p * len(shares)))
        thrust = limit_class(problem, c) == LimitClass.THRUST
        weight.append(np.full(len(scale[-1]), np.inf if thrust else LIMIT_WEIGHT * price))
    empty = [np.zeros(0)]
    return Transcription(
        layout.variables,
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
        np.concatenate(weight or empty),
        tuple(len(part) for part in scale),
        p,
        layout.inner,
        layout.defects,
        led_to,
    )


def smoothed_hinge(x: Any, width: Any) -> Any:
    """g(x): zero below -ϖ, x above ϖ, ``(x + ϖ)²/(4ϖ)`` between; continuously differentiable.

    The paper prints ``(x - ϖ)²/(4ϖ)``, which jumps at both ends. Works on numbers and on CasADi expressions.
    """
    clipped = ca.fmin(ca.fmax(x, -width), width)
    return (clipped + width) ** 2 / (4.0 * width) + ca.fmax(x - width, 0.0)


def trapezoid_weights(intervals: int) -> Array:
    """ω_0 … ω_{n_c} = (1/2, 1, …, 1, 1/2) ``(n_c+1,)``."""
    weights = np.ones(intervals + 1)
    weights[[0, -1]] = 0.5
    return weights
