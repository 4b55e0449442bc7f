"""Vehicles that are not flat: rates against the published equations, steering, limits of inputs, and the loop."""

import math
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gbt_ocp.experiments.build.loop import build_loop, build_problem, build_vehicle
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.config.vehicle import DRIVEN_BY_NAME, DRIVEN_DIMENSIONS, DRIVEN_INPUTS
from gbt_ocp.experiments.config.vehicle_faults import LAWS_OF_DRIVEN
from gbt_ocp.guidance.current import CurrentObserver
from gbt_ocp.guidance.helm import Helm, SteeringLimits, turning_away
from gbt_ocp.guidance.objectives import RangePull
from gbt_ocp.guidance.steering_limits import LeastSpeed, LeastTurnRadius, PitchLimit
from gbt_ocp.models import KNOWN_DRIVEN
from gbt_ocp.models.steady_motion import push_for, turning_circle
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.ocp import InputRateLimit, ShootingProblem, ThrustLimit, TrajectoryProblem, write_c
from gbt_ocp.ocp.export.verification import verify_folder
from gbt_ocp.ocp.plan_forms import ShotPlans
from gbt_ocp.pilot.shot_follower import ShotFollower
from gbt_ocp.simulation.loop import simulate
from gbt_ocp.simulation.tabular import dataframe


def lauv_of_the_paper(nu, theta, inputs):
    """ν̇ of (u, v, w, q, r) with sway to starboard and heave down, roll locked: da Silva et al. (2007), by matrices."""
    u, v, w, q, r = nu
    thrust, rudder, stern = inputs
    m, i = 18.0, 0.2 * 18.0 * (0.54**2 + 0.075**2)
    added = np.diag([1.0, 16.0, 16.0, 1.3, 1.3])
    mass = np.diag([m, m, m, i, i]) + added
    m1, m2, m3 = np.diag(mass)[:3]
    coriolis = np.array([m3 * w * q - m2 * v * r, m1 * u * r, -m1 * u * q, (m1 - m3) * u * w, (m2 - m1) * u * v])
    damping = -np.array(
        [
            [-2.4 - 2.4 * abs(u), 0, 0, 0, 0],
            [0, -23 - 80 * abs(v), 0, 0, 11.5 + 0.3 * abs(r)],
            [0, 0, -23 - 80 * abs(w), -11.5 - 0.3 * abs(q), 0],
            [0, 0, 3.1 + 1.5 * abs(w), -9.7 - 9.1 * abs(q), 0],
            [0, -3.1 - 1.5 * abs(v), 0, 0, -9.7 - 9.1 * abs(r)],
        ]
    )
    body = -0.5 * 1000.0 * math.pi * 0.075**2 * 1.24
    fin, x_fin, x_body = -1000.0 * 3.0 * 0.0064, -0.4, -0.65 * 1.08 + 0.4
    lift = -u * np.array(
        [
            [0, 0, 0, 0, 0],
            [0, body + fin, 0, 0, x_fin * fin],
            [0, 0, body + fin, -x_fin * fin, 0],
            [0, 0, -x_body * body - x_fin * fin, x_fin**2 * fin, 0],
            [0, x_body * body + x_fin * fin, 0, 0, x_fin**2 * fin],
        ]
    )
    pushed = np.array(
        [thrust, -fin * u**2 * rudder, fin * u**2 * stern, -x_fin * fin * u**2 * stern, -x_fin * fin * u**2 * rudder]
    )
    righting = np.array([0, 0, 0, 0.01 * m * 9.81 * math.sin(theta), 0])
    return np.linalg.solve(mass, pushed - coriolis - (damping + lift) @ np.asarray(nu) - righting)


def moved(vehicle, state, inputs, duration):
    return solve_ivp(lambda t, x: vehicle.rates(x, inputs), (0.0, duration), state, rtol=1e-6).y[:, -1]


MIRROR = np.array([1.0, -1.0, -1.0, 1.0, -1.0])
"""From surge, sway, heave, pitch rate, yaw rate with starboard and down to port and up; the bow rises in both."""


