"""A new target: a boat that surveys, in parallel legs joined by half circles.

gbt-ocp run new_target.py
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbt_ocp import TrackingProblem


class Survey:
    """Legs along x, each ``spacing`` further along y, joined by half circles; at constant speed."""

    dimension = 2

    leg = 4.0  # m
    spacing = 2.0  # m
    speed = 0.6  # m/s

    def position(self, times: ArrayLike) -> NDArray[np.float64]:
        """Position in metres at times in seconds: (K,) -> (K, 2)."""
        travelled = self.speed * np.asarray(times, dtype=float)
        radius = 0.5 * self.spacing
        lap = self.leg + np.pi * radius
        number, along = np.divmod(travelled, lap)
        onward = np.where(number % 2 == 0, 1.0, -1.0)  # every second leg runs back
        turn = np.maximum(along - self.leg, 0.0) / radius  # angle of the half circle, from 0 to pi
        ahead = np.minimum(along, self.leg) + radius * np.sin(turn) - 0.5 * self.leg
        across = number * self.spacing + radius * (1.0 - np.cos(turn))
        return np.stack([onward * ahead, across], axis=-1)


problem = TrackingProblem(
    name="survey",
    dimension=2,
    description="a boat that surveys in parallel legs",
    target=Survey,
    defaults={"duration_s": 20.0, "planner": {"formulation": "hard", "pieces": 10}},
)
