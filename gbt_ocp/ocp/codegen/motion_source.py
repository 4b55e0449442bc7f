"""How a piece leads to the next one, as C: nothing but sizes for flat trajectories, the integration for others."""

from __future__ import annotations

from math import factorial
from typing import NamedTuple

import casadi as ca
import numpy as np

from gbt_ocp.models.vehicles import acceleration
from gbt_ocp.ocp.codegen.expressions import c_array, c_function, c_numbers
from gbt_ocp.ocp.codegen.limit_source import nonzeros
from gbt_ocp.ocp.codegen.problem_header import FLAT_FORM, SHOOTING_FORM
from gbt_ocp.ocp.forms import FlatForm, ShootingForm
from gbt_ocp.ocp.problem_data import PosedProblem, ProblemData


class MotionInC(NamedTuple):
    """Sizes for the header, functions, tables in C, and nonzeros of a Hessian, at most."""

    sizes: str
    functions: list[ca.Function]
    tables: str
    entries: int


def motion_in_c(problem: PosedProblem, form: FlatForm | ShootingForm) -> MotionInC:
    """What the form of a problem's trajectories needs."""
    return _flat(problem, form) if isinstance(form, FlatForm) else _shooting(form)


def _flat(problem: PosedProblem, form: FlatForm) -> MotionInC:
    """Thrust and acceleration, which the planner around the solver needs."""
    assert isinstance(problem, ProblemData), "the flat form is that of no other"
    vehicle, size = problem.vehicle, problem.vehicle.flat_dimension
    z, dz, thrust = ca.SX.sym("z", size), ca.SX.sym("dz", size), ca.SX.sym("thrust", len(vehicle.thrust_max))
    functions = [
        c_function("gbt_vehicle_inputs", [form.point], vehicle.inputs(*ca.vertsplit(form.point, size))),
        c_function("gbt_vehicle_acceleration", [z, dz, thrust], acceleration(vehicle, z, dz, thrust)),
    ]
    tables = c_array("gbt_real", "gbt_acceleration_scale", vehicle.acceleration_scale, const="const")
    orders = range(problem.degree + 1)
    sizes = FLAT_FORM.format(
        degree=problem.degree,
        joined=problem.joined,
        taylor=c_numbers([float(problem.period) ** k / factorial(k) for k in orders]),
    )
    return MotionInC(sizes, functions, tables, 0)


def _shooting(form: ShootingForm) -> MotionInC:
    """The state at the end of a piece with its first and second derivatives, and what a plan reports of a piece."""
    piece, share = form.point[: form.width], ca.SX.sym("share")
    end = form.state_after(1.0)
    multiplier = ca.SX.sym("multiplier", form.states)
    curvature, rows, columns = nonzeros(ca.tril(ca.hessian(ca.dot(multiplier, end), piece)[0]))
    point = form.flat_point(piece[: form.states], form.inputs_after(0.0))
    functions = [
        c_function("gbt_stage", [piece], end),
        c_function("gbt_stage_slopes", [piece], ca.vec(ca.jacobian(end, piece).T)),
        c_function("gbt_stage_curvature", [piece, multiplier], curvature),
        c_function("gbt_stage_point", [piece], ca.vertcat(point.z, point.dz)),
        c_function("gbt_stage_inputs", [piece, share], form.inputs_after(share)),
    ]
    tables = "".join(
        [
            f"const int gbt_stage_entries = {len(rows)};\n",
            c_array("int", "gbt_stage_row", np.array(rows, dtype=int), const="const"),
            c_array("int", "gbt_stage_column", np.array(columns, dtype=int), const="const"),
        ]
    )
    sizes = SHOOTING_FORM.format(states=form.states, held=form.held, at_end=int(form.at_end))
    return MotionInC(sizes, functions, tables, len(rows))
