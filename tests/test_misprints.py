"""Where the paper is silent or misprinted: one test a row of the table, each of which fails on the misprint.

Theorem 2 of E13 belongs to the coregionalised tracker.
"""

import casadi as ca
import numpy as np
import pytest
import synthetic_run
from scipy.integrate import solve_ivp, trapezoid
from scipy.linalg import sqrtm
from scipy.stats import chi2, multivariate_normal

from gbt_ocp.experiments.build.desired import build_desired_bearing
from gbt_ocp.experiments.build.loop import build_vehicle
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.guidance.objectives import BearingSimilarity, sigma_points, sigma_weights
from gbt_ocp.models.bearings import DesiredBearing, condition_number, cumulative_bearing_matrix, unit_bearing
from gbt_ocp.models.fossen import FALCON_2D, FossenVehicle, rotation
from gbt_ocp.models.targets import case_target
from gbt_ocp.ocp import FlatTrajectory, ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.plan import Plan
from gbt_ocp.ocp.problem_data import PenaltyLimit
from gbt_ocp.ocp.transcription import smoothed_hinge, transcribe
from gbt_ocp.simulation.mover import Mover
from gbt_ocp.simulation.summary import summarise
from gbt_ocp.tracking.gp.bounds import bearing_bound
from gbt_ocp.tracking.gp.kernels import KERNELS
from gbt_ocp.tracking.gp.likelihood import LogLikelihood
from gbt_ocp.tracking.gp.posterior import Hyperparameters, Posterior
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.tracking.window import Window

FALCON = FossenVehicle(FALCON_2D, (5000.0, 5000.0, 1500.0))


def flat_inputs(vehicle):
    symbols = [ca.SX.sym(name, vehicle.flat_dimension) for name in ("z", "dz", "ddz")]
    function = ca.Function("inputs", symbols, [vehicle.inputs(*symbols)])
    return lambda *point: np.asarray(function(*point)).ravel()


def window(count=6, scale=1.0, capacity=20):
    """Bearings to a target that moves; lengths in units of ``scale``."""
    rng = np.random.default_rng(0)
    found = Window(capacity)
    for k in range(count):
        own = 3.0 * rng.standard_normal(2)
        found.append(0.1 * k, unit_bearing([2.0 + 0.1 * k, 1.0], own), scale * own)
    return found


def test_e1_the_smoothed_hinge_is_continuous_at_both_ends():
    width, printed = 0.01, lambda x: (x - 0.01) ** 2 / 0.04
    for end, value in ((-width, 0.0), (width, width)):
        for x in (end - 1e-12, end + 1e-12):
            assert float(smoothed_hinge(x, width)) == pytest.approx(value, abs=1e-11)
        assert abs(printed(end) - value) > 0.9 * width


def test_e2_the_likelihood_has_the_signs_of_a_normal_density():
    data, theta = window().measurements(), np.log([0.8, 2.0])
    h, lag = data.directions, data.times[:, None] - data.times[None, :]
    omega = 4.0 * (np.exp(-0.5 * (lag / 0.8) ** 2) * (h @ h.T) + 1e-3 * np.eye(6))
    found = LogLikelihood(KERNELS["se"], data, np.zeros(2), 1e-3)(theta)[0]
    assert found == pytest.approx(multivariate_normal(np.zeros(6), omega).logpdf(data.values))
    log_det, quadratic = np.linalg.slogdet(omega)[1], data.values @ np.linalg.solve(omega, data.values)
    assert abs(found + 0.5 * (quadratic - log_det - 6 * np.log(2 * np.pi))) > 1.0