@pytest.mark.parametrize("name", ["torpedo2d", "torpedo3d"])
def test_the_torpedo_obeys_the_published_equations(name):
    vehicle, rng = KNOWN_DRIVEN[name].make(), np.random.default_rng(0)
    d = vehicle.position_dimension
    for _ in range(20):
        nu = rng.normal(size=5) * [1.0, 0.3, 0.3, 0.3, 0.4] + [1.5, 0, 0, 0, 0]  # surge, sway, heave, yaw, pitch rate
        theta, inputs = rng.uniform(-0.4, 0.4), rng.uniform(vehicle.thrust_min, vehicle.thrust_max)
        if d == 2:
            nu[[2, 4]], theta = 0.0, 0.0
        eta = np.array([3.0, -1.0, 2.0, 0.7, theta])
        order = [0, 1, 2, 3, 4] if d == 3 else [0, 1, 3]
        here = np.concatenate([eta[order], nu[order]])
        u, v, w, r, q = nu
        # a positive rudder is one to port, a positive elevator lifts the bow: their stern planes have the other sign
        elevator = inputs[2] if d == 3 else 0.0
        wanted = MIRROR * lauv_of_the_paper(MIRROR * [u, v, w, q, r], theta, [inputs[0], inputs[1], -elevator])
        found = vehicle.rates(here, inputs)[vehicle.flat_dimension :]
        np.testing.assert_allclose(found, wanted[[0, 1, 2, 4, 3] if d == 3 else [0, 1, 4]], atol=2e-3)
        symbolic = ca.Function("f", [s := ca.SX.sym("s", len(here)), i := ca.SX.sym("i", d)], [vehicle.rates(s, i)])
        np.testing.assert_allclose(np.asarray(symbolic(here, inputs)).ravel(), vehicle.rates(here, inputs), atol=1e-12)


def test_the_vessel_obeys_the_published_equations():
    vehicle, rng = KNOWN_DRIVEN["vessel"].make(), np.random.default_rng(1)
    m, x, inertia = 55.0, 0.2, 55.0 * (0.5**2 + 0.2**2)
    surge = 2.7 * 1025.0 * (m / 1025.0) ** (5.0 / 3.0) / 4.0  # Söding
    mass = np.array([[m + surge, 0, 0], [0, 2.5 * m, m * x], [0, m * x, 2.7 * inertia]])
    places = np.linspace(-1.0, 1.0, 4001)
    for _ in range(20):
        u, v, r = nu = rng.normal(size=3) * [1.0, 0.3, 0.3] + [1.5, 0, 0]
        port, starboard = inputs = rng.uniform(vehicle.thrust_min, vehicle.thrust_max)
        drag = -0.5 * 1026.0 * (m / 1025.0 / 0.4) * 0.846 * np.abs(v + places * r) * (v + places * r)
        forces = [
            port + starboard - 24.4 * 9.81 / (6.0 * 0.5144) * u + m * (v * r + x * r**2),
            -2.5 * m * v + np.trapezoid(drag, places) - m * u * r,
            0.395 * (starboard - port) - 2.7 * inertia * (1 + 10 * abs(r)) * r
            + np.trapezoid(places * drag, places) - m * x * u * r,
        ]  # fmt: skip
        found = vehicle.rates(np.concatenate([np.zeros(3), nu]), inputs)[3:]
        np.testing.assert_allclose(found, np.linalg.solve(mass, forces), atol=2e-2)


def test_published_speeds_and_turns():
    torpedo, vessel = (KNOWN_DRIVEN[name].make() for name in ("torpedo2d", "vessel"))
    # 2.4 u + 2.4 u² = 14 N; 24.4 kgf drive the Otter at 6 knots
    assert turning_circle(torpedo, 1.0, 0.0)[0] == pytest.approx(
        (-2.4 + math.sqrt(2.4**2 + 4 * 2.4 * 14)) / 4.8, abs=1e-3
    )
    assert turning_circle(vessel, 1.0, 0.0)[0] == pytest.approx(6.0 * 0.5144, rel=1e-3)
    # the radius of a turn is that of the rudder, not of the speed
    radii = [turning_circle(torpedo, push, 1.0)[1] for push in (0.3, 1.0)]
    assert radii[0] == pytest.approx(radii[1], rel=0.5)
    nu = solve_ivp(
        lambda t, nu: lauv_of_the_paper(nu, 0.0, [14.0, -math.radians(30.0), 0.0]), (0.0, 60.0), [1.0, 0, 0, 0, 0]
    ).y[:, -1]
    assert np.hypot(nu[0], nu[1]) / abs(nu[4]) == pytest.approx(radii[1], rel=5e-3)
    assert push_for(torpedo, 1.2) == pytest.approx((2.4 * 1.2 + 2.4 * 1.2**2) / 14.0, rel=1e-3)


