"""The vehicle that moves: a model whose parameters are off, thrusters that lag, water that flows, unknown forces."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.fossen import FossenParameters, FossenVehicle, rotation
from gbt_ocp.models.sizes import not_negative
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.simulation.flow import Flow, SlowProcess
from gbt_ocp.simulation.held_inputs import ABSOLUTE, RELATIVE, HeldInputs
from gbt_ocp.typing import Array

CORRELATION_S = 20.0
"""Time constant of the slowly varying force in s."""

POWER_POINTS = 9
"""Times under one command at which the power of the thrusters is summed."""

SAME_COMMAND_TIME = 1e-9
"""Two times in s that differ by less are the same."""


def scaled(parameters: FossenParameters, *, mass: float, added_mass: float, drag: float) -> FossenParameters:
    """The coefficients times factors: ``mass`` scales the inertia too, ``drag`` its linear and its quadratic part.

    Raises
    ------
    ValueError
        If mass minus added mass is no longer positive.
    """
    return replace(
        parameters,
        mass=mass * parameters.mass,
        inertia=mass * parameters.inertia,
        added_mass=[added_mass * value for value in parameters.added_mass],
        linear_drag=[drag * value for value in parameters.linear_drag],
        quadratic_drag=[drag * value for value in parameters.quadratic_drag],
    )


@dataclass(frozen=True)
class Plant:
    """The vehicle that is simulated, as far as it differs from the model with which is planned.

    Attributes
    ----------
    vehicle
        Its forward dynamics.
    thrust
        Thrust that acts over thrust that is asked for, one number or ``(m,)``.
    lag
        Time constant in s of the thrusters, first order; 0 for none.
    dead_time
        Time in s after which they react at all.
    force
        Constant force in the earth frame in N, then the moment about the vertical in N m, ``(d+1,)``.
    force_std
        Standard deviation in N of the slowly varying force on each axis of the position, earth frame.
    flow
        How the water flows; ``None`` where it stands still.
    rng
        Source of the draws of the slowly varying force; needed if ``force_std`` is positive.

    Raises
    ------
    ValueError
        If a time or a deviation is negative or not finite, or there is nothing to draw the slowly varying force from.

    Notes
    -----
    A force asks for a vehicle whose inputs are forces in the body frame along the axes of its pose, as those of
    :class:`~gbt_ocp.models.fossen.FossenVehicle` are. In water that flows the model gives the motion through the water:
    drag and added mass act on that velocity (Fossen 2011, section 8.3). The state is always that over ground.
    """

    vehicle: Vehicle | DrivenBody
    thrust: ArrayLike = 1.0
    lag: float = 0.0
    dead_time: float = 0.0
    force: ArrayLike | None = None
    force_std: float = 0.0
    flow: Flow | None = None
    rng: np.random.Generator | None = None

    def __post_init__(self) -> None:
        for name in ("lag", "dead_time", "force_std"):
            not_negative(name, getattr(self, name))
        if self.force_std > 0.0 and self.rng is None:
            raise ValueError("rng: found None; allowed: a generator where force_std is positive")


def gives_power(vehicle: Vehicle | DrivenBody) -> bool:
    """Whether the power of a vehicle's inputs is known: they are forces along its velocities, or it says itself."""
    return vehicle.gives_power if isinstance(vehicle, DrivenBody) else hasattr(vehicle, "body_velocity")


def power_of(vehicle: Vehicle | DrivenBody, state: Array, inputs: Array) -> float:
    """``Σ|τ_i w_i|`` in W at a state, w_i the velocity along which an input pushes."""
    if isinstance(vehicle, DrivenBody):
        return vehicle.power(state, inputs)
    return float(np.sum(np.abs(inputs * vehicle.velocity(state))))


Command = Callable[[float], Array]
"""Inputs ``(m,)`` within their limits, by the seconds since they were given."""


@dataclass(frozen=True)
class Held:
    """A command that stays what it is: inputs ``(m,)``."""

    inputs: Array

    def __call__(self, seconds: float) -> Array:
        """The inputs."""
        return self.inputs


