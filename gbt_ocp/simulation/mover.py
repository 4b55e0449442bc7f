"""How the vehicle moves over one period: under a plan, under constant inputs, or placed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from typing import Any, Literal

import casadi as ca
import numpy as np

from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.dynamics import Dynamics
from gbt_ocp.models.evaluated import Evaluated
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.models.vehicles import Vehicle, acceleration
from gbt_ocp.ocp.follower import BANDWIDTH, samples
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.pilot.plan_follower import ON_PLAN, PlanFollower
from gbt_ocp.pilot.setpoint import setpoint_of
from gbt_ocp.pilot.shot_follower import ShotFollower
from gbt_ocp.simulation.autopilot import Autopilot
from gbt_ocp.simulation.plant import Held, Motion, Plant, gives_power
from gbt_ocp.typing import Array

GRID = 101
"""Points a piece at which the executed thrust is recorded and compared with its limits."""

ROUND_OFF = 1.0e-9
"""Relative excess of a thrust over its limit that counts as round-off."""


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
    power
        Mean over the period of ``Σ|τ_i ν_i|`` in W, ν through the water; NaN where inputs are not forces along ν.
    """

    flat: Array
    state: Array
    thrust: Array
    thrust_peak: Array
    clipped: bool = False
    off_plan: float = field(default=float("nan"))
    thrust_mean: Array | None = None
    power: float = field(default=float("nan"))


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
    autopilot
        Time constant in seconds of an autopilot that is given setpoints in place of thrust; ``None`` for thrust.
    lead
        How far ahead on the plan its setpoints are taken, in seconds; by default a period.
    input_rate
        Largest rates of the inputs ``(m,)`` that a follower of plans by integration keeps; ``None`` for no limit.
    thrust_lag
        Time constant in seconds of the thrusters, as of :class:`~gbt_ocp.pilot.plan_follower.PlanFollower`.

    Raises
    ------
    ValueError
        If a plant is to follow exactly, or a vehicle that is not flat is given setpoints.
    """

    def __init__(
        self,
        vehicle: Vehicle | DrivenBody,
        period: float,
        follow: Literal["exact", "dynamics", "feedback"],
        plant: Plant | None = None,
        bandwidth: float = BANDWIDTH,
        autopilot: float | None = None,
        lead: float | None = None,
        input_rate: Sequence[float] | None = None,
        thrust_lag: float | None = None,
    ) -> None:
        self._vehicle: Any = vehicle
        if follow == "exact" and plant is not None and autopilot is None:
            raise ValueError("vehicle.follow: found exact beside a plant; allowed: dynamics, feedback")
        self._range = ThrustRange.of(vehicle)
        self._period = period
        self._follow = follow
        self._motion = Motion(Plant(vehicle) if plant is None else plant)
        self._lead = period if lead is None else lead
        self._shot_follower = ShotFollower(vehicle, bandwidth, input_rate) if follow == "feedback" else None
        n = vehicle.flat_dimension
        z, dz, ddz = (ca.SX.sym(name, n) for name in ("z", "dz", "ddz"))
        held = ca.SX.sym("thrust", len(vehicle.thrust_max))
        if isinstance(vehicle, DrivenBody):
            if autopilot is not None:
                raise ValueError("command: found setpoint beside a vehicle that is not flat; allowed: thrust")
            dynamics, state = Dynamics(vehicle), ca.SX.sym("state", vehicle.states)
            self._accelerated = Evaluated("accelerated", [state, held], [dynamics.point(state, held)[2]])
            return
        self._follower = PlanFollower(vehicle, bandwidth, thrust_lag)
        self._held = 0.0
        self._autopilot = None if autopilot is None else Autopilot(vehicle, autopilot)
        inputs = vehicle.inputs(z, dz, ddz)
        self._thrust_at = Evaluated("thrust", [z, dz, ddz], [inputs])
        # where a plan is followed exactly, its power is known on the same grid
        power: Any = ca.SX(0, 1)
        if follow == "exact" and gives_power(vehicle):
            power = ca.sum1(ca.fabs(inputs * vehicle.body_velocity(z, dz)))  # type: ignore[attr-defined]
        self._thrust = Evaluated("thrust", [z, dz, ddz], [inputs, power], GRID)
        self._accelerated = Evaluated("accelerated", [z, dz, held], [acceleration(vehicle, z, dz, held)])

    def follow(self, state: Array, plan: Plan) -> Move:
        """Execute a plan for one period, from what has elapsed of it."""
        piece = plan.trajectory.segment(plan.elapsed, self._period)
        water, through = np.zeros(self._vehicle.position_dimension), piece
        if plan.current is not None:
            water = plan.current
            through = piece.moving(-water)
        thrust, powers = self._thrust.all(*(values[0] for values in through.sample(GRID)))
        peak = np.max(self._range.used(thrust), axis=0)
        clipped = bool(peak.max() > 1.0 + ROUND_OFF)
        if self._autopilot is not None:
            setpoint = setpoint_of(plan, self._vehicle, plan.elapsed + self._lead, self._lead)
            return self._sampled(state, piece, clipped, partial(self._autopilot.thrust, setpoint))
        if self._follow == "feedback":
            return self._led_back(state, piece, water, clipped)
        if self._follow == "exact" and not clipped and self._is_on(state, piece):
            end = piece.knots[1]
            mean = np.asarray(thrust.mean(axis=0))
            reached = self._vehicle.state(end[0], end[1])
            power = float(powers.mean()) if powers.size else float("nan")
            return Move(end, reached, thrust[0], peak, off_plan=0.0, thrust_mean=mean, power=power)

        def applied(s: float) -> Array:
            return self._range.clip(self._thrust_at(*through.point(s)))

        before = self._motion.work
        reached = self._motion.advance(state, applied, self._period)
        power = (self._motion.work - before) / self._period
        held = self._range.clip(thrust[0])
        mean = np.asarray(self._range.clip(thrust).mean(axis=0))
        return self._moved(reached, piece, held, np.minimum(peak, 1.0), clipped, mean, power)

    def execute(self, state: Array, plan: ShootingPlan) -> Move:
        """Apply the inputs of a plan by integration for one period; with ``feedback`` those of a follower about it."""
        if self._shot_follower is None:
            return self.hold(state, *plan.applied(self._period))
        follower, hold, number = self._shot_follower, self._period / samples(self._period), count()

        def thrust(z: Array, dz: Array) -> Array:
            return follower.thrust(plan, self._period, plan.elapsed + next(number) * hold, z, dz)

        state, asked, power = self._held_samples(state, thrust)
        planned = follower.planned(plan, self._period, plan.elapsed + self._period)
        z, dz = self._vehicle.flat(state)
        off = float(np.linalg.norm(z[: len(planned)] - planned))
        flat = np.vstack([z, dz, self._change(state, z, dz, asked[-1])])
        peak = np.max(self._range.used(asked), axis=0)
        return Move(flat, state, asked[0], peak, off_plan=off, thrust_mean=asked.mean(axis=0), power=power)

    def hold(self, state: Array, thrust: Array, until: Array | None = None) -> Move:
        """Integrate the forward dynamics under constant inputs, or under inputs linear in time ``until`` others."""
        if until is None and not isinstance(self._vehicle, DrivenBody):
            passed, self._held = self._held, self._period
            thrust = self._follower.ask(thrust, passed, self._period)
        before = self._motion.work
        last = thrust if until is None else until
        if until is None or np.array_equal(thrust, until):
            end = self._motion.advance(state, Held(thrust), self._period)
        else:
            end = self._motion.advance(state, lambda s: thrust + (last - thrust) * (s / self._period), self._period)
        power = (self._motion.work - before) / self._period
        z, dz = self._vehicle.flat(end)
        flat = np.vstack([z, dz, self._change(end, z, dz, last)])
        peak = np.maximum(self._range.used(thrust), self._range.used(last))
        mean = thrust if last is thrust else 0.5 * (thrust + last)
        return Move(flat, end, thrust, peak, thrust_mean=mean, power=power)

    def _change(self, state: Array, z: Array, dz: Array, thrust: Array) -> Array:
        """z̈ ``(n,)`` under inputs; zero where it is no number, as where a flatness map is singular."""
        point = (state,) if isinstance(self._vehicle, DrivenBody) else (z, dz)
        ddz = self._accelerated(*point, thrust)
        return np.where(np.isfinite(ddz), ddz, 0.0)

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
        z, dz = self._vehicle.flat(state)
        begin = piece.start
        return bool(np.abs(z - begin[0]).max() <= ON_PLAN and np.abs(dz - begin[1]).max() <= ON_PLAN)

    def _led_back(self, state: Array, piece: FlatTrajectory, water: Array, clipped: bool) -> Move:
        """Follow a piece with feedback, in the frame of the water."""
        through, hold = piece.moving(-water), self._period / samples(self._period)
        number = count()

        def thrust(z: Array, dz: Array) -> Array:
            sample = next(number)
            passed, self._held = self._held, hold
            return self._follower.thrust(through, sample * hold, (sample + 0.5) * hold, water, z, dz, passed)

        return self._sampled(state, piece, clipped, thrust)

    def _sampled(
        self, state: Array, piece: FlatTrajectory, clipped: bool, thrust: Callable[[Array, Array], Array]
    ) -> Move:
        """Move under a thrust that follows from the measured flat output and its rate, and is held between samples."""
        state, asked, power = self._held_samples(state, thrust)
        peak = np.max(self._range.used(asked), axis=0)
        return self._moved(state, piece, asked[0], peak, clipped, asked.mean(axis=0), power)

    def _held_samples(self, state: Array, thrust: Callable[[Array, Array], Array]) -> tuple[Array, Array, float]:
        """The state a period later, the thrusts that were held ``(samples, m)``, and their mean power in W."""
        step = self._period / samples(self._period)
        asked: list[Array] = []
        before = self._motion.work
        for _ in range(samples(self._period)):
            asked.append(thrust(*self._vehicle.flat(state)))
            state = self._motion.advance(state, Held(asked[-1]), step)
        return state, np.array(asked), (self._motion.work - before) / self._period

    def _moved(
        self, state: Array, piece: FlatTrajectory, thrust: Array, peak: Array, clipped: bool, mean: Array, power: float
    ) -> Move:
        z, dz = self._vehicle.flat(state)
        planned = piece.knots[1]
        d = self._vehicle.position_dimension
        off = float(np.linalg.norm(z[:d] - planned[0, :d]))
        return Move(np.vstack([z, dz, planned[2:]]), state, thrust, peak, clipped, off, mean, power)
