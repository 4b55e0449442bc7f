"""Sizes that a constructor cannot use are refused where they are given, in one line that names them."""

import numpy as np
import pytest

from gbt_ocp.guidance import (
    BearingSimilarity,
    Circumnavigation,
    CrossFirst,
    FieldOfView,
    FimPlacement,
    FisherInformation,
    HelicalGuidance,
    NearInformation,
    PacedBearing,
    PastBearings,
    PosteriorVariance,
    RandomThrust,
    RangeLimits,
    RangePull,
)
from gbt_ocp.guidance.inverse_dynamics import InverseDynamics
from gbt_ocp.guidance.pacing import circling_speed
from gbt_ocp.guidance.planned import PlannedMotion
from gbt_ocp.models import (
    FALCON_2D,
    FALCON_3D,
    BearingSensor,
    DesiredBearing,
    FossenParameters,
    FossenVehicle,
    PlanarPointMass,
    TrackTarget,
    TurningTarget,
    Unicycle,
    case_target,
)
from gbt_ocp.models.sizes import at_least, not_negative, positive, vector
from gbt_ocp.ocp import (
    DepthLimits,
    KeepOut,
    KeepOutPolygon,
    ShootingPlanner,
    SpeedLimit,
    ThrustLimit,
    TrajectoryProblem,
    YawRateLimit,
)

PLANAR = FossenVehicle(FALCON_2D, (5000.0, 5000.0, 1500.0))
SPATIAL = FossenVehicle(FALCON_3D, (5000.0, 5000.0, 5000.0, 1500.0))
POINT = PlanarPointMass()
DESIRED = DesiredBearing(2, 1.0)
PROBLEM = TrajectoryProblem(POINT, 3, 0.1)
HELIX = {
    "gain": 1.0, "amplitude_z": 0.1, "amplitude_y": 0.1, "frequency": 1.0, "standoff": 1.0, "range_gain": 1.0,
    "range_damping": 1.0,
}  # fmt: skip
TRACK = (np.arange(5.0), np.zeros((5, 2)))
TURNS = {"duration": 1.0, "start": np.zeros(2)}
TRIANGLE = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))


def similarity():
    return TrajectoryProblem(POINT, 3, 0.1).maximize(BearingSimilarity(2)).subject_to(ThrustLimit(POINT))


def turning(**given):
    return TurningTarget(2, np.random.default_rng(0), **(TURNS | given))


def crossing(**given):
    numbers = {"axis": (0.0, 0.0, 1.0), "deviation": 0.2, "speed": 1.0, "opening": 0.1, "leg": 10.0}
    return CrossFirst(None, PLANAR, 0.1, **(numbers | given))


def fossen(**given):
    numbers = {"added_mass": (0.0,) * 3, "linear_drag": (1.0,) * 3, "quadratic_drag": (1.0,) * 3}
    return FossenParameters(**({"mass": 1.0, "inertia": 1.0} | numbers | given))