@pytest.mark.parametrize("dimension", [2, 3])
def test_e3_sigma_point_weights_run_over_both_signs_and_sum_to_one(dimension):
    weights = sigma_weights(dimension, 1.0)
    assert len(weights) == 2 * dimension + 1
    assert weights.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(weights[1:], 1.0 / (2.0 * (dimension + 1.0)))
    # All of them are in the objective: a target that is surely ahead has similarity one.
    objective = BearingSimilarity(dimension)
    ahead = np.eye(dimension)[:1]
    bound = objective.bind(1, {"forecast": Forecast(1e4 * ahead, 0.01 * np.eye(dimension)[None]), "desired": ahead})
    z = ca.DM.zeros(dimension + 1)
    value = objective.value(type("Point", (), {"z": z}), {name: ca.DM(v[0]) for name, v in bound.items()})
    assert float(value) == pytest.approx(1.0, abs=1e-9)


def test_e4_the_window_holds_every_sample_so_far_up_to_its_capacity():
    found = Window(4)
    for k in range(8):
        found.append(0.1 * k, [0.6, 0.8], [0.0, 0.0])
        assert len(found) == min(4, k + 1)
        first = max(0, k - 4 + 1)
        np.testing.assert_allclose(found.times, 0.1 * np.arange(first, k + 1))


