import hashlib
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import odeint, solve_ivp

import gbt_ocp as gbt
from gbt_ocp.models.fossen import DRAG_SMOOTHING, FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.ocp import FlatTrajectory
from gbt_ocp.ocp.plan import Plan
from gbt_ocp.simulation.loop import step_count
from gbt_ocp.simulation.mover import Mover

ROOT = Path(__file__).parents[1]
PERIOD = 0.1
PLANAR = FossenVehicle(FALCON_2D, [5000.0, 5000.0, 1500.0])
SPATIAL = FossenVehicle(FALCON_3D, [5000.0, 5000.0, 5000.0, 1500.0])
CLOCK = ("solver_time", "tracker_time")


def run(case="case1", seconds=2.0, seed=0, **sections):
    """A short run with hard limits and IPOPT, which needs no C compiler."""
    planner = {"formulation": "hard", "solver": "ipopt", **sections.pop("planner", {})}
    return gbt.run({"problem": case, "duration_s": seconds, "seed": seed, "planner": planner, **sections})


def planned(vehicle, strength, seed=0):
    """A plan of two pieces from a moving start, its piece accelerations ``strength`` of full thrust."""
    rng, n = np.random.default_rng(seed), vehicle.flat_dimension
    start = np.vstack([rng.uniform(-2.0, 2.0, n), 0.3 * rng.standard_normal(n)])
    top = strength * rng.uniform(-1.0, 1.0, (2, n)) * vehicle.acceleration_scale
    trajectory = FlatTrajectory(PERIOD, start, top)
    return Plan(trajectory, "solved", 0.0, 0.0, np.zeros(2), 1, 0.0)


def integrated(vehicle, plan):
    """The end of the first piece under its thrust clipped to the limits, by another integrator, no grid in between."""
    symbols = [ca.SX.sym(name, vehicle.flat_dimension) for name in ("z", "dz", "ddz")]
    inputs = ca.Function("inputs", symbols, [vehicle.inputs(*symbols)])

    def rates(s, x):
        thrust = np.asarray(inputs(*(plan(s, order) for order in range(3)))).ravel()
        return vehicle.rates(x, np.clip(thrust, -vehicle.thrust_max, vehicle.thrust_max))

    start = vehicle.state(plan(0.0), plan(0.0, 1))
    # s = T belongs to the next piece already, and its thrust jumps there
    end = PERIOD * (1.0 - 1e-9)
    return solve_ivp(rates, (0.0, end), start, method="DOP853", rtol=1e-11, atol=1e-12, max_step=1e-3).y[:, -1]


@pytest.mark.parametrize("vehicle", [PLANAR, SPATIAL], ids=["planar", "spatial"])
@pytest.mark.parametrize("seed", range(3))
def test_within_the_limits_exact_following_is_what_the_dynamics_do(vehicle, seed):
    plan = planned(vehicle, 0.25, seed)
    state = vehicle.state(*plan.trajectory.start[:2])
    exact, dynamic = (Mover(vehicle, PERIOD, how).follow(state, plan) for how in ("exact", "dynamics"))
    assert exact.thrust_peak.max() < 1.0
    np.testing.assert_allclose(exact.state, integrated(vehicle, plan), atol=1e-6)
    np.testing.assert_allclose(dynamic.state, exact.state, atol=1e-6)
    np.testing.assert_allclose(dynamic.flat, exact.flat, atol=1e-6)
    np.testing.assert_allclose(dynamic.thrust_peak, exact.thrust_peak)
    np.testing.assert_allclose(exact.flat[0], plan(PERIOD))


@pytest.mark.parametrize("vehicle", [PLANAR, SPATIAL], ids=["planar", "spatial"])
def test_the_dynamics_apply_the_limits_where_a_plan_exceeds_them(vehicle):
    plan = planned(vehicle, 5.0)
    state = vehicle.state(*plan.trajectory.start[:2])
    exact, dynamic = (Mover(vehicle, PERIOD, how).follow(state, plan) for how in ("exact", "dynamics"))
    first = plan.trajectory.knots[1]
    asked = max(
        np.abs(
            np.asarray(vehicle.inputs(*(plan.trajectory(s, order) for order in range(3)))).ravel() / vehicle.thrust_max
        ).max()
        for s in np.linspace(0.0, 0.99 * PERIOD, 20)
    )
    assert asked > 1.5
    assert dynamic.thrust_peak.max() == 1.0
    assert dynamic.clipped
    np.testing.assert_allclose(dynamic.state, integrated(vehicle, plan), atol=1e-5)
    assert np.abs(dynamic.state - vehicle.state(first[0], first[1])).max() > 1e-2
    # nothing follows exactly what no thrust within the limits can follow
    np.testing.assert_array_equal(exact.state, dynamic.state)
    np.testing.assert_allclose(vehicle.state(*dynamic.flat[:2]), dynamic.state, atol=1e-12)


