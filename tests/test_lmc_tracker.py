"""The coregionalised tracker: what it shares with the plain one, and what its axes tell of each other."""

import numpy as np
import pytest

import gbt_ocp as gbt
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.tracking.gp.bounds import posterior_bound
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker
from gbt_ocp.tracking.gp.lmc import CoregionalizedTracker
from gbt_ocp.tracking.gp.posterior import LARGEST_NUGGET
from gbt_ocp.tracking.priors import PositionPrior
from gbt_ocp.tracking.protocol import GaussianProcess

COVARIANCE = np.array([[4.0, 1.5], [1.5, 1.0]])


def known_at(position, covariance=COVARIANCE):
    return PositionPrior(np.zeros(2), np.array(position), covariance)


def motion(times, dimension=2, slope=-0.6):
    """Along a line at varying speed, with a little of its own on each axis."""
    s = 1.2 * times + 0.5 * np.sin(0.9 * times)
    return np.stack([2.0 + s, 1.0 + slope * s + 0.05 * np.cos(times), 0.3 * s + 0.05 * np.sin(times)], axis=-1)[
        ..., :dimension
    ]


def fed(tracker, times, slope=-0.6):
    dimension = tracker.dimension
    target = motion(times, dimension, slope)
    angle = 2.0 * np.pi * times
    around = np.stack([np.cos(angle), np.sin(angle), 0.5 * np.sin(1.3 * angle)], axis=-1)[:, :dimension]
    for t, p, o in zip(times, target, target - 0.3 * around, strict=True):
        tracker.update(float(t), unit_bearing(p, o), o)
    return tracker


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("extra", [0, 1])
def test_it_tracks_as_the_plain_process_does(dimension, extra):
    times = 0.1 * np.arange(30)
    kernels = ["se"] * dimension + ["matern52"] * extra
    tracker = fed(CoregionalizedTracker(dimension, kernels=kernels), times)
    assert isinstance(tracker, GaussianProcess)
    ahead = times[-1] + 0.1 * np.arange(12)
    error = np.linalg.norm(tracker.predict(ahead).mean - motion(ahead, dimension), axis=1)
    assert error.max() < 0.03
    # the measured positions are inside the bound, which is never below the posterior's
    bound = tracker.bound(ahead, 0.05)
    assert np.all(error <= bound)
    assert np.all(bound >= posterior_bound(tracker.predict(ahead).covariance, delta=0.05) * (1.0 - 1e-9))
    assert np.all(np.isfinite(tracker.printed_bound(ahead, 0.05)))


@pytest.mark.parametrize("slope", [-0.6, 0.6])
def test_the_covariance_of_the_axes_has_the_sign_of_the_motion(slope):
    tracker = fed(CoregionalizedTracker(2, length_scale=1.0, nugget=1e-10), 0.1 * np.arange(40), slope)
    matrix = tracker.prior_covariance
    assert np.sign(matrix[0, 1]) == np.sign(slope)
    assert abs(matrix[0, 1]) > 0.5 * np.sqrt(matrix[0, 0] * matrix[1, 1])
    np.testing.assert_allclose(tracker.hyperparameters.length_scales, 1.0)
    plain = fed(GaussianProcessTracker(2, length_scale=1.0, nugget=1e-10), 0.1 * np.arange(40), slope)
    assert plain.prior_covariance[0, 1] == 0.0


def test_before_the_first_bearing_the_prior_is_the_answer():
    tracker = CoregionalizedTracker(2, prior=known_at([3.0, -1.0]))
    plain = GaussianProcessTracker(2, prior=known_at([3.0, -1.0]))
    for found, expected in zip(tracker.predict([0.0]), plain.predict([0.0]), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-9)
    unknown = CoregionalizedTracker(2, prior=PositionPrior(np.array([1.0, 2.0])))
    np.testing.assert_allclose(unknown.predict([0.0, 9.0]).mean, [[1.0, 2.0]] * 2)
    np.testing.assert_allclose(unknown.predict([0.0]).covariance[0], 9.0 * np.eye(2))
    assert np.all(np.isfinite(unknown.bound([0.0, 1.0], 0.05)))


