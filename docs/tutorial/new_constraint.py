"""A new constraint: the vehicle must stay within reach of a buoy that relays its data.

gbt-ocp run new_constraint.py
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gbt_ocp import TrackingProblem
from gbt_ocp.ocp import TrajectoryProblem
from gbt_ocp.ocp.trajectory import FlatPoint

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WithinReach:
    """``‖P_A - buoy‖ <= reach``, written as ``lower <= value <= upper`` at every time.

    As squares over the squared reach: smooth, also at the buoy itself, and of the size of one.
    """

    buoy: tuple[float, float]  # m
    reach: float  # m

    # One number for each that `value` gives: here one.
    lower: ClassVar[Array] = np.full(1, -np.inf)
    upper: ClassVar[Array] = np.ones(1)
    backoff: ClassVar[Array] = np.full(1, 0.01)  # how far inside the solver is kept, against what happens between nodes
    scale: ClassVar[Array] = np.full(1, 2.0)  # unit of reported violations: near 1 a square grows twice as fast

    def value(self, point: FlatPoint) -> Any:
        """A CasADi expression of position ``point.z``, velocity ``point.dz`` and acceleration ``point.ddz``."""
        return ca.sumsqr(point.z[:2] - ca.DM(self.buoy)) / self.reach**2


def constrain(problem: TrajectoryProblem) -> TrajectoryProblem:
    """Add the constraint: exactly, at the ends of four intervals a piece. `subject_to_penalty` would weigh it."""
    return problem.subject_to(WithinReach((0.0, 0.0), 2.0), nodes=4)


problem = TrackingProblem(
    name="within_reach",
    dimension=2,
    description="a figure eight that leaves the reach of the vehicle's buoy",
    target={"kind": "case2"},
    constrain=constrain,
    defaults={
        "duration_s": 20.0,
        "planner": {"formulation": "hard", "pieces": 10},
        "vehicle": {"start": {"position_m": [0.0, -1.0]}},
    },
)
