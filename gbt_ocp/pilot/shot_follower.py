"""Following a plan by integration: its inputs, and a linear-quadratic regulator about where they lead."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.dynamics import Dynamics, integrated
from gbt_ocp.models.sizes import not_negative
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.ocp.follower import BANDWIDTH
from gbt_ocp.ocp.plan import ShootingPlan
from gbt_ocp.typing import Array

GRID_S = 0.1
"""Longest step in s of the grid on which the plan is known; between its points all is linear."""

REACH_S = 5.0
"""Time in s of the plan over which the regulator looks ahead."""

GRID_STEPS = 2
"""Runge-Kutta steps between two points of the grid."""

ANGLE_WEIGHT, RATE_WEIGHT = 2.0, 0.2
"""Weights of angles (for a rad) and of velocities (for a m/s or rad/s), where a position weighs 1 for a metre."""


class ShotFollower:
    """The planned inputs, and feedback by a linear-quadratic regulator on the rates linearised along the plan.

    A deviation of a metre weighs as much as an input at its limit, at the default bandwidth; the weight of deviations
    grows with its square. Gains come from the backward Riccati recursion over the next :data:`REACH_S` of the plan.

    Parameters
    ----------
    vehicle
        The model, flat or not.
    bandwidth
        ω in rad/s; 0 leaves the planned inputs alone.
    rate
        Largest rates of the inputs ``(m,)``; ``None`` where they are not limited.

    Raises
    ------
    ValueError
        If the bandwidth is negative or not finite.

    References
    ----------
    Time-varying regulator: Anderson and Moore, Optimal Control: Linear Quadratic Methods (1990), chapter 3.
    """

    def __init__(
        self, vehicle: Vehicle | DrivenBody, bandwidth: float = BANDWIDTH, rate: Sequence[float] | None = None
    ) -> None:
        self._dynamics, self._range = Dynamics(vehicle), ThrustRange.of(vehicle)
        self._rate = None if rate is None else np.array(rate, dtype=float)
        self._share = (not_negative("bandwidth", bandwidth) / BANDWIDTH) ** 2
        n, d = vehicle.flat_dimension, vehicle.position_dimension
        size = self._dynamics.states
        duration = ca.SX.sym("duration")
        (state, inputs), slopes = self._derived(duration)
        self._slopes = ca.Function("slopes", [state, inputs, duration], slopes)
        self._angles = slice(d, n)
        weights = np.full(size, RATE_WEIGHT)
        weights[:d], weights[d:n] = 1.0, ANGLE_WEIGHT
        self._weights, self._effort = (
            np.diag(weights**2),
            np.diag(1.0 / np.asarray(vehicle.thrust_max, dtype=float) ** 2),
        )
        self._of: tuple[Array, Array] | None = None
        self._spacing = GRID_S
        self._states = self._inputs = self._gains = np.zeros(0)
        self._last: tuple[float, Array] | None = None

    def thrust(self, plan: ShootingPlan, period: float, now: float, z: Array, dz: Array) -> Array:
        """The inputs ``(m,)`` until the next sample, within their limits.

        Parameters
        ----------
        plan
            Over ground.
        period
            Seconds of a piece, where the plan does not say.
        now
            Seconds since it began.
        z, dz
            The measured first numbers of the state and their rates over ground ``(n,)``.
        """
        self._take(plan, period)
        water = np.zeros(0) if plan.current is None else plan.current
        z, dz = np.array(z, dtype=float), np.array(dz, dtype=float)
        z[: len(water)] -= now * water
        dz[: len(water)] -= water
        wanted, inputs, gain = self._at(now)
        error = wanted - self._dynamics.state(z, dz)
        error[self._angles] = np.remainder(error[self._angles] + np.pi, 2.0 * np.pi) - np.pi
        asked = self._range.clip(inputs + gain @ error)
        if self._rate is not None and self._last is not None and self._last[0] < now:
            most = (now - self._last[0]) * self._rate
            asked = np.clip(asked, self._last[1] - most, self._last[1] + most)
        self._last = now, asked
        return asked

    def planned(self, plan: ShootingPlan, period: float, now: float) -> Array:
        """Position ``(d,)`` over ground so many seconds after the plan began."""
        self._take(plan, period)
        place = self._at(now)[0][: self._angles.start].copy()
        return place if plan.current is None else place + now * plan.current

    @property
    def weights(self) -> Array:
        """Of the square of a deviation of each number of the state ``(states,)``."""
        return np.asarray(self._share * np.diag(self._weights))

    def grid(self, period: float, pieces: int) -> tuple[int, int]:
        """Parts of a piece between which a plan is known, and how many of the pieces of a period in s are looked at."""
        return max(1, int(np.ceil(period / GRID_S - 1e-9))), min(pieces, max(1, int(np.ceil(REACH_S / period))))

    def rows(self, duration: float) -> tuple[list[ca.SX], ca.SX]:
        """State and inputs, and of a hold of so many seconds the state after it and the rows of its derivatives."""
        symbols, (after, by_state, by_inputs) = self._derived(duration)
        return symbols, ca.vertcat(after, ca.vec(by_state.T), ca.vec(by_inputs.T))

    def _derived(self, duration: Any) -> tuple[list[ca.SX], list[ca.SX]]:
        """State and inputs, and the state after a hold with its derivatives for both."""
        state, inputs = ca.SX.sym("state", self._dynamics.states), ca.SX.sym("inputs", self._dynamics.inputs)
        after = integrated(self._dynamics, state, (inputs, inputs), duration, GRID_STEPS)
        return [state, inputs], [after, ca.jacobian(after, state), ca.jacobian(after, inputs)]

    def _take(self, plan: ShootingPlan, period: float) -> None:
        """Lay a plan out, unless it is the last one, or a copy of it."""
        last = self._of
        if last is None or not (np.array_equal(last[0], plan.thrust) and np.array_equal(last[1], plan.knots[0])):
            self._begin(plan, plan.period or period)

    def _at(self, now: float) -> tuple[Array, Array, Array]:
        """State, inputs and gain of the plan after so many seconds."""
        place = min(max(now / self._spacing, 0.0), float(len(self._inputs)))
        before = min(int(place + 1e-9), len(self._inputs) - 1)
        part = place - before
        state = (1.0 - part) * self._states[before] + part * self._states[before + 1]
        return state, self._inputs[before], self._gains[before]

    def _begin(self, plan: ShootingPlan, period: float) -> None:
        """Lay a plan out on the grid, and compute the gains along it."""
        parts, pieces = self.grid(period, len(plan.thrust))
        self._spacing = period / parts
        shares = (np.arange(parts) + 0.5) / parts
        ends = plan.thrust if plan.thrust_end is None else plan.thrust_end
        inputs = np.concatenate(
            [(1.0 - shares)[:, None] * plan.thrust[i] + shares[:, None] * ends[i] for i in range(pieces)]
        )
        z, dz = (values.copy() for values in plan.knots[0])
        if plan.current is not None:
            dz[: len(plan.current)] -= plan.current
        states = [self._dynamics.state(z, dz)]
        slopes = []
        for held in inputs:
            after, by_state, by_inputs = self._slopes(states[-1], held, self._spacing)
            states.append(np.asarray(after).ravel())
            slopes.append((np.asarray(by_state), np.asarray(by_inputs)))
        weights = self._share * self._weights
        rest, gains = weights / self._spacing, []
        for by_state, by_inputs in reversed(slopes):
            pushed = by_inputs.T @ rest
            gain = np.linalg.solve(self._effort + pushed @ by_inputs, pushed @ by_state)
            rest = weights + by_state.T @ rest @ (by_state - by_inputs @ gain)
            gains.append(gain)
        # a plan that begins where the last one is gives inputs that go on from it
        if self._last is not None:
            self._last = (min(0.0, self._last[0] - period), self._last[1])
        self._of = plan.thrust, plan.knots[0]
        self._states, self._inputs, self._gains = np.array(states), inputs, np.array(gains[::-1])
