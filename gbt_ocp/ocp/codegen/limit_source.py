"""Tables and functions of one problem's limits, for the generated C."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from gbt_ocp.ocp.codegen.expressions import c_array, c_function
from gbt_ocp.ocp.codegen.places import Placed, placed
from gbt_ocp.ocp.forms import FlatForm, LimitGrid, ShootingForm
from gbt_ocp.ocp.limit_classes import hard_weights, limit_class
from gbt_ocp.ocp.problem_data import HardLimit, PenaltyLimit, PosedProblem
from gbt_ocp.ocp.terms import Constraint
from gbt_ocp.ocp.transcription import limit_size
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class LimitInC:
    """One constraint in C: which sides it has, its functions and the places of their nonzeros."""

    functions: list[ca.Function]
    definition: str
    tables: str
    rows: int
    sides: int
    nodes: int
    jacobian_entries: int
    curvature_entries: int


def nonzeros(matrix: ca.SX) -> tuple[ca.SX, list[int], list[int]]:
    """Nonzeros of a matrix, one after another, with their rows and columns."""
    rows, columns = matrix.sparsity().get_triplet()
    values: Any = ca.SX(ca.Sparsity.dense(len(rows), 1), matrix.nz[:]) if rows else ca.SX.zeros(0, 1)
    return values, list(rows), list(columns)


def _sides(constraint: Constraint, shift: Array) -> list[tuple[int, float, float, float]]:
    """(row, sign, bound for the solver, true bound) of every finite bound, in units of the limit and less the shift."""
    found = []
    for bounds, sign in ((constraint.upper, 1.0), (constraint.lower, -1.0)):
        for row in np.flatnonzero(np.isfinite(bounds)).tolist():
            scale = constraint.scale[row]
            edge = sign * (bounds[row] / scale - shift[row])
            found.append((row, sign, float(edge - constraint.backoff[row] / scale), float(edge)))
    return found


def placed_limits(problem: PosedProblem, form: FlatForm | ShootingForm, moving: ca.SX, origin: ca.SX) -> list[Placed]:
    """The values of each constraint in units of its limits, less a bound where they are sums of coordinates."""
    d, point = problem.vehicle.position_dimension, form.point
    found, offset = [], 0
    for constraint in problem.constraints:
        own = moving[offset : offset + limit_size(constraint)]
        offset += limit_size(constraint)
        value = ca.SX(ca.vertcat(form.at_node(constraint, own))) / ca.DM(constraint.scale)
        bound = np.where(np.isfinite(constraint.upper), constraint.upper, constraint.lower) / constraint.scale
        found.append(placed(value, point[:d], own, point[d:], origin, bound))
    return found


@dataclass(frozen=True)
class LimitForm:
    """The values of a constraint of a place: a point and the numbers of all constraints."""

    value: ca.SX
    place: ca.SX
    shift: Array


def in_place(point: ca.SX, forms: Sequence[Placed], number: int) -> LimitForm:
    """The constraint of that number at a place, of which its point and its own numbers are parts."""
    counts = [form.numbers.numel() for form in forms]
    place = ca.SX.sym("place", point.numel() + sum(counts))
    first = point.numel() + sum(counts[:number])
    own = ca.vertcat(place[: point.numel()], place[first : first + counts[number]])
    value = ca.substitute(forms[number].value, ca.vertcat(point, forms[number].numbers), own)
    return LimitForm(value, place, forms[number].shift)


def node_shares(grid: LimitGrid) -> Array:
    """Shares of a piece at which a limit has its nodes."""
    return np.arange(grid.first, grid.intervals + 1) / grid.intervals


def places_in_c(form: FlatForm, grids: Sequence[LimitGrid]) -> tuple[Array, str]:
    """The shares of a piece at which some limit has a node, and the tables of what the kernel reads there."""
    shares = np.unique(np.concatenate([np.zeros(0), *map(node_shares, grids)])) if grids else np.zeros(1)
    tables = {"share": shares, **form.node_tables(shares)}
    found = [c_array("gbt_real", f"gbt_place_{name}", numbers, const="const") for name, numbers in tables.items()]
    return shares, "".join(found)


def limit_in_c(
    problem: PosedProblem,
    number: int,
    limit: HardLimit | PenaltyLimit,
    form: FlatForm | ShootingForm,
    at: LimitForm,
    places: Array,
) -> LimitInC:
    """One constraint with its functions; in the flat form, places are the shares of :func:`places_in_c`."""
    width, constraint, grid = form.width, limit.constraint, form.grid(limit)
    name, value, place = f"limit{number}", at.value, at.place
    row, moved, factors = (
        ca.SX.sym(*one) for one in (("row", value.numel()), ("moved", width), ("w", 2 * value.numel()))
    )
    first, second = ca.vertsplit(factors, value.numel())
    jacobian = ca.jacobian(value, place)[:, :width]
    chained = form.moves(constraint)
    # row by row without gaps, for the chain rule
    slopes = ca.vec(ca.densify(jacobian).T) if chained else nonzeros(jacobian)[0]
    known = ca.SX.sym("known", slopes.numel())
    again = ca.reshape(known, width, value.numel()).T if chained else ca.SX(jacobian.sparsity(), known)
    curvature = ca.hessian(ca.dot(first, value), place)[0][:width, :width]
    curvature += ca.mtimes([again.T, ca.diag(second), again])
    curves, curve_rows, curve_columns = nonzeros(ca.tril(curvature))
    functions = [
        c_function(f"{name}_value", [place], value),
        c_function(f"{name}_jacobian", [place], slopes),
        c_function(f"{name}_pull", [known, row], ca.mtimes(again.T, row)),
        c_function(f"{name}_push", [known, moved], ca.mtimes(again, moved)),
        c_function(f"{name}_curvature", [place, factors, known], curves),
    ]
    shares, flat = node_shares(grid), isinstance(form, FlatForm)
    sides = _sides(constraint, at.shift)
    weights, widths = _penalty(problem, number, limit, [side[0] for side in sides], grid)
    tables: Sequence[tuple[str, str, Any]] = (
        ("int", "side_row", [side[0] for side in sides]),
        ("gbt_real", "side_sign", [side[1] for side in sides]),
        ("gbt_real", "side_bound", [side[2] for side in sides]),
        ("gbt_real", "side_edge", [side[3] for side in sides]),
        ("gbt_real", "side_weight", weights),
        ("gbt_real", "side_width", widths),
        ("gbt_index", "row", curve_rows),
        ("gbt_index", "column", curve_columns),
        ("int", "place", np.searchsorted(places, shares)) if flat else ("gbt_real", "share", shares),
    )
    hard, judged = int(isinstance(limit, HardLimit)), int(problem.judged[number])
    kind = ("GBT_THRUST", "GBT_CERTAIN", "GBT_BELIEVED")[limit_class(problem, constraint)]
    nodes = f"{name}_place" if flat else f"{name}_share"
    definition = (
        f"    {{{value.numel()}, {len(sides)}, {grid.intervals}, {grid.first}, {len(shares)}, {hard}, {kind},\n"
        f"     {int(grid.given)}, {judged}, {int(grid.steady)}, {int(chained)},\n"
        f"     {name}_side_row, {name}_side_sign, {name}_side_bound,\n"
        f"     {name}_side_edge, {name}_side_weight, {name}_side_width,\n"
        f"     {name}_value, {name}_jacobian, {name}_pull, {name}_push, {name}_curvature,\n"
        f"     {slopes.numel()}, {len(curve_rows)}, {name}_row, {name}_column, {nodes}}}"
    )
    return LimitInC(
        functions,
        definition,
        "".join(c_array(kind, f"{name}_{table}", entries) for kind, table, entries in tables),
        value.numel(),
        len(sides),
        len(shares),
        slopes.numel(),
        len(curve_rows),
    )


def _penalty(
    problem: PosedProblem, number: int, limit: HardLimit | PenaltyLimit, rows: list[int], grid: LimitGrid
) -> tuple[list[float], list[float]]:
    """Weight at an inner node and half width of each side, with the constraint normalised by its scale."""
    if isinstance(limit, HardLimit):
        return [hard_weights(problem)[number]] * len(rows), [0.0] * len(rows)
    scale = limit.constraint.scale[rows]
    step = grid.share * problem.period / grid.intervals
    return (limit.weight * step * scale).tolist(), (limit.width / scale).tolist()