@pytest.mark.parametrize("name", KNOWN_DRIVEN)
def test_states_and_poses_belong_together(name):
    vehicle, known = KNOWN_DRIVEN[name].make(), KNOWN_DRIVEN[name]
    n, d = vehicle.flat_dimension, vehicle.position_dimension
    state = np.linspace(0.1, 0.9, 2 * n)
    z, dz = vehicle.flat(state)
    np.testing.assert_allclose(vehicle.state(z, dz), state, atol=1e-12)
    step, inputs = 1e-6, 0.5 * vehicle.thrust_max
    numeric = (vehicle.flat(state + step * vehicle.rates(state, inputs))[0] - z) / step
    np.testing.assert_allclose(numeric, dz, atol=1e-5)
    assert vehicle.pose(state).shape == vehicle.velocity(state).shape == (d + 1,)
    assert vehicle.velocity(state)[d] == pytest.approx(dz[d])
    assert d == known.dimension == DRIVEN_DIMENSIONS[name]
    assert len(vehicle.thrust_max) == DRIVEN_INPUTS[name] == len(vehicle.input_names[d]) == len(vehicle.input_units[d])
    assert list(DRIVEN_BY_NAME) == list(KNOWN_DRIVEN)
    with pytest.raises(ValueError, match="thrust_max"):
        known.make(tuple(-np.ones(len(inputs))))


@pytest.mark.parametrize("name", ["torpedo2d", "torpedo3d"])
def test_a_torpedo_without_a_plan_circles_on(name):
    """The last resort keeps the least speed, the radius and the rates, and does not stop."""
    known, vehicle = KNOWN_DRIVEN[name], KNOWN_DRIVEN[name].make()
    d, n = vehicle.position_dimension, vehicle.flat_dimension
    problem = ShootingProblem(vehicle, 40, 1.0, "held", 6).subject_to(InputRateLimit(vehicle, known.rate_max))
    plans = ShotPlans(problem)
    state = np.zeros(2 * n)
    state[n], state[n + d] = 1.4, -0.05
    start = plans.start(state, 0.5 * vehicle.thrust_max)
    top = plans.braking(start)
    assert np.all(ThrustRange.of(vehicle).used(top) <= 1.0)
    assert np.all(np.abs(np.diff(np.vstack([start[2 * n :], top]), axis=0)) <= np.array(known.rate_max) + 1e-12)
    assert np.all(top[5:, 1] < 0.0), "it turns on as it did"
    trajectory = plans.trajectory(start, top)
    speeds = np.array([vehicle.velocity(state[: 2 * n]) for state in trajectory.states])
    assert speeds[:, 0].min() > known.speed_min
    assert np.min(speeds[6:, 0] / np.abs(speeds[6:, d])) > known.turn_radius
    assert np.ptp(trajectory.states[10:, 0]) < 4.0 * known.turn_radius, "a circle"
    np.testing.assert_allclose(trajectory.states[1:, 2 * n :], top, atol=1e-12)


def test_a_vessel_without_a_plan_stops():
    plans = ShotPlans(ShootingProblem(KNOWN_DRIVEN["vessel"].make(), 3, 1.0))
    assert not np.any(plans.braking(np.array([0, 0, 0, 2.0, 0, 0])))


def test_limits_of_the_steering():
    """Speed along the bow, in space that of the pitch too; turns to both sides."""
    vehicle = KNOWN_DRIVEN["torpedo3d"].make()
    nu = np.array([1.5, 0.1, -0.2, 0.25, 0.1])
    z, dz = vehicle.flat(np.concatenate([[1.0, 2.0, 3.0, 0.6, -0.3], nu]))
    point = SimpleNamespace(z=ca.SX(ca.DM(z)), dz=ca.SX(ca.DM(dz)))
    assert float(LeastSpeed(3, 0.5).value(point)) == pytest.approx(3.0)
    turn = 4.0 * nu[3] / math.cos(-0.3)
    values = np.asarray(ca.DM(LeastTurnRadius(3, 4.0).value(point))).ravel()
    np.testing.assert_allclose(values, [1.5 - turn, 1.5 + turn])
    assert float(PitchLimit(0.6).value(point)) == pytest.approx(-0.5)
    with pytest.raises(ValueError, match=r"angle: found 1\.6"):
        PitchLimit(1.6)


