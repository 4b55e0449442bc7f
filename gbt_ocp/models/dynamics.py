"""How a vehicle moves under its inputs, in CasADi: what a trajectory by integration is made of.

A vehicle that has ``rates(state, inputs)`` in CasADi is taken as it is; its state begins with the flat output z, the
position first. A flat vehicle without is moved in the coordinates (z, ż), by its inverse dynamics solved for z̈.
"""

from __future__ import annotations

from typing import Any

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


def stepped(
    dynamics: Dynamics, state: Any, inputs: tuple[Any, Any, Any], duration: Any, numbers: ca.SX, multiplier: ca.SX
) -> tuple[Any, Any, Any]:
    """One classical Runge-Kutta step with its derivatives, CasADi expressions that know what depends on what.

    Derivatives of the rates at the four stages are put together by the chain rule. CasADi's own of the finished step
    are the same at twice the operations.

    Parameters
    ----------
    state
        At the beginning ``(states,)``.
    inputs
        At the beginning, in the middle and at the end ``(m,)`` each.
    duration
        In seconds.
    numbers
        Symbols for which is differentiated ``(k,)``; state and inputs are expressions of them.
    multiplier
        Symbols ``(states,)``.

    Returns
    -------
    The state after it ``(states,)``, its derivatives ``(states, k)``, and the second derivatives of its product with
    the multiplier ``(k, k)``.
    """
    sizes = dynamics.states, dynamics.inputs, dynamics.states
    x, u, weight = (ca.SX.sym(name, size) for name, size in zip("xuw", sizes, strict=True))
    rates, at = ca.SX(dynamics.rates(x, u)), ca.vertcat(x, u)
    stage = ca.Function("stage", [x, u], [rates, ca.jacobian(rates, at)])
    curve = ca.Function("curve", [x, u, weight], [ca.hessian(ca.dot(weight, rates), at)[0]])
    first, (before, middle, after) = ca.jacobian(state, numbers), inputs
    inner, outer = (0.0, 0.5, 0.5, 1.0), (1.0, 2.0, 2.0, 1.0)
    # of each stage: where it is; k; derivatives there, and of where it is for the numbers
    points: list[tuple[Any, Any]] = []
    moved: list[Any] = []
    slopes: list[tuple[Any, Any]] = []
    for part, given in zip(inner, (before, middle, middle, after), strict=True):
        here, along = state, first
        if moved:
            here = state + part * duration * moved[-1]
            along = first + part * duration * ca.mtimes(*slopes[-1])
        k, slope = stage(here, given)
        points.append((here, given))
        moved.append(k)
        slopes.append((slope, ca.vertcat(along, ca.jacobian(given, numbers))))
    shares = [part * duration / 6.0 for part in outer]
    end = state + sum(share * k for share, k in zip(shares, moved, strict=True))
    total = first + sum(share * ca.mtimes(*pair) for share, pair in zip(shares, slopes, strict=True))
    bend, back = ca.SX(numbers.numel(), numbers.numel()), 0.0
    for k in reversed(range(4)):
        own = shares[k] * multiplier + back
        slope, along = slopes[k]
        bend += ca.mtimes([along.T, curve(*points[k], own), along])
        back = inner[k] * duration * ca.mtimes(slope[:, : dynamics.states].T, own)
    return end, total, bend


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
