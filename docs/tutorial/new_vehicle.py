"""A new vehicle: a drone whose force is limited on each axis, with linear drag, in a steady current.

gbt-ocp run new_vehicle.py
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbt_ocp import TrackingProblem

Array = NDArray[np.float64]


class DriftingDrone:
    """``f = m z̈ + c (ż - v_c)``: the flat output z is the position, and the input f follows from its derivatives."""

    position_dimension = 2  # d
    flat_dimension = 2  # numbers in z: no yaw here

    mass = 20.0  # m in kg
    drag = 15.0  # c in N s/m
    current = np.array([0.3, 0.0])  # v_c in m/s

    thrust_max = np.array([150.0, 150.0])  # N
    acceleration_scale = thrust_max / mass  # natural size of z̈: the solver's unknowns are measured in it

    # What the planner needs. z, dz, ddz are CasADi expressions, so: operators and functions that CasADi knows.

    def inputs(self, z: Any, dz: Any, ddz: Any) -> Any:
        """Force on each axis in N, from position, velocity and acceleration."""
        return self.mass * ddz + self.drag * (dz - self.current)

    # What the simulation needs, in numpy. The state is [x, y, ẋ, ẏ].

    def rates(self, state: ArrayLike, thrust: ArrayLike) -> Array:
        """Time derivative of the state under a force in N (used with `vehicle.follow: dynamics`)."""
        velocity = np.asarray(state, dtype=float)[2:]
        force = np.asarray(thrust, dtype=float) - self.drag * (velocity - self.current)
        return np.concatenate([velocity, force / self.mass])

    def state(self, z: ArrayLike, dz: ArrayLike) -> Array:
        """State that belongs to a flat output and its derivative."""
        return np.concatenate([np.asarray(z, dtype=float), np.asarray(dz, dtype=float)])

    def flat(self, state: ArrayLike) -> tuple[Array, Array]:
        """Flat output and its derivative that belong to a state."""
        position, velocity = np.split(np.asarray(state, dtype=float), 2)
        return position, velocity

    # What is recorded: position and yaw, body velocity and yaw rate. A drone without a bow has neither yaw nor rate.

    def pose(self, state: ArrayLike) -> Array:
        """Position in m, and yaw in rad."""
        return np.append(np.asarray(state, dtype=float)[:2], 0.0)

    def velocity(self, state: ArrayLike) -> Array:
        """Velocity in m/s, and yaw rate in rad/s."""
        return np.append(np.asarray(state, dtype=float)[2:], 0.0)


problem = TrackingProblem(
    name="drone",
    dimension=2,
    description="a drone in a current, and the figure eight of the paper",
    target={"kind": "case2"},
    vehicle=DriftingDrone,
    # It is weaker than the paper's vehicle for its weight: one turn around the target takes 5 s instead of 1 s, and the
    # plan looks further ahead.
    defaults={
        "duration_s": 20.0,
        "planner": {"formulation": "hard", "pieces": 20},
        "tracker": {"forecast": 20},
        "desired_bearing": {"period_s": 5.0},
    },
)
