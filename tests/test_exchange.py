"""Nodes added where a limit is broken between them."""

import casadi as ca
import numpy as np
import pytest

from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull
from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.models.fossen import FALCON_2D, FossenVehicle
from gbt_ocp.ocp import ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.solvers.ipopt import IpoptSolver
from gbt_ocp.ocp.trajectory import FlatTrajectory, flat_point, propagate
from gbt_ocp.ocp.transcription import input_scale
from gbt_ocp.studies.limits.exchange import BETWEEN_NODES, DoublingCompiledSolver, ExchangeIpoptSolver
from gbt_ocp.tracking.protocol import Forecast

PIECES, PERIOD = 5, 0.1
LIMIT = np.array([5000.0, 5000.0, 1500.0])


@pytest.fixture(scope="module")
def problem():
    vehicle = FossenVehicle(FALCON_2D, LIMIT)
    problem = TrajectoryProblem(vehicle, PIECES, PERIOD).maximize(BearingSimilarity(2)).maximize(RangePull(2))
    return problem.subject_to(ThrustLimit(vehicle, 1.0), nodes=1)


def drawn(problem, seed):
    rng = np.random.default_rng(seed)
    start = np.zeros((2, 3))
    start[0, :2] = rng.uniform(-5.0, 5.0, 2)
    start[1] = rng.normal(size=3) * [1.0, 1.0, 0.5]
    ahead = PERIOD * np.arange(1, PIECES + 1)
    mean = rng.normal(size=2) + ahead[:, None] * rng.normal(size=2)
    data = {
        "forecast": Forecast(mean, np.tile(0.04 * np.eye(2), (PIECES, 1, 1))),
        "desired": DesiredBearing(2, 2.0 * np.pi)(seed + ahead),
    }
    return start, Binding(problem).objective_parameters(data)


def excess(problem, start, variables):
    """Largest |τ|/τ_max - 1 on a grid five times as fine as the solver's, by the vehicle's own dynamics."""
    trajectory = FlatTrajectory(PERIOD, start, variables * input_scale(problem))
    points = [
        flat_point(propagate(list(knot), [top], s))
        for knot, top in zip(trajectory.knots[:-1], trajectory.top, strict=True)
        for s in np.linspace(0.0, PERIOD, 501)
    ]
    flat = [ca.SX.sym(name, 3) for name in ("z", "dz", "ddz")]
    thrust = ca.Function("thrust", flat, [problem.vehicle.inputs(*flat)])
    found = np.asarray(thrust(*(np.stack(order, axis=1) for order in zip(*points, strict=True))))
    return float(np.max(np.abs(found) / LIMIT[:, None])) - 1.0


SEEDS = range(4)


@pytest.mark.parametrize("solver", [ExchangeIpoptSolver, DoublingCompiledSolver])
def test_limits_that_nodes_alone_break_are_kept(problem, solver):
    plain, added = IpoptSolver(problem, {}), solver(problem)
    broken = 0
    for seed in SEEDS:
        start, parameters = drawn(problem, seed)
        guess = np.zeros((PIECES, 3))
        alone = plain.solve(start, parameters, guess, cold=True)
        found = added.solve(start, parameters, guess, cold=True)
        assert alone.solved
        broken += excess(problem, start, alone.variables) > 1e-4
        if found.solved:
            assert excess(problem, start, found.variables) < 1e-5
        else:
            assert found.status == BETWEEN_NODES
        assert found.solved or solver is DoublingCompiledSolver  # whose nodes touch the full limit
        assert found.iterations >= 0
    assert broken >= 2


def test_added_nodes_lie_on_the_trajectory(problem):
    solver = ExchangeIpoptSolver(problem)
    start, _ = drawn(problem, 7)
    top = np.random.default_rng(1).normal(size=(PIECES, 3))
    trajectory = FlatTrajectory(PERIOD, start, top)
    for piece, time in ((0, 0.03), (2, 0.0), (4, 0.1)):
        z, dz, ddz = (np.vstack([start, top]).T @ column for column in solver._coefficients(piece, time).T)
        expected = flat_point(propagate(list(trajectory.knots[piece]), [top[piece]], time))
        assert z == pytest.approx(expected.z, abs=1e-12)
        assert dz == pytest.approx(expected.dz, abs=1e-12)
        assert ddz == pytest.approx(expected.ddz, abs=1e-12)


def test_running_out_of_nodes_is_a_failure(problem):
    # breaks its limits in several places, of which one node can mend one
    start, parameters = drawn(problem, 1)
    found = ExchangeIpoptSolver(problem, nodes=1).solve(start, parameters, np.zeros((PIECES, 3)), cold=True)
    assert excess(problem, start, found.variables) > 1e-4
    assert not found.solved
    assert found.status == BETWEEN_NODES


def test_an_exchange_without_nodes_is_refused(problem):
    with pytest.raises(ValueError, match="nodes: found 0"):
        ExchangeIpoptSolver(problem, nodes=0)
