"""Trajectories by integration: the compiled solver against finite differences, an independent integrator and IPOPT."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull, sigma_points, sigma_weights
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.models.vehicles import PlanarPointMass
from gbt_ocp.ocp import KeepOut, ShootingProblem, SpeedLimit, ThrustLimit, YawRateLimit, write_c
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.ocp.export.verification import verify_folder
from gbt_ocp.ocp.integration_steps import FASTER, stable_steps
from gbt_ocp.ocp.ladder import Ladder, _Given
from gbt_ocp.ocp.shot import Shots
from gbt_ocp.simulation.loop import simulate

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

PERIOD, GAMMA = 0.1, 0.98


def falcon(dimension: int) -> FossenVehicle:
    parameters = FALCON_2D if dimension == 2 else FALCON_3D
    return FossenVehicle(parameters, [5000.0] * dimension + [1500.0])


def posed(dimension: int, pieces: int = 5, steps: int | None = 1, **form) -> ShootingProblem:
    vehicle = falcon(dimension)
    problem = ShootingProblem(vehicle, pieces, PERIOD, steps=steps, **form).maximize(BearingSimilarity(dimension))
    return problem.maximize(RangePull(dimension)).subject_to(ThrustLimit(vehicle, GAMMA))


def cold(dimension: int, pieces: int, seed: int) -> dict:
    """A random state, forecast and desired bearings, as benchmarks/solver_instances.py draws them."""
    rng = np.random.default_rng(seed)
    state = np.zeros((2, dimension + 1))
    state[0, :dimension] = rng.uniform(-5.0, 5.0, dimension)
    state[1] = rng.normal(size=dimension + 1) * ([1.0] * dimension + [0.5])
    times = PERIOD * np.arange(1, pieces + 1)
    root = 0.2 * rng.normal(size=(dimension, dimension))
    mean = rng.normal(size=dimension) + times[:, None] * rng.normal(size=dimension)
    angle = rng.uniform(0.0, 6.0) + 2.0 * np.pi * times
    desired = np.stack([np.cos(angle), np.sin(angle), np.zeros(pieces)], axis=1)[:, :dimension]
    forecast = SimpleNamespace(mean=mean, covariance=np.tile(root @ root.T, (pieces, 1, 1)))
    return {"state": state, "forecast": forecast, "desired": desired}


def objective(vehicle, data: dict, begin: np.ndarray, end: np.ndarray) -> float:
    """The sum over the ends of the periods, in numpy alone: Runge-Kutta steps, similarity of bearings, pull."""
    d, total = vehicle.position_dimension, 0.0
    x = vehicle.state(*data["state"])
    for k, (first, last) in enumerate(zip(begin, end, strict=True)):
        middle = 0.5 * (first + last)
        k1 = vehicle.rates(x, first)
        k2 = vehicle.rates(x + 0.5 * PERIOD * k1, middle)
        k3 = vehicle.rates(x + 0.5 * PERIOD * k2, middle)
        k4 = vehicle.rates(x + PERIOD * k3, last)
        x = x + PERIOD / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        mean, covariance = data["forecast"].mean[k], data["forecast"].covariance[k]
        lines = sigma_points(mean, covariance, 1.0) - x[:d]
        total += float(sigma_weights(d, 1.0) @ (lines @ data["desired"][k] / np.linalg.norm(lines, axis=1)))
        excess = (np.linalg.norm(mean - x[:d]) - 1.0) / 0.1
        total -= 0.2 * 0.1 * float(np.logaddexp(0.0, excess))
    return total


def first_order_gain(vehicle, data: dict, plan) -> float:
    """What the objective would gain to first order by any change of one input within its limits, at most."""
    limit = vehicle.thrust_max
    ends = plan.thrust if plan.thrust_end is None else plan.thrust_end
    inputs = np.stack([plan.thrust, ends]) / limit
    sides = [(slice(None),)] if plan.thrust_end is None else [(0,), (1,)]
    worst, step = 0.0, 1e-5
    for side, (k, m) in itertools.product(sides, np.ndindex(plan.thrust.shape)):
        change = np.zeros_like(inputs)
        change[(*side, k, m)] = step
        after, before = (objective(vehicle, data, *((inputs + sign * change) * limit)) for sign in (1.0, -1.0))
        slope = (after - before) / (2.0 * step)
        here = inputs[(*side, k, m)].max()
        worst = max(worst, slope * (GAMMA - here), -slope * (GAMMA + here))
    return worst


@pytest.mark.parametrize(("dimension", "thrust"), [(2, "held"), (2, "linear"), (3, "held"), (3, "linear")])
def test_plans_are_stationary_by_independent_derivatives(dimension, thrust):
    planner = posed(dimension, thrust=thrust).compile("compiled")
    for seed in range(12):
        data = cold(dimension, 5, seed)
        planner.reset()
        plan = planner.solve(**data)
        assert plan.solved, plan.status
        assert np.abs(plan.thrust / planner.problem.vehicle.thrust_max).max() <= GAMMA + 1e-6
        ends = plan.thrust if plan.thrust_end is None else plan.thrust_end
        assert plan.objective == pytest.approx(objective(planner.problem.vehicle, data, plan.thrust, ends), abs=1e-9)
        assert first_order_gain(planner.problem.vehicle, data, plan) < 6e-4


@pytest.mark.parametrize(("dimension", "thrust"), [(2, "held"), (3, "linear")])
def test_ipopt_finds_the_same_plans(dimension, thrust):
    """Where both end in the same optimum; where not, neither is much better."""
    compiled, ipopt = (posed(dimension, thrust=thrust).compile(solver) for solver in ("compiled", "ipopt"))
    gaps = []
    for seed in range(10):
        data = cold(dimension, 5, seed)
        plans = []
        for planner in (compiled, ipopt):
            planner.reset()
            plans.append(planner.solve(**data))
        assert all(plan.solved for plan in plans)
        gaps.append(plans[0].objective - plans[1].objective)
    assert np.sum(np.abs(gaps) < 5e-4) >= 7, gaps
    assert np.mean(gaps) > -0.02


@pytest.mark.long
def test_path_limits_give_as_in_the_flat_form():
    """A zone that cannot be left in time gives, thrust does not; IPOPT's slack is the same."""
    vehicle = falcon(2)
    problem = posed(2).subject_to(KeepOut((0.0, 0.0), 1.0), nodes=2).subject_to_penalty(SpeedLimit(2, 3.0))
    data = cold(2, 5, 3)
    data["state"] = np.array([[0.3, 0.0, 0.0], [0.0, 0.0, 0.0]])
    plans = [problem.compile(solver).solve(**data) for solver in ("compiled", "ipopt")]
    for plan in plans:
        assert plan.status == "given up"
        assert set(plan.given_up) == {"keep_out"}
        assert np.abs(plan.thrust / vehicle.thrust_max).max() <= GAMMA + 1e-6
    assert plans[0].given_up["keep_out"] == pytest.approx(plans[1].given_up["keep_out"], abs=1e-4)
    far = dict(data, state=np.array([[2.5, 0.0, 0.0], [-1.0, 0.2, 0.0]]))
    plan = problem.compile("compiled").solve(**far)
    assert plan.solved
    assert plan.piece_violation[0] == 0.0


