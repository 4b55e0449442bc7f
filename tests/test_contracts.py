"""Classes of the user's that lack something are refused in one line that names class and member."""

from typing import ClassVar

import casadi as ca
import numpy as np
import pytest

from gbt_ocp.guidance import (
    BearingSimilarity,
    FieldOfView,
    FisherInformation,
    PosteriorVariance,
    RangeLimits,
    RangePull,
)
from gbt_ocp.models import FALCON_2D, FALCON_3D, FossenVehicle, PlanarPointMass, TurningTarget, Unicycle, case_target
from gbt_ocp.models.contracts import ContractError
from gbt_ocp.models.model_checks import check_flatness, check_target, check_vehicle, dynamics_gap
from gbt_ocp.ocp import DepthLimits, KeepOut, KeepOutPolygon, SpeedLimit, ThrustLimit, TrajectoryProblem, YawRateLimit
from gbt_ocp.ocp.binding import Binding

VEHICLE = PlanarPointMass(1.0, 0.2, (2.0, 2.0))
PROBLEM = TrajectoryProblem(VEHICLE, 5, 0.2)
PLANAR = FossenVehicle(FALCON_2D, (5000.0, 5000.0, 1500.0))
SPATIAL = FossenVehicle(FALCON_3D, (5000.0, 5000.0, 5000.0, 1500.0))


def refused(call, *words):
    with pytest.raises(ContractError) as caught:
        call()
    message = str(caught.value)
    assert "\n" not in message
    assert "; allowed: " in message
    for word in words:
        assert word in message, message


def raising(self):
    raise IndexError("list index out of range")


class Goal:
    """An objective as it should be."""

    shapes: ClassVar = {"goal": (2, 1)}

    def value(self, point, parameters):
        return -ca.sumsqr(point.z - parameters["goal"])

    def bind(self, pieces, data):
        return {"goal": np.tile(np.reshape(data["goal"], (2, 1)), (pieces, 1, 1))}


class Joint:
    """A joint objective as it should be."""

    shapes: ClassVar = {"goal": (2, 1)}
    bind = Goal.bind

    def total(self, points, parameters):
        return -sum(ca.sumsqr(point.z - given["goal"]) for point, given in zip(points, parameters, strict=True))


class Box:
    """A limit on two quantities as it should be."""

    lower, upper = -np.ones(2), np.ones(2)
    backoff, scale = np.zeros(2), np.ones(2)

    def value(self, point):
        return point.z[:2]


class Moving(Box):
    """A limit with numbers of its own, as it should be."""

    shapes: ClassVar = {"centre": (2, 1)}

    def value(self, point, parameters):
        return point.z - parameters["centre"]

    def bind(self, pieces, data):
        return {"centre": np.zeros((pieces + 1, 2, 1))}


def variant(base, **members):
    """A subclass of that name with other members; those that are ``None`` are missing."""
    kept = {name: value for name, value in vars(base).items() if name not in members and not name.startswith("__")}
    for parent in base.__mro__[1:-1]:
        kept = {name: v for name, v in vars(parent).items() if not name.startswith("__") and name not in members} | kept
    return type(base.__name__, (), kept | {name: value for name, value in members.items() if value is not None})()


def test_what_is_right_is_accepted():
    PROBLEM.maximize(Goal()).maximize(Joint()).subject_to(Box()).subject_to_penalty(Moving())
    for vehicle in (PLANAR, SPATIAL, VEHICLE, Unicycle()):
        check_vehicle(vehicle)
    for vehicle, d in ((PLANAR, 2), (SPATIAL, 3)):
        problem = TrajectoryProblem(vehicle, 3, 0.1)
        terms = [BearingSimilarity(d), BearingSimilarity(d, axial=True), RangePull(d), PosteriorVariance(d, 3)]
        for term in (*terms, *(FisherInformation(d, name) for name in ("logdet", "condition_number"))):
            problem = problem.maximize(term)
        limits = [ThrustLimit(vehicle, 0.98), KeepOut((0.0,) * d, 1.0), KeepOut((0.0, 0.0), 1.0), SpeedLimit(d, 1.0)]
        limits += [KeepOutPolygon(((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))), YawRateLimit(d, 0.1), FieldOfView(d, 1.0)]
        limits += [RangeLimits(d, 1.0, 9.0), RangeLimits(d, farthest=9.0)] + [DepthLimits(-10.0, np.inf)] * (d == 3)
        for limit in limits:
            problem = problem.subject_to(limit).subject_to_penalty(limit)
    check_target(case_target(2), 2)
    check_target(TurningTarget(3, np.random.default_rng(0), duration=1.0, start=np.zeros(3)), 3)


