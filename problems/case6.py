"""Case 6 of the paper (section 5.2): circle with varying speed, periodic depth.

The target moves as in case 3 and up and down with ``z = 5 sin²(0.2 t)``; ``turn_rate_step`` adds abrupt manoeuvres.
"""

from gbt_ocp.experiments.config.tracking_problem import TrackingProblem

problem = TrackingProblem(
    name="case6",
    dimension=3,
    description="circle with varying speed, periodic depth (paper, case 6)",
    target={"kind": "case6"},
)
