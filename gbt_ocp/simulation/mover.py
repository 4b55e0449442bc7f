"""How the vehicle moves over one period: under a plan, under constant inputs, or placed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import casadi as ca
import numpy as np

from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.ocp.plan import Plan
from gbt_ocp.typing import Array

GRID = 101
"""Points a piece at which the executed thrust is recorded and compared with its limits."""

ROUND_OFF = 1.0e-9
"""Excess of a thrust over its limit, relative to it, that is none."""


@dataclass(frozen=True)
class Move:
    """What the vehicle did over one period; ``clipped`` if a plan asked for more thrust than there is."""

    flat: Array
    state: Array
    thrust: Array
    thrust_peak: Array
    clipped: bool = False


class Mover:
    """Moves the vehicle over one period, under a plan or under constant inputs."""

    def __init__(self, vehicle: Vehicle, period: float, follow: Literal["exact", "dynamics"]) -> None:
        self._vehicle = vehicle
        self._period = period
        self._exact = follow == "exact"
        n = vehicle.flat_dimension
        point = [ca.SX.sym(name, n) for name in ("z", "dz", "ddz")]
        self._thrust_at = ca.Function("thrust", point, [vehicle.inputs(*point)])
        self._thrust = self._thrust_at.map(GRID)

    def follow(self, plan: Plan) -> Move:
        """Execute a plan for one period, from what has elapsed of it."""
        limit = self._vehicle.thrust_max
        first = plan.trajectory.segment(plan.elapsed, self._period)
        thrust = np.asarray(self._thrust(*(values[0].T for values in first.sample(GRID)))).T
        peak = np.max(np.abs(thrust), axis=0) / limit
        flat = first.knots[1]
        clipped = bool(peak.max() > 1.0 + ROUND_OFF)
        if self._exact and not clipped:
            return Move(flat, self._vehicle.state(flat[0], flat[1]), thrust[0], peak)

        def applied(s: float) -> Array:
            wanted = np.asarray(self._thrust_at(*(first(s, order) for order in range(3)))).ravel()
            return np.clip(wanted, -limit, limit)

        state = self._integrate(self._vehicle.state(*first.start[:2]), applied)
        z, dz = self._vehicle.flat(state)
        held = np.clip(thrust[0], -limit, limit)
        return Move(np.vstack([z, dz, flat[2:]]), state, held, np.minimum(peak, 1.0), clipped)

    def hold(self, state: Array, thrust: Array) -> Move:
        """Integrate the forward dynamics under constant inputs."""
        end = self._integrate(state, lambda s: thrust)
        z, dz = self._vehicle.flat(end)
        return Move(np.vstack([z, dz]), end, thrust, np.abs(thrust) / self._vehicle.thrust_max)

    def place(self, state: Array, position: Array) -> Move:
        """Put the vehicle somewhere, at rest and with the same yaw; there is no thrust to speak of."""
        z = self._vehicle.flat(state)[0].copy()
        z[: len(position)] = position
        none = np.full(self._vehicle.thrust_max.shape, np.nan)
        return Move(np.vstack([z, 0.0 * z]), self._vehicle.state(z, 0.0 * z), none, none)

    def _integrate(self, state: Array, thrust: Callable[[float], Array]) -> Array:
        from scipy.integrate import solve_ivp  # takes half a second to import, which other ways do not need

        found = solve_ivp(
            lambda s, x: self._vehicle.rates(x, thrust(s)), (0.0, self._period), state, rtol=1e-8, atol=1e-10
        )
        return np.asarray(found.y[:, -1])
