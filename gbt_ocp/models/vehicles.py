"""What a vehicle is to the planner and to the simulation, and two small examples.

A vehicle is described twice, on purpose. :meth:`Vehicle.inputs` is the inverse dynamics on the flat output, symbolic in
CasADi, which the trajectory problem uses. :meth:`Vehicle.rates` is the forward dynamics in numpy, which the simulation
integrates. Neither is derived from the other, so the tests can compare one with the other.
"""

from __future__ import annotations

from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.sizes import not_negative, positive, vector
from gbt_ocp.typing import Array


class Vehicle(Protocol):
    """What the trajectory problem and the simulation need of a vehicle.

    Attributes
    ----------
    position_dimension
        d, the dimension of the space (2 or 3).
    flat_dimension
        n, the number of flat outputs z; the first d of them are the position.
    thrust_max
        Limits of the inputs τ_max ``(m,)``, all positive. A vehicle whose limits differ by sign has ``thrust_min`` too
        ``(m,)``, all negative; see :class:`~gbt_ocp.models.thrust.ThrustRange`.
    acceleration_scale
        Typical size of z̈ under full thrust ``(n,)``; scales the decision variables and nothing else.
    """

    @property
    def position_dimension(self) -> int:
        """d, the dimension of the space."""

    @property
    def flat_dimension(self) -> int:
        """n, the number of flat outputs."""

    @property
    def thrust_max(self) -> Array:
        """Limits of the inputs ``(m,)``."""

    @property
    def acceleration_scale(self) -> Array:
        """Typical size of z̈ ``(n,)``."""

    def inputs(self, z: Any, dz: Any, ddz: Any) -> Any:
        """Inputs τ ``(m,)`` as a CasADi expression of the flat output and its first two derivatives ``(n,)``."""

    def state(self, z: ArrayLike, dz: ArrayLike) -> Array:
        """State vector of the forward dynamics at a point of the flat output."""

    def flat(self, state: ArrayLike) -> tuple[Array, Array]:
        """Flat output z and its rate ż ``(n,)`` at a state; the inverse of :meth:`state`."""

    def pose(self, state: ArrayLike) -> Array:
        """Position and yaw ``(d+1,)`` at a state (m, rad)."""

    def velocity(self, state: ArrayLike) -> Array:
        """Body-frame linear velocity and yaw rate ``(d+1,)`` at a state (m/s, rad/s)."""

    def rates(self, state: ArrayLike, thrust: ArrayLike) -> Array:
        """Time derivative of the state under constant inputs: the forward dynamics."""


class DrivenVehicle(Protocol):
    """What a trajectory by integration needs of a vehicle, which need not be flat.

    Attributes
    ----------
    position_dimension
        d, the dimension of the space (2 or 3).
    flat_dimension
        n, the first numbers of the state; the first d of them are the position, and a yaw comes after it.
    thrust_max
        Limits of the inputs ``(m,)``, all positive.
    """

    @property
    def position_dimension(self) -> int:
        """d, the dimension of the space."""

    @property
    def flat_dimension(self) -> int:
        """n, how many numbers of the state the objectives and limits read, with their derivatives."""

    @property
    def thrust_max(self) -> Array:
        """Limits of the inputs ``(m,)``."""

    def rates(self, state: Any, thrust: Any) -> Any:
        """Time derivative of the state under these inputs, a CasADi expression where the state is one."""

    def state(self, z: ArrayLike, dz: ArrayLike) -> Array:
        """State vector at the first n numbers z and their rates ``(n,)``; what these do not tell is zero."""


def acceleration(vehicle: Vehicle, z: Any, dz: Any, inputs: Any) -> Any:
    """The acceleration z̈ ``(n,)`` under given inputs, a CasADi expression of (z, ż, τ).

    Every vehicle here has as many inputs as flat outputs, and they are affine in z̈, so one linear solve inverts
    :meth:`Vehicle.inputs`: the forward dynamics in the coordinates of the flat output. They are singular where the
    flatness map is (a unicycle at rest).
    """
    ddz = ca.SX.sym("ddz", vehicle.flat_dimension)
    needed = vehicle.inputs(z, dz, ddz)
    without = ca.substitute(needed, ddz, ca.SX.zeros(ddz.shape))
    return ca.solve(ca.jacobian(needed, ddz), inputs - without)


