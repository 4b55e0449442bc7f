"""How a vehicle moves under its inputs, in CasADi: what a trajectory by integration is made of.

A vehicle that has ``rates(state, inputs)`` in CasADi is taken as it is; its state begins with the flat output z, the
position first. A flat vehicle without is moved in the coordinates (z, ż), by its inverse dynamics solved for z̈.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.contracts import ContractError, named, reason
from gbt_ocp.models.vehicles import DrivenVehicle, Vehicle, acceleration
from gbt_ocp.typing import Array


class Dynamics:
    """The forward dynamics of a vehicle in CasADi.

    Parameters
    ----------
    vehicle
        With ``rates`` in CasADi, or flat.

    Attributes
    ----------
    states
        Numbers of the state.
    inputs
        m, numbers of the inputs.

    Raises
    ------
    gbt_ocp.models.contracts.ContractError
        If the vehicle is neither.
    """

    def __init__(self, vehicle: DrivenVehicle | Vehicle) -> None:
        self.vehicle = vehicle
        self.inputs = len(vehicle.thrust_max)
        nothing = np.zeros(vehicle.flat_dimension)
        own, fault = len(vehicle.state(nothing, nothing)), ""
        try:
            rates = ca.SX(ca.vertcat(vehicle.rates(ca.SX.sym("state", own), ca.SX.sym("inputs", self.inputs))))
            self._is_driven = rates.shape == (own, 1)
            fault = f"found {rates.shape[0]} x {rates.shape[1]} rates for {own} states"
        except Exception as raised:  # rates of a flat vehicle may be of numpy alone
            self._is_driven, fault = False, reason(raised)
        if not self._is_driven and not hasattr(vehicle, "inputs"):
            raise ContractError(
                f"{named(vehicle, 'rates')}: {fault}; allowed: the time derivative of the state, a CasADi expression"
            )
        self.states = own if self._is_driven else 2 * vehicle.flat_dimension

    def rates(self, state: Any, inputs: Any) -> Any:
        """Time derivative of the state ``(states,)``, a CasADi expression."""
        if self._is_driven:
            return ca.vertcat(self.vehicle.rates(state, inputs))
        n = self.vehicle.flat_dimension
        flat: Any = self.vehicle
        return ca.vertcat(state[n:], acceleration(flat, state[:n], state[n:], inputs))

    def point(self, state: ca.SX, inputs: ca.SX) -> tuple[Any, Any, Any]:
        """z and its first two derivatives ``(n,)`` at symbols of state and inputs, the inputs as if held."""
        n, rates = self.vehicle.flat_dimension, self.rates(state, inputs)
        z, dz = state[:n], rates[:n]
        return z, dz, ca.jtimes(dz, state, rates)

    def state(self, z: ArrayLike, dz: ArrayLike, expected: Array | None = None) -> Array:
        """The state ``(states,)`` at a flat output and its rate; near the expected one, if the vehicle takes that."""
        if expected is not None and hasattr(self.vehicle, "state_near"):
            return np.asarray(self.vehicle.state_near(z, dz, expected[: self.states]), dtype=float)
        if self._is_driven:
            return np.asarray(self.vehicle.state(z, dz), dtype=float)
        return np.concatenate([np.asarray(z, dtype=float), np.asarray(dz, dtype=float)])

    @property
    def depends_on_place(self) -> bool:
        """Whether the rates depend on the position, as in a current that differs from place to place."""
        state, inputs = ca.SX.sym("state", self.states), ca.SX.sym("inputs", self.inputs)
        return bool(ca.depends_on(self.rates(state, inputs), state[: self.vehicle.position_dimension]))


def integrated(dynamics: Dynamics, state: Any, inputs: tuple[Any, Any], duration: Any, steps: int) -> Any:
    """The state after a while by classical Runge-Kutta steps, a CasADi expression.

    Parameters
    ----------
    state
        At the beginning ``(states,)``.
    inputs
        At the beginning and at the end ``(m,)`` each, linear in between.
    duration
        In seconds, a number or an expression.
    steps
        How many.
    """
    h, (first, last) = duration / steps, inputs
    for k in range(steps):
        before, middle, after = (first + (last - first) * ((k + part) / steps) for part in (0.0, 0.5, 1.0))
        k1 = dynamics.rates(state, before)
        k2 = dynamics.rates(state + 0.5 * h * k1, middle)
        k3 = dynamics.rates(state + 0.5 * h * k2, middle)
        k4 = dynamics.rates(state + h * k3, after)
        state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return state


class StepDerivatives(NamedTuple):
    """A Runge-Kutta step with its derivatives by some unknowns ``(w,)``: CasADi expressions.

    Attributes
    ----------
    end
        The state after it ``(states,)``.
    slopes
        Jacobian of that ``(states, w)``.
    curvature
        Hessian of its product with a multiplier ``(w, w)``, the lower triangle.
    """

    end: ca.SX
    slopes: ca.SX
    curvature: ca.SX


def differentiated(
    dynamics: Dynamics, state: ca.SX, inputs: tuple[ca.SX, ca.SX], duration: Any, unknowns: ca.SX, multiplier: ca.SX
) -> StepDerivatives:
    """One step of :func:`integrated`, differentiated evaluation by evaluation of the rates.

    The second derivatives of the step are those of its four rates, each times the multiplier that the later ones leave
    it, between the slopes of the point where it is evaluated. That takes fewer operations than those of the step as one
    expression.

    Parameters
    ----------
    state, inputs, duration
        As those of :func:`integrated`; state and inputs are linear in the unknowns.
    unknowns
        Symbols ``(w,)``.
    multiplier
        Symbols ``(states,)``.
    """
    x, u, weight = (
        ca.SX.sym(name, size) for name, size in (("x", dynamics.states), ("u", dynamics.inputs), ("m", dynamics.states))
    )
    point, rates = ca.vertcat(x, u), ca.SX(dynamics.rates(x, u))
    of_point = ca.Function("rates", [x, u], [rates, ca.jacobian(rates, point)])
    bend = ca.Function("bend", [x, u, weight], [ca.hessian(ca.dot(weight, rates), point)[0]])
    first, last = inputs
    middle = 0.5 * (first + last)
    fixed = ca.jacobian(state, unknowns)
    at, slope = state, fixed
    points, slopes, own, found = [], [], [], []
    for k, given in enumerate((first, middle, middle, last)):
        rate, jacobian = of_point(at, given)
        points.append((at, given))
        slopes.append(ca.vertcat(slope, ca.jacobian(given, unknowns)))
        own.append(jacobian[:, : dynamics.states])
        found.append((rate, ca.mtimes(jacobian, slopes[-1])))
        if k < 3:
            part = duration * (0.5, 0.5, 1.0)[k]
            at, slope = state + part * rate, fixed + part * found[-1][1]
    shares = [duration / 6.0 * factor for factor in (1.0, 2.0, 2.0, 1.0)]
    end = state + sum(share * rate for share, (rate, _) in zip(shares, found, strict=True))
    total = fixed + sum(share * slope for share, (_, slope) in zip(shares, found, strict=True))
    curvature, later = ca.SX(unknowns.numel(), unknowns.numel()), ca.SX(dynamics.states, 1)
    for k in (3, 2, 1, 0):
        push = shares[k] * multiplier + later
        if k > 0:
            later = duration * (0.5, 0.5, 1.0)[k - 1] * ca.mtimes(own[k].T, push)
        curvature += ca.tril(ca.mtimes(slopes[k].T, ca.mtimes(bend(*points[k], push), slopes[k])))
    return StepDerivatives(end, total, curvature)