@pytest.mark.parametrize(
    ("term", "words"),
    [
        (variant(Goal, shapes=None), ["Goal.shapes: found nothing"]),
        (variant(Goal, shapes=(2, 1)), ["Goal.shapes: found a tuple"]),
        (variant(Goal, shapes={"goal": 2}), ["Goal.shapes: found 2 for 'goal'"]),
        (variant(Goal, shapes={"goal": (2, 0)}), ["Goal.shapes: found (2, 0)"]),
        (variant(Goal, shapes={"aim": (2, 1)}), ["Goal.value: found KeyError: 'goal'"]),
        (variant(Goal, shapes=property(raising)), ["Goal.shapes: found IndexError: list index out of range"]),
        (variant(Goal, value=None), ["Goal.value: found nothing"]),
        (variant(Goal, value=3.0), ["Goal.value: found 3.0", "(point, parameters)"]),
        (variant(Goal, value=lambda self, point: 0.0), ["Goal.value: found the arguments (point)"]),
        (variant(Goal, value=lambda self, point, parameters: point.z), ["Goal.value: found shape (2, 1)", "(1, 1)"]),
        (variant(Goal, value=lambda self, point, parameters: None), ["Goal.value: found None"]),
        (variant(Goal, value=lambda self, point, parameters: point.z[7]), ["Goal.value: found RuntimeError"]),
        (variant(Goal, value=lambda self, point, parameters: ca.SX.sym("k")), ["Goal.value: found the symbol k"]),
        (variant(Goal, value=lambda self, point, parameters: ca.MX.sym("k")), ["Goal.value: found a MX"]),
        (variant(Goal, value=lambda self, point, parameters: np.linalg.norm(point.z)), ["Goal.value: found"]),
        (variant(Goal, bind=None), ["Goal.bind: found nothing"]),
        (variant(Goal, bind=lambda self, data: {}), ["Goal.bind: found the arguments (data)"]),
        (variant(Goal, from_moments=lambda self, mean, root: {}), ["Goal.from_moments: found the arguments"]),
        (variant(Goal, from_moments=lambda self, mean, root, desired: {}), ["Goal.from_moments: found nothing"]),
        (variant(Goal, from_moments=lambda self, m, r, d: {"goal": r}), ["Goal.from_moments, 'goal': found shape"]),
        (variant(Goal, dimension=3), ["Goal.dimension: found 3; allowed: 2, the vehicle's"]),
        (variant(Joint, bind=None), ["Joint.bind: found nothing"]),
        (variant(Joint, total=lambda self, points: 0.0), ["Joint.total: found the arguments (points)"]),
        (variant(Joint, total=lambda self, points, parameters: points[0].z), ["Joint.total: found shape (2, 1)"]),
        (variant(Joint, total=lambda self, points, parameters: points[5].z[0]), ["Joint.total: found IndexError"]),
        (Goal, ["Goal: found the class"]),
        (None, ["NoneType.shapes"]),
        (BearingSimilarity(3), ["BearingSimilarity.dimension: found 3"]),
    ],
)  # fmt: skip
def test_an_objective_that_lacks_something_is_named(term, words):
    refused(lambda: PROBLEM.maximize(term), *words)


SIDES = ("lower", "upper", "backoff", "scale")

