"""What a plan knows of the target's path: against FilterPy's recursion, the filters' models, and sampled motions."""

import casadi as ca
import numpy as np
import pytest

from gbt_ocp.experiments.build.objective import build_objective, build_path
from gbt_ocp.experiments.build.sensors import build_sensor
from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.guidance.path_information import MotionInformation, stage_ends
from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.ocp import FlatPoint
from gbt_ocp.tracking.filters.ekf import ExtendedKalmanFilter, FirstGuess
from gbt_ocp.tracking.filters.kalman import predicted
from gbt_ocp.tracking.filters.motion_models import constant_velocity
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker
from gbt_ocp.tracking.path_belief import PathBelief, path_covariance
from gbt_ocp.tracking.priors import RangedPrior
from gbt_ocp.tracking.protocol import Forecast, JointForecast

both_dimensions = pytest.mark.parametrize("dimension", [2, 3])
AHEAD = 4.0


def belief(dimension, seed=0):
    """Covariance of position and velocity, with ranges and speeds that go together."""
    root = np.random.default_rng(seed).normal(size=(2 * dimension, 2 * dimension))
    root[dimension:] *= 0.2
    return root @ root.T + 0.01 * np.eye(2 * dimension)


def marginals(motion, times, noise):
    """Covariance of the position after each time, by the recursion of the motion model."""
    d = len(motion) // 2
    transition, spread = constant_velocity(times, d)
    return predicted(np.zeros(2 * d), motion, transition, noise * spread)[1][:, :d, :d]


@both_dimensions
def test_covariances_of_two_times_are_those_of_sampled_motions(dimension):
    motion, noise, times = belief(dimension), 0.05, np.array([1.0, 3.0, 7.0])
    found = path_covariance(times, motion[:dimension, :dimension], marginals(motion, times, noise), motion)
    rng, count = np.random.default_rng(1), 200_000
    state, places = rng.multivariate_normal(np.zeros(2 * dimension), motion, count), []
    for step in np.diff(times, prepend=0.0):
        transition, spread = constant_velocity(step, dimension)
        state = state @ transition.T + rng.multivariate_normal(np.zeros(2 * dimension), noise * spread, count)
        places.append(state[:, :dimension])
    sampled = np.einsum("kni,nlj->kilj", np.array(places), np.array(places).transpose(1, 0, 2)) / count
    np.testing.assert_allclose(found, sampled, atol=0.02 * np.abs(sampled).max())


@both_dimensions
def test_without_a_motion_it_is_found_from_the_forecast(dimension):
    """Exactly, where the covariance of position and velocity is symmetric, as is all that forecasts show."""
    motion, noise, times = belief(dimension), 0.05, 1.0 * np.arange(1, 8)
    cross = motion[:dimension, dimension:]
    motion[:dimension, dimension:] = motion[dimension:, :dimension] = 0.5 * (cross + cross.T)
    motion[dimension:, dimension:] += np.eye(dimension)
    ahead = marginals(motion, times, noise)
    known = path_covariance(times, motion[:dimension, :dimension], ahead, motion)
    np.testing.assert_allclose(path_covariance(times, motion[:dimension, :dimension], ahead), known, atol=1e-8)
    np.testing.assert_allclose(np.einsum("kikj->kij", known), ahead, atol=1e-9)


def test_a_covariance_that_no_motion_has_is_made_one():
    """A forecast whose variance falls: no velocity, and nothing is negative."""
    times = np.array([1.0, 2.0, 3.0])
    found = path_covariance(times, 4.0 * np.eye(2), np.array([np.eye(2) * (4.0 - t) for t in times]))
    assert np.linalg.eigvalsh(found.reshape(6, 6)).min() > -1e-9


def planned(objective, path, mean, own):
    """Value of an objective for a vehicle at these places, in numbers."""
    pieces, d = own.shape
    bound = objective.bind(pieces, {"forecast": Forecast(mean, np.zeros((pieces, d, d))), "path": path})
    sums = 0
    for k in range(pieces):
        point = FlatPoint(ca.DM(own[k]), ca.DM.zeros(d), ca.DM.zeros(d))
        sums = sums + objective.accumulated(point, {name: ca.DM(values[k]) for name, values in bound.items()})
    return float(objective.of_sums(sums))


@both_dimensions
@pytest.mark.parametrize("criterion", ["logdet", "trace"])
def test_the_planned_covariance_is_filterpy_s_where_the_motion_is_straight(dimension, criterion):
    """Covariance recursion of a Kalman filter along the plan, of every stage, then predicted ahead."""
    kalman = pytest.importorskip("filterpy.kalman", reason="FilterPy comes with the extra bench")
    pieces, stages, period, sigma, d = 8, 2, 0.7, 0.03, dimension
    rng, motion = np.random.default_rng(2), belief(dimension)
    times = period * np.arange(1, pieces + 1)
    mean = np.array([8.0, 3.0, 2.0])[:d] + 0.3 * times[:, None]
    own = rng.normal(0.0, 2.0, (pieces, d))
    asked = np.concatenate([times, times[stage_ends(pieces, stages)] + AHEAD])
    path = path_covariance(asked, motion[:d, :d], marginals(motion, asked, 0.0), motion)
    objective = MotionInformation(d, pieces, criterion, stages)
    found = planned(objective, JointForecast(path, 0.0, sigma**2), mean, own)

    filter_ = kalman.KalmanFilter(2 * d, d - 1)
    filter_.P, filter_.F, filter_.Q = motion.copy(), constant_velocity(period, d)[0], np.zeros((2 * d, 2 * d))
    ahead, expected = constant_velocity(AHEAD, d)[0], []
    for k in range(pieces):
        filter_.predict()
        line = mean[k] - own[k]
        across = np.linalg.svd(line[None])[2][1:]
        filter_.update(np.zeros(d - 1), R=sigma**2 * (line @ line) * np.eye(d - 1), H=np.hstack([across, 0.0 * across]))
        if k in stage_ends(pieces, stages):
            now, later = filter_.P[:d, :d], (ahead @ filter_.P @ ahead.T)[:d, :d]
            if criterion == "trace":
                expected.append(-0.5 * pieces * np.log(np.trace(now) + np.trace(later)))
            else:
                expected.append(-0.25 * pieces / d * (np.linalg.slogdet(now)[1] + np.linalg.slogdet(later)[1]))
    assert found == pytest.approx(np.mean(expected), rel=1e-5)


