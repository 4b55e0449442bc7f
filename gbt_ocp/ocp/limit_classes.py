"""Which limits give for which where they cannot all be kept, what that weighs, and what the limits are called."""

from __future__ import annotations

from enum import IntEnum

import casadi as ca

from gbt_ocp.ocp.problem_data import PosedProblem
from gbt_ocp.ocp.terms import Constraint, MovingConstraint, is_believed
from gbt_ocp.ocp.thrust_limits import OfChanges, OfInputs
from gbt_ocp.ocp.trajectory import FlatPoint


class LimitClass(IntEnum):
    """Which limits give for which, the last first, where they cannot all be kept."""

    THRUST = 0
    """Moved by the acceleration: never given up."""
    CERTAIN = 1
    """On where the vehicle is and how fast, which it knows."""
    BELIEVED = 2
    """On the target, of which there is only a belief."""


LIMIT_WEIGHT = 10.0
"""Weight of a hard thrust limit where there are no others, for a violation of one unit of it at one node."""

FIRST_TO_GIVE = 3.0
"""The same where some limits may give, in units of :data:`LIMIT_WEIGHT`: their weight, unlike that of thrust limits, is
not raised while they are broken, so it has to exceed their multipliers at once."""

CLASS_RATIO = 10.0
"""Weight of a hard limit over that of one of the class that gives before it."""


def limit_class(problem: PosedProblem, constraint: Constraint) -> LimitClass:
    """The class of a constraint, which follows from what it depends on."""
    if is_believed(constraint):
        return LimitClass.BELIEVED
    if isinstance(constraint, OfInputs | OfChanges):
        return LimitClass.THRUST
    point = FlatPoint(*(ca.SX.sym(name, problem.vehicle.flat_dimension) for name in ("z", "dz", "ddz")))
    if isinstance(constraint, MovingConstraint):
        numbers = {name: ca.SX.sym(name, *shape) for name, shape in constraint.shapes.items()}
        value = constraint.value(point, numbers)
    else:
        value = constraint.value(point)
    moved = ca.depends_on(ca.SX(ca.vertcat(value)), point.ddz)
    return LimitClass.THRUST if moved else LimitClass.CERTAIN


def hard_weights(problem: PosedProblem) -> list[float]:
    """Weight of each hard limit's l1 penalty, in units of :data:`LIMIT_WEIGHT`."""
    classes = [limit_class(problem, limit.constraint) for limit in problem.hard]
    present = sorted(set(classes), reverse=True)
    first = 1.0 if present == [LimitClass.THRUST] else FIRST_TO_GIVE
    return [first * CLASS_RATIO ** present.index(found) for found in classes]


def limit_names(problem: PosedProblem) -> tuple[str, ...]:
    """What the constraints of a problem are called, each by another name.

    That is their attribute ``name``, or the name of their class; equal ones are numbered from the second on.
    """
    names: list[str] = []
    for constraint in problem.constraints:
        name = str(getattr(constraint, "name", type(constraint).__name__))
        count = sum(other == name or other.startswith(f"{name} ") for other in names)
        names.append(f"{name} {count + 1}" if count else name)
    return tuple(names)