def test_both_ways_of_following_give_the_same_run_while_limits_hold():
    # from the start of seed 0 two plans are equally good, and rounding decides
    exact, dynamic = (run(seconds=1.0, seed=1, vehicle={"follow": how}).history for how in ("exact", "dynamics"))
    np.testing.assert_allclose(dynamic.vehicle_pose[:5], exact.vehicle_pose[:5], atol=1e-4)
    for history in (exact, dynamic):
        assert history.piece_thrust_peak.max() <= 1.0


def test_recorded_plan_begins_with_the_pose_that_is_reached():
    history = run(seconds=1.0).history
    np.testing.assert_allclose(history.plan[:-1, 0], history.vehicle_pose[1:], atol=1e-12)
    line = history.target - history.vehicle_pose[:, :2]
    np.testing.assert_allclose(history.bearing, line / np.linalg.norm(line, axis=1, keepdims=True), atol=1e-12)


DIGEST = """
import hashlib, sys
from tests.test_simulation import digest
print(digest(sys.argv[1], int(sys.argv[2])))
"""


def digest(case, seed):
    """Hash of every array of a noisy run, the clock's aside."""
    sensor = {"noise_deg": 0.5, "missed_probability": 0.1, "outlier_deg": 5.0, "outlier_every_s": 0.3}
    history = run(case, seconds=1.0, seed=seed, sensor=sensor).history
    parts = [getattr(history, name).tobytes() for name in sorted(history.__dataclass_fields__) if name not in CLOCK]
    return hashlib.sha256(b"".join(parts)).hexdigest()