def test_with_a_velocity_that_changes_the_planned_covariance_is_near():
    """What happens on the way counts as noise of each bearing by itself, which it is not in the filter."""
    pieces, period, sigma, noise = 10, 1.0, 0.03, 2e-3
    motion, times = belief(2, seed=3), period * np.arange(1, pieces + 1)
    mean, angle = np.array([9.0, 2.0]) + 0.2 * times[:, None], 0.35 * times
    own = 3.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    asked = np.append(times, times[-1] + AHEAD)
    path = path_covariance(asked, motion[:2, :2], marginals(motion, asked, noise), motion)
    value = planned(MotionInformation(2, pieces, "trace"), JointForecast(path, 0.0, sigma**2), mean, own)
    planned_variance = np.exp(-2.0 / pieces * value)
    covariance = motion
    for k in range(pieces):
        transition, spread = constant_velocity(period, 2)
        covariance = predicted(np.zeros(4), covariance, transition, noise * spread)[1]
        line = mean[k] - own[k]
        row = np.array([-line[1], line[0], 0.0, 0.0]) / np.linalg.norm(line)
        gain = covariance @ row / (row @ covariance @ row + sigma**2 * (line @ line))
        covariance = covariance - np.outer(gain, row @ covariance)
    later = marginals(covariance, np.array([AHEAD]), noise)[0]
    exact = np.trace(covariance[:2, :2]) + np.trace(later)
    assert 0.9 * exact < planned_variance < 1.2 * exact


def test_trackers_give_their_own_motion():
    guess = FirstGuess(RangedPrior(np.zeros(2), range=10.0), 5.0, 1.0)
    tracker = ExtendedKalmanFilter(guess, process_noise=0.02, bearing_std=0.02)
    assert tracker.motion_at(0.0) is None
    for k in range(20):
        own = np.array([0.1 * k, 0.05 * k**1.5])
        tracker.update(0.2 * k, unit_bearing(np.array([10.0 + 0.1 * k, 4.0]), own), own)
    times = 5.0 + np.arange(4.0)
    found = PathBelief(tracker, 1e-4, 10.0, [3])(4.0, times)
    assert found.covariance.shape == (5, 2, 5, 2)
    marginal = np.einsum("kikj->kij", found.covariance)
    np.testing.assert_allclose(marginal[:4], tracker.predict(times).covariance, rtol=1e-6)
    process = GaussianProcessTracker(2, window=10, length_scale=4.0, amplitude=5.0, nugget=1e-4)
    for k in range(6):
        process.update(0.2 * k, unit_bearing(np.array([6.0, 2.0]), np.array([0.1 * k, 0.0])), np.array([0.1 * k, 0.0]))
    joint = process.joint(np.append(times, times[-1] + 10.0))
    given = PathBelief(process, 1e-4, 10.0, [3])(1.0, times)
    np.testing.assert_allclose(given.covariance, joint.covariance)
    assert given.angle_variance == pytest.approx(joint.angle_variance + 1e-4)


@pytest.mark.parametrize("kind", ["motion_gp", "imm_ekf", "held_turn"])
def test_the_belief_at_sea_agrees_with_the_forecast(kind):
    chosen = ["planner.objective=motion_trace"]
    if kind != "motion_gp":
        exact = ", bearing_std_deg: 0.1" if kind == "imm_ekf" else ""  # as the bearings below are
        chosen.append("tracker={kind: " + kind + ", forecast: 20, forecast_period_s: 1.0" + exact + "}")
    configuration = load_config("sea2d", chosen)
    tracker = build_tracker(configuration.tracker, np.zeros(2), build_sensor(configuration))
    believed = build_path(configuration, build_objective(configuration), tracker)
    for k in range(300):
        own = np.array([0.3 * k, 5.0 * np.sin(0.03 * k)])
        tracker.update(0.1 * k, unit_bearing(np.array([40.0, 20.0 + 0.1 * k]), own), own)
    times = 30.0 + np.arange(1.0, 21.0)
    path, forecast = believed(30.0, times), tracker.predict(times)
    spread, own = np.einsum("kikj->kij", path.covariance)[:20], forecast.covariance
    assert path.covariance.shape == (22, 2, 22, 2)
    ratio = np.trace(spread, axis1=1, axis2=2) / np.trace(own, axis1=1, axis2=2)
    # white noise on the velocity stands for whatever else the tracker believes
    assert np.all((ratio > 0.5) & (ratio < 2.0)), ratio
