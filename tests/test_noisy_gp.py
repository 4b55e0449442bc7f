import numpy as np
import pytest

from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.simulation.loop import simulate
from gbt_ocp.tracking.displacement.hypotheses import MotionPriors
from gbt_ocp.tracking.displacement.kernels import DISPLACEMENT_KERNELS
from gbt_ocp.tracking.displacement.tracker import NoisyGaussianProcessTracker
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.priors import LogNormal, PositionPrior

ONE_DEGREE = np.radians(1.0)


def drawn_target(rng, times, dimension, speed=1.0, length=4.0):
    """A path whose velocity is a squared-exponential process, from a place a few metres away."""
    kernel = DISPLACEMENT_KERNELS["velocity_se"](times, times, np.log(length))
    root = np.linalg.cholesky(kernel + 1e-9 * np.eye(len(times)))
    start = rng.standard_normal(dimension)
    return 4.0 * start / np.linalg.norm(start) + speed * root @ rng.standard_normal((len(times), dimension))


def circling(times, dimension):
    """A vehicle that goes round in a circle of 1.5 m once in two seconds."""
    angle = np.pi * times
    return 1.5 * np.stack([np.cos(angle), np.sin(angle), np.sin(0.7 * angle)][:dimension], axis=-1)


def fed(tracker, times, target, own, noise, rng, after=lambda k: None):
    for k, t in enumerate(times):
        turn = noise * rng.standard_normal(target.shape[1] - 1)
        tracker.update(float(t), rotate_bearing(unit_bearing(target[k], own[k]), turn), own[k])
        after(k)
    return tracker


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_errors_are_what_the_posterior_says_they_are(dimension):
    """Monte Carlo: targets drawn from the model, once range is observable; NEES a dimension and coverage of 95 %."""
    from scipy.stats import chi2

    squares = []
    runs = 12
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        times = 0.2 * np.arange(24)
        target, own = drawn_target(rng, times, dimension, speed=0.5), circling(times, dimension)
        tracker = NoisyGaussianProcessTracker(dimension, noise=BearingNoise(ONE_DEGREE), window=20)

        def note(k, tracker=tracker, times=times, target=target):
            if k in (13, 18, 23) and tracker.range_observable:
                forecast = tracker.predict(times[k : k + 1])
                error = forecast.mean[0] - target[k]
                squares.append(error @ np.linalg.solve(forecast.covariance[0], error))

        fed(tracker, times, target, own, ONE_DEGREE, rng, note)
    assert len(squares) > 2 * runs
    # three looks at a run are not independent: the bounds are those of the runs
    assert chi2(runs * dimension).ppf(0.001) / runs < np.mean(squares) < chi2(runs * dimension).ppf(0.999) / runs
    inside = np.mean(np.array(squares) < chi2(dimension).ppf(0.95))
    assert inside > 0.85


@pytest.mark.slow
def test_with_measured_tangents_the_same_bearings_are_told_wrong():
    """What re-linearising is for: at 3° the paper's measurement draws the target towards the vehicle."""
    noise = np.radians(3.0)
    theirs, ours = [], []
    for seed in range(3):
        times = 0.1 * np.arange(45)
        target, own = np.tile([6.0, 1.0], (45, 1)) + 0.3 * times[:, None], circling(times, 2)
        for found, tracker in (
            (theirs, GaussianProcessTracker(2, window=40, nugget=1e-3)),
            (ours, NoisyGaussianProcessTracker(2, noise=BearingNoise(noise))),
        ):
            fed(tracker, times, target, own, noise, np.random.default_rng(seed))
            found.append(np.linalg.norm(tracker.predict(times[-1:]).mean[0] - target[-1]))
    assert np.median(ours) < 1.0
    assert np.median(theirs) > 2.0 * np.median(ours)


def test_one_bearing_says_nothing_about_range_and_a_circle_says_all():
    times = 0.1 * np.arange(40)
    target = np.tile([6.0, 1.0], (40, 1))
    tracker = NoisyGaussianProcessTracker(2, noise=BearingNoise(ONE_DEGREE), prior=PositionPrior(np.array([0.5, 0.0])))
    before = tracker.predict([0.0])
    np.testing.assert_allclose(before.mean, [[0.5, 0.0]])
    assert not tracker.range_observable
    fed(tracker, times[:1], target, circling(times, 2), ONE_DEGREE, np.random.default_rng(0))
    assert not tracker.range_observable
    # the spread along the line of sight is about that of the prior, log-normal with median 5 and spread 1
    forecast = tracker.predict(times[:1])
    sight = unit_bearing(forecast.mean[0], circling(times, 2)[0])
    assert 3.0 < np.sqrt(sight @ forecast.covariance[0] @ sight) < 15.0
    fed(tracker, times[1:], target[1:], circling(times, 2)[1:], ONE_DEGREE, np.random.default_rng(1))
    assert tracker.range_observable
    assert tracker.relative_range_std < 0.1
    np.testing.assert_allclose(tracker.predict(times[-1:]).mean[0], target[-1], atol=0.4)


