"""Terms of the objective as CasADi functions: of one endpoint, and of all of them together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca

from gbt_ocp.ocp.problem_data import PosedProblem
from gbt_ocp.ocp.terms import AccumulatedObjective, AnyObjective, JointObjective, Objective, at_endpoint
from gbt_ocp.ocp.trajectory import FlatPoint


def point_symbols(size: int) -> FlatPoint:
    """Symbols z, ż, z̈ ``(n,)``."""
    return FlatPoint(*(ca.SX.sym(name, size) for name in ("z", "dz", "ddz")))


def stacked_size(shapes: Mapping[str, tuple[int, int]]) -> int:
    """How many numbers parameters of these shapes are at one time."""
    return sum(height * width for height, width in shapes.values())


def unstacked(shapes: Mapping[str, tuple[int, int]], stacked: Any) -> dict[str, Any]:
    """Parameters by name, as CasADi expressions, out of what :func:`stack_parameters` stacked at one time."""
    found, offset = {}, 0
    for name, (height, width) in shapes.items():
        found[name] = ca.reshape(stacked[offset : offset + height * width], height, width)
        offset += height * width
    return found


def objective_function(problem: PosedProblem, objective: Objective | AccumulatedObjective) -> ca.Function:
    """(z, ż, z̈, parameters) -> the term at one endpoint, or what that adds to the sums.

    The parameters are stacked column by column.
    """
    point = point_symbols(problem.vehicle.flat_dimension)
    stacked = ca.SX.sym("p", stacked_size(objective.shapes))
    value = at_endpoint(objective, point, unstacked(objective.shapes, stacked))
    return ca.Function("objective", [*point, stacked], [value], ["z", "dz", "ddz", "p"], ["value"])


def objective_total(problem: PosedProblem, objective: AnyObjective) -> ca.Function:
    """(Z, Ż, Z̈, parameters), one endpoint a column, -> the term of all endpoints together."""
    if isinstance(objective, AccumulatedObjective) or not isinstance(objective, JointObjective):
        single = objective_function(problem, objective).map(problem.pieces)
        columns = [ca.MX.sym(single.name_in(k), *single.size_in(k)) for k in range(4)]
        total = ca.sum2(single(*columns))
        if isinstance(objective, AccumulatedObjective):
            sums = ca.SX.sym("sums", total.numel())
            total = ca.Function("of_sums", [sums], [objective.of_sums(sums)])(total)
        return ca.Function("objective", columns, [total])
    n, p = problem.vehicle.flat_dimension, problem.pieces
    size = stacked_size(objective.shapes)
    ends = [ca.SX.sym(name, n, p) for name in ("z", "dz", "ddz")]
    stacked = ca.SX.sym("p", size, p)
    points, parameters = [], []
    for k in range(p):
        points.append(FlatPoint(*(values[:, k] for values in ends)))
        parameters.append(unstacked(objective.shapes, stacked[:, k]))
    return ca.Function("objective", [*ends, stacked], [objective.total(points, parameters)])
