"""How the vehicle moves over one period: under a plan, under constant inputs, or placed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import casadi as ca
import numpy as np

from gbt_ocp.models.vehicles import Vehicle, acceleration
from gbt_ocp.ocp.follower import BANDWIDTH, Follower, samples
from gbt_ocp.ocp.plan import Plan
from gbt_ocp.ocp.trajectory import FlatPoint, FlatTrajectory
from gbt_ocp.simulation.plant import Motion, Plant
from gbt_ocp.typing import Array

GRID = 101
"""Points a piece at which the executed thrust is recorded and compared with its limits."""

ROUND_OFF = 1.0e-9
"""Relative excess of a thrust over its limit that counts as round-off."""

ON_PLAN = 1.0e-6
"""Distance from a plan (m, rad, and per second) that counts as on it."""


@dataclass(frozen=True)
class Move:
    """What the vehicle did over one period.

    Attributes
    ----------
    flat
        Derivatives of the flat output at its end, as many as are known ``(>=2, n)``: those above the velocity are the
        plan's, or the acceleration is that under the inputs that were held.
    state
        State of the forward dynamics at its end.
    thrust
        Inputs asked for at its beginning, within the limits ``(m,)``.
    thrust_peak
        Largest of them over the period, over the limits ``(m,)``.
    clipped
        Whether a plan asked for more thrust than there is.
    off_plan
        Distance in m from the planned position at its end; NaN without a plan.
    thrust_mean
        Mean over the period of the inputs asked for ``(m,)``; ``None`` where the vehicle is placed.
    """

    flat: Array
    state: Array
    thrust: Array
    thrust_peak: Array
    clipped: bool = False
    off_plan: float = field(default=float("nan"))
    thrust_mean: Array | None = None


class Mover:
    """Moves the vehicle over one period after another, each time from where it is.

    Parameters
    ----------
    vehicle
        The model with which is planned.
    period
        In seconds.
    follow
        ``exact``, ``dynamics`` or ``feedback``; see :class:`~gbt_ocp.simulation.loop.ClosedLoop`.
    plant
        What moves; by default the model itself.
    bandwidth
        Of the follower in rad/s, with ``feedback``.

    Raises
    ------
    ValueError
        If a plant is to follow exactly.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        period: float,
        follow: Literal["exact", "dynamics", "feedback"],
        plant: Plant | None = None,
        bandwidth: float = BANDWIDTH,
    ) -> None:
        if follow == "exact" and plant is not None:
            raise ValueError("vehicle.follow: found exact beside a plant; allowed: dynamics, feedback")
        self._vehicle = vehicle
        self._period = period
        self._follow = follow
        self._motion = Motion(Plant(vehicle) if plant is None else plant)
        self._follower = Follower(vehicle, bandwidth)
        n = vehicle.flat_dimension
        z, dz, ddz = (ca.SX.sym(name, n) for name in ("z", "dz", "ddz"))
        self._thrust_at = ca.Function("thrust", [z, dz, ddz], [vehicle.inputs(z, dz, ddz)])
        self._thrust = self._thrust_at.map(GRID)
        held = ca.SX.sym("thrust", len(vehicle.thrust_max))
        self._accelerated = ca.Function("accelerated", [z, dz, held], [acceleration(vehicle, z, dz, held)])

    def follow(self, state: Array, plan: Plan) -> Move:
        """Execute a plan for one period, from what has elapsed of it."""
        piece = plan.trajectory.segment(plan.elapsed, self._period)
        water = np.zeros(self._vehicle.position_dimension) if plan.current is None else plan.current
        through = piece.moving(-water)
        limit = self._vehicle.thrust_max
        thrust = np.asarray(self._thrust(*(values[0].T for values in through.sample(GRID)))).T
        peak = np.max(np.abs(thrust), axis=0) / limit
        clipped = bool(peak.max() > 1.0 + ROUND_OFF)
        if self._follow == "feedback":
            return self._led_back(state, piece, water, clipped)
        if self._follow == "exact" and not clipped and self._is_on(state, piece):
            end = piece.knots[1]
            mean = np.asarray(thrust.mean(axis=0))
            return Move(end, self._vehicle.state(end[0], end[1]), thrust[0], peak, off_plan=0.0, thrust_mean=mean)

        def applied(s: float) -> Array:
            wanted = np.asarray(self._thrust_at(*_point(through, s))).ravel()
            return np.asarray(np.clip(wanted, -limit, limit))

        reached = self._motion.advance(state, applied, self._period)
        held = np.clip(thrust[0], -limit, limit)
        mean = np.asarray(np.clip(thrust, -limit, limit).mean(axis=0))
        return self._moved(reached, piece, held, np.minimum(peak, 1.0), clipped, mean)

    def hold(self, state: Array, thrust: Array, until: Array | None = None) -> Move:
        """Integrate the forward dynamics under constant inputs, or under inputs linear in time ``until`` others."""
        last = thrust if until is None else until
        if until is None or np.array_equal(thrust, until):
            end = self._motion.advance(state, lambda s: thrust, self._period)
        else:
            end = self._motion.advance(state, lambda s: thrust + (last - thrust) * (s / self._period), self._period)
        z, dz = self._vehicle.flat(end)
        ddz = np.asarray(self._accelerated(z, dz, last)).ravel()
        flat = np.vstack([z, dz, np.where(np.isfinite(ddz), ddz, 0.0)])  # no number where the flatness map is singular
        peak = np.maximum(np.abs(thrust), np.abs(last)) / self._vehicle.thrust_max
        return Move(flat, end, thrust, peak, thrust_mean=thrust if last is thrust else 0.5 * (thrust + last))

    def place(self, state: Array, position: Array) -> Move:
        """Put the vehicle somewhere, at rest and with the same yaw; there is no thrust to speak of."""
        z = self._vehicle.flat(state)[0].copy()
        z[: len(position)] = position
        none = np.full(self._vehicle.thrust_max.shape, np.nan)
        return Move(np.vstack([z, 0.0 * z]), self._vehicle.state(z, 0.0 * z), none, none)

    def water(self, state: Array) -> Array | None:
        """Velocity of the water over ground where the vehicle is now ``(d,)``; ``None`` where it stands still."""
        return self._motion.water(state)

    def _is_on(self, state: Array, piece: FlatTrajectory) -> bool:
        """Whether the vehicle is where the piece begins: after a clipped piece it is not."""
        return bool(np.abs(np.vstack(self._vehicle.flat(state)) - piece.start[:2]).max() <= ON_PLAN)

    def _led_back(self, state: Array, piece: FlatTrajectory, water: Array, clipped: bool) -> Move:
        """Follow a piece with feedback, whose thrust is held between its samples, in the frame of the water."""
        through, d = piece.moving(-water), len(water)
        count = samples(self._period)
        step = self._period / count
        asked: list[Array] = []
        for number in range(count):
            now, middle = _point(through, number * step), _point(through, (number + 0.5) * step)
            z, dz = (values.copy() for values in self._vehicle.flat(state))
            z[:d] -= number * step * water
            dz[:d] -= water
            asked.append(self._follower.thrust(now, middle, z, dz))
            state = self._motion.advance(state, lambda s, held=asked[-1]: held, step)  # type: ignore[misc]
        peak = np.max(np.abs(asked), axis=0) / self._vehicle.thrust_max
        return self._moved(state, piece, asked[0], peak, clipped, np.mean(asked, axis=0))

    def _moved(
        self, state: Array, piece: FlatTrajectory, thrust: Array, peak: Array, clipped: bool, mean: Array
    ) -> Move:
        z, dz = self._vehicle.flat(state)
        planned = piece.knots[1]
        d = self._vehicle.position_dimension
        off = float(np.linalg.norm(z[:d] - planned[0, :d]))
        return Move(np.vstack([z, dz, planned[2:]]), state, thrust, peak, clipped, off, mean)


def _point(piece: FlatTrajectory, s: float) -> FlatPoint:
    """z, ż, z̈ after ``s`` seconds of a trajectory of one piece."""
    return FlatPoint(*(piece(s, order) for order in range(3)))