class Toppling:
    """A point that flees from the origin by itself, e-fold in 0.5 s, with drag; not flat for the planner."""

    position_dimension = flat_dimension = 2
    thrust_max = np.array([6.0, 6.0])

    def rates(self, state, thrust):
        away, velocity = state[:2], state[2:]
        return ca.vertcat(velocity, 4.0 * away + thrust - 0.1 * velocity * ca.norm_2(velocity + 1e-3))

    def state(self, z, dz):
        return np.concatenate([z, dz])


@pytest.mark.parametrize("pieces", [5, 80])
def test_a_vehicle_that_is_unstable_by_itself_is_kept(pieces):
    vehicle = Toppling()
    problem = ShootingProblem(vehicle, pieces, PERIOD).maximize(BearingSimilarity(2)).maximize(RangePull(2))
    planner = problem.subject_to(ThrustLimit(vehicle)).compile("compiled")
    state = np.array([0.1, -0.05, 0.0, 0.0])
    for step in range(4):
        times = PERIOD * (step + np.arange(1, pieces + 1))
        forecast = SimpleNamespace(
            mean=np.tile([0.5, 0.5], (pieces, 1)), covariance=np.tile(1e-2 * np.eye(2), (pieces, 1, 1))
        )
        desired = np.stack([np.cos(times), np.sin(times)], axis=1)
        plan = planner.solve(state, forecast, desired)
        assert plan.solved, plan.status
        assert np.abs(plan.endpoints).max() < 3.0
        state = planner.previous.states[1] + 1e-3


@pytest.mark.long
def test_generated_c_says_what_python_says(tmp_path):
    problem = posed(3).subject_to(KeepOut((0.5, 0.5, 0.5), 0.7), nodes=2)
    folder = write_c(problem.compile("compiled"), tmp_path / "planner")
    found = verify_folder(folder, flags="-O1 -Werror -fsanitize=address,undefined -fno-sanitize-recover=all")
    assert found.faults == ()
    assert found.vectors >= 10
    assert found.difference < 1e-9
    assert not (folder / "src" / "gbt_riccati.c").exists()