class Motion:
    """Integrates a plant on and on: its thrusters and the force on it remember what was before.

    Parameters
    ----------
    plant
        What moves.

    Attributes
    ----------
    work
        ``∫ Σ|τ_i ν_i| dt`` in J that the thrusters did so far, ν through the water; NaN for a vehicle whose inputs are
        not forces along its velocities.
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self._time = 0.0
        self.work = 0.0 if gives_power(plant.vehicle) else np.nan
        idle = np.zeros(plant.vehicle.thrust_max.size)
        self._acting = idle
        self._factor = np.broadcast_to(np.asarray(plant.thrust, dtype=float), idle.shape)
        self._commands: deque[tuple[float, Command]] = deque([(-np.inf, Held(idle))])
        self._constant = None if plant.force is None else np.asarray(plant.force, dtype=float)
        self._slow = None
        if plant.force_std > 0.0 and plant.rng is not None:
            self._slow = SlowProcess(plant.force_std, plant.vehicle.position_dimension, plant.rng, CORRELATION_S)
        self._held = None
        if isinstance(plant.vehicle, FossenVehicle) and self._slow is None:
            self._held = HeldInputs(plant.vehicle, plant.lag, self._constant)

    def advance(self, state: Array, command: Command, duration: float) -> Array:
        """The state after ``duration`` seconds in which the command is given, both over ground."""
        # the water is taken as constant meanwhile: that of the middle, at the depth of the start
        water = self.water(state, 0.5 * duration)
        if water is None:
            return self._through_water(state, command, duration)
        end = self._through_water(self._seen_from(state, water), command, duration)
        return self._seen_from(end, -water, duration * water)

    def water(self, state: Array, later: float = 0.0) -> Array | None:
        """Velocity of the water ``(d,)`` where the vehicle is, in so many seconds; ``None`` where it stands still."""
        if self.plant.flow is None:
            return None
        in_space = self.plant.vehicle.position_dimension == 3
        depth = -float(self.plant.vehicle.pose(state)[2]) if in_space else 0.0
        return self.plant.flow.velocity(self._time + later, depth)

    def _seen_from(self, state: Array, velocity: Array, drift: float | Array = 0.0) -> Array:
        """The state as a frame sees it that moves with a velocity ``(d,)``, moved on by ``drift``."""
        z, dz = (values.copy() for values in self.plant.vehicle.flat(state))
        d = len(velocity)
        z[:d] += drift
        dz[:d] -= velocity
        return self.plant.vehicle.state(z, dz)

    def _through_water(self, state: Array, command: Command, duration: float) -> Array:
        """The same in water that stands still."""
        plant, began, size = self.plant, self._time, len(state)
        self._commands.append((began + plant.dead_time, command))
        x = np.concatenate([state, self._acting]) if plant.lag > 0.0 else np.asarray(state, dtype=float)
        reached = 0.0
        while reached < duration - SAME_COMMAND_TIME:
            while len(self._commands) > 1 and self._commands[1][0] <= began + reached + SAME_COMMAND_TIME:
                self._commands.popleft()
            given, present = self._commands[0]
            later = self._commands[1][0] - began if len(self._commands) > 1 else duration
            until = min(later, duration)
            x = self._stretch(x, size, present, began - given, reached, until)
            reached = until
        self._time = began + duration
        if plant.lag > 0.0:
            self._acting = x[size:]
        return x[:size]

    def _stretch(self, x: Array, size: int, command: Command, age: float, begin: float, end: float) -> Array:
        """Integrate from ``begin`` to ``end`` under one command, which is ``age`` seconds older than this period."""
        vehicle, lag, factor, began = self.plant.vehicle, self.plant.lag, self._factor, self._time
        if self._held is not None and isinstance(command, Held):
            reached = self._held.advance(x, factor * command.inputs, end - begin)
            if reached is not None:
                self.work += reached[1]
                return reached[0]
        pushed = self._constant is not None or self._slow is not None

        def rates(s: float, x: Array) -> Array:
            asked = factor * command(s + age)
            acting = x[size:] if lag > 0.0 else asked
            force = acting + self._push(x[:size], began + s) if pushed else acting
            moved = vehicle.rates(x[:size], force)
            return np.concatenate([moved, (asked - acting) / lag]) if lag > 0.0 else moved

        from scipy.integrate import solve_ivp  # takes half a second to import, which other ways do not need

        measured = not np.isnan(self.work)
        found = solve_ivp(rates, (begin, end), x, rtol=RELATIVE, atol=ABSOLUTE, dense_output=measured)
        if found.sol is not None:
            times = np.linspace(begin, end, POWER_POINTS)
            points = list(zip(times, found.sol(times).T, strict=True))
            acting = [y[size:] if lag > 0.0 else factor * command(s + age) for s, y in points]
            power = np.array([power_of(vehicle, y[:size], a) for (_, y), a in zip(points, acting, strict=True)])
            self.work += float(np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(times)))
        return np.asarray(found.y[:, -1])

    def _push(self, state: Array, time: float) -> Array:
        """The force that no model knows, in the body frame ``(d+1,)``."""
        pose = self.plant.vehicle.pose(state)
        force = np.zeros(len(pose)) if self._constant is None else self._constant.copy()
        if self._slow is not None:
            slow = self._slow(time)
            force[: len(slow)] += slow
        return np.asarray(rotation(pose[-1], len(pose)).T @ force)