@pytest.mark.slow
def test_a_vehicle_that_stays_where_it_is_learns_no_range():
    times = 0.1 * np.arange(60)
    target = np.tile([6.0, 1.0], (60, 1))
    tracker = NoisyGaussianProcessTracker(2, noise=BearingNoise(ONE_DEGREE))
    fed(tracker, times, target, np.zeros((60, 2)), ONE_DEGREE, np.random.default_rng(0))
    assert not tracker.range_observable
    assert tracker.relative_range_std > 0.4


def test_a_known_position_is_used_at_the_start():
    times = 0.1 * np.arange(3)
    target = np.tile([6.0, 1.0], (3, 1))
    tracker = NoisyGaussianProcessTracker(
        2, noise=BearingNoise(ONE_DEGREE), prior=PositionPrior(np.zeros(2), np.array([6.2, 1.0]), 0.04 * np.eye(2))
    )
    np.testing.assert_allclose(tracker.predict([0.0]).mean, [[6.2, 1.0]])
    fed(tracker, times, target, np.zeros((3, 2)), ONE_DEGREE, np.random.default_rng(0))
    forecast = tracker.predict(times[-1:])
    np.testing.assert_allclose(forecast.mean[0], target[0], atol=0.5)
    assert np.sqrt(forecast.covariance[0, 0, 0]) < 0.4


@pytest.mark.slow
def test_sigma_is_estimated_where_that_is_asked_for():
    rng = np.random.default_rng(4)
    times = 0.1 * np.arange(80)
    target, own = drawn_target(rng, times, 2), circling(times, 2)
    noise = BearingNoise(ONE_DEGREE, estimated=True)
    tracker = fed(NoisyGaussianProcessTracker(2, noise=noise, window=60), times, target, own, 4.0 * ONE_DEGREE, rng)
    found = np.sqrt(tracker.hyperparameters.nugget)
    assert 2.8 * ONE_DEGREE < found < 5.6 * ONE_DEGREE


@pytest.mark.slow
def test_a_single_outlier_moves_a_heavy_tailed_track_less():
    moved = {}
    for tails in (None, 4.0):
        errors = []
        for outlier in (0.0, np.radians(20.0)):
            rng = np.random.default_rng(7)
            times = 0.1 * np.arange(50)
            target, own = drawn_target(rng, times, 2), circling(times, 2)
            tracker = NoisyGaussianProcessTracker(2, noise=BearingNoise(ONE_DEGREE), tails=tails)
            fed(tracker, times[:-2], target, own, ONE_DEGREE, rng)
            for k in (-2, -1):
                turn = np.array([outlier if k == -2 else 0.0])
                tracker.update(times[k], rotate_bearing(unit_bearing(target[k], own[k]), turn), own[k])
            errors.append(tracker.predict(times[-1:] + 0.5).mean[0])
            assert tracker.restarts == 0
        moved[tails] = np.linalg.norm(errors[1] - errors[0])
    assert moved[4.0] < 0.3 * moved[None]


def test_a_lost_track_is_noticed_and_begun_again():
    rng = np.random.default_rng(9)
    times = 0.1 * np.arange(110)
    own = circling(times, 2)
    target = np.tile([6.0, 1.0], (110, 1))
    # the target is suddenly another one, on the other side
    target[60:] = [-4.0, -3.0]
    tracker = NoisyGaussianProcessTracker(2, noise=BearingNoise(ONE_DEGREE))
    fed(tracker, times, target, own, ONE_DEGREE, rng)
    assert tracker.restarts >= 1
    np.testing.assert_allclose(tracker.predict(times[-1:]).mean[0], target[-1], atol=0.5)


def test_a_manoeuvre_is_no_lost_track():
    rng = np.random.default_rng(9)
    times = 0.1 * np.arange(110)
    target = np.stack([np.where(times < 6.0, times, 12.0 - times), 0.0 * times + 3.0], axis=-1)
    tracker = NoisyGaussianProcessTracker(2, noise=BearingNoise(ONE_DEGREE), tails=4.0)
    fed(tracker, times, target, target - circling(times, 2), ONE_DEGREE, rng)
    assert tracker.restarts == 0
    np.testing.assert_allclose(tracker.predict(times[-1:]).mean[0], target[-1], atol=0.3)


@pytest.mark.parametrize("kernel", DISPLACEMENT_KERNELS)
def test_every_kernel_tracks(kernel):
    rng = np.random.default_rng(2)
    times = 0.1 * np.arange(40)
    target, own = drawn_target(rng, times, 2), circling(times, 2)
    scale = LogNormal(1.0 if kernel.startswith("velocity") else 4.0, 0.7)
    tracker = NoisyGaussianProcessTracker(
        2, noise=BearingNoise(ONE_DEGREE), kernel=kernel, priors=MotionPriors(scale=scale), hyperparameters="maximum"
    )
    fed(tracker, times, target, own, ONE_DEGREE, rng)
    forecast = tracker.predict(times[-1:])
    error = forecast.mean[0] - target[-1]
    assert error @ np.linalg.solve(forecast.covariance[0], error) < 20.0
    assert np.sqrt(np.trace(forecast.covariance[0])) < 1.5


