"""A recorded track in the plane, read from a CSV file with the columns ``t,x,y`` (s, m).

The example track lies beside this file; ``target.path`` in a configuration names another. A boat outruns the vehicle:
``target.length_scale`` and ``target.time_scale`` bring it to the vehicle's size and speed.
"""

from gbt_ocp.experiments.config.tracking_problem import TrackingProblem

problem = TrackingProblem(
    name="recorded",
    dimension=2,
    description="a recorded track from a CSV file, in the plane",
    target={"kind": "track", "path": "recorded_track.csv", "start_m": [3.0, 0.0]},
)