def test_a_flat_vehicle_without_rates_in_casadi_moves_by_its_inverse_dynamics():
    vehicle = PlanarPointMass(mass=2.0, drag=0.5)
    problem = ShootingProblem(vehicle, 4, 0.5, steps=3).maximize(RangePull(2)).subject_to(ThrustLimit(vehicle))
    forecast = SimpleNamespace(mean=np.tile([5.0, 1.0], (4, 1)), covariance=np.zeros((4, 2, 2)))
    plan = problem.compile("compiled").solve(np.zeros((2, 2)), forecast)
    state = np.zeros(4)
    for k, thrust in enumerate(plan.thrust):
        state = solve_ivp(lambda t, x, thrust=thrust: vehicle.rates(x, thrust), (0.0, 0.5), state, rtol=1e-9).y[:, -1]
        np.testing.assert_allclose(state.reshape(2, 2), plan.knots[k + 1], atol=1e-5)


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="thrust: found 'cubic'; allowed: held, linear"):
        posed(2, thrust="cubic")
    with pytest.raises(ValueError, match="steps: found 0"):
        posed(2, steps=0)
    with pytest.raises(ValueError, match=r"state: found shape \(3,\)"):
        posed(2).compile("ipopt").solve(np.zeros(3), **{k: v for k, v in cold(2, 5, 0).items() if k != "state"})

    class Immobile:
        position_dimension = flat_dimension = 2
        thrust_max = np.ones(2)

        def rates(self, state, thrust):
            return ca.vertcat(thrust)

        def state(self, z, dz):
            return np.concatenate([z, dz])

    with pytest.raises(ValueError, match="rates: found 2 x 1 rates for 4 states"):
        ShootingProblem(Immobile(), 3, 0.1)


def test_pieces_take_as_many_steps_as_are_stable_at_all_speeds_of_the_vehicle():
    """Against an adaptive integrator, from the speeds that full thrust leads to and a quarter more."""
    problem = posed(2, steps=None)
    assert problem.runge_kutta_steps == 2
    vehicle, rng = problem.vehicle, np.random.default_rng(0)
    shots, single = Shots(problem), Shots(posed(2, steps=1))
    off, off_by_one = [], []
    for _ in range(40):
        held = vehicle.thrust_max * rng.choice([-1.0, 1.0], 3)

        def after(state, thrust, seconds):
            return solve_ivp(lambda t, x: vehicle.rates(x, thrust), (0.0, seconds), state, rtol=1e-8).y[:, -1]

        state = after(np.zeros(6), held, rng.uniform(0.1, 0.8)) * [0.0, 0.0, 0.0, *[FASTER] * 3]
        exact = after(state, -held, PERIOD)
        with np.errstate(over="ignore", invalid="ignore"):
            ends = [np.asarray(one.end(np.concatenate([state, -held]))) for one in (shots, single)]
        off.append(np.abs(ends[0] - exact).max() / np.abs(exact - state).max())
        off_by_one.append(np.abs(ends[1] - exact).max() / np.abs(exact - state).max())
    assert max(off) < 0.1
    assert max(off_by_one) > 1.0


def test_fast_starts_are_planned_from():
    planner = posed(2, steps=None).compile("compiled")
    for seed in range(12):
        data = cold(2, 5, seed)
        data["state"][1] = [0.5, 6.0, 1.0]
        planner.reset()
        plan = planner.solve(**data)
        assert plan.solved, plan.status
        assert np.abs(plan.knots[1, 1]).max() < 6.0


def test_limits_on_speeds_spare_steps():
    vehicle = falcon(2)
    free = stable_steps(vehicle, 1.0)
    slow = stable_steps(vehicle, 1.0, [SpeedLimit(2, 2.0), YawRateLimit(2, 0.5)])
    assert 2 < slow < free / 2
    assert stable_steps(vehicle, 1.0, [KeepOut((0.0, 0.0), 1.0)]) == free
    problem = ShootingProblem(vehicle, 3, 1.0).maximize(RangePull(2)).subject_to_penalty(SpeedLimit(2, 2.0))
    assert problem.subject_to(YawRateLimit(2, 0.5)).runge_kutta_steps == slow
    assert replace(problem, steps=4).runge_kutta_steps == 4


@pytest.mark.parametrize("thrust", ["held", "linear"])
def test_the_form_is_a_key_of_the_planner(thrust):
    overrides = ["planner.form=shooting", f"planner.thrust={thrust}", "planner.formulation=hard"]
    loop, start = build_loop(load_config("case2", overrides=overrides, seed=0))
    arrays = simulate(loop, start, 4.0).arrays
    assert set(arrays["solver_status"]) == {"solved"}
    assert arrays["error"].mean(axis=1)[arrays["t"] >= 2.0].mean() < 0.04
    assert np.nanmax(np.abs(arrays["thrust"]) / loop.vehicle.thrust_max) <= GAMMA + 1e-6