class PlanarPointMass:
    """A point mass in the plane with linear drag: ``f = m z̈ + c ż``, flat output the position.

    Parameters
    ----------
    mass
        m in kg.
    drag
        c in N s/m.
    thrust_max
        Limit of the force on each axis in N ``(2,)``.

    Raises
    ------
    ValueError
        If mass or limits are not above 0, or the drag is below it.
    """

    position_dimension = 2
    flat_dimension = 2

    def __init__(self, mass: float = 1.0, drag: float = 0.0, thrust_max: ArrayLike = (1.0, 1.0)) -> None:
        self.mass, self.drag = float(positive("mass", mass)), float(not_negative("drag", drag))
        self.thrust_max = vector("thrust_max", thrust_max, 2, above_zero=True)
        self.acceleration_scale = self.thrust_max / self.mass

    def inputs(self, z: Any, dz: Any, ddz: Any) -> Any:
        """Force on each axis in N."""
        return self.mass * ddz + self.drag * dz

    def rates(self, state: ArrayLike, thrust: ArrayLike) -> Array:
        """Time derivative of ``[x, y, ẋ, ẏ]``."""
        _, velocity = np.split(np.asarray(state, dtype=float), 2)
        return np.concatenate([velocity, (np.asarray(thrust, dtype=float) - self.drag * velocity) / self.mass])

    def state(self, z: ArrayLike, dz: ArrayLike) -> Array:
        """State ``[x, y, ẋ, ẏ]``."""
        return np.concatenate([np.asarray(z, dtype=float), np.asarray(dz, dtype=float)])

    def flat(self, state: ArrayLike) -> tuple[Array, Array]:
        """Position and velocity."""
        position, velocity = np.split(np.asarray(state, dtype=float), 2)
        return position, velocity

    def pose(self, state: ArrayLike) -> Array:
        """Position, and zero yaw: a point mass has none."""
        return np.append(np.asarray(state, dtype=float)[:2], 0.0)

    def velocity(self, state: ArrayLike) -> Array:
        """Velocity, and zero yaw rate."""
        return np.append(np.asarray(state, dtype=float)[2:], 0.0)


class Unicycle:
    """A vehicle that moves only ahead and turns: inputs are the acceleration and the turn rate, flat output (x, y).

    With ``z = (x, y)`` the acceleration is ``(ẋẍ + ẏÿ)/v`` and the turn rate ``(ẋÿ - ẏẍ)/v²``. The map is singular at
    rest, so v² is read as ``ẋ² + ẏ² + v_0²``: exact well above v_0, bounded below it.

    Parameters
    ----------
    thrust_max
        Limits of acceleration (m/s²) and turn rate (rad/s) ``(2,)``.
    slow_speed
        v_0 in m/s.

    Raises
    ------
    ValueError
        If a number is not above 0.
    """

    position_dimension = 2
    flat_dimension = 2

    def __init__(self, thrust_max: ArrayLike = (1.0, 1.0), slow_speed: float = 0.01) -> None:
        self.thrust_max = vector("thrust_max", thrust_max, 2, above_zero=True)
        self.slow_speed = float(positive("slow_speed", slow_speed))
        self.acceleration_scale = np.full(2, self.thrust_max[0])

    def inputs(self, z: Any, dz: Any, ddz: Any) -> Any:
        """Acceleration along the heading and turn rate."""
        square = ca.sumsqr(dz) + self.slow_speed**2
        ahead = ca.dot(dz, ddz) / ca.sqrt(square)
        return ca.vertcat(ahead, (dz[0] * ddz[1] - dz[1] * ddz[0]) / square)

    def rates(self, state: ArrayLike, thrust: ArrayLike) -> Array:
        """Time derivative of ``[x, y, ψ, v]``."""
        _, _, yaw, speed = np.asarray(state, dtype=float)
        acceleration, turn = np.asarray(thrust, dtype=float)
        return np.array([speed * np.cos(yaw), speed * np.sin(yaw), turn, acceleration])

    def state(self, z: ArrayLike, dz: ArrayLike) -> Array:
        """State ``[x, y, ψ, v]``; the yaw is that of the velocity, zero at rest."""
        (x, y), (dx, dy) = np.asarray(z, dtype=float), np.asarray(dz, dtype=float)
        return np.array([x, y, np.arctan2(dy, dx), np.hypot(dx, dy)])

    def flat(self, state: ArrayLike) -> tuple[Array, Array]:
        """Position and velocity."""
        x, y, yaw, speed = np.asarray(state, dtype=float)
        return np.array([x, y]), speed * np.array([np.cos(yaw), np.sin(yaw)])

    def pose(self, state: ArrayLike) -> Array:
        """Position and yaw."""
        return np.asarray(state, dtype=float)[:3]

    def velocity(self, state: ArrayLike) -> Array:
        """Speed ahead, no sideways speed; the yaw rate is an input here and reads NaN."""
        return np.array([np.asarray(state, dtype=float)[3], 0.0, np.nan])
