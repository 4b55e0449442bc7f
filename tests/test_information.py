"""Objectives of all bearings together: against brute force, finite differences, and the tracker's own posterior."""

import itertools
from typing import ClassVar

import casadi as ca
import numpy as np
import pytest

from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.run import run
from gbt_ocp.guidance.information import (
    CRITERIA,
    FisherInformation,
    NearInformation,
    smooth_largest,
    smooth_smallest,
)
from gbt_ocp.guidance.past import PastBearings
from gbt_ocp.guidance.path_information import PosteriorVariance
from gbt_ocp.models.bearings import condition_number, cumulative_bearing_matrix, unit_bearing
from gbt_ocp.models.vehicles import PlanarPointMass
from gbt_ocp.ocp import FlatPoint, ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.codegen.expressions import NotGenerableError
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker
from gbt_ocp.tracking.protocol import Forecast, JointForecast

both_dimensions = pytest.mark.parametrize("dimension", [2, 3])
REFERENCE = 5.0


def setting(dimension, pieces, seed=0):
    """Own positions, a forecast, and the information of bearings already taken."""
    rng = np.random.default_rng(seed)
    own = rng.normal(0.0, 2.0, (pieces, dimension))
    mean = np.array([8.0, 3.0, 2.0][:dimension]) + 0.3 * np.arange(pieces)[:, None]
    lines = rng.standard_normal((4, dimension))
    sights = lines / np.linalg.norm(lines, axis=1, keepdims=True)
    past = sum(0.3 * (np.eye(dimension) - np.outer(g, g)) for g in sights)
    root = rng.standard_normal((pieces * dimension,) * 2)
    joint = JointForecast((root @ root.T).reshape(pieces, dimension, pieces, dimension), 0.01, 0.02**2)
    forecast = Forecast(mean, np.tile(np.eye(dimension), (pieces, 1, 1)))
    return own, {"forecast": forecast, "past": past, "joint": joint}


def objectives(dimension, pieces):
    return [*(FisherInformation(dimension, name, REFERENCE) for name in CRITERIA), PosteriorVariance(dimension, pieces)]


def function(objective, data, pieces):
    """Own positions, one a row, stacked -> the objective."""
    bound = objective.bind(pieces, data)
    d = objective.dimension
    flat = ca.SX.sym("own", pieces * d)
    points = [FlatPoint(flat[k * d : (k + 1) * d], ca.SX.zeros(d), ca.SX.zeros(d)) for k in range(pieces)]
    given = [{name: ca.DM(values[k]) for name, values in bound.items()} for k in range(pieces)]
    sums = sum(objective.accumulated(point, numbers) for point, numbers in zip(points, given, strict=True))
    total = objective.of_sums(sums)
    return ca.Function("f", [flat], [total, ca.gradient(total, flat), ca.hessian(total, flat)[0]])


def information(own, mean, past, *, weighed=True):
    matrix = past + 1e-3 * np.eye(own.shape[1])
    for place, target in zip(own, mean, strict=True):
        line = target - place
        r = np.linalg.norm(line)
        weight = REFERENCE**2 / (r**2 + (0.1 * REFERENCE) ** 2) if weighed else 1.0
        matrix = matrix + weight * (np.eye(len(line)) - np.outer(line, line) / r**2)
    return matrix


@both_dimensions
def test_the_criteria_are_those_of_the_information_matrix(dimension):
    pieces = 3
    own, data = setting(dimension, pieces)
    matrix = information(own, data["forecast"].mean, data["past"])
    plain = information(own, data["forecast"].mean, data["past"], weighed=False)
    values = np.linalg.eigvalsh(matrix)
    found = {o.criterion: float(function(o, data, pieces)(own.ravel())[0]) for o in objectives(dimension, pieces)[:-1]}
    assert found["logdet"] == pytest.approx(pieces / dimension * np.linalg.slogdet(matrix / pieces)[1])
    assert found["trace"] == pytest.approx(np.trace(matrix) / dimension)
    assert dimension ** (-1.0 / 16.0) * values[0] <= found["min_eigenvalue"] * (1.0 + 1e-9)
    assert found["min_eigenvalue"] <= values[0] * (1.0 + 1e-9)
    exact = -pieces * np.log(condition_number(plain))
    assert exact - pieces * np.log(dimension) / 8.0 <= found["condition_number"] <= exact + 1e-9


