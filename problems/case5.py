"""Case 5 of the paper (section 5.2): figure eight in the plane, periodic depth.

The target moves as in case 2 and up and down with ``z = 3 sin(πt/8)``.
"""

from gbt_ocp.experiments.config.tracking_problem import TrackingProblem

problem = TrackingProblem(
    name="case5",
    dimension=3,
    description="figure eight in the plane, periodic depth (paper, case 5)",
    target={"kind": "case5"},
)
