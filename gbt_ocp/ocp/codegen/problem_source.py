"""The part of the solver that is generated: sizes, limits and derivatives of one trajectory problem, as C99."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.models.vehicles import Vehicle, acceleration
from gbt_ocp.ocp.check import FINE_POINTS
from gbt_ocp.ocp.codegen.expressions import NotGenerableError, c_array, c_function, c_source
from gbt_ocp.ocp.codegen.moment_functions import from_moments as from_moments
from gbt_ocp.ocp.codegen.moment_functions import moment_functions
from gbt_ocp.ocp.codegen.options import CompiledOptions
from gbt_ocp.ocp.codegen.places import Placed, placed
from gbt_ocp.ocp.codegen.problem_header import HEADER
from gbt_ocp.ocp.limit_classes import hard_weights, limit_class, limit_names
from gbt_ocp.ocp.problem_data import HardLimit, PenaltyLimit, ProblemData
from gbt_ocp.ocp.terms import (
    Constraint,
    JointObjective,
)
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.ocp.transcription import (
    constraint_value,
    first_free_node,
    input_scale,
    limit_size,
    stacked_size,
    unstacked,
)
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class GeneratedProblem:
    """C text of a problem: the header with its sizes and the source with its tables and functions."""

    header: str
    source: str

    @property
    def files(self) -> dict[str, str]:
        """File names and their content."""
        return {"gbt_problem.h": self.header, "gbt_problem.c": self.source}


@dataclass(frozen=True)
class _Limit:
    """One constraint in C: which sides it has, its functions and the places of their nonzeros."""

    functions: list[ca.Function]
    definition: str
    tables: str
    rows: int
    sides: int
    nodes: int
    jacobian_entries: int
    curvature_entries: int


def generate_problem(problem: ProblemData, options: CompiledOptions | None = None) -> GeneratedProblem:
    """Derivatives by CasADi, tables and sizes.

    Parameters
    ----------
    problem
        The problem.
    options
        What ``gbt_default_settings`` gives; ``None`` for the defaults of :class:`CompiledOptions`.

    Raises
    ------
    ValueError
        If an expression cannot be written as C.
    """
    size = problem.vehicle.flat_dimension
    d = problem.vehicle.position_dimension
    point, origin = ca.SX.sym("point", 3 * size), ca.SX.sym("origin", d)
    parameters = ca.SX.sym("p", sum(stacked_size(term.shapes) for term in problem.objectives))
    objective = _placed_objective(problem, point, parameters, origin)
    objective_functions, objective_text, hessian_entries = _objective(point, objective)
    imposed: list[HardLimit | PenaltyLimit] = [*problem.hard, *problem.penalties]
    moving = ca.SX.sym("moving", sum(limit_size(limit.constraint) for limit in imposed))
    places = _placed_limits(problem, point, moving, origin)
    limits = [_limit(problem, number, limit, _in_place(point, places, number)) for number, limit in enumerate(imposed)]
    per_piece = [limit.nodes * problem.pieces for limit in limits]
    sides = sum(count * limit.sides for count, limit in zip(per_piece, limits, strict=True))
    jacobians = sum(count * limit.jacobian_entries for count, limit in zip(per_piece, limits, strict=True))
    header = HEADER.format(
        flat=size,
        dimension=problem.vehicle.position_dimension,
        degree=problem.degree,
        joined=problem.joined,
        pieces=problem.pieces,
        period=repr(float(problem.period)),
        parameters=parameters.numel(),
        moving=moving.numel(),
        ends=objective.numbers.numel(),
        knots=sum(form.numbers.numel() for form in places),
        relative=int(not _depends_on_place(problem.vehicle)),
        limits=len(limits),
        count=sides,
        sides=max(sides, 1),
        jacobians=max(jacobians, 1),
        rows=max([1, *(limit.rows for limit in limits)]),
        entries=max([1, hessian_entries, *(limit.curvature_entries for limit in limits)]),
        inputs=len(problem.vehicle.thrust_max),
        fine=FINE_POINTS,
        moments=int(from_moments(problem)),
        present=int(from_moments(problem) and moving.numel() > 0),
        settings=(options or CompiledOptions.checked({}, problem.pieces)).initialiser(),
    )
    functions = [*objective_functions, *(function for limit in limits for function in limit.functions)]
    functions += _of_vehicle(problem.vehicle)
    located = ca.vertcat(ca.SX(0, 1), *(form.located for form in places))
    wide = [
        c_function("gbt_end_numbers", [origin, parameters], objective.located),
        c_function("gbt_knot_numbers", [origin, moving], located),
        *moment_functions(problem),
    ]
    table = ",\n".join(limit.definition for limit in limits) or "    {0}"
    source = "\n".join(
        [
            '#include "gbt_problem.h"\n\n#include "gbt_math.h"\n',
            c_source(functions),
            c_source(wide, "double"),
            c_array("gbt_real", "gbt_input_scale", input_scale(problem), const="const"),
            c_array("gbt_real", "gbt_acceleration_scale", problem.vehicle.acceleration_scale, const="const"),
            c_array("gbt_real", "gbt_thrust_min", ThrustRange.of(problem.vehicle).lower, const="const"),
            c_array("gbt_real", "gbt_thrust_max", problem.vehicle.thrust_max, const="const"),
            objective_text,
            *(limit.tables for limit in limits),
            f"const gbt_limit gbt_limits[] = {{\n{table}\n}};\n",
            "const char *const gbt_limit_names[] = {"
            + ", ".join([*map(json.dumps, limit_names(problem)), "0"])
            + "};\n",
        ]
    )
    return GeneratedProblem(header, source)


def _of_vehicle(vehicle: Vehicle) -> list[ca.Function]:
    """Thrust and acceleration, which the planner around the solver needs."""
    size = vehicle.flat_dimension
    point, z, dz = ca.SX.sym("point", 3 * size), ca.SX.sym("z", size), ca.SX.sym("dz", size)
    thrust = ca.SX.sym("thrust", len(vehicle.thrust_max))
    return [
        c_function("gbt_vehicle_inputs", [point], vehicle.inputs(*_split(point, size))),
        c_function("gbt_vehicle_acceleration", [z, dz, thrust], acceleration(vehicle, z, dz, thrust)),
    ]


def _depends_on_place(vehicle: Vehicle) -> bool:
    """Whether the dynamics depend on the position, as in a current that differs from place to place."""
    z, dz, ddz = (ca.SX.sym(name, vehicle.flat_dimension) for name in ("z", "dz", "ddz"))
    return bool(ca.depends_on(ca.vertcat(vehicle.inputs(z, dz, ddz)), z[: vehicle.position_dimension]))


def _split(point: ca.SX, size: int) -> FlatPoint:
    return FlatPoint(point[:size], point[size : 2 * size], point[2 * size :])


def _nonzeros(matrix: ca.SX) -> tuple[ca.SX, list[int], list[int]]:
    rows, columns = matrix.sparsity().get_triplet()
    values: Any = ca.SX(ca.Sparsity.dense(len(rows), 1), matrix.nz[:]) if rows else ca.SX.zeros(0, 1)
    return values, list(rows), list(columns)


def _placed_objective(problem: ProblemData, point: ca.SX, parameters: ca.SX, origin: ca.SX) -> Placed:
    """The objective at an endpoint."""
    size, d = problem.vehicle.flat_dimension, problem.vehicle.position_dimension
    value, offset = ca.SX(0), 0
    for term in problem.objectives:
        if isinstance(term, JointObjective):
            raise NotGenerableError(
                f"planner.solver: found compiled, which takes sums over the endpoints of a plan; allowed: ipopt, since "
                f"the objective {type(term).__name__} couples them"
            )
        value += term.value(_split(point, size), unstacked(term.shapes, parameters[offset:]))
        offset += stacked_size(term.shapes)
    return placed(value, point[:d], parameters, point[d:], origin)


def _objective(point: ca.SX, objective: Placed) -> tuple[list[ca.Function], str, int]:
    stacked, value, weight = objective.numbers, objective.value, ca.SX.sym("weight")
    gradient = ca.gradient(value, point)
    hessian, rows_, columns_ = _nonzeros(ca.tril(ca.hessian(weight * value, point)[0]))
    functions = [
        c_function("objective_value", [point, stacked], value),
        c_function("objective_gradient", [point, stacked], gradient),
        c_function("objective_hessian", [point, stacked, weight], hessian),
    ]
    text = "".join(
        [
            c_array("int", "objective_row", rows_),
            c_array("int", "objective_column", columns_),
            "const gbt_objective_functions gbt_objective = {objective_value, objective_gradient, objective_hessian,\n"
            f"    {len(rows_)}, objective_row, objective_column}};\n",
        ]
    )
    return functions, text, len(rows_)


def _sides(constraint: Constraint, shift: Array) -> list[tuple[int, float, float, float]]:
    """(row, sign, bound for the solver, true bound) of every finite bound, in units of the limit and less the shift."""
    found = []
    for bounds, sign in ((constraint.upper, 1.0), (constraint.lower, -1.0)):
        for row in np.flatnonzero(np.isfinite(bounds)).tolist():
            scale = constraint.scale[row]
            edge = sign * (bounds[row] / scale - shift[row])
            found.append((row, sign, float(edge - constraint.backoff[row] / scale), float(edge)))
    return found


def _placed_limits(problem: ProblemData, point: ca.SX, moving: ca.SX, origin: ca.SX) -> list[Placed]:
    """The values of each constraint in units of its limits, less a bound where they are sums of coordinates."""
    size, d = problem.vehicle.flat_dimension, problem.vehicle.position_dimension
    found, offset = [], 0
    for constraint in problem.constraints:
        own = moving[offset : offset + limit_size(constraint)]
        offset += limit_size(constraint)
        value = ca.SX(ca.vertcat(constraint_value(constraint, _split(point, size), own))) / ca.DM(constraint.scale)
        bound = np.where(np.isfinite(constraint.upper), constraint.upper, constraint.lower) / constraint.scale
        found.append(placed(value, point[:d], own, point[d:], origin, bound))
    return found


@dataclass(frozen=True)
class _Form:
    """The values of a constraint of a place: a point and the numbers of all constraints."""

    value: ca.SX
    place: ca.SX
    shift: Array


def _in_place(point: ca.SX, forms: Sequence[Placed], number: int) -> _Form:
    counts = [form.numbers.numel() for form in forms]
    place = ca.SX.sym("place", point.numel() + sum(counts))
    first = point.numel() + sum(counts[:number])
    own = ca.vertcat(place[: point.numel()], place[first : first + counts[number]])
    value = ca.substitute(forms[number].value, ca.vertcat(point, forms[number].numbers), own)
    return _Form(value, place, forms[number].shift)


def _limit(problem: ProblemData, number: int, limit: HardLimit | PenaltyLimit, form: _Form) -> _Limit:
    size, constraint = problem.vehicle.flat_dimension, limit.constraint
    name, value, place = f"limit{number}", form.value, form.place
    first, second = ca.SX.sym("first", value.numel()), ca.SX.sym("second", value.numel())
    jacobian = ca.jacobian(value, place)[:, : 3 * size]
    curvature = ca.hessian(ca.dot(first, value), place)[0][: 3 * size, : 3 * size]
    curvature += ca.mtimes([jacobian.T, ca.diag(second), jacobian])
    slopes, slope_rows, slope_columns = _nonzeros(jacobian)
    curves, curve_rows, curve_columns = _nonzeros(ca.tril(curvature))
    functions = [
        c_function(f"{name}_value", [place], value),
        c_function(f"{name}_jacobian", [place], slopes),
        c_function(f"{name}_curvature", [place, first, second], curves),
    ]
    sides = _sides(constraint, form.shift)
    weights, widths = _penalty(problem, number, limit, [side[0] for side in sides])
    given = first_free_node(problem, constraint)
    begin = given if isinstance(limit, HardLimit) else 0
    tables: Sequence[tuple[str, str, Any]] = (
        ("int", "side_row", [side[0] for side in sides]),
        ("gbt_real", "side_sign", [side[1] for side in sides]),
        ("gbt_real", "side_bound", [side[2] for side in sides]),
        ("gbt_real", "side_edge", [side[3] for side in sides]),
        ("gbt_real", "side_weight", weights),
        ("gbt_real", "side_width", widths),
        ("int", "jacobian_row", slope_rows),
        ("int", "jacobian_column", slope_columns),
        ("int", "curvature_row", curve_rows),
        ("int", "curvature_column", curve_columns),
    )
    hard, judged = int(isinstance(limit, HardLimit)), int(problem.judged[number])
    kind = ("GBT_THRUST", "GBT_CERTAIN", "GBT_BELIEVED")[limit_class(problem, constraint)]
    definition = (
        f"    {{{value.numel()}, {len(sides)}, {limit.nodes}, {begin}, {hard}, {kind}, {given}, {judged},\n"
        f"     {name}_side_row, {name}_side_sign, {name}_side_bound,\n"
        f"     {name}_side_edge, {name}_side_weight, {name}_side_width,\n"
        f"     {name}_value, {name}_jacobian, {name}_curvature,\n"
        f"     {len(slope_rows)}, {name}_jacobian_row, {name}_jacobian_column,\n"
        f"     {len(curve_rows)}, {name}_curvature_row, {name}_curvature_column}}"
    )
    return _Limit(
        functions,
        definition,
        "".join(c_array(kind, f"{name}_{table}", entries) for kind, table, entries in tables),
        value.numel(),
        len(sides),
        limit.nodes + 1 - begin,
        len(slope_rows),
        len(curve_rows),
    )


def _penalty(
    problem: ProblemData, number: int, limit: HardLimit | PenaltyLimit, rows: list[int]
) -> tuple[list[float], list[float]]:
    """Weight at an inner node and half width of each side, with the constraint normalised by its scale."""
    if isinstance(limit, HardLimit):
        return [hard_weights(problem)[number]] * len(rows), [0.0] * len(rows)
    scale = limit.constraint.scale[rows]
    step = problem.period / limit.nodes
    return (limit.weight * step * scale).tolist(), (limit.width / scale).tolist()
