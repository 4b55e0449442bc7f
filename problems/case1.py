"""Case 1 of the paper (section 5.2): constant velocity in the plane.

The target moves with constant velocity: ``x = y = -1 + t``.
"""

from gbt_ocp.experiments.config.tracking_problem import TrackingProblem

problem = TrackingProblem(
    name="case1",
    dimension=2,
    description="constant velocity in the plane (paper, case 1)",
    target={"kind": "case1"},
)