def test_limits_on_rates_need_a_plan_by_integration():
    vehicle = KNOWN_DRIVEN["vessel"].make()
    with pytest.raises(ValueError, match="rate: found"):
        InputRateLimit(vehicle, (1.0, 0.0))
    from gbt_ocp.models import PlanarPointMass

    flat = PlanarPointMass()
    with pytest.raises(ValueError, match=r"limits.input_rate: found planner.form: flat; allowed: shooting"):
        TrajectoryProblem(flat, 3, 0.1).subject_to(InputRateLimit(flat, (1.0, 1.0)))


@pytest.mark.parametrize("name", ["torpedo2d", "torpedo3d"])
def test_the_helm_keeps_the_limits_of_the_vehicle(name):
    known, vehicle = KNOWN_DRIVEN[name], KNOWN_DRIVEN[name].make()
    d, n, period = vehicle.position_dimension, vehicle.flat_dimension, 0.1
    helm = Helm(vehicle, period, SteeringLimits(known.speed_min, known.turn_radius, known.rate_max))
    state, given = np.zeros(2 * n), [np.zeros(d)]
    state[n] = known.cruise
    for k in range(130):
        velocity = np.array([0.0, 1.9 if k < 80 else -1.9, 0.3])[:d]
        given.append(helm.reach_velocity(np.vstack(vehicle.flat(state)), velocity))
        state = moved(vehicle, state, given[-1], period)
        ahead, rate = vehicle.velocity(state)[[0, d]]
        assert ahead >= known.speed_min
        assert ahead >= known.turn_radius * abs(rate)
        assert np.all(np.abs(given[-1] - given[-2]) <= period * np.array(known.rate_max) + 1e-12)
        if k == 79:
            np.testing.assert_allclose(vehicle.flat(state)[1][:d], velocity, atol=0.15)


def test_the_follower_comes_back_to_its_plan():
    """From a metre beside, against inputs alone; within range and rates."""
    known, vehicle = KNOWN_DRIVEN["torpedo2d"], KNOWN_DRIVEN["torpedo2d"].make()
    inputs = np.tile([8.0, 0.05], (8, 1))
    plans = ShotPlans(ShootingProblem(vehicle, 8, 1.0, "held", 6))
    start = np.array([0, 0, 0, 1.4, 0, 0.0])
    knots = plans.trajectory(start, inputs).knots
    plan = SimpleNamespace(thrust=inputs, thrust_end=None, period=1.0, knots=knots, current=None)
    ends = {}
    for bandwidth in (0.0, 2.0):
        follower, state, before = ShotFollower(vehicle, bandwidth, known.rate_max), start.copy(), None
        state[1] = 1.0
        for k in range(45):
            asked = follower.thrust(plan, 0.1, 0.1 * k, *vehicle.flat(state))
            assert np.all(ThrustRange.of(vehicle).used(asked) <= 1.0)
            assert before is None or np.all(np.abs(asked - before) <= 0.1 * np.array(known.rate_max) + 1e-9)
            state, before = moved(vehicle, state, asked, 0.1), asked
        ends[bandwidth] = float(np.linalg.norm(state[:2] - follower.planned(plan, 0.1, 4.5)))
    assert ends[2.0] < 0.4 < 0.8 < ends[0.0]


