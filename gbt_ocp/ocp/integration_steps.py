"""How many Runge-Kutta steps a piece of a trajectory by integration takes, so that none of them is unstable."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gbt_ocp.models.dynamics import Dynamics, integrated
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.models.vehicles import DrivenVehicle
from gbt_ocp.ocp.terms import Constraint, MovingConstraint
from gbt_ocp.ocp.thrust_limits import OfChanges, OfInputs
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.typing import Array

STABLE = 2.78
"""Decay over a classical Runge-Kutta step beyond which it grows what it should damp."""

FASTER = 1.25
"""Times the fastest motion that inputs and limits allow: a plan may begin with more, after a push or in a current."""

DRIVEN = 8
"""Pieces over which inputs are held to find the fastest motion. A vehicle that is still gaining speed after them decays
by less than about a quarter over a piece, whatever its final speed."""

FINE = 32
"""Runge-Kutta steps a piece of that drive."""

HALVINGS = 20
"""Of the search for how much of a motion a limit allows."""


def stable_steps(vehicle: DrivenVehicle, period: float, constraints: Sequence[Constraint] = ()) -> int:
    """The fewest classical Runge-Kutta steps over a period that are stable at all speeds that inputs and limits allow.

    Parameters
    ----------
    vehicle
        Flat or not.
    period
        In seconds.
    constraints
        Those on speeds bound the motion.
    """
    return max(1, math.ceil(quickest_decay(vehicle, period, constraints) * period / STABLE))


def quickest_decay(vehicle: DrivenVehicle, period: float, constraints: Sequence[Constraint] = ()) -> float:
    """How fast the quickest motion of a vehicle decays, or grows or turns, in 1/s.

    The vehicle is driven from rest with every combination of full, no and full reverse inputs. At what it has moved
    after each piece, as far as limits on its speeds allow that, and at :data:`FASTER` times as much, the answer is the
    largest eigenvalue of the Jacobian of its rates. A motion that is not finite, as of a vehicle that is unstable by
    itself, is left out. Parameters are those of :func:`stable_steps`.
    """
    dynamics = Dynamics(vehicle)
    state, inputs = ca.SX.sym("state", dynamics.states), ca.SX.sym("inputs", dynamics.inputs)
    held = _combinations(ThrustRange.of(vehicle))
    after = integrated(dynamics, state, (inputs, inputs), period / FINE, 1)
    step = ca.Function("step", [state, inputs], [after]).map(len(held))
    slope = ca.jacobian(dynamics.rates(state, inputs), state)
    jacobian = ca.Function("jacobian", [state, inputs], [slope]).map(len(held))
    broken = _broken(dynamics, state, inputs, constraints).map(len(held))
    nothing = np.zeros(vehicle.flat_dimension)
    rest = np.asarray(dynamics.state(nothing, nothing), dtype=float)[:, None]
    moved, most = np.zeros((dynamics.states, len(held))), 0.0
    for _ in range(DRIVEN):
        for _ in range(FINE):
            with np.errstate(invalid="ignore"):
                moved = np.asarray(step(rest + moved, held.T)) - rest
        allowed = moved * _allowed(lambda share: np.asarray(broken(rest + share * moved, held.T)), len(held))  # noqa: B023
        for share in (1.0, FASTER):
            found = np.asarray(jacobian(rest + share * allowed, held.T))
            each = found.reshape(len(found), len(held), -1).swapaxes(0, 1)
            each = each[np.all(np.isfinite(each), axis=(1, 2))]
            most = max(most, float(np.max(np.abs(np.linalg.eigvals(each)), initial=0.0)))
    return most


def _combinations(limits: ThrustRange) -> Array:
    """Full, no and full reverse inputs, each with each ``(3^m, m)``; fewer where there is no reverse."""
    each = np.transpose([limits.upper, 0.0 * limits.upper, limits.lower])
    return np.unique(list(itertools.product(*each)), axis=0)


def _broken(dynamics: Dynamics, state: ca.SX, inputs: ca.SX, constraints: Sequence[Constraint]) -> ca.Function:
    """By how much each limit on speeds alone is broken at a state and inputs."""
    point = FlatPoint(*(ca.SX.sym(name, dynamics.vehicle.flat_dimension) for name in ("z", "dz", "ddz")))
    found: list[ca.SX] = [ca.SX(-1)]
    for limit in constraints:
        if isinstance(limit, OfInputs | OfChanges | MovingConstraint):
            continue
        value = ca.SX(ca.vertcat(limit.value(point)))
        if not ca.depends_on(value, ca.vertcat(point.z, point.ddz)):
            found += [value - ca.DM(limit.upper), ca.DM(limit.lower) - value]
    at = ca.substitute(ca.vertcat(*found), ca.vertcat(*point), ca.vertcat(*dynamics.point(state, inputs)))
    return ca.Function("broken", [state, inputs], [at])


def _allowed(broken: Callable[[Array], Array], count: int) -> Array:
    """The largest shares of some motions ``(1, count)`` that keep the limits, of those that are kept at rest."""
    low, high = np.zeros((1, count)), np.ones((1, count))
    asked = broken(low) <= 0.0

    def kept(share: Array) -> NDArray[np.bool_]:
        return np.asarray(~np.any(asked & ~(broken(share) <= 0.0), axis=0))

    whole = kept(high)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        keeps = kept(middle)
        low, high = np.where(keeps, middle, low), np.where(keeps, high, middle)
    return np.where(whole, 1.0, low)
