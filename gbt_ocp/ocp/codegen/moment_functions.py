"""Where mean and covariance of a forecast are all that a problem needs: its parameters from them, as C."""

from __future__ import annotations

from typing import cast

import casadi as ca

from gbt_ocp.ocp.codegen.expressions import c_function
from gbt_ocp.ocp.problem_data import PosedProblem
from gbt_ocp.ocp.terms import FromMoments, LimitFromMoments, LimitFromMotion, MovingConstraint
from gbt_ocp.ocp.transcription import limit_size


def from_moments(problem: PosedProblem) -> bool:
    """Whether the moments of a forecast are all that the problem needs."""
    return all(isinstance(term, FromMoments) or not term.shapes for term in problem.objectives) and all(
        isinstance(constraint, LimitFromMoments | LimitFromMotion)
        for constraint in problem.constraints
        if limit_size(constraint)
    )


def moment_functions(problem: PosedProblem) -> list[ca.Function]:
    """Functions in C of the parameters from the moments of a forecast, where these are all that is needed."""
    if not from_moments(problem):
        return []
    d = problem.vehicle.position_dimension
    mean, root, desired = ca.SX.sym("mean", d), ca.SX.sym("root", d, d), ca.SX.sym("desired", d)
    stacked = [ca.SX(0, 1)]
    for term in problem.objectives:
        if isinstance(term, FromMoments):
            values = term.from_moments(mean, root, desired)
            stacked += [ca.vec(ca.densify(values[name])) for name in term.shapes]
    functions = [c_function("gbt_prepare", [mean, root, desired], ca.vertcat(*stacked))]
    covariance, present, numbers = ca.SX.sym("covariance", d, d), ca.SX.sym("present", d, d), []
    before, later = ca.SX.sym("before", d), ca.SX.sym("later")
    for constraint in problem.constraints:
        if not limit_size(constraint):
            continue
        if isinstance(constraint, LimitFromMotion):
            values = constraint.at_knot_after(mean, covariance, present, before, later)
        else:
            values = cast(LimitFromMoments, constraint).at_knot(mean, covariance, present)
        shapes = cast(MovingConstraint, constraint).shapes
        numbers += [ca.vec(ca.densify(ca.SX(values[name]))) for name in shapes]
    if numbers:
        past = ca.vertcat(ca.vec(present), before, later)
        functions.append(c_function("gbt_prepare_limits", [mean, covariance, past], ca.vertcat(*numbers)))
    return functions