ABOVE_ZERO = {
    "KeepOut.radius": lambda x: KeepOut((0.0, 0.0), x),
    "KeepOutPolygon.softness": lambda x: KeepOutPolygon(TRIANGLE, x),
    "SpeedLimit.speed": lambda x: SpeedLimit(2, x),
    "YawRateLimit.rate": lambda x: YawRateLimit(2, x),
    "RangeLimits.nearest": lambda x: RangeLimits(2, nearest="1" if x is None else x),
    "RangeLimits.farthest": lambda x: RangeLimits(2, farthest="1" if x is None else x),
    "TrajectoryProblem.period": lambda x: TrajectoryProblem(POINT, 3, x),
    "subject_to_penalty.weight": lambda x: PROBLEM.subject_to_penalty(ThrustLimit(POINT), weight=x),
    "subject_to_penalty.width": lambda x: PROBLEM.subject_to_penalty(ThrustLimit(POINT), width=x),
    "RangePull.reference": lambda x: RangePull(2, reference=x),
    "FisherInformation.reference": lambda x: FisherInformation(2, reference=x),
    "NearInformation.reference": lambda x: NearInformation(2, reference=x),
    "PacedBearing.speed": lambda x: PacedBearing(DESIRED, x),
    "PastBearings.span": lambda x: PastBearings(2, x, 1.0, lambda r: 1.0),
    "PastBearings.share": lambda x: PastBearings(2, 1.0, x, lambda r: 1.0),
    "circling_speed.radius": lambda x: circling_speed(POINT, x),
    "circling_speed.share": lambda x: circling_speed(POINT, 1.0, x),
    "InverseDynamics.period": lambda x: InverseDynamics(PLANAR, x),
    "Circumnavigation.period": lambda x: Circumnavigation(PLANAR, x, speed=1.0, radial_gain=1.0, standoff=1.0),
    "Circumnavigation.speed": lambda x: Circumnavigation(PLANAR, 0.1, speed=x, radial_gain=1.0, standoff=1.0),
    "Circumnavigation.standoff": lambda x: Circumnavigation(PLANAR, 0.1, speed=1.0, radial_gain=1.0, standoff=x),
    "FimPlacement.period": lambda x: FimPlacement(DESIRED, x, standoff=1.0),
    "FimPlacement.standoff": lambda x: FimPlacement(DESIRED, 0.1, standoff=x),
    "HelicalGuidance.period": lambda x: HelicalGuidance(SPATIAL, x, **HELIX),
    "HelicalGuidance.frequency": lambda x: HelicalGuidance(SPATIAL, 0.1, **(HELIX | {"frequency": x})),
    "HelicalGuidance.standoff": lambda x: HelicalGuidance(SPATIAL, 0.1, **(HELIX | {"standoff": x})),
    "RandomThrust.hold": lambda x: RandomThrust(PLANAR, x, np.random.default_rng(0)),
    "CrossFirst.deviation": lambda x: crossing(deviation=x),
    "CrossFirst.speed": lambda x: crossing(speed=x),
    "CrossFirst.leg": lambda x: crossing(leg=x),
    "BearingSensor.period": lambda x: BearingSensor(x),
    "BearingSensor.outlier_every": lambda x: BearingSensor(0.1, outlier_every=x),
    "PlanarPointMass.mass": lambda x: PlanarPointMass(x),
    "PlanarPointMass.thrust_max": lambda x: PlanarPointMass(thrust_max=(1.0, x)),
    "Unicycle.slow_speed": lambda x: Unicycle(slow_speed=x),
    "Unicycle.thrust_max": lambda x: Unicycle((1.0, x)),
    "FossenVehicle.thrust_max": lambda x: FossenVehicle(FALCON_2D, (1.0, x, 1.0)),
    "TrackTarget.length_scale": lambda x: TrackTarget(*TRACK, length_scale=x),
    "TrackTarget.time_scale": lambda x: TrackTarget(*TRACK, time_scale=x),
    "TurningTarget.duration": lambda x: turning(duration=x),
    "TurningTarget.speed": lambda x: turning(speed=x),
    "case_target.every_s": lambda x: case_target(3, turn_rate_step=0.1, every_s=x),
}

NOT_BELOW_ZERO = {
    "RangePull.weight": lambda x: RangePull(2, x),
    "Circumnavigation.radial_gain": lambda x: Circumnavigation(PLANAR, 0.1, speed=1.0, radial_gain=x, standoff=1.0),
    "CrossFirst.opening": lambda x: crossing(opening=x),
    "BearingSensor.noise": lambda x: BearingSensor(0.1, x),
    "BearingSensor.missed_probability": lambda x: BearingSensor(0.1, missed_probability=x),
    "BearingSensor.outlier": lambda x: BearingSensor(0.1, outlier=x),
    "BearingSensor.latency": lambda x: BearingSensor(0.1, latency=x),
    "PlanarPointMass.drag": lambda x: PlanarPointMass(drag=x),
    "FossenParameters.linear_drag": lambda x: fossen(linear_drag=(0.0, x, 0.0)),
    "FossenParameters.quadratic_drag": lambda x: fossen(quadratic_drag=(0.0, x, 0.0)),
    "TurningTarget.turn_rate_max": lambda x: turning(turn_rate_max=x),
    "TurningTarget.climb_rate_max": lambda x: turning(climb_rate_max=x),
    "TurningTarget.speed_std": lambda x: turning(speed_std=x),
}