def test_the_prior_position_leaves_with_the_first_bearing():
    times = 0.1 * np.arange(9)
    known = CoregionalizedTracker(2, window=5, prior=known_at([2.0, 1.05], 0.0001 * np.eye(2)))
    fed(known, times[:1])
    # one bearing alone says nothing of range
    np.testing.assert_allclose(known.predict([0.0]).mean[0], [2.0, 1.05], atol=0.01)
    known = fed(CoregionalizedTracker(2, window=5, prior=known_at([2.0, 1.05])), times[:5])
    assert len(known._measurements().times) == 5 + 2
    known.update(0.5, [1.0, 0.0], [0.0, 0.0])
    assert len(known._measurements().times) == 5


HARD_WINDOWS = {
    "same place, same bearing": lambda k, rng: ([1.0, 0.0], [0.0, 0.0]),
    "nearly the same": lambda k, rng: (unit_bearing([5.0, 1e-9 * k], [0.0, 0.0]), [0.0, 1e-9 * k]),
    "to and fro": lambda k, rng: ([1.0 - 2.0 * (k % 2), 0.0], [0.0, 0.0]),
    "contradictory": lambda k, rng: (unit_bearing(rng.standard_normal(2), [0.0, 0.0]), [0.0, 0.0]),
    "very far": lambda k, rng: (unit_bearing([1e7, 1.0], [0.0, float(k)]), [1e6, float(k)]),
}


@pytest.mark.parametrize("settings", [{}, {"nugget": 1e-16}, {"kernels": ["se", "rq", "matern32"]}], ids=str)
@pytest.mark.parametrize("name", HARD_WINDOWS)
@pytest.mark.long
def test_no_window_is_too_badly_conditioned(name, settings):
    rng = np.random.default_rng(5)
    tracker = CoregionalizedTracker(2, **settings)
    for k in range(25):
        tracker.update(0.01 * k, *HARD_WINDOWS[name](k, rng))
        forecast = tracker.predict(0.01 * k + 0.1 * np.arange(12))
        assert np.all(np.isfinite(forecast.mean))
        assert np.all(np.isfinite(forecast.covariance))
        assert np.all(np.isfinite(tracker.bound(0.01 * k + 0.1 * np.arange(12), 0.05)))
        assert 0.0 < tracker.hyperparameters.nugget <= LARGEST_NUGGET


@pytest.mark.parametrize(
    ("key", "value"), [("kernels", ["se"]), ("kernels", ["se", "cubic"]), ("nugget", 0.0), ("window", 1)]
)
def test_impossible_settings_are_refused(key, value):
    with pytest.raises(ValueError, match=r"found|capacity"):
        CoregionalizedTracker(2, **{key: value})


def test_a_run_with_it_and_what_it_records():
    settings = ["tracker.kind=lmc", "planner.formulation=hard", "duration_s=4.0"]
    result = gbt.run(gbt.load_config("case6", settings, 0))
    assert result.summary["error_settled"] < 0.05
    assert np.all(result.history.error[20:] <= result.history.bound[20:])
    matrices = result.history.prior_cov
    assert np.any(np.abs(matrices[:, 0, 1]) > 0.1)
    np.testing.assert_allclose(result.history.amplitude**2, np.trace(matrices, axis1=1, axis2=2) / 3.0, rtol=1e-9)


def test_what_a_configuration_may_say_of_it():
    made = gbt.load_config("case5", ["tracker={kind: lmc, kernels: [se, se, matern52, rq]}"]).tracker
    assert made.kernels == ("se", "se", "matern52", "rq")
    assert (made.window, made.centre, made.nugget) == (12, "vehicle", "tuned")
    with pytest.raises(ConfigurationError) as caught:
        gbt.load_config("case5", ["tracker={kind: lmc, kernels: [se, se]}"])
    assert len(caught.value.faults) == 1
    assert "at least 3 of se, matern32" in caught.value.faults[0]
    # what both Gaussian processes have is kept when one takes the other's place; the amplitude is not
    paper = gbt.load_config("case2", ["preset=paper", "tracker.kind=lmc"]).tracker
    assert (paper.centre, paper.nugget) == ("origin", 1e-8)
    with pytest.raises(ConfigurationError, match="amplitude"):
        gbt.load_config("case2", ["tracker={kind: lmc, amplitude: 2.0}"])