def test_the_name_of_a_vehicle_brings_its_limits_along():
    configuration = load_config("sea2d", overrides=["vehicle.model=torpedo2d"])
    assert configuration.planner.form == "shooting"
    assert build_problem(configuration, build_vehicle(configuration)).runge_kutta_steps == 5
    assert {"range", "speed", "input_rate", "speed_min", "turn_radius"} <= set(configuration.limits.hard)
    # legs of one and a half times half a turn at 1.4 times the least radius
    assert configuration.desired_bearing.reverse_s == round(1.5 * math.pi * 1.4 * 4.0 / 1.96)
    assert configuration.desired_bearing.target_speed == 0.0
    assert load_config("sea2d", overrides=["vehicle.model=vessel"]).desired_bearing.reverse_s == 12.0
    assert "pitch" in load_config("torpedo3d").limits.hard
    assert load_config("sea2d", overrides=["vehicle.model=falcon"]).vehicle.parameters == "falcon"
    assert load_config(configuration.to_mapping()) == configuration


def test_a_half_turn_leads_away_from_the_target():
    known, vehicle, period = KNOWN_DRIVEN["torpedo2d"], KNOWN_DRIVEN["torpedo2d"].make(), 0.1
    target, wanted = np.array([0.0, 40.0]), np.array([-1.9, 0.0])
    for yaw in (0.0, 0.3, -0.3):  # across the line of sight, the other way than it is to go
        helm = Helm(vehicle, period, SteeringLimits(known.speed_min, known.turn_radius, known.rate_max))
        state, nearest = np.array([0.0, 0.0, yaw, known.cruise, 0.0, 0.0]), math.inf
        for _ in range(200):
            z, dz = vehicle.flat(state)
            course = turning_away(wanted, z[2], target - z[:2])
            state = moved(vehicle, state, helm.reach_velocity(np.vstack([z, dz]), course), period)
            nearest = min(nearest, np.linalg.norm(target - z[:2]))
        assert nearest > 38.0, "a turn through the target's side ends at 31 m"
        assert abs(math.remainder(state[2] - math.pi, 2.0 * math.pi)) < 0.2
    np.testing.assert_array_equal(turning_away(wanted, 2.0, target), wanted)
    given = turning_away(np.array([-1.0, 0.0, 0.2]), 0.0, np.array([0.0, 5.0, 3.0]))
    np.testing.assert_allclose(given, [0.0, -1.0, 0.2])


@pytest.mark.parametrize(
    ("overrides", "line"),
    [
        (["vehicle.model=torpedo3d"], "vehicle.model: found .*torpedo3d.*; allowed: torpedo2d, vessel"),
        (["vehicle.model=torpedo2d", "planner.form=flat"], "planner.form: found .*flat.*; allowed: shooting"),
        (["vehicle.model=vessel", "guidance.kind=circumnavigation"], f"guidance.kind: .*{LAWS_OF_DRIVEN[1]}"),
        (["vehicle.model=vessel", "command=setpoint"], "command: found setpoint"),
        (["vehicle.model=vessel", "plant.drag=1.2", "vehicle.follow=dynamics"], "plant: found"),
        (["vehicle.model=torpedo2d", "vehicle.thrust_max=[1.0]"], "vehicle.thrust_max: found .*; allowed: .*2 numbers"),
        (
            ["vehicle.model=submarine"],
            "vehicle.model: found .*submarine.*; allowed: falcon, bluerov2_heavy, torpedo2d, torpedo3d, vessel",
        ),
    ],
)
def test_what_does_not_fit_such_a_vehicle_is_one_line(overrides, line):
    with pytest.raises(ConfigurationError, match=line):
        load_config("sea2d", overrides=overrides)


