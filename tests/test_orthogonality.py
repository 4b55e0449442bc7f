"""The orthogonality-based estimators where they must work, and where theory says that they do not."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gbt_ocp.tracking.filters.orthogonality import OrthogonalityTracker
from gbt_ocp.tracking.priors import RangedPrior

PERIOD = 0.02


def nothing_known(dimension, distance=3.0):
    return RangedPrior(np.zeros(dimension), range=distance)


def circling(tracker, target, rate, seconds, radius=2.0, period=PERIOD):
    """Errors of the position while the vehicle circles the target, so that the line of sight turns at ``rate``."""
    errors = []
    for t in np.arange(0.0, seconds, period):
        here = target(t)
        bearing = np.zeros_like(here)
        bearing[:2] = np.cos(rate * t), np.sin(rate * t)
        tracker.update(t, bearing, here - radius * bearing)
        errors.append(np.linalg.norm(tracker.predict([t]).mean[0] - here))
    return np.array(errors)


def still(t):
    return np.array([1.0, -2.0])


@pytest.mark.parametrize("gain", [0.5, 1.0, 5.0, 10.0])
def test_a_static_target_is_found_at_the_rate_of_theory(gain):
    rate = 1.0
    error = circling(OrthogonalityTracker(nothing_known(2), position_gain=gain), still, rate, 60.0)
    # roots of s² + k s + w²
    slowest = np.max(np.roots([1.0, gain, rate**2]).real)
    assert error[0] == pytest.approx(1.0)
    late, later = error[round(4.0 / -slowest / PERIOD)], error[round(6.0 / -slowest / PERIOD)]
    if gain != 2.0 * rate:
        assert np.log(later / late) / (2.0 / -slowest) == pytest.approx(slowest, rel=0.25)
    assert error[-1] < error[0] * np.exp(0.8 * slowest * 60.0) + 1e-9


def test_a_static_target_is_found_best_with_twice_the_turn_rate():
    reached = [
        circling(OrthogonalityTracker(nothing_known(2), position_gain=gain), still, 1.5, 6.0)[-1]
        for gain in (0.5, 3.0, 20.0)
    ]
    assert reached[1] < 1e-2
    assert reached[1] < 0.1 * min(reached[0], reached[2])


def test_a_static_target_is_found_in_space():
    tracker = OrthogonalityTracker(nothing_known(3), position_gain=4.0)
    target = np.array([0.5, -1.0, 2.0])
    for t in np.arange(0.0, 15.0, PERIOD):
        bearing = np.array([np.cos(2 * t), np.sin(2 * t), np.sqrt(0.5)]) / np.sqrt(1.5)
        tracker.update(t, bearing, target - 3.0 * bearing)
    np.testing.assert_allclose(tracker.predict([15.0]).mean[0], target, atol=1e-6)


def moving(t):
    return np.array([1.0, -2.0]) + t * np.array([0.5, 0.3])


@pytest.mark.parametrize(("gain", "converges"), [(0.55, True), (0.9, True), (1.2, False)])
def test_constant_velocity_is_tracked_only_if_its_gain_is_below_the_square_of_the_turn_rate(gain, converges):
    rate = 2.0
    tracker = OrthogonalityTracker(nothing_known(2), position_gain=2.0 * rate, velocity_gain=gain * rate**2)
    error = circling(tracker, moving, rate, 60.0)
    if not converges:
        assert error[-500:].max() > 10.0 * error[0]
        return
    assert error[-1] < 1e-2 * error[0]
    ahead = tracker.predict([59.98, 61.98])
    np.testing.assert_allclose(ahead.mean[1] - ahead.mean[0], [1.0, 0.6], atol=0.02)


def test_a_step_is_motion_and_then_the_flow_of_the_feedback():
    tracker = OrthogonalityTracker(nothing_known(2), position_gain=1.3, velocity_gain=0.8)
    rng = np.random.default_rng(0)
    angles, owns, times = rng.uniform(0, 6, 4), rng.standard_normal((4, 2)), np.array([0.0, 0.1, 0.7, 3.1])
    state = None
    for t, angle, own in zip(times, angles, owns, strict=True):
        g = np.array([np.cos(angle), np.sin(angle)])
        tracker.update(t, g, own)
        if state is None:
            state, before = np.concatenate([own + 3.0 * g, np.zeros(2)]), t
            continue

        def flow(_, x, g=g, own=own):
            y = (np.eye(2) - np.outer(g, g)) @ (own - x[:2])
            return np.concatenate([1.3 * y, 0.8 * y])

        moved = state + (t - before) * np.concatenate([state[2:], np.zeros(2)])
        state = solve_ivp(flow, (before, t), moved, rtol=1e-11, atol=1e-12).y[:, -1]
        before = t
        np.testing.assert_allclose(tracker.predict([t, t + 1.0]).mean, [state[:2], state[:2] + state[2:]], atol=1e-8)


def test_it_has_no_covariance_and_begins_on_the_first_bearing():
    known = RangedPrior(np.array([9.0, 9.0]), np.array([1.0, 2.0]), np.diag([4.0, 1.0]), range=3.0)
    tracker = OrthogonalityTracker(known, position_gain=1.0)
    np.testing.assert_array_equal(tracker.predict([0.0, 1.0]).mean, [[1.0, 2.0], [1.0, 2.0]])
    g, own = np.array([0.6, 0.8]), np.array([-3.0, 0.0])
    tracker.update(0.0, g, own)
    forecast = tracker.predict([0.0])
    assert np.isnan(forecast.covariance).all()
    # the mode of the prior on the line, by brute force
    reach = np.linspace(-10.0, 10.0, 200_001)
    offset = own + reach[:, None] * g - known.mean
    best = own + reach[np.argmin(offset[:, 0] ** 2 / 4.0 + offset[:, 1] ** 2)] * g
    np.testing.assert_allclose(forecast.mean[0], best, atol=1e-3)
    np.testing.assert_array_equal(OrthogonalityTracker(nothing_known(2), position_gain=1.0).predict([0.0]).mean, 0.0)


@pytest.mark.parametrize("gains", [{"position_gain": 0.0}, {"position_gain": 1.0, "velocity_gain": -1.0}])
def test_gains_out_of_range_are_refused(gains):
    with pytest.raises(ValueError, match=r"_gain: found .*; allowed: a number >"):
        OrthogonalityTracker(nothing_known(2), **gains)


def test_a_bad_sample_leaves_the_estimate_alone():
    tracker = OrthogonalityTracker(nothing_known(2), position_gain=1.0)
    tracker.update(0.0, [1.0, 0.0], [0.0, 0.0])
    before = tracker.predict([0.0]).mean
    for sample in [(0.0, [1.0, 0.0], [0.0, 0.0]), (1.0, [2.0, 0.0], [0.0, 0.0]), (1.0, [1.0, 0.0], [np.nan, 0.0])]:
        with pytest.raises(ValueError, match=r"time must|length 1|finite"):
            tracker.update(*sample)
    np.testing.assert_array_equal(tracker.predict([0.0]).mean, before)