WRONG = (
    (np.ones(1), "found shape (1,); allowed: a numpy array of shape (2,)"),
    (np.ones(3), "found shape (3,)"),
    (np.ones((2, 1)), "found shape (2, 1)"),
    (1.0, "found 1.0"),
    ([1.0, 1.0], "found [1.0, 1.0]"),
    (np.array([1.0, np.nan]), "found [1.0, nan]"),
    (np.array(["a", "b"]), "found a ndarray"),
    (None, "found nothing"),
)


@pytest.mark.parametrize("verb", ["subject_to", "subject_to_penalty"])
@pytest.mark.parametrize(
    ("limit", "words"),
    [
        *((variant(Box, **{name: value}), [f"Box.{name}: {found}"]) for name in SIDES for value, found in WRONG),
        (variant(Box, value=None), ["Box.value: found nothing"]),
        (variant(Box, scale=np.array([1.0, 0.0])), ["Box.scale: found [1.0, 0.0]", "> 0"]),
        (variant(Box, scale=np.array([1.0, np.inf])), ["Box.scale: found [1.0, inf]"]),
        (variant(Box, backoff=np.array([0.0, -0.1])), ["Box.backoff: found [0.0, -0.1]", ">= 0"]),
        (variant(Box, backoff=np.array([0.0, 1.0])), ["Box.backoff: found 1.0 beside -1.0 and 1.0 (entry 1)"]),
        (variant(Box, lower=np.zeros(2), upper=np.zeros(2)), ["Box.lower: found 0.0 beside upper 0.0", "to hold a"]),
        (variant(Box, lower=np.ones(2), upper=-np.ones(2)), ["Box.lower: found 1.0 beside upper -1.0 (entry 0)"]),
        (variant(Box, lower=np.full(2, -np.inf), upper=np.full(2, np.inf)), ["Box.upper: found no finite bound"]),
        (variant(Box, upper=np.array([1.0, -np.inf])), ["Box.lower: found -1.0 beside upper -inf (entry 1)"]),
        (variant(Box, value=lambda self, point: point.z.T), ["Box.value: found shape (1, 2)"]),
        (variant(Box, value=lambda self, point: [point.z[0], point.z[1]]), ["Box.value: found ["]),
        (variant(Box, value=lambda self, point: point.z[:0]), ["Box.value: found shape (0, 1)"]),
        (variant(Moving, shapes=None), ["Moving.shapes: found nothing"]),
        (variant(Moving, bind=None), ["Moving.bind: found nothing"]),
        (variant(Moving, value=lambda self, point: point.z), ["Moving.value: found the arguments (point)"]),
        (variant(Moving, at_knot=lambda self, mean: {}), ["Moving.at_knot: found the arguments"]),
        (
            variant(Moving, at_knot=lambda self, m, c, present: {"centre": c}),
            ["Moving.at_knot, 'centre': found shape (2, 2)"],
        ),
        (variant(Moving, at_knot=lambda self, m, c, present: [m]), ["Moving.at_knot: found ["]),
        (Box, ["Box: found the class"]),
        (SpeedLimit(3, 1.0), ["SpeedLimit.dimension: found 3; allowed: 2"]),
        (KeepOut((1.0, 2.0, 3.0), 1.0), ["KeepOut.value: ", "centre: found 3 numbers; allowed: 2 for a vehicle"]),
    ],
)  # fmt: skip
def test_a_limit_that_lacks_something_is_named(limit, words, verb):
    refused(lambda: getattr(PROBLEM, verb)(limit), *words)


