"""The objective that does not care about the sign of a bearing: its value, its derivatives, and as C."""

import shutil
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from gbt_ocp.experiments.build.loop import build_problem, build_vehicle
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull, sigma_points, sigma_weights
from gbt_ocp.models.bearings import cumulative_bearing_matrix
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.ocp import FlatPoint, ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.ocp.export.folder import write_c
from gbt_ocp.ocp.export.verification import verify_folder
from gbt_ocp.ocp.planner import Planner

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


def moments(mean, size=0.0):
    mean = np.atleast_2d(mean)
    d = mean.shape[1]
    return SimpleNamespace(mean=mean, covariance=np.tile(size**2 * np.eye(d), (len(mean), 1, 1)))


def value(objective, own, data):
    z = ca.SX.sym("z", len(own) + 1)
    bound = {name: ca.DM(values[0]) for name, values in objective.bind(1, data).items()}
    term = objective.value(FlatPoint(z, 0 * z, 0 * z), bound)
    function = ca.Function("f", [z], [term, ca.gradient(term, z)])
    return function(np.append(own, 0.3))


def problem(dimension, form, axial=True):
    vehicle = FossenVehicle(FALCON_2D if dimension == 2 else FALCON_3D, [5000.0] * dimension + [1500.0])
    planned = TrajectoryProblem(vehicle, 5, 0.1).maximize(BearingSimilarity(dimension, axial=axial))
    planned = planned.maximize(RangePull(dimension))
    limit = ThrustLimit(vehicle, 0.98)
    return planned.subject_to(limit, nodes=4) if form == "hard" else planned.subject_to_penalty(limit, nodes=4)


def test_a_bearing_and_its_opposite_are_the_same_to_the_bearing_matrix_and_to_the_axial_objective():
    bearings = np.array([[0.6, 0.8], [0.0, 1.0], [-0.8, 0.6]])
    np.testing.assert_array_equal(cumulative_bearing_matrix(bearings), cumulative_bearing_matrix(-bearings))
    data = {"forecast": moments([0.0, 0.0]), "desired": np.array([[0.6, 0.8]])}
    for own, cosine in (([-3.0, -4.0], 1.0), ([3.0, 4.0], -1.0), ([4.0, -3.0], 0.0), ([-2.0, 0.0], 0.6)):
        assert float(value(BearingSimilarity(2), own, data)[0]) == pytest.approx(cosine, abs=1e-9)
        assert float(value(BearingSimilarity(2, axial=True), own, data)[0]) == pytest.approx(cosine**2, abs=1e-9)


@pytest.mark.parametrize("dimension", [2, 3])
def test_expected_square_agrees_with_random_draws(dimension):
    rng = np.random.default_rng(0)
    mean, desired = np.array([2.0, 1.0, 0.5][:dimension]), np.array([0.6, -0.8, 0.0][:dimension])
    line = mean + 0.15 * rng.standard_normal((200_000, dimension))
    draws = (line @ desired) ** 2 / np.sum(line**2, axis=1)
    data = {"forecast": moments(mean, 0.15), "desired": desired[None]}
    found = float(value(BearingSimilarity(dimension, axial=True), np.zeros(dimension), data)[0])
    assert found == pytest.approx(draws.mean(), abs=4.0 * draws.std() / np.sqrt(200_000) + 2e-4)
    # the square of the expectation is something else
    points, weights = sigma_points(mean, 0.15**2 * np.eye(dimension), 1.0), sigma_weights(dimension, 1.0)
    assert abs((weights @ (points @ desired / np.linalg.norm(points, axis=1))) ** 2 - draws.mean()) > 5e-4


@pytest.mark.parametrize("reach", [0.01, 0.5, 30.0])
def test_gradient_against_central_differences(reach):
    data = {"forecast": moments([reach, 0.3 * reach], 0.2), "desired": np.array([[0.6, -0.8]])}
    objective, own, step = BearingSimilarity(2, axial=True), np.array([0.1, -0.3]), 1e-6
    numeric = [
        float(value(objective, own + step * e, data)[0] - value(objective, own - step * e, data)[0]) for e in np.eye(2)
    ]
    found = np.asarray(value(objective, own, data)[1]).ravel()
    np.testing.assert_allclose(found, [*(np.array(numeric) / (2.0 * step)), 0.0], atol=1e-7)


@pytest.mark.slow
@needs_compiler
@pytest.mark.skipif(shutil.which("make") is None, reason="no make")
def test_the_generated_step_from_the_moments_agrees_with_python(tmp_path):
    found = verify_folder(
        write_c(Planner(problem(3, "penalty"), "compiled"), tmp_path / "planner"), flags="-O2 -Werror"
    )
    assert found.faults == ()
    assert found.difference < 1e-12


@needs_compiler
def test_both_solvers_find_the_same_plan_and_stay_on_the_side_they_are_on():
    """The desired bearing is +x and the vehicle has the target at -x: signed it has to go around, axial it stays."""
    start = np.zeros((2, 3))
    start[0, :2] = [1.0, 0.2]
    data = {"forecast": moments(np.zeros((5, 2)), 0.1), "desired": np.tile([1.0, 0.0], (5, 1))}
    plans = {}
    for axial in (False, True):
        planners = [problem(2, "hard", axial).compile(solver) for solver in ("compiled", "ipopt")]
        compiled, ipopt = (planner.solve(start, **data) for planner in planners)
        assert compiled.status == ipopt.status == "solved"
        assert compiled.objective == pytest.approx(ipopt.objective, abs=1e-3)
        plans[axial] = compiled
    assert plans[True].objective > 4.5
    assert plans[False].objective < 0.0
    assert plans[True].endpoints[-1, 0] > 0.5


@pytest.mark.parametrize("similarity", ["signed", "axial"])
def test_the_configuration_chooses(similarity):
    configuration = load_config("case1", overrides=[f"planner.similarity={similarity}"])
    first = build_problem(configuration, build_vehicle(configuration)).objectives[0]
    assert isinstance(first, BearingSimilarity)
    assert first.axial == (similarity == "axial")