def test_the_current_is_found_from_how_a_vessel_moves():
    """Over ground it drifts with the water; thrust and drag belong to the motion through it."""
    vehicle, water = KNOWN_DRIVEN["vessel"].make(), np.array([0.4, -0.3])
    observer, state, rng = CurrentObserver(vehicle), np.array([0, 0, 0.3, 1.0, 0, 0]), np.random.default_rng(0)
    drift, given = np.zeros(2), rng.uniform(-30.0, 80.0, (15, 2))
    before = np.add(vehicle.flat(state), [[0, 0, 0], [*water, 0]])
    for k in range(150):
        inputs = given[k // 10]
        state, drift = moved(vehicle, state, inputs, 0.2), drift + 0.2 * water
        after = np.add(vehicle.flat(state), [[*drift, 0], [*water, 0]])
        observer.observe(before, after, inputs, 0.2)
        before = after
    np.testing.assert_allclose(observer.velocity, water, atol=0.05)


def instance(vehicle, seed):
    rng, n, d = np.random.default_rng(seed), vehicle.flat_dimension, vehicle.position_dimension
    state = np.zeros(2 * n)
    state[:d], state[d], state[n] = rng.normal(size=d), rng.uniform(-1.0, 1.0), 1.3
    mean = np.array([20.0, 6.0, 2.0])[:d] + 0.5 * np.arange(1, 5)[:, None]
    return np.stack(vehicle.flat(state)), SimpleNamespace(mean=mean, covariance=np.tile(np.eye(d), (4, 1, 1)))


@pytest.mark.parametrize(
    "thrust", [pytest.param("held", marks=pytest.mark.long), pytest.param("linear", marks=pytest.mark.slow)]
)
def test_several_steps_and_rates_compiled_as_by_ipopt(thrust, tmp_path):
    """Chain rule in C against CasADi's derivatives of the multiple-shooting program; and the generated folder."""
    known, vehicle = KNOWN_DRIVEN["torpedo2d"], KNOWN_DRIVEN["torpedo2d"].make()
    problem = ShootingProblem(vehicle, 4, 1.0, thrust, 4).maximize(RangePull(2, 0.05, 3.0))
    problem = problem.subject_to(ThrustLimit(vehicle, 0.98)).subject_to(InputRateLimit(vehicle, known.rate_max))
    problem = problem.subject_to(LeastSpeed(2, 0.8), nodes=2).subject_to(LeastTurnRadius(2, 4.0), nodes=2)
    planners = [problem.compile(solver) for solver in ("compiled", "ipopt")]
    for seed in range(4):
        state, forecast = instance(vehicle, seed)
        plans = []
        for planner in planners:
            planner.reset()
            planner.act([6.0, 0.2])
            plans.append(planner.solve(state, forecast))
        assert [plan.status for plan in plans] == ["solved"] * 2
        assert plans[0].objective == pytest.approx(plans[1].objective, abs=1e-3)
        for plan in plans:
            ends = plan.thrust if plan.thrust_end is None else plan.thrust_end
            if thrust == "linear":
                np.testing.assert_allclose(plan.thrust[0], [6.0, 0.2])
                np.testing.assert_allclose(plan.thrust[1:], ends[:-1], atol=1e-9)
            changes = np.diff(np.vstack([[6.0, 0.2], ends]), axis=0)
            assert np.all(np.abs(changes) <= np.array(known.rate_max) * (1.0 + 1e-6))
            assert plan.violation < 0.2
    if thrust == "linear":
        folder = write_c(planners[0], tmp_path / "planner")
        found = verify_folder(folder, flags="-O1 -Werror -fsanitize=address,undefined -fno-sanitize-recover=all")
        assert (found.faults, found.difference < 1e-9) == ((), True)


@pytest.mark.long
def test_a_torpedo_closes_the_loop():
    """With feedback, through a plant with a lag; its own limits in every sample."""
    overrides = ["vehicle.follow=feedback", "guidance.startup_deviation=0.6", "planner.pieces=8", "plant.thrust=0.97"]
    overrides += ["tracker.noise.std_deg=1.15"]
    loop, start = build_loop(load_config("torpedo2d", overrides=overrides, seed=1))
    history = simulate(loop, start, 12.0).history
    ahead, rate = history.vehicle_velocity[:, 0], history.vehicle_velocity[:, -1]
    assert ahead.min() >= 0.8
    assert np.all(ahead >= 4.0 * np.abs(rate) - 0.05)
    assert np.nanmax(history.piece_thrust_peak) <= 1.0
    # all plans begin inside the standoff, and each goes on from the last one, which leads out already
    assert np.all(np.isin(history.solver_status[history.planned], ("solved", "given up")))
    assert np.median(history.solver_iterations[history.planned]) <= 12
    assert history.planned.sum() >= 3
    assert np.nanmax(history.off_plan) < 0.5
    assert np.all(np.isfinite(history.power))
    distance = np.linalg.norm(history.target - history.vehicle_pose[:, :2], axis=1)
    assert distance.min() > 30.0
    pytest.importorskip("pandas", reason="pandas is not installed; the rest of the test passed")
    assert "thrust_rudder" in dataframe(history, loop.vehicle.input_names[2])