@pytest.mark.parametrize(
    ("bind", "words"),
    [
        (lambda self, pieces, data: {"goal": data["goal"]}, ["Goal.bind: found KeyError: 'goal'", "from desired"]),
        (lambda self, pieces, data: None, ["Goal.bind: found None"]),
        (lambda self, pieces, data: {"aim": 1.0}, ["Goal.bind: found aim; allowed: goal"]),
        (lambda self, pieces, data: {"goal": np.zeros((pieces, 2))}, ["'goal': found shape (5, 2)", "(5, 2, 1)"]),
        (lambda self, pieces, data: {"goal": [[1.0]]}, ["Goal.bind, 'goal': found [[1.0]]"]),
        (lambda self, pieces, data: {"goal": np.full((pieces, 2, 1), np.nan)}, ["Goal.bind, 'goal'", "finite numbers"]),
        (lambda self, pieces, data: {"goal": np.full((pieces, 2, 1), "a")}, ["Goal.bind, 'goal': found a ndarray"]),
    ],
)  # fmt: skip
def test_numbers_that_do_not_fit_are_named(bind, words):
    problem = PROBLEM.maximize(variant(Goal, bind=bind))
    refused(lambda: Binding(problem).objective_parameters({"desired": 1.0, "forecast": None}), *words)


def test_a_bound_of_the_wrong_length_never_reaches_a_solver():
    """What a solver would have left out: |y| reached 3 where 1 was the limit, with no violation reported."""
    box = variant(Box, lower=np.array([-1.0]), upper=np.array([1.0]), backoff=np.zeros(1), scale=np.ones(1))
    problem = PROBLEM.maximize(Goal()).subject_to(ThrustLimit(VEHICLE), nodes=1)
    for verb in (problem.subject_to, problem.subject_to_penalty):
        refused(lambda verb=verb: verb(box), "Box.lower: found shape (1,)")
    long = TrajectoryProblem(VEHICLE, 20, 0.2).maximize(Goal()).subject_to(ThrustLimit(VEHICLE), nodes=1)
    plan = long.subject_to(Box()).compile("ipopt").solve(np.zeros((2, 2)), goal=(0.5, 3.0))
    assert plan.solved
    assert np.abs(plan(np.linspace(0.0, 4.0, 400))).max() == pytest.approx(1.0, abs=1e-3)


class Drone(PlanarPointMass):
    """A vehicle as it should be."""


@pytest.mark.parametrize(
    ("members", "words"),
    [
        ({"position_dimension": 1}, ["Drone.position_dimension: found 1"]),
        ({"position_dimension": 4, "flat_dimension": 4}, ["Drone.position_dimension: found 4; allowed: 2, 3"]),
        ({"position_dimension": 2.0}, ["Drone.position_dimension: found 2.0"]),
        ({"flat_dimension": 1}, ["Drone.flat_dimension: found 1"]),
        ({"flat_dimension": 3}, ["Drone.thrust_max: found shape (2,)", "(3,)"]),
        ({"thrust_max": np.ones(3)}, ["Drone.thrust_max: found shape (3,)"]),
        ({"thrust_max": [1.0, 1.0]}, ["Drone.thrust_max: found [1.0, 1.0]", "numpy array"]),
        ({"thrust_max": np.array([1.0, 0.0])}, ["Drone.thrust_max: found [1.0, 0.0]", "> 0"]),
        ({"acceleration_scale": np.array([1.0, np.inf])}, ["Drone.acceleration_scale: found [1.0, inf]"]),
        ({"inputs": lambda z, dz, ddz: ddz[0]}, ["Drone.inputs: found shape (1, 1)", "(2, 1), as many inputs"]),
        ({"inputs": lambda z, dz, ddz: ca.vertcat(ddz, z[0])}, ["Drone.inputs: found shape (3, 1)"]),
        ({"inputs": lambda z, dz, ddz: ca.vertcat(ddz[0], dz[1])}, ["Drone.inputs: found inputs that do not fix ddz"]),
        ({"inputs": lambda z, dz, ddz: ca.vertcat(ddz[0], ddz[0])}, ["Drone.inputs: found inputs that do not fix ddz"]),
        ({"inputs": lambda z, dz, ddz: ddz**2}, ["Drone.inputs: found inputs that are not linear in ddz"]),
        ({"inputs": lambda z, dz, ddz: np.array([1.0, 2.0])}, ["Drone.inputs: found a ndarray"]),
        ({"inputs": lambda z, dz: dz}, ["Drone.inputs: found the arguments (z, dz)"]),
        ({"state": lambda z, dz: np.stack([z, dz])}, ["Drone.state: found shape (2, 2)"]),
        ({"state": lambda z, dz: [*z, *dz]}, ["Drone.state: found ["]),
        ({"flat": lambda state: state}, ["Drone.flat: found a ndarray"]),
        ({"flat": lambda state: (state[:2], state[2:] * 2.0)}, ["dz of Drone.flat: found"]),
        ({"flat": lambda state: (state[2:], state[:2])}, ["z of Drone.flat: found"]),
        ({"pose": lambda state: state[:2]}, ["Drone.pose: found shape (2,)", "(3,)"]),
        ({"velocity": lambda state: state[2:]}, ["Drone.velocity: found shape (2,)"]),
        ({"rates": lambda state, thrust: thrust}, ["Drone.rates: found shape (2,)", "(4,)"]),
        ({"rates": lambda state, thrust: state @ thrust}, ["Drone.rates: found ValueError"]),
    ],
)  # fmt: skip
def test_a_vehicle_that_lacks_something_is_named(members, words):
    vehicle = Drone()
    for name, value in members.items():
        setattr(vehicle, name, value)
    refused(lambda: check_vehicle(vehicle), *words)