def drifting(dimension: int, pieces: int, step: int) -> dict:
    """The forecast of a target that drifts, and bearings that turn, at a step; the forecast comes true."""
    times = PERIOD * (step + np.arange(1, pieces + 1))
    mean = np.array([0.5, -0.3, 0.2])[:dimension] * (1.0 + times[:, None])
    desired = np.stack([np.cos(2.0 * times), np.sin(2.0 * times), 0.0 * times], axis=1)[:, :dimension]
    covariance = np.tile(1e-3 * np.eye(dimension), (pieces, 1, 1))
    return {"forecast": SimpleNamespace(mean=mean, covariance=covariance), "desired": desired}


@pytest.mark.parametrize(("dimension", "thrust"), [(3, "held"), (3, "linear")])
def test_a_step_in_two_parts_comes_near_the_plan_in_one(dimension, thrust):
    problem = posed(dimension, thrust=thrust)
    parts, whole = problem.compile("compiled"), problem.compile("compiled")
    state = np.zeros((2, dimension + 1))
    state[0, 0], rng, losses = 2.0, np.random.default_rng(0), []
    assert not parts.prepare(), "there is no plan yet"
    for step in range(25):
        data = drifting(dimension, 5, step)
        plan, best = parts.feedback(state, **data), whole.solve(state, **data)
        assert plan.solved
        assert plan.iterations <= (best.iterations if step == 0 else 3)
        limit = problem.vehicle.thrust_max
        ends = plan.thrust if plan.thrust_end is None else plan.thrust_end
        assert np.all(np.abs(np.concatenate([plan.thrust, ends])) <= limit)
        assert plan.objective == pytest.approx(
            objective(problem.vehicle, {"state": state, **data}, plan.thrust, ends), abs=1e-6
        )
        losses.append(best.objective - plan.objective)
        assert parts.prepare()
        # the vehicle is pushed a little from where the plan led
        state = plan.knots[1] + 1e-3 * rng.normal(size=plan.knots[1].shape)
    assert np.median(losses) < 5e-3, losses


def test_the_second_part_of_a_step_serves_better_than_braking():
    """Pushed off its plan, two iterations are not enough; a plan that has not converged must beat doing nothing."""
    planner = posed(2).compile("compiled")
    ladder, rng, said = Ladder(planner.problem, planner.solver), np.random.default_rng(100), set()
    state = np.array([[2.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    for step in range(60):
        data, start = drifting(2, 5, step), planner.start(state)
        plan = planner.feedback(state, **data)
        given = _Given(start, planner._binding.objective_parameters(data), [], np.zeros(1))
        assert ladder._beats_braking(given, planner.previous)
        assert (plan.status == "solved") == (plan.fallback == "")
        said.add(plan.fallback)
        planner.prepare()
        state = plan.knots[1] + 0.5 * rng.normal(size=(2, 3)) * (rng.random() < 0.4)
    assert said == {"", "braking"}


def test_only_the_compiled_solver_takes_a_step_in_parts():
    planner = posed(2).compile("ipopt")
    with pytest.raises(ValueError, match="solver: found 'ipopt'; allowed: 'compiled'"):
        planner.prepare()
    planner = posed(2).compile("compiled")
    data = cold(2, 5, 4)
    planner.solve(**data)
    planner.previous = planner.solve(**data) and None
    assert not planner.prepare(), "there is no last plan any more"
    assert planner.feedback(**data).iterations > 1


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_rest_at_its_limits_gives_way_to_thrust_that_is_held_where_that_is_better(dimension):
    """Plans go on from rests of earlier ones, and no thrust held in a corner of its limits is better than a plan."""
    planner = posed(dimension).compile("compiled")
    vehicle, pressed, better = planner.problem.vehicle, 0, 0
    for seed in range(20):
        data, other = cold(dimension, 5, seed), cold(dimension, 5, seed + 100)
        planner.reset()
        last = planner.solve(**dict(other, state=data["state"]))
        rest = np.vstack([last.thrust[1:], last.thrust[-1:]])
        pressed += np.mean(np.abs(rest / vehicle.thrust_max) > GAMMA - 0.05) >= 0.5
        after = dict(data, state=np.asarray(last.knots[1]))
        plan = planner.solve(**after)
        corners = [
            np.tile(0.97 * np.array(corner) * vehicle.thrust_max, (5, 1))
            for corner in itertools.product((-1.0, 0.0, 1.0), repeat=dimension + 1)
        ]
        held = max(objective(vehicle, after, thrust, thrust) for thrust in corners)
        better += held > objective(vehicle, after, rest, rest)
        assert plan.solved
        assert plan.objective > held - 1e-9, seed
    assert pressed >= 5, "rests of which half of the thrust is at its limits"
    assert better >= 5, "rests that are worse than held thrust"
