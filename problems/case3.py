"""Case 3 of the paper (section 5.2): circle with varying speed in the plane.

The target moves on a circle of radius 4 m from (4, 0) with turn rate ``ψ̇ = 0.3 + 0.2 sin(0.4 t)``:
``x = 4 cos ψ``, ``y = 4 sin ψ``. ``turn_rate_step`` adds abrupt manoeuvres (section 5.6, scenario 5).
"""

from gbt_ocp.experiments.config.tracking_problem import TrackingProblem

problem = TrackingProblem(
    name="case3",
    dimension=2,
    description="circle with varying speed in the plane (paper, case 3)",
    target={"kind": "case3"},
)