@pytest.mark.parametrize(
    "name",
    ["position_dimension", "flat_dimension", "thrust_max", "acceleration_scale", "inputs", "state", "flat", "pose",
     "velocity", "rates"],
)  # fmt: skip
def test_a_missing_member_of_a_vehicle_is_named(name):
    have = {key: getattr(VEHICLE, key) for key in dir(VEHICLE) if not key.startswith("_") and key != name}
    vehicle = type("Drone", (), {})()
    for key, value in have.items():
        setattr(vehicle, key, value)
    refused(lambda: check_vehicle(vehicle), f"Drone.{name}: found nothing of this name")
    if name in ("position_dimension", "flat_dimension", "thrust_max", "acceleration_scale", "inputs"):
        refused(lambda: TrajectoryProblem(vehicle, 5, 0.2), f"Drone.{name}: found nothing of this name")
    else:
        check_flatness(vehicle)  # the toolbox alone needs no forward dynamics


def test_the_gap_between_forward_and_inverse_dynamics_is_found():
    for vehicle in (PLANAR, SPATIAL, VEHICLE):
        assert dynamics_gap(vehicle) < 1e-6
    # below v_0 the unicycle's map is bounded on purpose
    assert dynamics_gap(Unicycle()) < 0.1
    wrong = Drone(drag=1.0)
    wrong.rates = lambda state, thrust: PlanarPointMass(mass=2.0, drag=1.0).rates(state, thrust)
    assert dynamics_gap(wrong) > 0.01


class Line:
    """A target as it should be."""

    dimension = 2

    def position(self, times):
        return np.stack([np.asarray(times, dtype=float), np.zeros_like(times, dtype=float)], axis=-1)


@pytest.mark.parametrize(
    ("members", "words"),
    [
        ({"dimension": None}, ["Line.dimension: found nothing"]),
        ({"dimension": 3}, ["Line.dimension: found 3; allowed: 2, the problem's"]),
        ({"position": None}, ["Line.position: found nothing"]),
        ({"position": lambda self: np.zeros(2)}, ["Line.position: found the arguments ()"]),
        ({"position": lambda self, times: np.zeros(2)}, ["Line.position at 2 times: found shape (2,)", "(2, 2)"]),
        ({"position": lambda self, times: np.zeros((2, 2))}, ["Line.position at 1 time: found shape (2, 2)", "(2,)"]),
        ({"position": lambda self, times: np.full((*np.shape(times), 2), np.nan)}, ["Line.position at 2", "finite"]),
        ({"position": lambda self, times: times[5]}, ["Line.position: found IndexError"]),
        ({"position": lambda self, times: [[0.0, 0.0], [1.0, 0.0]]}, ["Line.position at 2 times: found [["]),
    ],
)  # fmt: skip
def test_a_target_that_lacks_something_is_named(members, words):
    check_target(Line(), 2)
    refused(lambda: check_target(variant(Line, **members), 2), *words)
