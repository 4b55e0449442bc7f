"""The reference solver: both ways of telling IPOPT the penalty, and what it answers to bad input."""

from typing import NamedTuple

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize

from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull
from gbt_ocp.models.fossen import FALCON_2D, FossenVehicle
from gbt_ocp.ocp import ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.solvers.ipopt import FILES, IpoptSolver, ipopt_function
from gbt_ocp.ocp.transcription import transcribe


class Moments(NamedTuple):
    mean: np.ndarray
    covariance: np.ndarray


def penalised_problem(pieces=3):
    vehicle = FossenVehicle(FALCON_2D, [5000.0, 5000.0, 1500.0])
    problem = TrajectoryProblem(vehicle, pieces, 0.1).maximize(BearingSimilarity(2)).maximize(RangePull(2, 0.2, 1.0))
    return problem.subject_to_penalty(ThrustLimit(vehicle, 0.98), nodes=4)


def random_instance(rng, problem):
    pieces = problem.pieces
    start = np.array([[*rng.uniform(-3, 3, 2), 0.3], [*rng.normal(size=2), 0.4 * rng.normal()]])
    root = 0.2 * rng.normal(size=(2, 2))
    moments = Moments(rng.normal(size=2) + np.zeros((pieces, 2)), np.tile(root @ root.T, (pieces, 1, 1)))
    angle = rng.uniform(0, 6.28) + 0.6 * np.arange(pieces)
    desired = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return start, Binding(problem).objective_parameters({"forecast": moments, "desired": desired})


@pytest.mark.parametrize("seed", range(5))
def test_both_forms_of_the_penalty_have_the_same_minimisers(seed):
    problem = penalised_problem()
    elastic, printed = IpoptSolver(problem, {}), IpoptSolver(problem, {"penalty": "printed", "max_iter": 2000})
    start, parameters = random_instance(np.random.default_rng(seed), problem)
    guess = np.zeros((3, 3))
    first = elastic.solve(start, parameters, guess, cold=True)
    assert first.solved
    # from the elastic solution the printed form must find that it is already there
    second = printed.solve(start, parameters, first.variables, cold=False)
    assert second.solved
    np.testing.assert_allclose(second.variables, first.variables, atol=2e-3)


def test_elastic_form_solves_the_penalty_as_scipy_minimises_it():
    problem = penalised_problem(pieces=1)
    start, parameters = random_instance(np.random.default_rng(11), problem)
    program, binding = transcribe(problem), Binding(problem)
    value = ca.Function("value", [program.variables, program.parameters], [program.nlp["f"]])
    vector = binding.vector(start, parameters, [(0.01, 1000.0)], 0.0)
    found = IpoptSolver(problem, {}).solve(start, parameters, np.zeros((1, 3)), cold=True)
    # a simplex search on the printed penalty: no derivatives, no reformulation
    reference = minimize(
        lambda u: float(value(u, vector)),
        found.variables.ravel() + 0.05,
        method="Nelder-Mead",
        options={"xatol": 1e-9, "fatol": 1e-12, "maxiter": 20000, "maxfev": 20000},
    )
    assert found.solved
    assert float(value(found.variables.ravel(), vector)) <= reference.fun + 1e-6


def test_elastic_form_needs_far_fewer_iterations_than_the_printed_one():
    problem = penalised_problem(pieces=5)
    counts = []
    for options in ({}, {"penalty": "printed"}):
        solver = IpoptSolver(problem, options)
        rng = np.random.default_rng(3)
        total = 0
        for _ in range(5):
            start, parameters = random_instance(rng, problem)
            total += solver.solve(start, parameters, np.zeros((5, 3)), cold=True).iterations
        counts.append(total)
    assert counts[0] < counts[1] / 2


def test_tightening_moves_the_penalty_inwards():
    problem = penalised_problem()
    start, parameters = random_instance(np.random.default_rng(1), problem)
    solver = IpoptSolver(problem, {})
    program = transcribe(problem)
    first = program.excess[: program.excess.numel() // problem.pieces // 2]  # the upper bounds in the first piece
    largest = ca.Function("largest", [program.variables, program.parameters], [ca.mmax(first)])
    vector = Binding(problem).vector(start, parameters, [(0.01, 1000.0)], 0.0)
    loose = solver.solve(start, parameters, np.zeros((3, 3)), cold=True, tightening=0.0)
    tight = solver.solve(start, parameters, np.zeros((3, 3)), cold=True, tightening=0.2)
    assert float(largest(loose.variables.ravel(), vector)) > -0.05
    assert float(largest(tight.variables.ravel(), vector)) < -0.15


def test_unknown_form_of_the_penalty_is_refused():
    with pytest.raises(ValueError, match=r"solver_options\.penalty: found 'magic'; allowed: elastic, printed"):
        IpoptSolver(penalised_problem(), {"penalty": "magic"})


def test_unknown_option_of_ipopt_is_refused_in_one_line():
    with pytest.raises(ValueError, match=r"^solver_options: No such IPOPT option: max_itre$"):
        IpoptSolver(penalised_problem(), {"max_itre": 5})


@pytest.mark.parametrize("name", FILES)
def test_options_that_name_a_file_are_refused_and_exist(name, tmp_path):
    x = ca.MX.sym("x")
    path = tmp_path / "written"
    with pytest.raises(ValueError, match=rf"solver_options\.{name}: found .*written.*; allowed: no option that names"):
        ipopt_function({"x": x, "f": (x - 1.0) ** 2}, {name: str(path)})
    assert not path.exists()
    # the name is IPOPT's own: CasADi knows it
    ca.nlpsol("known", "ipopt", {"x": x, "f": (x - 1.0) ** 2}, {"ipopt": {name: str(path)}})
