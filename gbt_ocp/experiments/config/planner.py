"""The section ``planner``: the trajectory problem and its solver."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, ValidationInfo

from gbt_ocp.experiments.config.keys import Section, key

SOLVER_CHOICES = {
    "auto": "compiled where a C compiler is found, ipopt otherwise",
    "compiled": "interior point in C99, generated for the problem",
    "ipopt": "interior point (IPOPT through CasADi), the reference",
}
"""Values of ``planner.solver``."""


def _above_minus_d(value: float, info: ValidationInfo) -> float:
    if value <= -(info.context or {}).get("d", 3):
        raise ValueError("κ > -d")
    return value


def _plain_options(value: dict[str, Any]) -> dict[str, Any]:
    for item in value.values():
        if isinstance(item, dict):
            _plain_options(item)
        elif not isinstance(item, str | int | float | list) or (isinstance(item, float) and not math.isfinite(item)):
            raise ValueError("not a plain value")
    return value


class PlannerSection(Section):
    """The trajectory optimisation."""

    pieces: int = key(5, "p, pieces of the trajectory.", "a whole number from 1 to tracker.forecast (p <= n)", ge=1)
    form: Literal["flat", "shooting"] = key(
        "flat", "Pieces of flat trajectories, or inputs over each piece with the motion that follows by integration."
    )
    thrust: Literal["held", "linear"] = key(
        "held", "Inputs over a piece: constant, or linear from one value to another; with form: shooting."
    )
    steps: int | None = key(
        None,
        "M, Runge-Kutta steps a piece; null is as few as are stable at all speeds that inputs and limits allow; with "
        "form: shooting.",
        "null, or a whole number >= 1",
        ge=1,
    )
    degree: int = key(2, "L, degree of the pieces; with form: flat.", ge=2, le=5)
    continuity: int | None = key(
        None,
        "Derivatives that are continuous between pieces; null is L - 1, the paper's. Fewer leave a piece more freedom.",
        "null, or a whole number from 1 to planner.degree - 1",
        ge=1,
    )
    period_s: float | None = key(
        None,
        "Length of a piece in s, after which the next plan is made; null is one sampling period.",
        "null, or a whole multiple of sensor.period_s",
        gt=0.0,
    )
    formulation: Literal["penalty", "hard"] = key("penalty", "Thrust limits as the paper's penalty or as constraints.")
    nodes: int = key(4, "n_c, intervals a piece at which limits are imposed.", ge=1)
    gamma: float = key(0.98, "γ, share of the limit that the solver is held to.", gt=0.0, le=1.0)
    width: float = key(0.01, "ϖ, width of the penalty's smoothing, in thrust_units; with formulation: penalty.", gt=0.0)
    weight: float = key(1000.0, "w_p, weight of the penalty; with formulation: penalty.", gt=0.0)
    thrust_units: Literal["normalised", "newton"] = key(
        "normalised", "Unit of the penalised thrust: the limit, or N and N m."
    )
    kappa: Annotated[float, AfterValidator(_above_minus_d)] = key(
        1.0, "κ, spread of the sigma points.", "a number > -{d} (κ > -d)"
    )
    objective: Literal[
        "similarity",
        "fisher_logdet",
        "fisher_trace",
        "fisher_min_eigenvalue",
        "posterior_variance",
        "condition_number",
        "motion_logdet",
        "motion_trace",
    ] = key(
        "similarity",
        "What the plan maximises (of variances and the condition number: minimises). Those of motion are the "
        "covariance of the target's position at the end of the plan and ahead_s later, after the planned bearings.",
    )
    stages: int = key(
        2,
        "Times of a plan, evenly spaced and the last one its end, at which the covariance counts; with objective: "
        "motion_logdet, motion_trace.",
        ge=1,
    )
    ahead_s: float = key(
        10.0, "Time in s from each of them to another that counts; with objective: motion_logdet, motion_trace.", gt=0.0
    )
    similarity: Literal["signed", "axial"] = key(
        "signed", "Whether a bearing opposite to the desired one counts as the worst, as in the paper, or the same."
    )
    effort: float = key(
        0.0, "Weight of the effort, taken off the objective: 1/s of the integral of Σ(τ/τ_max)² over the plan.", ge=0.0
    )
    effort_rate: float = key(
        0.0,
        "Weight in s² of changes of the thrust, taken off the objective: 1/s of the integral of Σ(dτ/dt/τ_max)² over "
        "the plan; of pieces of degree 2 the steps between them count. Not with continuity: 1 and a degree above 2.",
        ge=0.0,
    )
    range_pull: float = key(0.2, "Weight of the pull towards the target; 0.02 in preset paper.", ge=0.0)
    range_reference_m: float = key(1.0, "Range in m below which the pull fades.", gt=0.0)
    solver: Literal["auto", "compiled", "ipopt"] = key("auto", "Solver of the NLP.")
    solver_options: Annotated[dict[str, Any], AfterValidator(_plain_options)] = key(
        {},
        "Options handed to the solver; those in a mapping under compiled or ipopt to that solver only.",
        "a mapping of option names to finite numbers, strings, booleans or lists",
    )
