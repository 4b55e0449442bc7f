"""The part of the solver that is generated: sizes, limits and derivatives of one trajectory problem, as C99."""

from __future__ import annotations

import json
import weakref
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.ocp.check import FINE_POINTS
from gbt_ocp.ocp.codegen.expressions import c_array, c_function, c_source
from gbt_ocp.ocp.codegen.limit_source import in_place, limit_in_c, placed_limits, places_in_c
from gbt_ocp.ocp.codegen.moment_functions import from_moments as from_moments
from gbt_ocp.ocp.codegen.moment_functions import moment_functions
from gbt_ocp.ocp.codegen.motion_source import motion_in_c
from gbt_ocp.ocp.codegen.objective_source import objective_in_c
from gbt_ocp.ocp.codegen.options import CompiledOptions
from gbt_ocp.ocp.codegen.problem_header import HEADER
from gbt_ocp.ocp.forms import ShootingForm, form_of
from gbt_ocp.ocp.limit_classes import limit_names
from gbt_ocp.ocp.objective_total import stacked_size
from gbt_ocp.ocp.problem_data import HardLimit, PenaltyLimit, PosedProblem, ShootingData
from gbt_ocp.ocp.transcription import limit_size


@dataclass(frozen=True)
class GeneratedProblem:
    """C text of a problem: the header with its sizes and the source with its tables and functions."""

    header: str
    source: str

    @property
    def files(self) -> dict[str, str]:
        """File names and their content."""
        return {"gbt_problem.h": self.header, "gbt_problem.c": self.source}


_GENERATED: dict[int, GeneratedProblem] = {}
"""What was generated of a problem with default options, for as long as there is the problem."""


def generate_problem(problem: PosedProblem, options: CompiledOptions | None = None) -> GeneratedProblem:
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
    if options is not None:
        return _generated(problem, options)
    if id(problem) not in _GENERATED:
        _GENERATED[id(problem)] = _generated(problem, None)
        weakref.finalize(problem, _GENERATED.pop, id(problem), None)
    return _GENERATED[id(problem)]


def _generated(problem: PosedProblem, options: CompiledOptions | None) -> GeneratedProblem:
    form, d = form_of(problem), problem.vehicle.position_dimension
    shooting = isinstance(problem, ShootingData)
    origin = ca.SX.sym("origin", d)
    parameters = ca.SX.sym("p", sum(stacked_size(term.shapes) for term in problem.objectives))
    objective = objective_in_c(problem, form, parameters, origin)
    imposed: list[HardLimit | PenaltyLimit] = [*problem.hard, *problem.penalties]
    moving = ca.SX.sym("moving", sum(limit_size(limit.constraint) for limit in imposed))
    places = placed_limits(problem, form, moving, origin)
    shares, at_places = (
        (np.zeros(0), "") if isinstance(form, ShootingForm) else places_in_c(form, list(map(form.grid, imposed)))
    )
    limits = [
        limit_in_c(problem, number, limit, form, in_place(form.point, places, number), shares)
        for number, limit in enumerate(imposed)
    ]
    motion = motion_in_c(problem, form)
    per_piece = [limit.nodes * problem.pieces for limit in limits]
    sides = sum(count * limit.sides for count, limit in zip(per_piece, limits, strict=True))
    jacobians = sum(count * limit.jacobian_entries for count, limit in zip(per_piece, limits, strict=True))
    header = HEADER.format(
        flat=problem.vehicle.flat_dimension,
        dimension=problem.vehicle.position_dimension,
        form=motion.sizes,
        pieces=problem.pieces,
        period=repr(float(problem.period)),
        parameters=parameters.numel(),
        moving=moving.numel(),
        sums=objective.sums,
        sum_columns=objective.columns,
        ends=objective.numbers,
        knots=sum(form.numbers.numel() for form in places),
        relative=int(not form.depends_on_place),
        limits=len(limits),
        count=sides,
        sides=max(sides, 1),
        jacobians=max(jacobians, 1),
        places=max(sum(per_piece), 1) if shooting else problem.pieces * len(shares),
        soft=int(bool(problem.penalties)),
        rows=max([1, *(limit.rows for limit in limits)]),
        entries=max([1, objective.hessian_entries, motion.entries, *(limit.curvature_entries for limit in limits)]),
        nodes=max([1, *(limit.nodes for limit in limits)]),
        inputs=len(problem.vehicle.thrust_max),
        fine=FINE_POINTS,
        moments=int(from_moments(problem)),
        present=int(from_moments(problem) and moving.numel() > 0),
        settings=(options or CompiledOptions.checked({}, problem.pieces, shooting=shooting)).initialiser(),
    )
    functions = [*objective.functions, *(function for limit in limits for function in limit.functions)]
    functions += motion.functions
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
            c_array("gbt_real", "gbt_input_scale", form.scale, const="const"),
            c_array("gbt_real", "gbt_thrust_min", ThrustRange.of(problem.vehicle).lower, const="const"),
            c_array("gbt_real", "gbt_thrust_max", problem.vehicle.thrust_max, const="const"),
            motion.tables,
            objective.tables,
            at_places,
            *(limit.tables for limit in limits),
            f"const gbt_limit gbt_limits[] = {{\n{table}\n}};\n",
            "const char *const gbt_limit_names[] = {"
            + ", ".join([*map(json.dumps, limit_names(problem)), "0"])
            + "};\n",
        ]
    )
    return GeneratedProblem(header, source)