@pytest.mark.slow
def test_bins_take_irregular_samples_and_gaps():
    rng = np.random.default_rng(3)
    times = np.sort(rng.uniform(0.0, 60.0, 250))
    times = times[(times < 30.0) | (times > 40.0)]
    angle = 0.2 * times
    target = np.stack([30.0 + 0.5 * times, 10.0 + 0.0 * times], axis=-1)
    own = 20.0 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    tracker = NoisyGaussianProcessTracker(
        2,
        noise=BearingNoise(ONE_DEGREE),
        window=40.0,
        bin_width=1.5,
        priors=MotionPriors(length=LogNormal(20.0, 0.7), range=LogNormal(50.0, 1.0), position_std=300.0),
    )
    fed(tracker, times, target, own, ONE_DEGREE, rng)
    assert tracker.range_observable
    forecast = tracker.predict(times[-1:])
    error = forecast.mean[0] - target[-1]
    # about 65 m away, seen from a circle of 20 m
    assert np.linalg.norm(error) < 7.0
    assert error @ np.linalg.solve(forecast.covariance[0], error) < 13.8


HARD_WINDOWS = {
    "same place, same bearing": lambda k, rng: ([1.0, 0.0], [0.0, 0.0]),
    "to and fro": lambda k, rng: ([1.0 - 2.0 * (k % 2), 0.0], [0.0, 0.0]),
    "contradictory": lambda k, rng: (unit_bearing(rng.standard_normal(2), [0.0, 0.0]), [0.0, 0.0]),
    "very far": lambda k, rng: (unit_bearing([1e7, 1.0], [0.0, float(k)]), [1e6, float(k)]),
}


@pytest.mark.parametrize("name", HARD_WINDOWS)
@pytest.mark.parametrize("std", [1e-5, 0.3])
@pytest.mark.long
def test_no_window_makes_it_fail(name, std):
    rng = np.random.default_rng(5)
    tracker = NoisyGaussianProcessTracker(2, noise=BearingNoise(std), window=15, tails=4.0)
    for k in range(25):
        tracker.update(0.1 * k, *HARD_WINDOWS[name](k, rng))
        forecast = tracker.predict(0.1 * k + 0.1 * np.arange(3))
        assert np.all(np.isfinite(forecast.mean))
        assert np.all(np.linalg.eigvalsh(forecast.covariance) > -1e-6 * np.abs(forecast.covariance).max())


def test_what_is_refused_leaves_the_tracker_unchanged():
    rng = np.random.default_rng(0)
    times = 0.1 * np.arange(12)
    tracker = NoisyGaussianProcessTracker(2, noise=BearingNoise(ONE_DEGREE))
    fed(tracker, times, np.tile([4.0, 1.0], (12, 1)), circling(times, 2), ONE_DEGREE, rng)
    before = tracker.predict([1.2]).mean
    for time, bearing in ((1.1, [1.0, 0.0]), (1.2, [1.0, 1.0]), (np.nan, [1.0, 0.0])):
        with pytest.raises(ValueError, match="must"):
            tracker.update(time, bearing, [0.0, 0.0])
    np.testing.assert_array_equal(tracker.predict([1.2]).mean, before)


@pytest.mark.parametrize("settings", [{"kernel": "rq"}, {"linearisations": 0}, {"tails": 0.0}], ids=str)
def test_parameters_out_of_range_are_refused(settings):
    with pytest.raises(ValueError, match=next(iter(settings))):
        NoisyGaussianProcessTracker(2, noise=BearingNoise(ONE_DEGREE), **settings)


# in the closed loop


def recorded(case, *overrides):
    configuration = load_config(case, ["planner.formulation=hard", *overrides])
    loop, start = build_loop(configuration)
    return loop, simulate(loop, start, configuration.duration_s).arrays


@pytest.mark.long
@pytest.mark.parametrize("case", ["case3", "case6"])
def test_five_degrees_of_noise_do_not_lose_the_target(case):
    loop, arrays = recorded(case, "duration_s=5.0", "sensor.noise_deg=5.0")
    assert isinstance(loop.tracker, NoisyGaussianProcessTracker)
    assert arrays["error"].mean(axis=1)[arrays["t"] >= 3.0].mean() < 1.0
    np.testing.assert_allclose(np.linalg.norm(arrays["desired_bearing"], axis=1), 1.0)


def test_without_noise_nothing_has_changed():
    """The defaults, and both settings written out as null, give the same run bit by bit."""
    (loop, default), (_, plain) = (
        recorded("case3", "duration_s=3.0", *more)
        for more in ((), ("tracker.noise=null", "desired_bearing.speed_mps=null"))
    )
    assert isinstance(loop.tracker, GaussianProcessTracker)
    for name, values in default.items():
        if name not in ("solver_time", "tracker_time"):
            np.testing.assert_array_equal(values, plain[name], err_msg=name)


def test_the_paper_keeps_its_tracker_whatever_the_noise():
    loop, _ = build_loop(load_config("case3", ["preset=paper", "sensor.noise_deg=1.0"]))
    assert isinstance(loop.tracker, GaussianProcessTracker)
