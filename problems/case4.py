"""Case 4 of the paper (section 5.2): constant velocity in space.

The target moves as in case 1 and rises at 0.1 m/s: ``z = 0.1 t``.
"""

from gbt_ocp.experiments.config.tracking_problem import TrackingProblem

problem = TrackingProblem(
    name="case4",
    dimension=3,
    description="constant velocity in space (paper, case 4)",
    target={"kind": "case4"},
)
