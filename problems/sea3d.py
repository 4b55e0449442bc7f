"""At sea, in space: noisy bearings to a boat that must not be approached.

As ``sea2d``, whose settings it takes, with a target that rises and sinks at 60 m below the surface, and a vehicle that
keeps between surface and seabed.
"""

from gbt_ocp.experiments.config.catalogue import load_problem
from gbt_ocp.experiments.config.tracking_problem import TrackingProblem

plane = load_problem("sea2d").defaults

problem = TrackingProblem(
    name="sea3d",
    dimension=3,
    description="noisy bearings and a standoff of 30 m, in space",
    target={"kind": "turning", "start_m": [0.0, 0.0, -60.0]},
    defaults={
        **plane,
        "limits": {
            **plane["limits"],
            "depth": {"lowest_m": -150.0, "highest_m": -2.0},
            "hard": [*plane["limits"]["hard"], "depth"],
        },
    },
)
