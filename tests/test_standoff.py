"""The standoff: kept to each hypothesis of where the target is, and to wherever it can be until the next plan."""

import casadi as ca
import numpy as np
import pytest

from gbt_ocp.experiments.build.limits import with_limits
from gbt_ocp.experiments.build.loop import build_loop, build_problem, build_vehicle
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull
from gbt_ocp.guidance.planned import PlannedMotion
from gbt_ocp.guidance.standoff import PLACES, RangeOfHypotheses, ReachableRange, counted
from gbt_ocp.guidance.startup import planned_of
from gbt_ocp.guidance.target_limits import RangeLimits
from gbt_ocp.models.bearings import DesiredBearing, rotate_bearing, unit_bearing
from gbt_ocp.models.vehicles import PlanarPointMass
from gbt_ocp.ocp import ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.codegen.problem_source import from_moments
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.tracking.protocol import Forecast, WeighedForecasts, mixed

POINT = PlanarPointMass(1.0, 0.0, (1.0, 1.0))


def at(place):
    return FlatPoint(place, ca.DM.zeros(2), ca.DM.zeros(2))


@pytest.mark.parametrize("first", [0, 3])
def test_no_motion_within_the_targets_speed_comes_nearer_within_a_piece(first):
    """Brute force: motions that leave the forecast at a knot in any direction, at any speed up to the largest."""
    period, fastest, nearest, pieces = 2.0, 1.5, 10.0, 5
    limit = ReachableRange(RangeLimits(2, nearest, confidence=0.5), fastest * period)
    knots = np.arange(pieces + 1)[:, None]
    mean = np.array([30.0, 5.0]) + knots * period * np.array([-0.6, 0.8])
    certain = np.zeros((pieces + 1, 2, 2))
    bound = limit.bind(pieces, {"present": Forecast(mean[0], certain[0]), "forecast": Forecast(mean[1:], certain[1:])})
    rng = np.random.default_rng(first)
    place, numbers = ca.SX.sym("place", 2), {name: ca.SX.sym(name, *shape) for name, shape in limit.shapes.items()}
    value = ca.Function("value", [place, *numbers.values()], [limit.value(at(place), numbers)])
    # the first piece is left at once; a later one after the forecast was followed to the knot before
    since = mean[max(first - 1, 0)]
    for part in (0.2, 0.7, 1.0) if first == 0 else (1.0,):
        now = [(1.0 - part) * both[0] + part * both[1] for both in (bound[name][[0, 1]] for name in numbers)]
        angle = rng.uniform(-np.pi, np.pi, 40)
        sight = np.stack([np.cos(angle), np.sin(angle)])
        near, far = np.zeros(40), np.full(40, 60.0)
        for _ in range(50):  # the nearest place on each line of sight at which the limit is kept
            middle = 0.5 * (near + far)
            places = since[:, None] - middle * sight
            given = now if first == 0 else [bound[name][first] for name in numbers]
            kept = np.asarray(value.map(40)(places, *(np.tile(one, (1, 40)) for one in given))).ravel() >= 1.0
            near, far = np.where(kept, near, middle), np.where(kept, middle, far)
        turn, speed = rng.uniform(-np.pi, np.pi, (2000, 40)), fastest * rng.uniform(0.0, 1.0, (2000, 40))
        turn[-1], speed[-1] = angle + np.pi, fastest  # straight at the vehicle
        moved = since + part * period * speed[..., None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        distances = np.linalg.norm(moved - (since - (far * sight).T), axis=-1)
        assert distances.min() >= nearest - 1e-4
        np.testing.assert_allclose(distances.min(axis=0), nearest, atol=1e-3)


def two_places(pieces, weights=(0.9, 0.1)):
    """A target that is on the left, or else on the right, and the moments of both together."""
    means = np.tile(np.array([[[-8.0, 14.0]], [[8.0, 14.0]]]), (1, pieces + 1, 1))
    covariances = np.tile(0.01 * np.eye(2), (2, pieces + 1, 1, 1))
    found = WeighedForecasts(np.array(weights), means, covariances)
    mean, covariance = mixed(np.tile(found.weights[:, None], pieces + 1), means, covariances)
    return found, {
        "present": Forecast(mean[0], covariance[0]),
        "forecast": Forecast(mean[1:], covariance[1:]),
        "desired": np.tile([-1.0, 0.0], (pieces, 1)),
        "hypotheses": found,
    }


def towards(limit, pieces=8):
    problem = TrajectoryProblem(POINT, pieces, 1.0).maximize(BearingSimilarity(2)).maximize(RangePull(2, 0.1, 1.0))
    return problem.subject_to(ThrustLimit(POINT), nodes=1).subject_to(limit, nodes=3)


@pytest.mark.parametrize("solver", ["compiled", "ipopt"])
def test_the_distance_is_kept_from_each_hypothesis_and_not_from_their_moments(solver):
    found, data = two_places(8)
    limits = RangeLimits(2, nearest=9.0, confidence=0.9)
    start = np.array([[26.0, 14.0], [-1.0, 0.0]])  # to the right of both, and coming
    least = {}
    for name, limit in (("moments", limits), ("each", RangeOfHypotheses(limits, 0.05))):
        plan = towards(limit).compile(solver).solve(start, **data)
        assert plan.status == "solved"
        path = plan.trajectory.sample(40)[0].reshape(-1, 2)
        least[name] = min(np.linalg.norm(path - mean[0], axis=1).min() for mean in found.means)
    assert least["moments"] < 8.0
    assert 9.0 < least["each"] < 9.3


def test_an_unlikely_hypothesis_does_not_count():
    _, data = two_places(8, (0.97, 0.03))
    limit = RangeOfHypotheses(RangeLimits(2, nearest=9.0), 0.05)
    bound = limit.bind(8, data)
    np.testing.assert_array_equal(bound["mean"], np.tile([[-8.0], [14.0]], (9, 1, PLACES)))
    both = RangeOfHypotheses(RangeLimits(2, nearest=9.0), 0.02).bind(8, data)
    assert set(both["mean"][0, 0]) == {-8.0, 8.0}


def test_hypotheses_beyond_the_places_are_taken_together():
    rng = np.random.default_rng(0)
    weights = np.array([0.1, 0.3, 0.05, 0.25, 0.14, 0.16])
    roots = rng.normal(size=(6, 3, 2, 2))
    given = WeighedForecasts(weights, rng.normal(size=(6, 3, 2)), roots @ np.swapaxes(roots, -1, -2))
    found = counted(given, 0.09)
    np.testing.assert_allclose(found.weights, [0.3, 0.25, 0.16, 0.24])
    np.testing.assert_array_equal(found.means[:3], given.means[[1, 3, 5]])
    # the rest by sampling
    draws = np.concatenate(
        [
            rng.multivariate_normal(given.means[one, 2], given.covariances[one, 2], int(4e6 * weights[one]))
            for one in (4, 0)
        ]
    )
    np.testing.assert_allclose(found.means[3, 2], draws.mean(axis=0), atol=0.01)
    np.testing.assert_allclose(found.covariances[3, 2], np.cov(draws.T), rtol=0.02, atol=0.02)
    few = counted(given, 0.2)
    np.testing.assert_allclose(few.weights, [0.3, 0.25, 0.0, 0.0])
    np.testing.assert_array_equal(few.means, given.means[[1, 3, 1, 1]])


@pytest.mark.parametrize(
    "make",
    [
        lambda: ReachableRange(RangeLimits(2, 3.0), -1.0),
        lambda: RangeOfHypotheses(RangeLimits(2, 3.0), 0.0),
        lambda: RangeOfHypotheses(RangeLimits(2, 3.0), 0.1, -1.0),
    ],
)
def test_standoffs_that_mean_nothing_are_refused(make):
    with pytest.raises(ValueError, match=r"found .*; allowed:"):
        make()


@pytest.mark.parametrize("solver", ["compiled", "ipopt"])
@pytest.mark.parametrize("wrap", [lambda limits: limits, lambda limits: RangeOfHypotheses(limits, 0.1, 0.5)])
def test_whoever_is_inside_leaves_as_fast_as_the_thrust_allows(solver, wrap):
    """Away from the target along an axis, a double integrator is out after sqrt(2 s/a) at best."""
    limit = wrap(RangeLimits(2, nearest=30.0, confidence=0.5))
    pieces = 10
    mean, covariance = np.zeros((pieces + 1, 2)), np.tile(1e-8 * np.eye(2), (pieces + 1, 1, 1))
    data = {"present": Forecast(mean[0], covariance[0]), "forecast": Forecast(mean[1:], covariance[1:])}
    start = np.array([[18.0, 0.0], [0.0, 0.5]])
    plan = towards(limit, pieces).compile(solver).solve(start, **data, desired=np.tile([0.0, 1.0], (pieces, 1)))
    assert set(plan.given_up) == {"range"}
    assert plan.broken_at_start["range"] == pytest.approx(0.4, abs=0.01)
    distance = np.linalg.norm(plan.trajectory.sample(11)[0][:4, :, :2].reshape(-1, 2), axis=1)
    times = (np.arange(4)[:, None] + np.linspace(0.0, 1.0, 11)).ravel()
    assert np.all(np.diff(distance) > -1e-9)
    # full thrust along the line of sight, and on both axes
    assert np.all(distance >= 18.0 + 0.49 * times**2 - 0.02)
    assert np.all(distance <= np.hypot(18.0 + 0.5 * times**2, 0.5 * times + 0.5 * times**2) + 0.02)


def bearings(dimension, count=400):
    rng = np.random.default_rng(5)
    t = 0.1 * np.arange(count)
    own = np.stack([30.0 * np.sin(0.1 * t), -30.0 * np.cos(0.1 * t), np.zeros_like(t)], axis=-1)[:, :dimension]
    target = np.stack([0.5 * t, 5.0 + 0.2 * t, -10.0 + 0.0 * t], axis=-1)[:, :dimension]
    noise = np.deg2rad(1.0) * rng.normal(size=(count, dimension - 1))
    return t, rotate_bearing(unit_bearing(target, own), noise), own


@pytest.mark.parametrize(("kind", "dimension"), [("motion_gp", 3), ("mixture", 2)])
@pytest.mark.long
def test_the_hypotheses_of_a_tracker_make_up_its_forecast(dimension, kind):
    keys = [f"tracker.kind={kind}", "tracker.engine=numpy", "planner.pieces=2"]
    loop, _ = build_loop(load_config(f"sea{dimension}d", keys))
    several = 0
    for k, (time, bearing, own) in enumerate(zip(*bearings(dimension), strict=True)):
        loop.tracker.update(time, bearing, own)
        if k % 50 == 7:
            ahead = time + np.arange(4.0)
            found = loop.tracker.hypotheses_at(ahead)
            several += len(found.weights) > 1
            assert found.weights.sum() == pytest.approx(1.0)
            mean, covariance = mixed(np.tile(found.weights[:, None], 4), found.means, found.covariances)
            forecast = loop.tracker.predict(ahead)
            if kind == "mixture" and not loop.tracker._counted[0]:
                continue  # until its members tell the range, it is mixed at their median
            np.testing.assert_allclose(mean, forecast.mean, atol=1e-8)
            # interpolated in time before the hypotheses are mixed, or after
            np.testing.assert_allclose(covariance, forecast.covariance, atol=0.01 * np.abs(covariance).max())
    assert several


def test_plans_are_given_the_hypotheses_in_the_frame_of_the_forecast():
    """In moving water the forecast drifts, and with it whatever the tracker says over ground."""
    found, data = two_places(3)
    drift = np.arange(4.0)[:, None] * np.array([-0.3, 0.1])
    mean, covariance = mixed(np.tile(found.weights[:, None], 4), found.means, found.covariances)
    asked = []
    planner = towards(RangeOfHypotheses(RangeLimits(2, nearest=3.0), 0.05), 3).compile("ipopt")
    solve = planner.solve
    planner.solve = lambda state, **given: asked.append(given) or solve(state, **given)
    law = PlannedMotion(planner, DesiredBearing(2, 0.1), hypotheses=lambda times: found)
    law.decide(0.0, np.zeros((2, 2)), Forecast(mean + drift, covariance))
    np.testing.assert_allclose(asked[0]["hypotheses"].means, found.means + drift, atol=1e-12)
    assert data["hypotheses"] is found


def limit_of(*changes):
    configuration = load_config("sea2d", list(changes))
    problem = build_problem(configuration, build_vehicle(configuration))
    (limit,) = [one.constraint for one in problem.hard if getattr(one.constraint, "name", "") == "range"]
    return limit, problem


def test_the_keys_make_the_limits():
    limit, problem = limit_of("limits.range.target_speed_max=1.5", "limits.range.hypothesis_probability=null")
    assert isinstance(limit, ReachableRange)
    assert limit.reach == pytest.approx(1.5)
    assert from_moments(problem), "in C from the moments of a forecast"
    limit, problem = limit_of("limits.range.hypothesis_probability=0.1", "limits.range.target_speed_max=null")
    assert isinstance(limit, RangeOfHypotheses)
    assert (limit.probability, limit.reach) == (0.1, 0.0)
    assert not from_moments(problem), "in C from numbers that the caller binds"
    with pytest.raises(ConfigurationError, match=r"limits.range.hypothesis_probability: found 1"):
        load_config("sea2d", ["limits.range.hypothesis_probability=1"])
    plain = load_config("sea2d", ["limits.range.target_speed_max=1.5", "limits.range.hypothesis_probability=0.1"])
    posed = TrajectoryProblem(POINT, 4, 2.0).maximize(BearingSimilarity(2))
    (both,) = [
        one.constraint
        for one in with_limits(posed, plain.limits.model_copy(update={"yaw_rate_deg": None})).hard
        if isinstance(one.constraint, RangeOfHypotheses)
    ]
    assert both.reach == pytest.approx(3.0)


def test_a_tracker_without_hypotheses_is_refused_by_name():
    changes = ["limits.range.hypothesis_probability=0.1", "tracker.kind=plkf"]
    with pytest.raises(ValueError, match=r"limits.range.hypothesis_probability: found 0.1 beside tracker.kind plkf"):
        build_loop(load_config("sea2d", changes))
    loop, _ = build_loop(load_config("sea2d", changes[:1]))
    assert planned_of(loop.guidance) is not None
