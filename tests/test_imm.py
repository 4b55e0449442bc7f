"""Interacting multiple models: FilterPy's on the same data, mode switches that are followed, and positive matrices."""

import numpy as np
import pytest

from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.tracking.filters.imm import MODES, ImmPositionTracker, ImmPseudoLinearTracker, InteractingMultipleModel
from gbt_ocp.tracking.priors import RangedPrior

PERIOD = 0.1


def models(**keys):
    given = {"initial_variance": 1.0, "process_noise": 0.02, "jerk_noise": 0.5, "stay_probability": 0.9}
    return InteractingMultipleModel(**{**given, "turn_rate_max": 2.0, **keys})


def prior(dimension=2, std=3.0):
    return RangedPrior(np.zeros(dimension), np.zeros(dimension), std**2 * np.eye(dimension), range=3.0)


def manoeuvring(times):
    """Straight for 10 s, a turn at 0.8 rad/s for 10 s, straight again; at 1.5 m/s."""
    fine = np.linspace(0.0, times[-1], 30_001)
    heading = 0.8 * np.clip(fine - 10.0, 0.0, 10.0)
    step = fine[1]
    x, y = (np.concatenate([[0.0], np.cumsum(1.5 * f(heading[:-1] + 0.4 * step) * step)]) for f in (np.cos, np.sin))
    return np.stack([np.interp(times, fine, x), np.interp(times, fine, y)], axis=-1)


@pytest.mark.parametrize("dimension", [2, 3])
def test_full_positions_are_those_of_filterpy(dimension):
    kalman = pytest.importorskip("filterpy.kalman", reason="FilterPy comes with the extra bench")
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.choice([0.05, 0.1, 0.3], 200))
    truth = np.concatenate([manoeuvring(times), np.sin(times)[:, None]], axis=1)[:, :dimension]
    values = truth + 0.02 * rng.standard_normal(truth.shape)

    ours = ImmPositionTracker(prior(dimension), models(), position_std=0.02)
    filters = []
    for _ in MODES:
        one = kalman.KalmanFilter(dim_x=3 * dimension, dim_z=dimension)
        one.x = np.zeros(3 * dimension)
        one.P = np.diag([9.0] * dimension + [1.0] * 2 * dimension)
        one.H, one.R = np.eye(dimension, 3 * dimension), 0.02**2 * np.eye(dimension)
        filters.append(one)
    theirs = kalman.IMMEstimator(filters, np.full(3, 1.0 / 3.0), ours.models.transition)
    for k, (t, value) in enumerate(zip(times, values, strict=True)):
        if k:
            transitions, noises = ours.models.models(t - times[k - 1])
            for one, transition, noise in zip(filters, transitions, noises, strict=True):
                one.F, one.Q = transition, noise
            theirs.predict()
        else:
            # theirs mixes before it predicts, and starts with an update
            theirs.cbar = np.full(3, 1.0 / 3.0)
        ours.update_position(t, value)
        theirs.update(value)
        np.testing.assert_allclose(ours.models.probabilities, theirs.mu, atol=1e-9)
        np.testing.assert_allclose(ours.models.combined()[0], theirs.x, atol=1e-9)
        np.testing.assert_allclose(ours.models.combined()[1], theirs.P, atol=1e-9)
        for j, one in enumerate(filters):
            np.testing.assert_allclose(ours.models.means[j], one.x, atol=1e-9)
            np.testing.assert_allclose(ours.models.covariances[j], one.P, atol=1e-9)


def followed(tracker, update, times):
    """Mode probabilities ``(K, 3)`` and errors of the position and of the forecast a second ahead ``(K, 2)``."""
    truth = manoeuvring(np.append(times, times[-1] + 2.0))
    ahead = np.stack([np.interp(times + 1.0, np.append(times, times[-1] + 2.0), axis) for axis in truth.T], axis=-1)
    modes, errors = [], []
    for k, t in enumerate(times):
        update(k, t, truth[k])
        forecast = tracker.predict([t, t + 1.0])
        modes.append(tracker.models.probabilities.copy())
        errors.append(np.linalg.norm(forecast.mean - [truth[k], ahead[k]], axis=1))
    return np.array(modes), np.array(errors)


STRAIGHT, TURNING, AFTER = slice(60, 100), slice(130, 200), slice(250, 300)
DECIDED = {"process_noise": 1e-3, "jerk_noise": 1.0, "stay_probability": 0.98}
"""Modes that last: with 0.9 a tenth of each is mixed into the others every 0.1 s, and none is ever sure."""


def test_the_modes_follow_a_target_that_switches_seen_in_full():
    rng = np.random.default_rng(0)
    tracker = ImmPositionTracker(prior(), models(**DECIDED), position_std=0.005)
    times = PERIOD * np.arange(300)
    noise = 0.005 * rng.standard_normal((300, 2))
    modes, errors = followed(tracker, lambda k, t, p: tracker.update_position(t, p + noise[k]), times)
    np.testing.assert_allclose(modes.sum(axis=1), 1.0, atol=1e-12)
    velocity, turn = MODES.index("constant velocity"), MODES.index("coordinated turn")
    assert modes[STRAIGHT, velocity].mean() > 0.8
    assert modes[TURNING, turn].mean() > 0.8
    assert modes[AFTER, velocity].mean() > 0.8
    assert errors[TURNING, 0].mean() < 0.006
    # constant velocity would be 1.5 m/s * 0.8 rad/s / 2 = 0.6 m off a second ahead
    assert errors[TURNING, 1].mean() < 0.15