@both_dimensions
def test_the_trace_of_single_bearings_is_the_trace_of_all_but_for_a_constant(dimension):
    own, data = setting(dimension, 3)
    joint = float(function(FisherInformation(dimension, "trace", REFERENCE), data, 3)(own.ravel())[0])
    near = NearInformation(dimension, REFERENCE)
    bound = near.bind(3, data)
    single = sum(
        float(near.value(FlatPoint(ca.DM(own[k]), None, None), {"mean": ca.DM(bound["mean"][k])})) for k in range(3)
    )
    constant = np.trace(data["past"] + 1e-3 * np.eye(dimension)) / dimension
    assert joint == pytest.approx(single + constant)


def test_smooth_extremes_bound_the_true_ones_and_are_smooth_where_they_meet():
    rng = np.random.default_rng(3)
    for size in (2, 3):
        for _ in range(20):
            root = rng.standard_normal((size, size))
            matrix = root @ root.T + 1e-3 * np.eye(size)
            values = np.linalg.eigvalsh(matrix)
            large, small = float(smooth_largest(ca.DM(matrix))), float(smooth_smallest(ca.DM(matrix)))
            assert values[-1] <= large * (1 + 1e-9) <= size ** (1 / 16) * values[-1] * (1 + 2e-9)
            assert size ** (-1 / 16) * values[0] * (1 - 1e-6) <= small <= values[0] * (1 + 1e-6)
    x = ca.SX.sym("x", 2)
    equal = ca.diag(1.0 + x)
    slope = ca.Function("g", [x], [ca.gradient(smooth_smallest(equal), x)])
    assert np.all(np.isfinite(np.asarray(slope(np.zeros(2)))))


