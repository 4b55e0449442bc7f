"""Tables and functions of one problem's objective, for the generated C."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from gbt_ocp.ocp.codegen.expressions import NotGenerableError, c_array, c_function
from gbt_ocp.ocp.codegen.limit_source import nonzeros
from gbt_ocp.ocp.codegen.places import placed
from gbt_ocp.ocp.forms import FlatForm, ShootingForm
from gbt_ocp.ocp.objective_total import stacked_size
from gbt_ocp.ocp.problem_data import PosedProblem
from gbt_ocp.ocp.terms import AccumulatedObjective, JointObjective


@dataclass(frozen=True)
class ObjectiveInC:
    """The objective in C.

    Attributes
    ----------
    functions, located, tables
        Of a point and of the sums; of the numbers at the origin; and text.
    numbers, sums, columns, hessian_entries
        Numbers of an endpoint, sums over the endpoints, numbers of a state that these depend on, and nonzeros of the
        Hessian at an endpoint.
    """

    functions: list[ca.Function]
    located: ca.SX
    tables: str
    numbers: int
    sums: int
    columns: int
    hessian_entries: int


def objective_in_c(
    problem: PosedProblem, form: FlatForm | ShootingForm, parameters: ca.SX, origin: ca.SX
) -> ObjectiveInC:
    """Functions and tables of the objective of parameters at an endpoint.

    Raises
    ------
    NotGenerableError
        If a term couples the endpoints otherwise than by sums, or the sums depend on more than the state at the ends.
    """
    d, point = problem.vehicle.position_dimension, form.objective_point
    single, sums, worth, offset = ca.SX(0), [ca.SX(0, 1)], ca.SX(0), 0
    symbols = [ca.SX(0, 1)]
    for term in problem.objectives:
        name, own = type(term).__name__, parameters[offset:]
        offset += stacked_size(term.shapes)
        if isinstance(term, AccumulatedObjective):
            sums.append(ca.SX(form.objective(term, own)))
            symbols.append(ca.SX.sym(name, sums[-1].numel()))
            worth += term.of_sums(symbols[-1])
        elif isinstance(term, JointObjective):
            raise NotGenerableError(
                f"planner.solver: found compiled, which takes sums over the endpoints of a plan and functions of sums; "
                f"allowed: ipopt, since the objective {name} couples them otherwise"
            )
        else:
            single += form.objective(term, own)
    found = placed(ca.vertcat(single, *sums), point[:d], parameters, point[d:], origin)
    stacked, total, count = found.numbers, found.value, found.value.numel() - 1
    weight = ca.SX.sym("weight", 1 + count)
    gradient = ca.gradient(ca.dot(weight, total) if count else total, point)
    hessian, rows, columns = nonzeros(ca.tril(ca.hessian(ca.dot(weight, total), point)[0]))
    functions = [
        c_function("objective_value", [point, stacked], total),
        c_function("objective_gradient", [point, stacked, weight], gradient),
        c_function("objective_hessian", [point, stacked, weight], hessian),
    ]
    text = "".join(
        [
            c_array("gbt_index", "objective_row", rows),
            c_array("gbt_index", "objective_column", columns),
            "const gbt_objective_functions gbt_objective = {objective_value, objective_gradient, objective_hessian,\n"
            f"    {len(rows)}, objective_row, objective_column}};\n",
        ]
    )
    read: list[int] = []
    if count:
        slopes = ca.jacobian(total[1:], point)
        read = np.flatnonzero(np.diff(slopes.sparsity().colind())).tolist() or [0]
        if not form.at_end_of_state(read):
            raise NotGenerableError(
                "planner.solver: found compiled beside sums of an objective that depend on more than the flat output "
                "and its rate at the end of a piece; allowed: ipopt"
            )
        every = ca.vertcat(*symbols)
        value = ca.SX(worth)
        functions += [
            c_function("sums_value", [every], value),
            c_function("sums_gradient", [every], ca.gradient(value, every)),
            c_function("sums_hessian", [every], ca.vec(ca.densify(ca.hessian(value, every)[0]))),
            c_function("sums_slopes", [point, stacked], ca.vec(ca.densify(slopes[:, read]))),
        ]
        text += c_array("int", "sums_column", read)
        text += (
            "const gbt_sum_functions gbt_of_sums = {sums_value, sums_gradient, sums_hessian, sums_slopes,\n"
            "    sums_column};\n"
        )
    return ObjectiveInC(functions, found.located, text, stacked.numel(), count, len(read), len(rows))