def test_the_modes_follow_a_target_that_switches_seen_by_bearings():
    rng = np.random.default_rng(1)
    tracker = ImmPseudoLinearTracker(prior(), models(**DECIDED), bearing_std=0.005, initial_variance=1.0)
    times = PERIOD * np.arange(300)
    noise = 0.005 * rng.standard_normal((300, 1))

    def update(k, t, position):
        line = np.array([np.cos(2.0 * np.pi * t + 0.3), np.sin(2.0 * np.pi * t + 0.3)])
        own = position - 1.0 * line
        tracker.update(t, rotate_bearing(unit_bearing(position, own), noise[k]), own)

    modes, errors = followed(tracker, update, times)
    assert modes[STRAIGHT, 0].mean() > 0.8
    assert modes[TURNING, 2].mean() > 0.8
    assert modes[AFTER, 0].mean() > 0.8
    assert errors[TURNING, 0].mean() < 0.02
    assert errors[TURNING, 1].mean() < 0.3


@pytest.mark.parametrize("dimension", [2, 3])
def test_matrices_stay_symmetric_and_positive_definite_and_no_mode_dies(dimension):
    rng = np.random.default_rng(dimension)
    tracker = ImmPseudoLinearTracker(
        prior(dimension), models(process_noise=1e-8, jerk_noise=1e-8), bearing_std=1e-5, initial_variance=1.0
    )
    for k in range(400):
        target = np.array([0.1 * k, 3.0 * np.sin(0.05 * k), 0.2 * k])[:dimension]
        own = target + rng.standard_normal(dimension)
        tracker.update(PERIOD * k, unit_bearing(target, own), own)
        found = tracker.models.covariances
        np.testing.assert_array_equal(found, np.swapaxes(found, -1, -2))
        assert np.all(np.linalg.eigvalsh(found) > 0.0)
        assert np.all(tracker.models.probabilities > 0.0)
    assert np.all(np.isfinite(tracker.predict(PERIOD * np.arange(400, 412)).mean))


def test_likelihoods_far_below_the_smallest_number_still_weigh_the_modes():
    tracker = ImmPositionTracker(prior(), models(process_noise=1e-6, jerk_noise=1e-6), position_std=1e-4)
    for k in range(30):
        tracker.update_position(PERIOD * k, [PERIOD * k, 0.0])
    tracker.update_position(3.0, [50.0, 0.0])
    np.testing.assert_allclose(tracker.models.probabilities.sum(), 1.0)
    assert np.all(np.isfinite(tracker.models.combined()[0]))


def test_the_forecast_is_the_mixture_of_the_modes_own_predictions():
    tracker = ImmPositionTracker(prior(), models(), position_std=0.01)
    times = PERIOD * np.arange(120)
    for t, position in zip(times, manoeuvring(times), strict=True):
        tracker.update_position(t, position)
    transitions, noises = tracker.models.models(0.7)
    mean, covariance = np.zeros(2), np.zeros((2, 2))
    each = [f @ m for f, m in zip(transitions, tracker.models.means, strict=True)]
    for weight, state in zip(tracker.models.probabilities, each, strict=True):
        mean += weight * state[:2]
    for j, weight in enumerate(tracker.models.probabilities):
        spread = transitions[j] @ tracker.models.covariances[j] @ transitions[j].T + noises[j]
        covariance += weight * (spread[:2, :2] + np.outer(each[j][:2] - mean, each[j][:2] - mean))
    forecast = tracker.predict([times[-1] + 0.7])
    np.testing.assert_allclose(forecast.mean[0], mean, atol=1e-12)
    np.testing.assert_allclose(forecast.covariance[0], covariance, atol=1e-12)


@pytest.mark.parametrize(
    ("keys", "allowed"),
    [
        ({"initial_variance": 0.0}, "numbers > 0"),
        ({"jerk_noise": -1.0}, "numbers > 0"),
        ({"turn_rate_max": 0.0}, "numbers > 0"),
        ({"stay_probability": 1.0}, "between 0 and 1"),
    ],
)
def test_parameters_out_of_range_are_refused(keys, allowed):
    with pytest.raises(ValueError, match=allowed):
        models(**keys)


def test_bad_positions_are_refused():
    tracker = ImmPositionTracker(prior(), models(), position_std=0.01)
    tracker.update_position(0.0, [0.0, 0.0])
    for time, position in [(0.0, [0.0, 0.0]), (1.0, [np.inf, 0.0])]:
        with pytest.raises(ValueError, match=r"increase|finite"):
            tracker.update_position(time, position)
    with pytest.raises(ValueError, match="position_std"):
        ImmPositionTracker(prior(), models(), position_std=0.0)
    with pytest.raises(ValueError, match="bearing_std"):
        ImmPseudoLinearTracker(prior(), models(), bearing_std=0.0, initial_variance=1.0)
