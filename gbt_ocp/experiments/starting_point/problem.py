"""A tracking problem of my own: a target that drifts and weaves.

Check it:        gbt-ocp check my_problem.py
Run it:          gbt-ocp run my_problem.py
Change a key:    gbt-ocp run my_problem.py --set sensor.noise_deg=0.05 duration_s=20 --seed 1
Look at it:      gbt-ocp animate RUN_DIR
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbt_ocp import TrackingProblem


class WeavingTarget:
    """A target in the plane that drifts along x and weaves across it.

    The tracker knows nothing of this: it sees bearings only. The simulation uses it to make them, and to say how large
    the error is.
    """

    # 2 in the plane, 3 in space (then position returns three columns).
    dimension = 2

    drift = 0.4  # m/s
    width = 1.5  # m
    period = 10.0  # s

    def position(self, times: ArrayLike) -> NDArray[np.float64]:
        """Position in metres at times in seconds: (K,) -> (K, 2)."""
        t = np.asarray(times, dtype=float)
        return np.stack([self.drift * t, self.width * np.sin(2.0 * np.pi * t / self.period)], axis=-1)


# `gbt-ocp run` looks for an object of this name.
problem = TrackingProblem(
    name="my_problem",
    dimension=2,
    description="a target that drifts and weaves",
    # A function without arguments that makes the target; or a mapping, as a YAML file has it:
    #   target={"kind": "track", "path": "boat.csv"}
    target=WeavingTarget,
    # Any key of a configuration, here with another default (docs/configuration.md and `gbt-ocp schema` list them all).
    # A YAML file that says `problem: my_problem.py`, and --set, may still say otherwise.
    defaults={
        "duration_s": 15.0,
        "planner": {"formulation": "hard", "pieces": 10},
        "vehicle": {"start": {"position_m": [-3.0, -2.0]}},
        # Limits besides thrust, of which there are more:
        #   "limits": {"speed": 3.0, "keep_out": [{"centre_m": [2.0, 3.0], "radius_m": 0.5}], "hard": ["keep_out"]},
    },
    # Three more fields change more than numbers; the tutorial has a file for each:
    #   vehicle=...    a function that makes a gbt_ocp.models.vehicles.Vehicle
    #   objective=...  a function that makes what the planner maximises
    #   constrain=...  a function that puts a constraint of yours on the planner's problem
)
