"""Multiple shooting: its integration, its optimum and its limits against what was found by other means."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

from gbt_ocp.experiments.build.loop import build_loop, build_problem
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull
from gbt_ocp.guidance.planned import PlannedMotion
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.models.vehicles import PlanarPointMass, Unicycle, acceleration
from gbt_ocp.ocp import KeepOut, ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.shooting import ShootingPlanner
from gbt_ocp.simulation.loop import simulate
from gbt_ocp.tracking.protocol import Forecast

PLANAR = FossenVehicle(FALCON_2D, (5000.0, 5000.0, 1500.0))
SPATIAL = FossenVehicle(FALCON_3D, (5000.0, 5000.0, 5000.0, 1500.0))
VEHICLES = {"planar": PLANAR, "spatial": SPATIAL, "point": PlanarPointMass(2.0, 0.7), "unicycle": Unicycle()}
PERIOD, PIECES = 0.1, 4


def posed(vehicle=PLANAR, gamma=0.98, pull=True, pieces=PIECES):
    d = vehicle.position_dimension
    problem = TrajectoryProblem(vehicle, pieces, PERIOD).maximize(BearingSimilarity(d))
    problem = problem.maximize(RangePull(d)) if pull else problem
    return problem.subject_to(ThrustLimit(vehicle, gamma), nodes=4)


def numbers(dimension=2, mean=(2.0, 1.0, 0.5), spread=0.1, pieces=PIECES):
    forecast = Forecast(
        np.array(mean)[:dimension] + 0.05 * np.arange(pieces)[:, None],
        np.tile(spread**2 * np.eye(dimension), (pieces, 1, 1)),
    )
    turn = 0.5 + 0.6 * np.arange(pieces)
    desired = np.stack([np.cos(turn), np.sin(turn), np.zeros(pieces)], axis=1)[:, :dimension]
    return {"forecast": forecast, "desired": desired}


def objective_by_hand(ends, forecast, desired, pull=0.2):
    """The unscented similarity and the pull, written out for a covariance that is a multiple of the identity."""
    total, d = 0.0, desired.shape[1]
    for own, mean, covariance, wanted in zip(ends[:, :d], forecast.mean, forecast.covariance, desired, strict=True):
        radius = np.sqrt((d + 1.0) * covariance[0, 0])
        for axis, sign in [(None, 0.0), *((axis, sign) for axis in range(d) for sign in (1.0, -1.0))]:
            point = mean.copy()
            if axis is not None:
                point[axis] += sign * radius
            line = point - own
            weight = 1.0 / (d + 1.0) if axis is None else 0.5 / (d + 1.0)
            total += weight * wanted @ line / np.linalg.norm(line)
        total -= pull * 0.1 * np.log1p(np.exp((np.linalg.norm(mean - own) - 1.0) / 0.1))
    return total


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_symbolic_forward_dynamics_are_those_of_the_simulation(vehicle):
    n, rng = vehicle.flat_dimension, np.random.default_rng(3)
    z, dz, tau = (ca.SX.sym(name, n) for name in ("z", "dz", "tau"))
    symbolic = ca.Function("acceleration", [z, dz, tau], [acceleration(vehicle, z, dz, tau)])
    for _ in range(5):
        flat, rate = rng.normal(size=n), rng.normal(size=n) + 0.5
        thrust = rng.uniform(-1.0, 1.0, n) * vehicle.thrust_max
        state = vehicle.state(flat, rate)
        step = 1e-6
        later, sooner = (vehicle.flat(state + sign * step * vehicle.rates(state, thrust))[1] for sign in (1.0, -1.0))
        expected = (later - sooner) / (2.0 * step)
        np.testing.assert_allclose(np.asarray(symbolic(flat, rate, thrust)).ravel(), expected, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("vehicle", [PLANAR, SPATIAL], ids=["planar", "spatial"])
@pytest.mark.long
def test_runge_kutta_map_against_solve_ivp(vehicle):
    n, rng = vehicle.flat_dimension, np.random.default_rng(0)
    coarse, fine = ShootingPlanner(posed(vehicle)), ShootingPlanner(posed(vehicle), substeps=16)
    worst = np.zeros(2)
    for _ in range(10):
        z, dz = rng.normal(size=n), rng.normal(size=n) * ([1.0] * (n - 1) + [4.0])
        held = rng.uniform(-1.0, 1.0, n)
        found = solve_ivp(
            lambda s, x, u: vehicle.rates(x, u * vehicle.thrust_max),
            (0.0, PERIOD),
            vehicle.state(z, dz),
            args=(held,),
            rtol=1e-10,
            atol=1e-12,
        )
        expected = np.concatenate(vehicle.flat(found.y[:, -1]))
        for i, planner in enumerate((coarse, fine)):
            end = np.asarray(planner.step(np.concatenate([z, dz]), held)[0]).ravel()
            worst[i] = max(worst[i], np.abs(end - expected)[: n - 1].max())
        knots, peaks = fine.rollout(np.array([z, dz]), np.tile(held, (PIECES, 1)))
        np.testing.assert_allclose(knots[1].ravel(), expected, atol=1e-6)
        np.testing.assert_allclose(peaks, np.abs(held).max(), rtol=1e-9)
    # The error of a method of fourth order shrinks by 256; the position is good to a fraction of a millimetre before.
    assert worst[0] < 5e-4
    assert worst[1] < worst[0] / 100.0


@pytest.mark.parametrize("vehicle", [PLANAR, SPATIAL], ids=["planar", "spatial"])
def test_objective_and_limits_of_a_plan(vehicle):
    d = vehicle.position_dimension
    planner, data = ShootingPlanner(posed(vehicle)), numbers(vehicle.position_dimension)
    state = np.zeros((2, vehicle.flat_dimension))
    state[1, 0] = 0.5
    plan = planner.solve(state, **data)
    assert plan.solved
    assert plan.fallback == ""
    assert plan.objective == pytest.approx(objective_by_hand(plan.endpoints[:, :d], **data), abs=1e-9)
    assert plan.violation == 0.0
    assert np.abs(plan.thrust / vehicle.thrust_max).max() == pytest.approx(0.98, abs=1e-6)  # the limits are felt
    # It is where these inputs lead, by the simulation's own dynamics.
    x = vehicle.state(*state)
    for i, thrust in enumerate(plan.thrust):
        span = solve_ivp(lambda s, x, u: vehicle.rates(x, u), (0.0, PERIOD), x, args=(thrust,), rtol=1e-9, atol=1e-11)
        x = span.y[:, -1]
        np.testing.assert_allclose(plan.endpoints[i], vehicle.flat(x)[0], atol=1e-5)


def test_optimum_against_another_optimiser():
    """Single shooting with scipy, from the same start: no better than what IPOPT found, and as good."""
    planner, data = ShootingPlanner(posed(pieces=2), substeps=8), numbers(pieces=2)
    state = np.array([[0.0, 0.0, 0.3], [0.4, -0.2, 0.1]])
    plan = planner.solve(state, **data)

    def loss(u):
        return -objective_by_hand(planner.rollout(state, u.reshape(2, 3))[0][1:, 0], **data)

    best = minimize(loss, np.zeros(6), method="L-BFGS-B", bounds=[(-0.98, 0.98)] * 6, options={"ftol": 1e-12})
    assert plan.objective == pytest.approx(-best.fun, abs=1e-5)


def test_same_optimum_as_the_flat_form_where_limits_do_not_bind():
    # Endpoints in reach, and little to gain: the optimum is the same stationary point of the same function of them.
    strong = FossenVehicle(FALCON_2D, (4e5, 4e5, 1e5))
    problem, data = posed(strong), numbers(mean=(0.6, 0.3), spread=0.05)
    flat = problem.compile("ipopt").solve(np.zeros((2, 3)), **data)
    shot = ShootingPlanner(problem, substeps=16).solve(np.zeros((2, 3)), **data)
    assert flat.solved
    assert shot.solved
    assert np.abs(shot.thrust / strong.thrust_max).max() < 0.9
    assert shot.objective == pytest.approx(flat.objective, abs=1e-5)


class HeldAcceleration(ShootingPlanner):
    """The flat form by other means: z̈ held in the earth frame, limits at the nodes."""

    bounded = False

    def motion(self, z, dz, held):
        return held * ca.DM(self.problem.vehicle.acceleration_scale)


def test_held_earth_acceleration_is_the_flat_form():
    problem, data, state = posed(), numbers(), np.array([[0.0, 0.0, 0.3], [0.4, -0.2, 0.1]])
    flat = problem.compile("ipopt").solve(state, **data)
    shot = HeldAcceleration(problem).solve(state, **data)
    assert flat.solved
    assert shot.solved
    assert shot.objective == pytest.approx(flat.objective, abs=1e-5)
    np.testing.assert_allclose(shot.endpoints[:, :2], flat.endpoints[:, :2], atol=1e-3)


def test_held_thrust_and_held_acceleration_agree_without_drag_or_turning():
    """A point mass in a vacuum: both hold the same thing, so they must reach the same optimum at the limits."""
    problem, data = posed(PlanarPointMass(1.0, 0.0, (3.0, 3.0))), numbers()
    flat = problem.compile("ipopt").solve(np.zeros((2, 2)), **data)
    shot = ShootingPlanner(problem).solve(np.zeros((2, 2)), **data)
    assert np.abs(shot.held).max() == pytest.approx(0.98, abs=1e-5)
    assert shot.objective == pytest.approx(flat.objective, abs=2e-5)


def test_warm_start_and_answers_to_a_failed_solve(monkeypatch):
    planner, data = ShootingPlanner(posed()), numbers()
    state = np.zeros((2, 3))
    first = planner.solve(state, **data)
    attempt, asked = planner.attempt, []

    def failing(times):
        asked.clear()

        def answer(start, objectives, guess):
            asked.append(guess)
            found = attempt(start, objectives, guess)
            return replace(found, solved=False, status="gave up") if len(asked) <= times else found

        monkeypatch.setattr(planner, "attempt", answer)

    failing(0)
    planner.solve(first.knots[1], **data)
    np.testing.assert_array_equal(asked[0], np.vstack([first.held[1:], np.zeros((1, 3))]))
    for times, fallback, held in ((1, "cold", None), (2, "shifted", first.rest())):
        planner.previous = first
        failing(times)
        plan = planner.solve(first.knots[1], **data)
        assert (plan.status, plan.fallback, plan.solved) == ("gave up", fallback, False)
        assert len(asked) == 2
        assert not asked[1].any()
        assert held is None or np.array_equal(plan.held, held)
        assert plan.violation == 0.0
    planner.reset()
    failing(1)
    plan = planner.solve(state, **data)
    assert plan.fallback == "coasting"
    assert not plan.thrust.any()


def test_closed_loop_holds_the_first_thrust():
    configuration = load_config("case2", overrides=["planner.formulation=hard", "planner.solver=ipopt"], seed=0)
    loop, start = build_loop(configuration)
    planner = ShootingPlanner(build_problem(configuration, loop.vehicle))
    run = simulate(replace(loop, guidance=PlannedMotion(planner, loop.desired)), start, 1.0).arrays
    assert set(run["solver_status"]) == {"solved"}
    assert set(run["fallback"]) == {""}
    assert np.all(np.isfinite(run["objective"]))
    assert run["piece_thrust_peak"].max() <= 0.98 + 1e-9
    # The vehicle arrives where the step before planned to be.
    np.testing.assert_allclose(run["vehicle_pose"][1:], run["plan"][:-1, 0], atol=1e-5)
    assert run["plan"].shape == (11, 5, 3)


def test_what_shooting_cannot_take_is_refused():
    with pytest.raises(ValueError, match="found: KeepOut"):
        ShootingPlanner(posed().subject_to(KeepOut((0.0, 0.0), 1.0)))
    with pytest.raises(ValueError, match="found: none"):
        ShootingPlanner(TrajectoryProblem(PLANAR, 2, PERIOD).maximize(BearingSimilarity(2)))
    with pytest.raises(ValueError, match="no objective"):
        ShootingPlanner(TrajectoryProblem(PLANAR, 2, PERIOD).subject_to(ThrustLimit(PLANAR)))
    with pytest.raises(ValueError, match="substeps: found 0; allowed: a whole number >= 1"):
        ShootingPlanner(posed(), substeps=0)
    with pytest.raises(ValueError, match="unheard_of"):
        ShootingPlanner(posed(), options={"unheard_of": 1})
    with pytest.raises(ValueError, match=r"state: found shape \(1, 3\); allowed: \(2, 3\)"):
        ShootingPlanner(posed()).solve(np.zeros((1, 3)), **numbers())