WHOLE = {
    "TrajectoryProblem.pieces": lambda x: TrajectoryProblem(POINT, x, 0.1),
    "TrajectoryProblem.degree": lambda x: TrajectoryProblem(POINT, 3, 0.1, x),
    "TrajectoryProblem.continuity": lambda x: TrajectoryProblem(POINT, 3, 0.1, 3, "1" if x is None else x),
    "subject_to.nodes": lambda x: PROBLEM.subject_to(ThrustLimit(POINT), nodes=x),
    "subject_to_penalty.nodes": lambda x: PROBLEM.subject_to_penalty(ThrustLimit(POINT), nodes=x),
    "PosteriorVariance.pieces": lambda x: PosteriorVariance(2, x),
    "ShootingPlanner.substeps": lambda x: ShootingPlanner(similarity(), substeps=x),
    "PlannedMotion.steps": lambda x: PlannedMotion(None, DESIRED, x),
    "PlannedMotion.stride": lambda x: PlannedMotion(None, DESIRED, 1, stride="1" if x is None else x),
}

NO_NUMBER = (np.nan, np.inf, -np.inf, None, "1", True)


@pytest.mark.parametrize("name", [*ABOVE_ZERO, *NOT_BELOW_ZERO])
def test_sizes_that_are_none_are_refused(name):
    make, floor = (ABOVE_ZERO[name], (0, 0.0)) if name in ABOVE_ZERO else (NOT_BELOW_ZERO[name], ())
    make(0.5)
    for value in (*floor, -1.0, *NO_NUMBER):
        if "thrust_max" in name and value in ("1", True):
            continue  # entries of a vector are converted
        with pytest.raises(ValueError, match=rf"^{name.split('.')[1]}: found .*; allowed: "):
            make(value)
    if name in NOT_BELOW_ZERO:
        make(0.0)


@pytest.mark.parametrize("name", WHOLE)
def test_counts_that_are_none_are_refused(name):
    WHOLE[name](2)
    WHOLE[name](np.int64(2))
    for value in (0, -1, 1.5, 2.0, *NO_NUMBER):
        with pytest.raises(ValueError, match=rf"^{name.split('.')[1]}: found .*; allowed: a whole number >= "):
            WHOLE[name](value)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: KeepOut((0.0, np.nan), 1.0), r"centre: found .*; allowed: 2 finite numbers"),
        (lambda: KeepOut((0.0,), 1.0), r"centre: found .*; allowed: 2 finite numbers"),
        (lambda: KeepOutPolygon((*TRIANGLE[:2], (0.0, np.inf))), r"corners: found .*; allowed: 2 finite numbers"),
        (lambda: DepthLimits(0.0, 0.0), r"lowest: found 0.0; allowed: a number below highest"),
        (lambda: DepthLimits(np.nan, 0.0), r"lowest: found nan; allowed: a number below highest"),
        (lambda: FieldOfView(2, 0.0), r"half_angle: found 0.0; allowed: a number in"),
        (lambda: ThrustLimit(POINT, np.nan), "gamma must lie in"),
        (lambda: BearingSimilarity(2, kappa=-2.0), r"dimension \+ kappa: found 0.0; allowed: a number > 0"),
        (
            lambda: BearingSensor(0.1, missed_probability=1.0),
            "missed_probability: found 1.0; allowed",
        ),
        (lambda: DesiredBearing(2, np.inf), "rate, phase and leg_start: found"),
        (lambda: DesiredBearing(3, 1.0, (0.0, 0.0, 0.0)), "axis must not be zero"),
        (lambda: DesiredBearing(3, 1.0, (0.0, np.nan, 1.0)), "axis: found"),
        (lambda: crossing(axis=(0.0, 0.0, 0.0)), "length of axis: found 0.0"),
        (lambda: crossing(opening=1.0), "startup_opening: found 1.0; allowed: a number < startup_speed"),
        (lambda: fossen(mass=np.nan), "mass minus added mass must be positive"),
        (lambda: TrajectoryProblem(POINT, 3, 0.1, 3, 3), "continuity: found 3; allowed: at most degree - 1 = 2"),
    ],
)
def test_sizes_of_several_numbers_are_refused(make, says):
    with pytest.raises(ValueError, match=says):
        make()


def test_what_fits_is_handed_back():
    assert positive("x", 2) == 2
    assert not_negative("x", 0.0) == 0.0
    assert at_least("x", np.int32(3), 3) == 3
    given = np.ones(2)
    found = vector("x", given, 2, above_zero=True)
    np.testing.assert_array_equal(found, given)
    assert found is not given, "what the caller changes later must not change it"
    for wrong in ((1.0, 2.0), "ab", [[1.0], [2.0, 3.0]], None):
        with pytest.raises(ValueError, match=r"x: found .*; allowed: 3 finite numbers"):
            vector("x", wrong, 3)
