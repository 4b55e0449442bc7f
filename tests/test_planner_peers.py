"""The planner's peers in benchmarks/peers: their judge against another integrator, one step of each against ours."""

import sys
import warnings
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.ocp import ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.problem_data import HardLimit
from gbt_ocp.ocp.solvers.ipopt import IpoptSolver
from gbt_ocp.ocp.transcription import input_scale

PERIOD, PIECES = 0.1, 5


@pytest.fixture(autouse=True, scope="module")
def benchmarks():
    folder = str(Path(__file__).resolve().parents[1] / "benchmarks")
    sys.path.insert(0, folder)
    yield
    sys.path.remove(folder)


def posed(dimension):
    """A problem, a start and the parameters of one step."""
    vehicle = FossenVehicle(FALCON_2D if dimension == 2 else FALCON_3D, [5000.0] * dimension + [1500.0])
    problem = TrajectoryProblem(vehicle, PIECES, PERIOD).maximize(BearingSimilarity(dimension))
    problem = problem.maximize(RangePull(dimension)).subject_to(ThrustLimit(vehicle, 0.98), nodes=4)
    start = np.zeros((2, dimension + 1))
    start[1] = [0.8, -0.5, 0.3, 0.4][: dimension + 1]
    mean = np.array([1.2, 0.7, 0.4])[:dimension] + 0.05 * np.arange(PIECES)[:, None]
    forecast = SimpleNamespace(mean=mean, covariance=np.tile(0.01 * np.eye(dimension), (PIECES, 1, 1)))
    turn = 0.5 + 0.6 * np.arange(PIECES)
    desired = np.stack([np.cos(turn), np.sin(turn), np.zeros(PIECES)], axis=1)[:, :dimension]
    data = {"forecast": forecast, "desired": desired}
    return problem, start, Binding(problem).objective_parameters(data), data


def by_hand(ends, data, pull=0.2):
    """Similarity and pull at the ends ``(p, d)``, written out for a covariance that is a multiple of the identity."""
    total, d = 0.0, ends.shape[1]
    for own, mean, covariance, wanted in zip(
        ends, data["forecast"].mean, data["forecast"].covariance, data["desired"], strict=True
    ):
        radius = np.sqrt((d + 1.0) * covariance[0, 0])
        offsets = [np.zeros(d), *(sign * radius * axis for axis in np.eye(d) for sign in (1.0, -1.0))]
        for number, offset in enumerate(offsets):
            line = mean + offset - own
            total += (1.0 if number == 0 else 0.5) / (d + 1.0) * wanted @ line / np.linalg.norm(line)
        total -= pull * 0.1 * np.log1p(np.exp((np.linalg.norm(mean - own) - 1.0) / 0.1))
    return total


@pytest.mark.long
@pytest.mark.parametrize("dimension", [2, 3])
def test_held_thrust_is_judged_where_the_simulated_vehicle_gets(dimension):
    from peers.judge import Judge

    problem, start, parameters, data = posed(dimension)
    vehicle = problem.vehicle
    held = np.random.default_rng(0).uniform(-0.9, 0.9, (PIECES, dimension + 1))
    state, ends = vehicle.state(start[0], start[1]), []
    for share in held:
        thrust = share * vehicle.thrust_max
        moved = solve_ivp(lambda _, s, tau=thrust: vehicle.rates(s, tau), (0.0, PERIOD), state, rtol=1e-10, atol=1e-12)
        state = moved.y[:, -1]
        ends.append(vehicle.flat(state)[0][:dimension])
    objective, peak = Judge(problem).held(start, held, parameters)
    assert objective == pytest.approx(by_hand(np.array(ends), data), abs=1e-8)
    assert peak == pytest.approx(np.abs(held).max(), abs=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("dimension", [2, 3])
def test_held_acceleration_is_judged_on_its_parabolas(dimension):
    from peers.judge import Judge

    problem, start, parameters, data = posed(dimension)
    variables = np.random.default_rng(1).uniform(-0.5, 0.5, (PIECES, dimension + 1))
    z, dz, ends, peak = start[0], start[1], [], 0.0
    for ddz in variables * problem.vehicle.acceleration_scale:
        for t in np.linspace(0.0, PERIOD, 101):
            inputs = problem.vehicle.inputs(z + t * dz + 0.5 * t**2 * ddz, dz + t * ddz, ddz)
            peak = max(peak, float(np.abs(np.asarray(inputs).ravel() / problem.vehicle.thrust_max).max()))
        z, dz = z + PERIOD * dz + 0.5 * PERIOD**2 * ddz, dz + PERIOD * ddz
        ends.append(z[:dimension])
    objective, found = Judge(problem).flat(start, variables * problem.vehicle.acceleration_scale, parameters)
    assert objective == pytest.approx(by_hand(np.array(ends), data), abs=1e-10)
    assert found == pytest.approx(peak, rel=1e-10)


PEERS = [
    ("alpaqa", "alpaqa"),
    # its functions are compiled, for minutes
    pytest.param("fatrop", "casadi", marks=pytest.mark.slow),
    ("opti", "casadi"),
    ("rockit", "rockit"),
    ("do_mpc", "do_mpc"),
]


@pytest.mark.long
@pytest.mark.parametrize(("name", "module"), PEERS)
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_peer_reaches_what_our_multiple_shooting_reaches(name, module, dimension):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # optional parts of do-mpc
        pytest.importorskip(module)
        from peers import Statement, make
        from peers.judge import Judge

        problem, start, parameters, _ = posed(dimension)
        judge, peer = Judge(problem), make(name, Statement(problem))
        coasting = np.zeros((PIECES, dimension + 1))
        states = start[0] + np.arange(1, PIECES + 1)[:, None] * PERIOD * start[1]
        guess = np.column_stack([states, np.tile(start[1], (PIECES, 1))]).T
        found = [peer.solve(start.ravel(), np.vstack(parameters), guess, coasting.T) for _ in range(2)]
    ours = judge.shooting.attempt(start, parameters, coasting)
    assert ours.solved
    value, _ = judge.held(start, ours.variables, parameters)
    for answer in found:  # the second time, do-mpc starts from multipliers too
        assert answer.solved
        assert answer.iterations > 0
        assert answer.solver_seconds > 0.0
        reached, peak = judge.held(start, answer.held, parameters)
        # one Runge-Kutta step or one collocation element a period, not four steps
        assert reached == pytest.approx(value, abs=2e-3)
        assert peak <= 0.98 + 1e-6
    flat = IpoptSolver(problem, {}).solve(start, parameters, coasting, cold=True, tightening=0.0)
    assert judge.flat(start, flat.variables * input_scale(problem), parameters)[0] < value
    free = replace(problem, degree=4, continuity=1, hard=(HardLimit(problem.hard[0].constraint, 8),))
    guess = np.zeros((PIECES, free.freedoms))
    freer = IpoptSolver(free, {}).solve(start, parameters, guess, cold=True, tightening=0.0)
    reached, peak = judge.flat(start, freer.variables * input_scale(free), parameters)
    assert reached > value - 1e-4
    assert peak <= 1.0
