"""How narrow and how stiff the kink of a penalty is, in what the optimiser moves.

The smoothed hinge turns from flat to steep within 2ϖ of the constrained quantity. A Newton step is right only as far as
the curvature holds, so on a narrow kink steps shrink to its width: in thrust that is 2ϖ, in the endpoint of a piece it
is what moves the thrust by as much.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from gbt_ocp.ocp.problem_data import PenaltyLimit, ProblemData
from gbt_ocp.ocp.transcription import constraint_function, limit_size
from gbt_ocp.typing import Array

STALLING = 100.0
"""Stiffness above which Newton steps on the printed penalty stall: in the sweeps of ``gbt-ocp compare`` IPOPT solved
every problem below it, and ever fewer above."""


def stiffness(problem: ProblemData, penalty: PenaltyLimit) -> float:
    """Curvature that one inner node adds on the kink, with the quantity in units of its limit: ``w_p T/n_c / (2ϖ)``.

    The objective changes by about one over an endpoint, and a scaled unknown moves the quantity by about one, so this
    is how much the curvature jumps where the kink begins and ends.
    """
    unit = float(np.max(penalty.constraint.scale))
    return penalty.weight * problem.period / penalty.nodes / (2.0 * penalty.width) * unit**2


def kink_widths(problem: ProblemData, penalty: PenaltyLimit) -> Array:
    """How far the endpoint of a piece moves while a penalised quantity crosses its kink ``(n,)``, in units of z.

    The endpoint of a piece that moves by δ by the lowest derivative that is free, the m-th, changes z̈ at its end by
    ``m (m-1) δ/T²`` (with m = 2 all along the piece; m = L in the paper),
    a thrust by M times that (``eq30``, ``eq32``), and the kink of ``eq34`` is 2ϖ wide: with one mass M and a limit
    τ_max, ``δ = ϖ τ_max T²/M`` for a width in units of the limit. Evaluated at rest, each axis with the quantity that
    it moves most; infinite for an axis that moves none.

    Parameters
    ----------
    problem
        Gives the vehicle, T and m.
    penalty
        One of its penalties.
    """
    n, lowest = problem.vehicle.flat_dimension, problem.joined
    point = [ca.SX.sym(name, n) for name in ("z", "dz", "ddz")]
    size = limit_size(penalty.constraint)
    value = constraint_function(problem, penalty.constraint)(*point, *([ca.SX.zeros(size)] if size else []))
    slope = ca.Function("slope", point, [ca.jacobian(value, point[2])])
    each = np.abs(np.asarray(slope(np.zeros(n), np.zeros(n), np.zeros(n))))
    steepest = each.max(axis=0) * lowest * (lowest - 1) / problem.period**2
    with np.errstate(divide="ignore"):
        return np.asarray(2.0 * penalty.width / steepest)
