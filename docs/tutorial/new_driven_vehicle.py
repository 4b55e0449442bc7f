"""A vehicle that is not flat: a boat with an outboard motor, by its rates alone.

gbt-ocp run new_driven_vehicle.py
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from gbt_ocp import TrackingProblem


class OutboardBoat:
    """Two inputs for three ways to move: the thrust of the motor, and how fast it is turned.

    The state is [x, y, yaw, surge, sway, yaw rate, angle of the motor]: positions in m in the earth frame, the yaw
    counter-clockwise from +x, velocities of the body in m/s and rad/s, a positive angle turns to port.
    """

    position_dimension = 2  # d: the state begins with a position of so many numbers
    flat_dimension = 3  # numbers z of the state, the position first, then the yaw, that objectives and limits read
    states = 7  # all of them; needed where they are not twice as many as z

    mass = np.array([110.0, 160.0])  # with added mass, ahead and to the side, kg
    inertia = 60.0  # with the added one, kg m²
    drag = np.array([40.0, 200.0, 150.0])  # N s/m, N s/m, N m s
    lever = 1.2  # how far astern the motor is, m

    thrust_max = np.array([150.0, 1.5])  # N, rad/s
    thrust_min = np.array([0.0, -1.5])  # the motor does not reverse
    input_names = ("thrust", "motor_rate")

    def rates(self, state: Any, inputs: Any) -> Any:
        """Time derivative of the state. Both are CasADi expressions, so: operators and functions that CasADi knows."""
        yaw, u, v, r, angle = (state[k] for k in range(2, 7))
        ahead, aside = inputs[0] * ca.cos(angle), -inputs[0] * ca.sin(angle)
        return ca.vertcat(
            u * ca.cos(yaw) - v * ca.sin(yaw),
            u * ca.sin(yaw) + v * ca.cos(yaw),
            r,
            (ahead - self.drag[0] * u + self.mass[1] * v * r) / self.mass[0],
            (aside - self.drag[1] * v - self.mass[0] * u * r) / self.mass[1],
            (-self.lever * aside - self.drag[2] * r) / self.inertia,
            inputs[1],
        )


problem = TrackingProblem(
    name="outboard",
    dimension=2,
    description="a boat with an outboard motor, around a slow target",
    target={"kind": "turning", "speed": 0.3},
    vehicle=OutboardBoat,
    defaults={
        "duration_s": 60.0,
        # one turn round the target in half a minute; pieces of half a second, at whose ends the next plan is made
        "planner": {
            "form": "shooting",
            "formulation": "hard",
            "pieces": 10,
            "period_s": 0.5,
            "steps": 2,
        },
        "tracker": {"forecast": 50},
        "desired_bearing": {"period_s": 30.0},
        "vehicle": {"start": {"position_m": [8.0, 0.0]}},
    },
)