@both_dimensions
@pytest.mark.parametrize("number", range(5))
def test_derivatives_against_central_differences(dimension, number):
    pieces, step = 3, 1e-5
    own, data = setting(dimension, pieces, seed=1)
    f = function(objectives(dimension, pieces)[number], data, pieces)
    at = own.ravel()
    _, gradient, hessian = (np.asarray(part) for part in f(at))
    shifts = step * np.eye(len(at))
    slopes = [(float(f(at + s)[0]) - float(f(at - s)[0])) / (2.0 * step) for s in shifts]
    np.testing.assert_allclose(gradient.ravel(), slopes, rtol=1e-6, atol=1e-7)
    curves = [(np.asarray(f(at + s)[1]) - np.asarray(f(at - s)[1])).ravel() / (2.0 * step) for s in shifts]
    np.testing.assert_allclose(hessian, np.array(curves), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("number", [0, 2, 3, 4])
def test_a_plan_of_one_piece_is_the_best_of_all(number):
    """Brute force over the reachable endpoints of a point mass."""
    vehicle = PlanarPointMass(1.0, 0.0, (1.0, 1.0))
    objective = [*(FisherInformation(2, name, REFERENCE) for name in CRITERIA), PosteriorVariance(2, 1)][number]
    _, data = setting(2, 1, seed=4)
    data |= {
        "past": np.diag([0.9, 0.2]),
        "joint": JointForecast(np.array([[4.0, 1.0], [1.0, 9.0]]).reshape(1, 2, 1, 2), 0.01, 1e-3),
    }
    problem = TrajectoryProblem(vehicle, 1, 2.0).maximize(objective).subject_to(ThrustLimit(vehicle, gamma=1.0))
    start = np.array([[0.0, 0.0], [0.3, -0.2]])
    plan = problem.compile("ipopt").solve(start, **data)
    assert plan.solved
    f = function(objective, data, 1)
    thrust = np.linspace(-1.0, 1.0, 81)
    ends = [start[0] + 2.0 * start[1] + 2.0 * np.array([a, b]) for a in thrust for b in thrust]
    best = max(float(f(end)[0]) for end in ends)
    assert plan.objective == pytest.approx(best, abs=2e-3 * max(1.0, abs(best)))


@pytest.mark.parametrize(("dimension", "pieces", "within"), [(2, 3, 1e-6), (2, 4, 5e-4), (3, 2, 1e-6), (3, 4, 0.05)])
def test_the_planned_variance_is_the_posterior_after_those_bearings(dimension, pieces, within):
    """The tracker itself, conditioned on the bearings that were only planned: whatever they read, the same variance."""

    def make():
        return GaussianProcessTracker(dimension, window=40, length_scale=4.0, amplitude=5.0, nugget=1e-4)

    rng = np.random.default_rng(5)
    period = 0.5
    tracker = make()
    taken = []
    for k in range(6):
        own = rng.normal(0.0, 1.0, dimension)
        target = np.array([6.0 + 0.2 * k, 2.0, 1.0][:dimension])
        taken.append((period * k, unit_bearing(target, own), own))
    for sample in taken:
        tracker.update(*sample)
    times = period * np.arange(6, 6 + pieces)
    forecast = tracker.predict(times)
    own = rng.normal(0.0, 1.0, (pieces, dimension))
    data = {"forecast": forecast, "joint": tracker.joint(times)}
    found = float(function(PosteriorVariance(dimension, pieces), data, pieces)(own.ravel())[0])
    after = make()
    for sample in [*taken, *zip(times, unit_bearing(forecast.mean, own), own, strict=True)]:
        after.update(*sample)
    variance = np.trace(after.predict(times[-1:]).covariance[0])
    # all that the path can do are its coordinates, or 6 of 8 and of 12
    assert np.exp(-2.0 / pieces * found) == pytest.approx(variance, rel=within)
    marginals = np.einsum("kikj->kij", data["joint"].covariance)
    np.testing.assert_allclose(marginals, forecast.covariance, rtol=1e-9, atol=1e-10)


def test_past_bearings_count_by_range_and_are_forgotten():
    past = PastBearings(2, 10.0, 0.1, FisherInformation(2, "logdet", REFERENCE).weight)
    past.add(0.0, [1.0, 0.0], 5.0)
    past.add(10.5, [0.0, 1.0], 10.0)
    np.testing.assert_allclose(past.information, 0.1 * np.diag([25.0 / 100.25, 0.0]))
    bearings = np.array([[1.0, 0.0], [0.6, 0.8]])
    counted = PastBearings(2, 10.0, 1.0, FisherInformation(2, "condition_number").weight)
    for k, bearing in enumerate(bearings):
        counted.add(float(k), bearing, 7.0 + k)
    np.testing.assert_allclose(counted.information, cumulative_bearing_matrix(bearings))


class Spread:
    """Product of the distances between neighbouring endpoints."""

    shapes: ClassVar = {}

    def total(self, points, parameters):
        return sum(ca.log(1.0 + ca.sumsqr(a.z - b.z)) for a, b in itertools.pairwise(points))

    def bind(self, pieces, data):
        return {}


class Turning:
    """A sum that reads accelerations."""

    shapes: ClassVar = {}

    def accumulated(self, point, parameters):
        return point.ddz[0] * point.z[1]

    def of_sums(self, sums):
        return -(sums**2)

    def bind(self, pieces, data):
        return {}


def test_the_compiled_solver_says_what_it_does_not_take():
    vehicle = PlanarPointMass()
    for term, said in ((Spread(), "Spread couples them"), (Turning(), "sums of an objective that depend on more")):
        problem = TrajectoryProblem(vehicle, 2, 1.0).maximize(term).subject_to(ThrustLimit(vehicle))
        with pytest.raises(NotGenerableError, match=said):
            problem.compile("compiled")
        assert problem.compile("ipopt").solve(np.ones((2, 2))).solved
    near = TrajectoryProblem(vehicle, 2, 1.0).maximize(NearInformation(2, 5.0)).subject_to(ThrustLimit(vehicle))
    _, data = setting(2, 2)
    plans = [near.compile(name).solve(np.zeros((2, 2)), data["forecast"]) for name in ("ipopt", "compiled")]
    assert plans[1].objective == pytest.approx(plans[0].objective, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("objective", ["fisher_logdet", "posterior_variance", "condition_number"])
def test_a_closed_loop_with_another_objective_runs(objective):
    result = run(
        {
            "problem": "case3",
            "duration_s": 2.0,
            "planner": {"objective": objective, "solver": "ipopt", "formulation": "hard"},
        }
    )
    assert result.summary["solver_success_rate"] > 0.5
    assert result.summary["violation_max"] == 0.0
    assert np.isfinite(result.history.condition_number[-1])
    assert np.all(np.isfinite(result.history.objective[result.history.planned]))


def test_the_variance_needs_a_tracker_that_is_one_process():
    with pytest.raises(
        ValueError, match=r"planner\.objective: found posterior_variance; allowed: beside tracker\.kind gp"
    ):
        build_loop(
            load_config(
                {
                    "problem": "case3",
                    "planner": {"objective": "posterior_variance", "solver": "ipopt"},
                    "tracker": {"kind": "plkf"},
                }
            )
        )
    with pytest.raises(ConfigurationError, match=r"planner\.objective: found"):
        load_config({"problem": "case3", "planner": {"objective": "entropy"}})
