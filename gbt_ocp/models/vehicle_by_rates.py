"""A vehicle of the user's that is known by its rates alone, with all that a plan and a simulation need beside them."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.contracts import ContractError, array, called, count, expression, finite, has, member, named
from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.typing import Array

SAME_RATE = 1.0e-6
"""Difference of ż, relative to its size and absolute, up to which a state has the rate that it was made of."""

GAUSS_NEWTON_STEPS = 20
"""Steps in which a state is looked for that has a rate."""

GENERIC = np.array([0.13, -0.29, 0.31, 0.47, -0.53, 0.61, 0.71, -0.83])
"""Numbers at which the members of a vehicle are evaluated once; of more, they begin again."""


class VehicleByRates(DrivenBody):
    """Any object with ``rates(state, inputs)`` in CasADi, as a vehicle of plans by integration.

    What the object does not have is made of its rates, in numbers too:

    ========================================  =====================================================================
    member                                    without it
    ========================================  =====================================================================
    ``position_dimension``                    needed: d, 2 or 3
    ``flat_dimension``                        needed: n, the first numbers z of the state, the position first, then
                                              (where n > d) the yaw
    ``thrust_max`` ``(m,)``                   needed: upper limits of the inputs, above 0
    ``rates(state, inputs)``                  needed: the time derivative of the state, a CasADi expression
    ``thrust_min`` ``(m,)``                   minus ``thrust_max``
    ``states``                                2n numbers of the state, where there is no ``state`` either
    ``state(z, dz)``                          z, and of the rest what has the rate ż without inputs
    ``flat(state)``                           z, and ż without inputs
    ``pose(state)``, ``velocity(state)``      of z and ż: position and yaw; surge, sway, (heave,) yaw rate
    ``last_resort(state)`` in CasADi          no inputs
    ``idle`` ``(m,)``                         no inputs: where a cold solve begins
    ``steering(push, turn)``                  start-up moves and turns that follow from the vehicle are refused
    ``input_velocities(state)`` in CasADi     power and energy are not known
    ``input_names``, ``input_units``          ``input1``, ...; none
    ========================================  =====================================================================

    Parameters
    ----------
    own
        The object.

    Raises
    ------
    gbt_ocp.models.contracts.ContractError
        If a member is missing, gives something of a wrong size, or does not fit the others.
    """

    def __init__(self, own: Any) -> None:
        self._own = own
        self.position_dimension = count(own, "position_dimension", 2, "the dimension of the space")
        if self.position_dimension > 3:
            raise ContractError(f"{named(own, 'position_dimension')}: found {self.position_dimension}; allowed: 2, 3")
        least, meaning = self.position_dimension, "the first numbers of the state, the position among them"
        self.flat_dimension = count(own, "flat_dimension", least, meaning)
        given = np.asarray(member(own, "thrust_max", "(m,) numbers > 0"), dtype=float)
        self.thrust_max = finite(named(own, "thrust_max"), given.reshape(-1), positive=True)
        self.thrust_min = ThrustRange.of(own).lower
        m = len(self.thrust_max)
        if self.thrust_min.shape != (m,) or not np.all(np.isfinite(self.thrust_min) & (self.thrust_min <= 0.0)):
            found = self.thrust_min.tolist()
            raise ContractError(f"{named(own, 'thrust_min')}: found {found}; allowed: {m} numbers <= 0")
        self.states = self._count_of_states()
        where = named(own, "idle")
        self.idle = finite(where, array(where, np.asarray(getattr(own, "idle", np.zeros(m))), (m,)))
        names, units = getattr(own, "input_names", None), getattr(own, "input_units", None)
        d = self.position_dimension
        self.input_names = {d: tuple(names or (f"input{k + 1}" for k in range(m)))}  # type: ignore[misc]
        self.input_units = {d: tuple(units or ("",) * m)}  # type: ignore[misc]
        for name, found in (("input_names", self.input_names[d]), ("input_units", self.input_units[d])):
            if len(found) != m:
                raise ContractError(f"{named(own, name)}: found {len(found)}; allowed: {m}, one an input")
        state, inputs = ca.SX.sym("state", self.states), ca.SX.sym("inputs", m)
        rates = self._symbolic_rates(state, inputs)
        n, rest = self.flat_dimension, state[self.flat_dimension :]
        self._numbers = ca.Function("rates", [state, inputs], [rates])
        self._moved = ca.Function("moved", [state], [ca.substitute(rates[:n], inputs, ca.SX.zeros(m))])
        self._slope = ca.Function("slope", [state], [ca.jacobian(self._moved(state), rest)])
        self._along = ca.Function("along", [state], [self.input_velocities(state)])
        self._check()

    @property
    def name(self) -> str:
        """That of the object's class."""
        return type(self._own).__name__

    @property
    def gives_power(self) -> bool:
        """Whether the object has ``input_velocities``."""
        return has(self._own, "input_velocities")

    def body_rates(self, eta: Any, nu: Any, inputs: Any) -> Any:
        """What of the state is not z: its rates ``(states - n,)``."""
        return self._symbolic_rates(ca.vertcat(eta, nu), inputs)[self.flat_dimension :]

    def input_velocities(self, state: Any) -> Any:
        """The object's own; NaN where it has none: the power is not known."""
        if not has(self._own, "input_velocities"):
            return ca.SX(np.full(len(self.thrust_max), np.nan))
        where = named(self._own, "input_velocities")
        value = called(self._own, "input_velocities", {"state": state}, "a CasADi expression, one number an input")
        return expression(where, value, (len(self.thrust_max), 1), [state], "one number an input")

    def steering(self, push: float, turn: float) -> Array:
        """The object's own."""
        if not has(self._own, "steering"):
            return super().steering(push, turn)
        value = called(self._own, "steering", {"push": push, "turn": turn}, "inputs (m,)")
        return self.clipped(array(named(self._own, "steering"), np.asarray(value), self.thrust_max.shape, "(m,)"))

    def last_resort(self, state: Any) -> Any:
        """The object's own, or no inputs."""
        if not has(self._own, "last_resort"):
            return super().last_resort(state)
        where, m = named(self._own, "last_resort"), len(self.thrust_max)
        value = called(self._own, "last_resort", {"state": state}, "a CasADi expression, the inputs")
        return expression(where, value, (m, 1), ca.symvar(ca.SX(state)), "the inputs")

    def state(self, z: ArrayLike, dz: ArrayLike) -> Array:
        """The object's own; else the state ``(states,)`` whose rate without inputs is nearest to ``dz``."""
        first, rate = np.asarray(z, dtype=float), np.asarray(dz, dtype=float)
        if has(self._own, "state"):
            value = np.asarray(called(self._own, "state", {"z": first, "dz": rate}, "the state, a vector of numbers"))
            return array(named(self._own, "state"), value.astype(float).reshape(-1), (self.states,), "the state")
        found = self._with_rate(first, rate, np.zeros(self.states))
        # at rest ż may not depend on the rest
        return found if self._has_rate(found, rate) else self._with_rate(first, rate, np.resize(GENERIC, self.states))

    def state_near(self, z: ArrayLike, dz: ArrayLike, expected: Array) -> Array:
        """The state that has z and ż, and of what these do not tell (a rudder, say) what is expected ``(states,)``."""
        found = self._with_rate(np.asarray(z, dtype=float), np.asarray(dz, dtype=float), expected)
        return found if self._has_rate(found, np.asarray(dz, dtype=float)) else self.state(z, dz)

    def _with_rate(self, z: Array, dz: Array, near: Array) -> Array:
        """z, and of the rest what is near a state ``(states,)`` and has the rate, by Gauss and Newton."""
        found = np.concatenate([z, near[len(z) :]])
        for _ in range(GAUSS_NEWTON_STEPS):  # one is enough where ż is linear in the rest
            if self._has_rate(found, dz):
                break
            off = dz - np.asarray(self._moved(found)).ravel()
            found[len(z) :] += np.linalg.lstsq(np.asarray(self._slope(found)), off, rcond=1e-9)[0]
        return found

    def _has_rate(self, state: Array, dz: Array) -> bool:
        off = np.max(np.abs(dz - np.asarray(self._moved(state)).ravel()))
        return bool(off <= SAME_RATE * (1.0 + np.max(np.abs(dz))))

    def symbolic_state(self, z: Any, dz: Any) -> Any:
        """The state where ż is linear in what of it is not z, a CasADi expression."""
        resting = ca.vertcat(z, ca.SX.zeros(self.states - self.flat_dimension))
        return ca.vertcat(z, ca.mtimes(ca.pinv(self._slope(resting)), dz - self._moved(resting)))

    def flat(self, state: ArrayLike) -> tuple[Array, Array]:
        """The object's own; else z and its rate without inputs ``(n,)``."""
        found = np.asarray(state, dtype=float)
        if has(self._own, "flat"):
            z, dz = called(self._own, "flat", {"state": found}, "z and dz")
            return np.asarray(z, dtype=float), np.asarray(dz, dtype=float)
        return found[: self.flat_dimension].copy(), np.asarray(self._moved(found)).ravel()

    def pose(self, state: ArrayLike) -> Array:
        """Position and yaw ``(d+1,)``; a yaw of zero where z has none."""
        if has(self._own, "pose"):
            return np.asarray(called(self._own, "pose", {"state": np.asarray(state)}, "(d+1,)"), dtype=float)
        d, z = self.position_dimension, self.flat(state)[0]
        return np.append(z[:d], z[d] if len(z) > d else 0.0)

    def velocity(self, state: ArrayLike) -> Array:
        """Surge, sway, (heave) and the rate of the yaw ``(d+1,)``, turned by the yaw alone."""
        if has(self._own, "velocity"):
            return np.asarray(called(self._own, "velocity", {"state": np.asarray(state)}, "(d+1,)"), dtype=float)
        d, (z, dz), yaw = self.position_dimension, self.flat(state), self.pose(state)[-1]
        c, s = np.cos(yaw), np.sin(yaw)
        return np.array([c * dz[0] + s * dz[1], c * dz[1] - s * dz[0], *dz[2:d], dz[d] if len(z) > d else 0.0])

    def _symbolic_rates(self, state: Any, inputs: Any) -> Any:
        where, m = named(self._own, "rates"), len(self.thrust_max)
        value = called(
            self._own, "rates", {"state": state, "inputs": inputs}, "the time derivative of the state in CasADi"
        )
        if isinstance(value, list | tuple):
            value = ca.vertcat(*value)
        elif isinstance(value, np.ndarray) and value.dtype == object:  # numpy makes these of expressions
            value = ca.vertcat(*value.ravel().tolist())
        if isinstance(state, ca.MX):
            return value
        symbols = ca.symvar(ca.vertcat(ca.SX(state), ca.SX(inputs)))
        return expression(where, value, (self.states, 1), symbols, f"of {self.states} states and {m} inputs")

    def _count_of_states(self) -> int:
        n = self.flat_dimension
        if has(self._own, "state"):
            nothing = np.zeros(n)
            value = called(self._own, "state", {"z": nothing, "dz": nothing}, "the state, a vector of numbers")
            return max(int(np.size(value)), n)
        return count(self._own, "states", n, "numbers of the state") if has(self._own, "states") else 2 * n

    def _check(self) -> None:
        """Evaluate what the object has of its own at one state."""
        state, m = np.resize(GENERIC, self.states), len(self.thrust_max)
        where, n = named(self._own, "rates"), self.flat_dimension
        finite(where, np.asarray(self._numbers(state, 0.3 * self.thrust_max)).ravel())
        z, dz = self.flat(state)
        for name, values, size in (("flat", z, n), ("flat", dz, n)):
            array(named(self._own, name), values, (size,), "z and dz")
        for name, values in (("pose", self.pose(state)), ("velocity", self.velocity(state))):
            array(named(self._own, name), values, (self.position_dimension + 1,), "(d+1,)")
        self.last_resort(ca.SX.sym("state", self.states))
        if not has(self._own, "state") and not self._has_rate(self.state(z, dz), dz):
            text = f"found no state with the rate {dz.tolist()} without inputs"
            raise ContractError(f"{named(self._own, 'state')}: {text}; allowed: a method state(z, dz) of its own")
        if has(self._own, "steering"):
            array(named(self._own, "steering"), self.steering(0.5, 0.1), (m,), "(m,)")