@pytest.mark.parametrize("case", ["case2", pytest.param("case6", marks=pytest.mark.slow)])
@pytest.mark.long
def test_one_seed_gives_the_same_bytes_in_another_process(case):
    def elsewhere(seed):
        done = subprocess.run(
            [sys.executable, "-c", DIGEST, case, str(seed)], cwd=ROOT, capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    assert digest(case, 3) == elsewhere(3)
    assert digest(case, 4) != digest(case, 3)


def test_noise_does_not_move_the_start_nor_the_misses():
    base = {"missed_probability": 0.4}
    quiet, loud = (
        run(sensor={**base, **more}, guidance={"kind": "random"}).history
        for more in ({}, {"noise_deg": 3.0, "outlier_deg": 20.0, "outlier_every_s": 0.5})
    )
    np.testing.assert_array_equal(quiet.vehicle_pose, loud.vehicle_pose)
    np.testing.assert_array_equal(quiet.detected, loud.detected)
    seen = quiet.detected
    assert 0 < seen.sum() < len(seen)
    assert np.abs(quiet.bearing[seen] - loud.bearing[seen]).max() > 0.01
    np.testing.assert_array_equal(run(seed=1, seconds=0.2).history.vehicle_pose[0][2:], 0.0)
    assert np.all(run(seed=1, seconds=0.2).history.vehicle_pose[0][:2] != quiet.vehicle_pose[0][:2])


def test_static_stays_where_it_is():
    history = run("case5", guidance={"kind": "static"}).history
    np.testing.assert_array_equal(history.vehicle_pose, np.tile(history.vehicle_pose[0], (21, 1)))
    np.testing.assert_array_equal(history.thrust, 0.0)
    assert history.plan.shape == (21, 0, 4)
    assert not history.planned.any()


def test_constant_force_reaches_the_speed_at_which_drag_balances_it():
    history = run(seconds=20.0, guidance={"kind": "constant_force", "force": [500.0, 0.0, 0.0]}).history
    mass, linear, quadratic = 116.0 + 167.6, 26.9, 241.3

    def surge(state, t):
        u = state[1]
        return [u, (500.0 - linear * u - quadratic * np.sqrt(u * u + DRAG_SMOOTHING) * u) / mass]

    by_hand = odeint(surge, [history.vehicle_pose[0, 0], 0.0], history.t, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(history.vehicle_pose[:, 0], by_hand[:, 0], atol=1e-5)
    np.testing.assert_allclose(history.vehicle_velocity[:, 0], by_hand[:, 1], atol=1e-6)
    terminal = (-linear + np.sqrt(linear**2 + 4.0 * quadratic * 500.0)) / (2.0 * quadratic)
    assert history.vehicle_velocity[-1, 0] == pytest.approx(terminal, abs=1e-3)
    np.testing.assert_array_equal(history.vehicle_velocity[:, 1:], 0.0)


def test_random_thrust_is_integrated_between_its_draws():
    history = run(guidance={"kind": "random", "hold_s": 0.5}).history
    changes = np.any(np.diff(history.thrust, axis=0) != 0.0, axis=1)
    np.testing.assert_array_equal(np.flatnonzero(changes) + 1, [5, 10, 15, 20])
    state = np.concatenate([history.vehicle_pose[0], history.vehicle_velocity[0]])
    for k in range(20):
        state = solve_ivp(
            lambda s, x, k=k: PLANAR.rates(x, history.thrust[k]), (0.0, PERIOD), state, rtol=1e-11, atol=1e-12
        ).y[:, -1]
    np.testing.assert_allclose(np.split(state, 2)[0], history.vehicle_pose[20], atol=1e-6)


@pytest.mark.parametrize("probability", [0.5, 0.999999])
@pytest.mark.parametrize("preset", ["default", "paper"])
def test_a_run_that_sees_little_or_nothing_finishes(probability, preset):
    result = run(sensor={"missed_probability": probability}, preset=preset, seed=1)
    history = result.history
    assert not history.detected[:2].any()
    assert history.detected.any() == (probability == 0.5)
    for name in ("vehicle_pose", "vehicle_velocity", "thrust", "forecast_mean", "forecast_cov", "bound"):
        assert np.all(np.isfinite(getattr(history, name))), name
    assert np.all(np.isnan(history.bearing[~history.detected]))
    assert history.piece_thrust_peak.max() <= 1.0
    assert np.all(np.isinf(history.condition_number[:2]))


def test_a_target_that_passes_through_the_vehicle(tmp_path):
    problem = tmp_path / "through.py"
    problem.write_text(
        "import numpy as np\n"
        "from gbt_ocp.experiments.config.tracking_problem import TrackingProblem\n"
        "class Through:\n"
        "    dimension = 2\n"
        "    def position(self, times):\n"
        "        t = np.asarray(times, dtype=float)\n"
        "        return np.stack([np.round(t - 0.5, 12), 0.0 * t], axis=-1)\n"
        "problem = TrackingProblem('through', 2, 'through the origin', Through)\n"
    )
    at = {"start": {"position_m": [0.0, 0.0]}}
    static = run(str(problem), seconds=1.0, vehicle=at, guidance={"kind": "static"}).history
    np.testing.assert_array_equal(np.flatnonzero(~static.detected), [5])
    assert np.all(np.isfinite(static.error))
    # At the start the planner has nothing to look at, and must move off all the same.
    met = run("case1", seconds=1.0, vehicle={"start": {"position_m": [-1.0, -1.0]}}).history
    assert not met.detected[0]
    assert met.detected[1:].all()
    assert np.all(np.isfinite(met.vehicle_pose))
    assert met.mean_error[-1] < 0.1


@pytest.mark.parametrize(
    ("duration", "period", "steps"), [(30.0, 0.1, 301), (0.3, 0.1, 4), (0.35, 0.1, 4), (0.39, 0.1, 4), (1.1, 0.05, 23)]
)
def test_no_step_lies_beyond_the_duration(duration, period, steps):
    assert step_count(duration, period) == steps


def test_a_run_never_outlasts_its_track(tmp_path):
    # 2.06 s of run and 1.1 s of forecast fit into 3.16 s; a rounded number of steps would not.
    t = np.linspace(0.0, 3.16, 40)
    np.savetxt(
        tmp_path / "track.csv", np.column_stack([t, 3.0 + t, t]), delimiter=",", header="t,x,y", comments="", fmt="%.9f"
    )
    target = {"kind": "track", "path": str(tmp_path / "track.csv")}
    history = run("recorded", seconds=2.06, target=target, guidance={"kind": "static"}).history
    assert history.t[-1] == pytest.approx(2.0)