def test_e5_coriolis_forces_act_on_body_velocities():
    # A steady turn: constant body velocities, so that C(ν)ν is all there is besides drag, whatever the yaw.
    nu, inputs = np.array([1.0, 0.4, 0.5]), flat_inputs(FALCON)
    turning = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    printed = []
    for yaw in (0.0, 1.0, 2.5):
        j = rotation(yaw, 3)
        thrust = inputs([0.0, 0.0, yaw], j @ nu, nu[2] * j @ turning @ nu)
        expected = (FALCON.coriolis_matrix(nu) + FALCON.damping_matrix(nu)) @ nu
        np.testing.assert_allclose(thrust, expected, atol=1e-9)
        printed.append(FALCON.coriolis_matrix(nu) @ (j @ nu) + FALCON.damping_matrix(nu) @ nu)
    assert np.abs(printed[0] - printed[2]).max() > 100.0
    # And that thrust keeps the turn: the forward model, integrated for a second.
    state = np.concatenate([np.zeros(3), nu])
    steady = inputs(np.zeros(3), nu, nu[2] * turning @ nu)
    found = solve_ivp(lambda t, x: FALCON.rates(x, steady), (0.0, 1.0), state, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(found.y[3:, -1], nu, atol=1e-9)


def test_e6_the_penalty_weighs_thrust_in_units_of_its_limit():
    assert ThrustLimit(FALCON).units == "normalised"
    problem = TrajectoryProblem(FALCON, 1, 0.1).maximize(BearingSimilarity(2)).subject_to_penalty(ThrustLimit(FALCON))
    soft: PenaltyLimit = problem.penalties[0]
    assert (soft.weight, soft.width) == (1000.0, 0.01)
    config = load_config({"problem": "case2"}).planner
    assert (config.weight, config.width, config.thrust_units) == (1000.0, 0.01, "normalised")
    # A tenth over the surge limit and growing with the drag: 1000 times shares of the limit, not 1000 times newtons.
    top = np.array([1.1 * 5000.0 / 283.6, 0.0, 0.0])
    program = transcribe(problem)
    start = np.zeros((2, 3))
    parameters = np.concatenate([start.ravel(), np.zeros(12), [soft.width, soft.weight, 0.0]])
    penalty = ca.Function("penalty", [program.variables, program.parameters], [program.penalty])
    inputs = flat_inputs(FALCON)
    excess = [inputs(0.5 * s * s * top, s * top, top)[0] / 5000.0 - 1.0 for s in np.linspace(0.0, 0.1, 21)]
    expected = 1000.0 * trapezoid(excess, dx=0.005)
    found = float(penalty(top / FALCON.acceleration_scale, parameters))
    assert found == pytest.approx(expected, rel=1e-6)


def test_e7_two_presets_differ_in_where_the_prior_lies_and_what_is_tuned():
    paper = load_config({"problem": "case2", "preset": "paper"}).tracker
    default = load_config({"problem": "case2"}).tracker
    assert (paper.centre, paper.amplitude, paper.length_scale, paper.prior) == ("origin", 1.0, "tuned", None)
    assert (default.centre, default.amplitude, default.length_scale) == ("vehicle", "tuned", "tuned")
    # A prior centred on the vehicle makes the posterior move with the world; one at the origin does not.
    theta = Hyperparameters(np.log([1.0]), 0.0, 1e-8)
    moved, shift = Window(20), np.array([100.0, -40.0])
    for t, b, own in zip(window().times, window().bearings, window().own_positions, strict=True):
        moved.append(t, b, own + shift)
    last = window().own_positions[-1]

    def mean(data, centre):
        return Posterior(KERNELS["se"], theta, data.measurements(), centre).predict(np.array([0.8])).mean[0]

    np.testing.assert_allclose(mean(moved, last + shift), mean(window(), last) + shift, atol=1e-4)
    assert np.abs(mean(moved, np.zeros(2)) - mean(window(), np.zeros(2)) - shift).max() > 0.1


def test_e8_the_nugget_is_relative_to_the_amplitude():
    assert load_config({"problem": "case2", "preset": "paper"}).tracker.nugget == 1e-8
    assert load_config({"problem": "case2"}).tracker.nugget == "tuned"
    # A world a thousand times larger, with a prior as much wider, is the same problem; with metres it were not.
    small = Posterior(KERNELS["se"], Hyperparameters(np.log([0.5]), 0.0, 0.01), window().measurements(), np.zeros(2))
    large = Posterior(
        KERNELS["se"], Hyperparameters(np.log([0.5]), np.log(1e3), 0.01), window(scale=1e3).measurements(), np.zeros(2)
    )
    times = np.array([0.5, 0.9])
    np.testing.assert_allclose(large.predict(times).mean, 1e3 * small.predict(times).mean, rtol=1e-9)
    np.testing.assert_allclose(large.predict(times).covariance, 1e6 * small.predict(times).covariance, atol=1e-3)


@pytest.mark.parametrize("case", ["case1", "case4"])
def test_e9_a_run_lasts_30_s_from_rest_in_a_box_of_5_m(case):
    config = load_config({"problem": case})
    assert config.duration_s == 30.0
    start = config.vehicle.start
    assert (start.position_m, start.box_m, start.yaw_deg) == (None, 5.0, 0.0)
    fixed = load_config({"problem": "case1", "vehicle": {"start": {"position_m": [1.0, 2.0], "yaw_deg": 90.0}}})
    assert (fixed.vehicle.start.position_m, fixed.vehicle.start.yaw_deg) == ((1.0, 2.0), 90.0)


def test_e10_tracking_error_is_the_mean_over_the_forecast_whole_and_settled():
    history = synthetic_run.history(steps=100)
    summary = summarise(
        history,
        period=0.1,
        seed=0,
        wall_s=1.0,
        solver_first_try=np.ones(101, dtype=bool),
        retries={},
        versions={},
    )
    each = [sum(row) / 12 for row in history.error]
    assert summary["error_mean"] == pytest.approx(np.mean(each))
    assert summary["error_settled"] == pytest.approx(np.mean(each[20:]))
    assert summary["error_final"] == pytest.approx(each[100])
    assert summary["error_rms"] == pytest.approx(np.sqrt(np.mean(np.square(each))))
    assert summary["error_median"] == pytest.approx(np.median(each))
    # Start-up weighs: the two are not the same number.
    assert summary["error_mean"] > 1.5 * summary["error_settled"]


@pytest.mark.parametrize(("surge", "within"), [(5.0, True), (40.0, False)])
def test_e11_the_vehicle_follows_the_flat_output_or_its_dynamics_within_the_limits(surge, within):
    period, yaw = 0.1, 0.7
    start = np.array([[1.0, -2.0, yaw], [0.3, 0.1, 0.4]])
    top = np.array([[surge * np.cos(yaw), surge * np.sin(yaw), 2.0]])
    plan = Plan(FlatTrajectory(period, start, top), "solved", 0.0, 0.0, np.zeros(1), 1, 0.0)
    planned = start[0] + period * start[1] + 0.5 * period**2 * top[0]

    exact = Mover(FALCON, period, "exact").follow(FALCON.state(*start), plan)
    assert exact.clipped is not within
    if within:
        np.testing.assert_allclose(exact.flat, [planned, start[1] + period * top[0]], rtol=1e-12)

    moved = Mover(FALCON, period, "dynamics").follow(FALCON.state(*start), plan)
    thrust, limit = flat_inputs(FALCON), FALCON.thrust_max

    def rates(s, x):
        point = (start[0] + s * start[1] + 0.5 * s**2 * top[0], start[1] + s * top[0], top[0])
        return FALCON.rates(x, np.clip(thrust(*point), -limit, limit))

    end = solve_ivp(rates, (0.0, period), FALCON.state(*start), rtol=1e-10, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(moved.state, end, atol=1e-4)  # the corner of the clipped thrust lies between samples
    if not within:  # what no thrust within the limits can follow is not followed exactly either
        np.testing.assert_allclose(exact.state, end, atol=1e-4)
    # The difference between the two is what the limits take away.
    assert bool(np.abs(moved.flat[0] - planned).max() < 1e-5) is within
    assert max(moved.thrust_peak.max(), exact.thrust_peak.max()) <= 1.0


def test_e12_the_root_of_the_covariance_is_the_symmetric_one_and_survives_round_off():
    factor = np.random.default_rng(1).standard_normal((3, 3))
    sigma = factor @ factor.T
    columns = sigma_points(np.zeros(3), sigma, 1.0)[4:]
    np.testing.assert_allclose(columns, columns.T, atol=1e-12)
    np.testing.assert_allclose(columns, np.real(sqrtm(4.0 * sigma)), atol=1e-10)
    assert np.abs(columns - np.linalg.cholesky(4.0 * sigma).T).max() > 0.1
    # A covariance of rank one with a negative eigenvalue from round-off has real points on its line.
    line = np.array([1.0, 2.0, -1.0])
    points = sigma_points(np.zeros(3), np.outer(line, line) - 1e-12 * np.eye(3), 1.0)
    assert np.all(np.isfinite(points))
    np.testing.assert_allclose(np.cross(points, line), 0.0, atol=1e-5)


@pytest.mark.parametrize("nugget", [1e-10, 0.2])
def test_e13_the_bound_is_theorem_1_and_with_a_nugget_still_bounds_the_posterior(nugget):
    data, times, variance = window(8), np.array([0.75, 0.9, 1.2]), 4.0
    kernel, theta = KERNELS["se"], Hyperparameters(np.log([1.5]), np.log(2.0), nugget)
    covariances = variance * kernel(times[:, None] - data.times[None, :], theta.log_kernel)
    matrix = data.bearing_matrix()
    found = bearing_bound(covariances, variance, matrix, delta=0.05, noise_variance=nugget * variance)
    beta = np.sqrt(chi2(2).isf(0.05 / 3))
    printed = beta * np.sqrt(
        variance - covariances.min(axis=1) ** 2 / (np.sqrt(2.0) * variance * np.linalg.cond(matrix))
    )
    if nugget < 1e-6:
        np.testing.assert_allclose(found, printed, rtol=1e-6)
    else:
        # Noise makes the bound looser, never tighter.
        assert np.all(found > printed + 1e-3)
    posterior = Posterior(kernel, theta, data.measurements(), np.zeros(2)).predict(times).covariance
    assert np.all((found / beta) ** 2 >= np.linalg.eigvalsh(posterior)[:, -1])


@pytest.mark.parametrize("number", [2, 5])
def test_e14_the_figure_eight_has_its_denominators_squared_as_printed(number):
    # At t = 4 s, sin² = 1: both denominators are 4, a lemniscate's would be 2. At 2 s, sin² = 1/2.
    target = case_target(number)
    np.testing.assert_allclose(target.position(2.0)[:2], [3.0 * np.sqrt(0.5) / 2.25, 1.5 / 2.25], atol=1e-12)
    np.testing.assert_allclose(target.position(4.0)[:2], [0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(target.position(6.0)[:2], [-3.0 * np.sqrt(0.5) / 2.25, -1.5 / 2.25], atol=1e-12)
    np.testing.assert_allclose(target.position(0.0)[:2], [3.0, 0.0])


def test_e15_drag_is_twice_differentiable_at_rest():
    symbols = [ca.SX.sym(name, 3) for name in ("z", "dz", "ddz")]
    surge = FALCON.inputs(*symbols)[0]
    hessian = ca.Function("h", symbols, [ca.hessian(surge, symbols[1])[0]])
    curvature = [float(hessian(np.zeros(3), [u, 0.0, 0.0], np.zeros(3))[0, 0]) for u in (-1e-6, 0.0, 1e-6)]
    # |u|u has curvature -2 and +2 times D_u on the two sides of rest.
    assert np.all(np.isfinite(curvature))
    np.testing.assert_allclose(np.diff(curvature), 0.0, atol=0.01 * 241.3)
    assert curvature[1] == pytest.approx(0.0, abs=1e-9)
    # And at speed it is the drag of the paper.
    at_speed = flat_inputs(FALCON)(np.zeros(3), [2.0, 0.0, 0.0], np.zeros(3))[0]
    assert at_speed == pytest.approx(26.9 * 2.0 + 241.3 * 4.0, rel=1e-4)


@pytest.mark.parametrize(("case", "turn_s"), [("case2", 1.0), ("case5", 0.4)])
def test_e16_desired_bearings_turn_once_in_m_sampling_periods(case, turn_s):
    config = load_config({"problem": case})
    period, m, dimension = config.sensor.period_s, config.desired_bearing.m, config.dimension
    desired = build_desired_bearing(config, build_vehicle(config))
    np.testing.assert_allclose(desired(0.37 + turn_s), desired(0.37), atol=1e-12)
    assert np.abs(desired(0.37 + 0.5 * turn_s) - desired(0.37)).max() > 0.5
    # m samples in a row are perfectly conditioned; at 1/(T m), without 2π, they are far from it.
    assert condition_number(cumulative_bearing_matrix(desired(period * np.arange(m)))) == pytest.approx(1.0)
    slow = DesiredBearing(dimension, 1.0 / (period * m))
    assert condition_number(cumulative_bearing_matrix(slow(period * np.arange(m)))) > 3.0
    config = load_config({"problem": case, "desired_bearing": {"period_s": 20.0}})
    usable = build_desired_bearing(config, build_vehicle(config))
    np.testing.assert_allclose(usable(20.37), usable(0.37), atol=1e-12)
    assert np.abs(usable(10.0) - usable(0.0)).max() > 0.5


def test_e17_endpoints_and_accelerations_are_the_same_unknowns():
    rng, period = np.random.default_rng(2), 0.1
    start, endpoints = rng.standard_normal((2, 3)), rng.standard_normal((4, 3))
    plan = FlatTrajectory.from_endpoints(period, start, endpoints)
    z, dz = start
    for i in range(4):
        a = 2.0 * (endpoints[i] - z - period * dz) / period**2
        np.testing.assert_allclose(plan.top[i], a, rtol=1e-10)
        z, dz = endpoints[i], dz + period * a
        np.testing.assert_allclose(plan.knots[i + 1], [z, dz], atol=1e-9)
    # The start is ż(0) = J ν: the earth-frame velocity, not its body components.
    state = np.array([1.0, 2.0, 0.8, 1.5, -0.3, 0.2])
    moving = FlatTrajectory(period, np.array(FALCON.flat(state)), np.zeros((1, 3)))
    found = solve_ivp(lambda t, x: FALCON.rates(x, np.zeros(3)), (0.0, 1e-4), state, rtol=1e-10).y[:3, -1]
    np.testing.assert_allclose(moving(1e-4), found, atol=1e-7)
