import numpy as np
import pytest

from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.pilot.compiled_gp import CompiledGaussianProcessTracker
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker
from gbt_ocp.tracking.gp.posterior import LARGEST_NUGGET
from gbt_ocp.tracking.priors import PositionPrior

TURN = np.array([[0.6, -0.8], [0.8, 0.6]])
COVARIANCE = np.array([[4.0, 1.5], [1.5, 1.0]])
KNOWN = PositionPrior(np.zeros(2), np.array([3.0, -1.0]), COVARIANCE)


def circling(times):
    """A target on a straight line, and a vehicle that goes round it once a second."""
    target = np.stack([2.0 + 0.5 * times, 1.0 - 0.2 * times], axis=-1)
    angle = 2.0 * np.pi * times
    return target, target - 1.5 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def fed(times, tracker, turn=None):
    turn = np.eye(2) if turn is None else turn
    target, own = circling(times)
    for t, p, o in zip(times, target, own, strict=True):
        tracker.update(float(t), unit_bearing(turn @ p, turn @ o), turn @ o)
    return tracker


def test_irregular_samples_need_no_special_case():
    times = np.sort(np.random.default_rng(3).uniform(0.0, 2.0, 25))
    tracker = fed(times, GaussianProcessTracker(2, window=20))
    ahead = times[-1] + np.array([0.0, 0.3])
    np.testing.assert_allclose(tracker.predict(ahead).mean, circling(ahead)[0], atol=2e-3)


def test_before_the_first_bearing_the_prior_is_the_answer():
    tracker = GaussianProcessTracker(2, prior=KNOWN, amplitude=50.0)
    forecast = tracker.predict([0.0])
    np.testing.assert_allclose(forecast.mean, [[3.0, -1.0]], atol=1e-9)
    # a Gaussian prior of variance a² seen through the covariance: (C⁻¹ + I/a²)⁻¹
    expected = np.linalg.inv(np.linalg.inv(COVARIANCE) + np.eye(2) / 2500.0)
    np.testing.assert_allclose(forecast.covariance[0], expected, rtol=1e-6)
    plain = GaussianProcessTracker(2, prior=PositionPrior(np.array([1.0, 2.0])), amplitude=3.0).predict([0.0, 9.0])
    np.testing.assert_allclose(plain.mean, [[1.0, 2.0]] * 2)
    np.testing.assert_allclose(plain.covariance, [9.0 * np.eye(2)] * 2)


def test_prior_and_bearing_are_combined_as_by_bayes():
    tracker = GaussianProcessTracker(2, prior=KNOWN, amplitude=1e4, length_scale=1.0, nugget=1e-16)
    tracker.update(4.0, [0.6, 0.8], [1.0, 1.0])
    # A Kalman update of the prior with the line λ̄ᵀP = λ̄ᵀP_A; the amplitude is all but infinite.
    normal = np.array([-0.8, 0.6])
    gain = COVARIANCE @ normal / (normal @ COVARIANCE @ normal)
    mean = np.array([3.0, -1.0]) + gain * (normal @ (np.array([1.0, 1.0]) - [3.0, -1.0]))
    forecast = tracker.predict([4.0])
    np.testing.assert_allclose(forecast.mean[0], mean, atol=1e-4)
    expected = COVARIANCE - np.outer(gain, normal @ COVARIANCE)
    np.testing.assert_allclose(forecast.covariance[0], expected, atol=1e-3)


@pytest.mark.parametrize("centre", ["vehicle", "origin"])
def test_the_prior_position_leaves_with_the_first_bearing(centre):
    settings = {"window": 5, "length_scale": 2.0, "amplitude": 3.0, "nugget": 1e-9, "centre": centre}
    times = 0.1 * np.arange(9)
    trackers = [
        GaussianProcessTracker(2, **settings, prior=PositionPrior(np.zeros(2), np.full(2, 9.0), 0.01 * np.eye(2))),
        GaussianProcessTracker(2, **settings),
    ]
    target, own = circling(times)
    for k, t in enumerate(times):
        for tracker in trackers:
            tracker.update(t, unit_bearing(target[k], own[k]), own[k])
        one, other = (tracker.predict([t + 0.1]).mean for tracker in trackers)
        # Five samples fit: the sixth pushes out the first, and the prior with it.
        if k < 5:
            assert np.abs(one - other).max() > 1e-5
        else:
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("tuned", [False, True])
def test_a_rotated_world_gives_the_rotated_answer(tuned):
    settings = {"window": 20} if tuned else {"window": 20, "length_scale": 2.0, "amplitude": 3.0}
    position = np.array([2.5, 0.0])
    priors = (
        PositionPrior(np.zeros(2), position, COVARIANCE),
        PositionPrior(np.zeros(2), TURN @ position, TURN @ COVARIANCE @ TURN.T),
    )
    plain, turned = (GaussianProcessTracker(2, **settings, nugget=1e-8, prior=prior) for prior in priors)
    for count in (1, 3, 8):
        fed(0.1 * np.arange(count) + 10.0 * count, plain)
        fed(0.1 * np.arange(count) + 10.0 * count, turned, TURN)
        ahead = 10.0 * count + 0.1 * np.arange(count, count + 5)
        one, other = plain.predict(ahead), turned.predict(ahead)
        allowed = 1e-3 if tuned else 1e-6
        np.testing.assert_allclose(other.mean, one.mean @ TURN.T, atol=allowed)
        np.testing.assert_allclose(other.covariance, TURN @ one.covariance @ TURN.T, atol=allowed)


