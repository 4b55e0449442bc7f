"""Vehicles that are not flat: fewer inputs than ways to move, described by the rates of their state alone.

:class:`DrivenBody` is a body on the pose and the body velocity, the coordinates of the other vehicles. The rates are
CasADi expressions, and the numbers that a simulation needs come from the same expressions.
"""

from __future__ import annotations

from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.contracts import ContractError
from gbt_ocp.models.sizes import vector
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.typing import Array


class DrivenBody:
    """A body with the state ``[η, ν]``: its pose in the earth frame and its velocity in the body frame.

    In the plane η is (x, y, ψ) and ν (surge, sway, yaw rate). In space η is (x, y, z, ψ, θ), θ the pitch, bow up, and ν
    (surge, sway, heave, yaw rate, pitch rate): roll is kept at zero by what rights the vehicle, and left out. z, sway
    and heave point up and to port, the yaw runs counter-clockwise. The first numbers of the state, η, take the place of
    a flat output: with their rates they tell the state.

    Parameters
    ----------
    dimension
        d, 2 or 3.
    thrust_max, thrust_min
        Limits of the inputs ``(m,)`` in the units of :attr:`input_units`: above 0, and not above it; a ``thrust_min``
        of 0 is an input that has one sense.

    Attributes
    ----------
    states
        Numbers of the state.

    Raises
    ------
    ValueError
        If a limit is on the wrong side of 0, or there are not as many as inputs.
    """

    input_names: ClassVar[dict[int, tuple[str, ...]]]
    """What the inputs are called, by the dimension."""
    input_units: ClassVar[dict[int, tuple[str, ...]]]
    """Their units."""
    idle: Array
    """Inputs ``(m,)`` with which it goes on as it does, as near as that is known."""

    def __init__(self, dimension: int, thrust_max: ArrayLike, thrust_min: ArrayLike) -> None:
        if dimension not in (2, 3):
            raise ValueError(f"dimension: found {dimension}; allowed: 2, 3")
        self.position_dimension = dimension
        self.flat_dimension = 3 if dimension == 2 else 5
        self.states = 2 * self.flat_dimension
        size = len(self.input_names[dimension])
        self.idle = np.zeros(size)
        self.thrust_max = vector("thrust_max", thrust_max, size, above_zero=True)
        self.thrust_min = vector("thrust_min", thrust_min, size)
        if np.any(self.thrust_min > 0.0):
            raise ValueError(f"thrust_min: found {thrust_min!r}; allowed: numbers <= 0")
        state = ca.SX.sym("state", 2 * self.flat_dimension)
        inputs = ca.SX.sym("inputs", size)
        turned = self._turned(state[: self.flat_dimension])
        self._numbers = ca.Function("rates", [state, inputs], [self._symbolic_rates(state, inputs)])
        self._turn = ca.Function("turned", [state[: self.flat_dimension]], [turned])
        self._along = ca.Function("along", [state], [self.input_velocities(state)])

    @property
    def name(self) -> str:
        """What messages call it."""
        return type(self).__name__

    @property
    def gives_power(self) -> bool:
        """Whether the velocities along which its inputs push are known."""
        return True

    def body_rates(self, eta: Any, nu: Any, inputs: Any) -> Any:
        """ν̇ ``(n,)``, a CasADi expression."""
        raise NotImplementedError

    def input_velocities(self, state: Any) -> Any:
        """The velocities along which the inputs push ``(m,)``: their products are the power in W; 0 for a fin."""
        raise NotImplementedError

    def steered(self, push: Any, turn: Any) -> Any:
        """Inputs ``(m,)`` of a share of the push ahead and one of the turn to port, a CasADi expression of the two.

        Raises
        ------
        gbt_ocp.models.contracts.ContractError
            If the vehicle does not say how it is steered.
        """
        raise ContractError(
            f"{self.name}.steering: found nothing of this name; allowed: inputs (m,) of shares of push and turn, which "
            "guidance.startup_deviation > 0, desired_bearing.period_s: auto and desired_bearing.speed_mps: sensor need"
        )

    def steering(self, push: float, turn: float) -> Array:
        """The same in numbers, within their limits.

        Parameters
        ----------
        push
            In [0, 1].
        turn
            In [-1, 1].
        """
        return self.clipped(np.asarray(ca.DM(self.steered(push, turn))).ravel())

    def last_resort(self, state: Any) -> Any:
        """What is done where nothing can be planned: inputs ``(m,)`` at a state, a CasADi expression; here none."""
        return ca.SX.zeros(len(self.thrust_max))

    def rates(self, state: Any, thrust: Any) -> Any:
        """Time derivative of the state ``(2n,)`` under the inputs ``(m,)``; CasADi expressions give one."""
        if isinstance(state, ca.SX | ca.MX):
            return self._symbolic_rates(state, thrust)
        return np.asarray(self._numbers(state, thrust)).ravel()

    def state(self, z: ArrayLike, dz: ArrayLike) -> Array:
        """State ``(2n,)`` at the pose η and its rate ``(n,)``."""
        eta = np.asarray(z, dtype=float)
        return np.concatenate([eta, np.linalg.solve(self.turned(eta), np.asarray(dz, dtype=float))])

    def symbolic_state(self, z: Any, dz: Any) -> Any:
        """The same in CasADi."""
        return ca.vertcat(z, ca.solve(self._turned(z), dz))

    def flat(self, state: ArrayLike) -> tuple[Array, Array]:
        """The pose η and its rate ``(n,)``; the inverse of :meth:`state`."""
        eta, nu = np.split(np.asarray(state, dtype=float), 2)
        return eta, self.turned(eta) @ nu

    def pose(self, state: ArrayLike) -> Array:
        """Position and yaw ``(d+1,)``."""
        return np.asarray(state, dtype=float)[: self.position_dimension + 1]

    def velocity(self, state: ArrayLike) -> Array:
        """Surge, sway, (heave) in m/s and the rate of the yaw in rad/s ``(d+1,)``."""
        d, (_, rate) = self.position_dimension, self.flat(state)
        nu = np.asarray(state, dtype=float)[self.flat_dimension :]
        return np.append(nu[:d], rate[d])

    def turned(self, eta: ArrayLike) -> Array:
        """J(η) ``(n, n)``: η̇ = J ν."""
        return np.asarray(self._turn(np.asarray(eta, dtype=float)))

    def power(self, state: ArrayLike, inputs: ArrayLike) -> float:
        """``Σ|τ_i w_i|`` in W, w_i the velocity along which an input pushes."""
        return float(
            np.sum(
                np.abs(
                    np.asarray(inputs, dtype=float) * np.asarray(self._along(np.asarray(state, dtype=float))).ravel()
                )
            )
        )

    def clipped(self, inputs: ArrayLike) -> Array:
        """Inputs ``(m,)`` within their limits."""
        return ThrustRange.of(self).clip(inputs)

    def _symbolic_rates(self, state: Any, inputs: Any) -> Any:
        eta, nu = state[: self.flat_dimension], state[self.flat_dimension :]
        return ca.vertcat(ca.mtimes(self._turned(eta), nu), self.body_rates(eta, nu, inputs))

    def _turned(self, eta: Any) -> Any:
        d, c, s = self.position_dimension, ca.cos(eta[self.position_dimension]), ca.sin(eta[self.position_dimension])
        turned = ca.SX.eye(self.flat_dimension)
        turned[0, 0], turned[0, 1], turned[1, 0], turned[1, 1] = c, -s, s, c
        if d == 3:
            ct, st = ca.cos(eta[4]), ca.sin(eta[4])
            turned[0, 0], turned[1, 0], turned[2, 0] = c * ct, s * ct, st
            turned[0, 2], turned[1, 2], turned[2, 2] = -c * st, -s * st, ct
            turned[3, 3] = 1.0 / ct
        return turned


def smooth_square(value: Any, smoothing: float) -> Any:
    """``|x| x`` with a second derivative at rest: ``sqrt(x² + ε) x``."""
    return ca.sqrt(value**2 + smoothing) * value
