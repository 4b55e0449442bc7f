"""Case 2 of the paper (section 5.2): figure eight in the plane.

The target moves on a figure eight of half width 3 m, once in 16 s, from (3, 0):
``x = 3 cos(πt/8) / (1 + sin²(πt/8))²``, ``y = 1.5 sin(πt/4) / (1 + sin²(πt/8))²``, squared as printed.
"""

from gbt_ocp.experiments.config.tracking_problem import TrackingProblem

problem = TrackingProblem(
    name="case2",
    dimension=2,
    description="figure eight in the plane (paper, case 2)",
    target={"kind": "case2"},
)