@pytest.mark.parametrize("covariance", [None, -np.eye(2), np.zeros((2, 2))])
def test_a_prior_needs_a_positive_covariance(covariance):
    with pytest.raises(ValueError, match="covariance"):
        PositionPrior(np.zeros(2), np.zeros(2), covariance)


def test_what_is_refused_leaves_the_tracker_unchanged():
    tracker = fed(0.1 * np.arange(6), GaussianProcessTracker(2))
    before = tracker.predict([0.6]).mean
    for time, bearing, own in [
        (0.5, [1.0, 0.0], [0.0, 0.0]),
        (0.6, [1.0, 1.0], [0.0, 0.0]),
        (0.6, [1.0, 0.0], [np.nan, 0.0]),
    ]:
        with pytest.raises(ValueError, match="must"):
            tracker.update(time, bearing, own)
    assert len(tracker.window) == 6
    np.testing.assert_array_equal(tracker.predict([0.6]).mean, before)


HARD_WINDOWS = {
    "same place, same bearing": lambda k, rng: ([1.0, 0.0], [0.0, 0.0]),
    "nearly the same": lambda k, rng: (unit_bearing([5.0, 1e-9 * k], [0.0, 0.0]), [0.0, 1e-9 * k]),
    "to and fro": lambda k, rng: ([1.0 - 2.0 * (k % 2), 0.0], [0.0, 0.0]),
    "contradictory": lambda k, rng: (unit_bearing(rng.standard_normal(2), [0.0, 0.0]), [0.0, 0.0]),
    "very far": lambda k, rng: (unit_bearing([1e7, 1.0], [0.0, float(k)]), [1e6, float(k)]),
}


BOTH = pytest.mark.parametrize("kind", [GaussianProcessTracker, CompiledGaussianProcessTracker])


@BOTH
@pytest.mark.parametrize("settings", [{}, {"amplitude": 1e7}, {"length_scale": 1e6, "amplitude": 1e-6}], ids=str)
@pytest.mark.parametrize("name", HARD_WINDOWS)
def test_no_window_is_too_badly_conditioned(name, settings, kind):
    rng = np.random.default_rng(5)
    tracker = kind(2, nugget=1e-16, **settings)
    for k in range(30):
        tracker.update(0.01 * k, *HARD_WINDOWS[name](k, rng))
        forecast = tracker.predict(0.01 * k + 0.1 * np.arange(12))
        assert np.all(np.isfinite(forecast.mean))
        assert np.all(np.isfinite(forecast.covariance))
        assert np.all(np.isfinite(tracker.bound(0.01 * k + 0.1 * np.arange(12), 0.05)))
        assert 1e-16 <= tracker.hyperparameters.nugget <= LARGEST_NUGGET
    if "length_scale" in settings:
        assert tracker.nugget_retries > 0


@BOTH
def test_retries_are_counted_and_show_in_the_nugget(kind):
    tracker = kind(2, window=200, length_scale=100.0, amplitude=3.0, nugget=1e-16)
    fed(0.02 * np.arange(200), tracker)
    # The last sample alone needed as many as its nugget shows.
    needed = round(np.log10(tracker.hyperparameters.nugget / 1e-16))
    assert needed >= 1
    assert tracker.nugget_retries >= needed
    before = tracker.nugget_retries
    target, own = circling(np.array([4.1]))
    tracker.update(4.1, unit_bearing(target[0], own[0]), own[0])
    nugget = tracker.hyperparameters.nugget
    assert tracker.nugget_retries - before == round(np.log10(nugget / 1e-16))
    np.testing.assert_allclose(tracker.predict([4.1]).mean, target, atol=1e-2)


@BOTH
def test_a_well_conditioned_window_needs_no_retry(kind):
    tracker = fed(0.1 * np.arange(30), kind(2, length_scale=1.0, amplitude=3.0, nugget=1e-8))
    assert tracker.nugget_retries == 0
    assert tracker.hyperparameters.nugget == 1e-8


@pytest.mark.parametrize(("key", "value"), [("kernel", "cubic"), ("nugget", 0.0), ("nugget", np.nan), ("window", 1)])
def test_impossible_settings_are_refused(key, value):
    with pytest.raises(ValueError, match=r"found|capacity"):
        GaussianProcessTracker(2, **{key: value})
