"""How a piece leads to the next one, as C: nothing but sizes for flat trajectories, the integration for others."""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial
from typing import Any, NamedTuple

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
        c_function("gbt_vehicle_inputs", [form.point], vehicle.inputs(*ca.vertsplit(form.point, size)[:3])),
        c_function("gbt_vehicle_acceleration", [z, dz, thrust], acceleration(vehicle, z, dz, thrust)),
    ]
    tables = c_array("gbt_real", "gbt_acceleration_scale", vehicle.acceleration_scale, const="const")
    orders = range(problem.degree + 1)
    sizes = FLAT_FORM.format(
        degree=problem.degree,
        joined=problem.joined,
        seen=form.seen,
        remembered=int(problem.remembers),
        taylor=c_numbers([float(problem.period) ** k / factorial(k) for k in orders]),
    )
    return MotionInC(sizes, functions, tables, 0)


def _shooting(form: ShootingForm) -> MotionInC:
    """The state at the end of a piece with its first and second derivatives, and what a plan reports of a piece."""
    piece, share, span = form.point[: form.width], ca.SX.sym("share"), ca.SX.sym("span", 2)
    single = form.steps == 1
    multiplier = ca.SX.sym("multiplier", form.states if single else form.dynamics.states)
    part: tuple[Any, Any] = (0.0, 1.0) if single else (span[0], span[1])
    end, slopes, bend = form.derivatives(*part, multiplier)
    if single and form.states > form.dynamics.states:
        kept = form.inputs_after(1.0)
        end, slopes = ca.vertcat(end, kept), ca.vertcat(slopes, ca.jacobian(kept, piece))
    curvature, rows, columns = nonzeros(bend)
    point = form.flat_point(piece[: form.states], form.inputs_after(0.0))
    name, more = ("gbt_stage", []) if single else ("gbt_flow", [span])
    tables = _pattern(name, rows, columns)
    if not single:
        tables += _pattern("gbt_stage", *(places.tolist() for places in np.tril_indices(form.width)))
    functions = [
        c_function(name, [piece, *more], end),
        c_function(f"{name}_slopes", [piece, *more], ca.vec(slopes.T)),
        c_function(f"{name}_curvature", [piece, multiplier, *more], curvature),
        c_function("gbt_stage_point", [piece], ca.vertcat(point.z, point.dz)),
        c_function("gbt_stage_inputs", [piece, share], form.inputs_after(share)),
        c_function("gbt_last_resort", [piece], form.resort),
    ]
    tables += "".join(
        [
            c_array("gbt_real", "gbt_idle", form.idle, const="const"),
            c_array("gbt_real", "gbt_input_step", np.minimum(form.steps_of_inputs, 1e30), const="const"),
        ]
    )
    sizes = SHOOTING_FORM.format(
        states=form.states,
        last=form.dynamics.states,
        steps=form.steps,
        held=form.held,
        at_end=int(form.at_end),
        box=form.box,
    )
    entries = len(rows) if single else form.width * (form.width + 1) // 2
    return MotionInC(sizes, functions, tables, entries)


def _pattern(name: str, rows: Sequence[int], columns: Sequence[int]) -> str:
    """Rows and columns of the nonzeros of a Hessian's lower triangle."""
    return "".join(
        [
            f"const int {name}_entries = {len(rows)};\n",
            c_array("gbt_index", f"{name}_row", np.array(rows, dtype=int), const="const"),
            c_array("gbt_index", f"{name}_column", np.array(columns, dtype=int), const="const"),
        ]
    )
