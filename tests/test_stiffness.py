"""How narrow and stiff the kink of a penalty is, and the warning of a run."""

import warnings

import numpy as np
import pytest

import gbt_ocp as gbt
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.ocp import ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.stiffness import STALLING, kink_widths, stiffness
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.ocp.transcription import smoothed_hinge


def posed(degree=2, width=0.01, units="normalised", parameters=FALCON_2D, weight=1000.0):
    n = len(parameters.added_mass)
    vehicle = FossenVehicle(parameters, [5000.0] * (n - 1) + [1500.0])
    problem = TrajectoryProblem(vehicle, 3, 0.1, degree)
    limit = ThrustLimit(vehicle, 0.98, units)
    return problem.subject_to_penalty(limit, width=width, weight=weight, nodes=4)


def thrust_at_the_end(problem, endpoints):
    """τ/τ_max at the very end of the trajectory through these endpoints, from rest."""
    size = problem.vehicle.flat_dimension
    trajectory = FlatTrajectory.from_endpoints(problem.period, np.zeros((problem.degree, size)), endpoints)
    point = (values[-1, -1] for values in trajectory.sample(2))
    return np.asarray(problem.vehicle.inputs(*point)).ravel() / problem.vehicle.thrust_max


@pytest.mark.parametrize("parameters", [FALCON_2D, FALCON_3D])
@pytest.mark.parametrize("degree", [2, 3])
def test_moving_an_endpoint_by_the_width_moves_the_thrust_across_the_kink(degree, parameters):
    problem = posed(degree, parameters=parameters)
    widths = kink_widths(problem, problem.penalties[0])
    at_rest = np.zeros((problem.pieces, problem.vehicle.flat_dimension))
    for axis, width in enumerate(widths):
        moved = at_rest.copy()
        share = 1e-3  # small: the drag that the motion brings is no part of it
        moved[-1, axis] = share * width
        change = thrust_at_the_end(problem, moved) - thrust_at_the_end(problem, at_rest)
        assert abs(change[axis]) / share == pytest.approx(2.0 * 0.01, rel=0.02)


def test_the_papers_newtons_make_a_kink_of_a_fifth_of_a_millimetre():
    problem = posed(width=10.0, units="newton")
    assert 1e3 * kink_widths(problem, problem.penalties[0])[:2].min() == pytest.approx(0.17, abs=0.01)


@pytest.mark.parametrize("units", ["normalised", "newton"])
def test_stiffness_is_the_curvature_of_one_node_on_the_kink(units):
    problem = posed(width=40.0 if units == "newton" else 0.02, units=units, weight=7.0)
    penalty = problem.penalties[0]
    unit = 5000.0 if units == "newton" else 1.0

    def cost(x):  # one inner node of the trapezoidal rule, x in units of the limit
        return 7.0 * 0.1 / 4 * smoothed_hinge(x * unit, penalty.width)

    h = 0.1 * penalty.width / unit
    curvature = float(cost(h) - 2.0 * cost(0.0) + cost(-h)) / h**2
    assert stiffness(problem, penalty) == pytest.approx(curvature, rel=1e-6)


SHORT = ["duration_s=0.3", "planner.solver=ipopt", "planner.formulation=penalty"]
PRINTED = "planner.solver_options={penalty: printed}"


def test_a_run_warns_of_a_kink_that_stalls_newtons_method():
    with pytest.warns(RuntimeWarning, match="case2: planner: width 0.01 and weight 1000 .* will stall"):
        result = gbt.run("case2", overrides=[*SHORT, PRINTED])
    (line,) = result.summary["warnings"]
    assert "0.843 mm" in line
    assert f"above {STALLING:g}" in line


@pytest.mark.parametrize(
    "overrides", [[*SHORT, PRINTED, "planner.width=0.3"], SHORT, [*SHORT, "planner.formulation=hard"]]
)
def test_a_run_without_such_a_kink_does_not_warn(overrides):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = gbt.run("case2", overrides=overrides)
    assert result.summary["warnings"] == []
