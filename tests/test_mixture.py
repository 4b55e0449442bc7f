"""The mixture of motion shape and velocity, against densities and moments of scipy and targets of either kind."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.models.bearings import rotate_bearing, tangent_basis, unit_bearing
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.tracking.bins import BearingBins, BinnedBearings
from gbt_ocp.tracking.displacement.fit import Anchor, DisplacementFit, Node
from gbt_ocp.tracking.displacement.kernels import DISPLACEMENT_KERNELS
from gbt_ocp.tracking.displacement.rows import bearing_rows
from gbt_ocp.tracking.filters.ekf import ExtendedKalmanFilter, FirstGuess
from gbt_ocp.tracking.filters.watched import WatchedFilter
from gbt_ocp.tracking.mixture import ASTRAY, MixtureTracker, log_density, velocity_scale
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.priors import LogNormal, PositionPrior, RangedPrior
from gbt_ocp.tracking.protocol import Forecast, mixed
from gbt_ocp.tracking.shape.tracker import MotionShapeTracker

SIGMA = np.deg2rad(1.0)
SETTINGS = {
    "kind": "mixture",
    "noise": {"std_deg": 1.0},
    "bin_s": 2.0,
    "window_s": 40.0,
    "update_s": 2.0,
    "turn_rate_std": [0.03],
    "turn_time_s": [25.0],
    "speed_change_std": [0.05],
    "members": [],
    "evidence_s": None,
}


def built(dimension=2, **changes):
    problem = "case2" if dimension == 2 else "case5"
    section = load_config({"problem": problem, "tracker": {**SETTINGS, **changes}}).tracker
    return build_tracker(section, np.zeros(dimension), BearingSensor(0.1))


def single(bearing, own, count=1.0, time=0.0):
    return BinnedBearings(np.array([time]), np.array([bearing]), np.array([own], dtype=float), np.array([count]))


def around(target, times, radius=30.0, rate=0.15):
    circle = [np.cos(rate * times), np.sin(rate * times), np.full(len(times), 0.5)]
    return target - radius * np.stack(circle[: target.shape[1]], axis=-1)


def fed(tracker, times, target, own, seed=0, missed=0.0, after=lambda k: None):
    rng = np.random.default_rng(seed)
    for k, t in enumerate(times):
        turn = SIGMA * rng.standard_normal(target.shape[1] - 1)
        if rng.uniform() >= missed:
            tracker.update(float(t), rotate_bearing(unit_bearing(target[k], own[k]), turn), own[k])
        after(k)
    return tracker


# ---- moments ----------------------------------------------------------------------------------------------------


def test_the_moments_of_a_mixture_are_those_of_its_second_moments():
    """``Σ = Σ w (Σ_m + μ_m μ_mᵀ) - μ μᵀ``, one mixture at a time; the axes in between broadcast."""
    rng = np.random.default_rng(0)
    means, roots = rng.standard_normal((4, 5, 3)), rng.standard_normal((4, 5, 3, 3))
    covariances = roots @ np.swapaxes(roots, -1, -2)
    weights = rng.uniform(0.1, 1.0, (4, 5))
    for given, others in ((weights, slice(None)), (weights[:, 0], slice(None)), (weights, slice(0, 1))):
        share = given / given.sum(axis=0)
        mean, covariance = mixed(share, means[:, others], covariances[:, others])
        for k in range(5):
            w = share[:, k] if share.ndim == 2 else share
            j = k if others == slice(None) else 0
            expected = sum(w[m] * means[m, j] for m in range(4))
            second = sum(w[m] * (covariances[m, j] + np.outer(means[m, j], means[m, j])) for m in range(4))
            np.testing.assert_allclose(mean[k], expected, rtol=1e-12)
            np.testing.assert_allclose(covariance[k], second - np.outer(expected, expected), rtol=1e-10, atol=1e-12)
    np.testing.assert_array_equal(covariance, np.swapaxes(covariance, -1, -2))


# ---- evidence -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimension", [2, 3])
def test_density_of_a_bearing_is_that_of_drawn_positions(dimension):
    """Monte Carlo in angles: the share of drawn bearings in a small cone over its solid angle."""
    rng = np.random.default_rng(0)
    mean, own = np.array([40.0, 10.0, -8.0])[:dimension], np.array([3.0, -5.0, 1.0])[:dimension]
    root = np.diag([3.0, 2.0, 1.5][:dimension]) + 0.4
    noise = BearingNoise(np.deg2rad(3.0), own_std=0.5)
    bearing = rotate_bearing(unit_bearing(mean, own), np.array([0.05, -0.03])[: dimension - 1])
    count = 400_000
    # the sensor's own position has an error too, and four bearings are averaged
    line = mean + rng.standard_normal((count, dimension)) @ root.T - own
    line += 0.5 / 2.0 * rng.standard_normal((count, dimension))
    drawn = line / np.linalg.norm(line, axis=1, keepdims=True)
    drawn = rotate_bearing(drawn, noise.std / 2.0 * rng.standard_normal((count, dimension - 1)))
    cone = 0.015
    share = np.mean(np.arccos(np.clip(drawn @ bearing, -1.0, 1.0)) < cone)
    angle = 2.0 * cone if dimension == 2 else np.pi * cone**2
    forecast = Forecast(mean[None], (root @ root.T)[None])
    found = log_density(single(bearing, own, 4.0), forecast, noise, noise.std**2)
    assert found == pytest.approx(np.log(share / angle), abs=0.06)


@pytest.mark.parametrize("dimension", [2, 3])
def test_an_angle_has_the_density_of_its_metres_times_the_range_a_row(dimension):
    """The Jacobian: scipy's density of the pseudo-measurement, and the same bearing twice as far away."""
    mean, own = np.array([30.0, -20.0, 5.0])[:dimension], np.zeros(dimension)
    covariance = np.diag([9.0, 4.0, 2.0][:dimension]) + 1.0
    bearing = rotate_bearing(unit_bearing(mean, own), np.array([0.04, 0.02])[: dimension - 1])
    distance = np.linalg.norm(mean)
    basis = tangent_basis(unit_bearing(mean, own))
    tangent = basis.T @ bearing
    metres = distance * tangent * np.arcsin(np.linalg.norm(tangent)) / np.linalg.norm(tangent)
    spread = basis.T @ covariance @ basis + (distance * SIGMA) ** 2 / 3.0 * np.eye(dimension - 1)
    expected = multivariate_normal.logpdf(metres, np.zeros(dimension - 1), spread) + (dimension - 1) * np.log(distance)
    noise = BearingNoise(SIGMA)
    found = log_density(single(bearing, own, 3.0), Forecast(mean[None], covariance[None]), noise, SIGMA**2)
    assert found == pytest.approx(expected, abs=1e-9)
    farther = Forecast(2.0 * mean[None], 4.0 * covariance[None])
    assert log_density(single(bearing, own, 3.0), farther, noise, SIGMA**2) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("dimension", [2, 3])
def test_foretold_densities_add_up_to_the_evidence_of_the_velocity_process(dimension):
    """The chain rule, with each bin conditioned on those before it, against one joint density of all angles."""
    rng = np.random.default_rng(1)
    times = 2.0 * np.arange(9)
    target = np.array([25.0, 5.0, -4.0])[:dimension] + np.outer(times, [0.05, 0.1, 0.05][:dimension])
    own = around(target, times) + 3.0 * rng.standard_normal((9, dimension))
    errors = SIGMA / np.sqrt(5.0) * rng.standard_normal((9, dimension - 1))
    bearings = rotate_bearing(unit_bearing(target, own), errors)
    samples = BinnedBearings(times, bearings, own, np.full(9, 5.0))
    noise, kernel = BearingNoise(SIGMA), DISPLACEMENT_KERNELS["velocity_matern32"]
    node = Node(np.log(0.1), np.log(20.0), SIGMA**2, 0.0)
    anchor = Anchor(0.0, target[0] + 0.1, 0.1 * np.eye(dimension))
    # all linearised at the truth, so that the model is linear and the chain rule exact
    rows = bearing_rows(samples, target)
    h, r = rows.directions, rows.ranges
    moved = 0.1**2 * kernel(times, times, np.log(20.0))[np.ix_(rows.sample, rows.sample)] * (h @ h.T)
    joint = moved + h @ anchor.covariance @ h.T + np.diag(r**2 * SIGMA**2 / 5.0)
    angles = (rows.values - h @ anchor.mean) / r
    expected = multivariate_normal.logpdf(angles, np.zeros(len(r)), joint / np.outer(r, r))
    whole = DisplacementFit(kernel, anchor, noise, samples, rows, np.ones(len(r)))
    assert whole.solve(node).log_evidence == pytest.approx(expected, abs=1e-4)

    total = 0.0
    for k in range(9):
        part = BinnedBearings(times[:k], bearings[:k], own[:k], np.full(k, 5.0))
        if k:
            fit = DisplacementFit(
                kernel, anchor, noise, part, bearing_rows(part, target[:k]), np.ones((dimension - 1) * k)
            )
            mean, covariance = fit.predict(fit.solve(node), times[k : k + 1])
        else:
            mean, covariance = anchor.mean[None], anchor.covariance[None]
        total += log_density(single(bearings[k], own[k], 5.0), Forecast(mean, covariance), noise, SIGMA**2)
    # the densities are linearised at what was foretold and not at the truth; a range left out would be 3 nats a row
    assert total == pytest.approx(expected, abs=0.2)


def test_no_single_bin_decides():
    """Of two models that foretell the same, but for one stray bin, none is ruled out."""
    tracker = built()
    times = 0.5 * np.arange(60)
    target = np.outer(times, [0.7, 0.7])
    fed(tracker, times, target, around(target, times))
    before = tracker.log_evidence
    away = unit_bearing(np.array([0.0, -1.0]), np.zeros(2))
    for k in range(4):
        tracker.update(30.0 + 0.5 * k, away, np.array([0.0, 60.0]))
    tracker.update(32.0, away, np.array([0.0, 60.0]))
    least = np.log(ASTRAY / (2.0 * np.pi))
    assert np.all(tracker.log_evidence - before >= least - 8.0)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_scale_of_the_velocity_makes_the_speeds_of_the_prior(dimension):
    rng = np.random.default_rng(2)
    scale = velocity_scale(LogNormal(2.5, 1.0), dimension)
    deviation = scale.median * np.exp(scale.log_std * rng.standard_normal(200_000))
    speed = np.log(np.linalg.norm(deviation[:, None] * rng.standard_normal((200_000, dimension)), axis=1))
    assert np.mean(speed) == pytest.approx(np.log(2.5), abs=0.01)
    assert np.std(speed) == pytest.approx(1.0, abs=0.01)


def boat(rng, times, kind):
    """A steady boat that turns now and then, or one whose velocity is a process of its own on each axis."""
    if kind == "shape":
        rate = np.repeat(rng.uniform(-0.06, 0.06, len(times) // 40 + 1), 40)[: len(times)]
        heading = np.cumsum(0.5 * rate) + rng.uniform(-np.pi, np.pi)
        return np.cumsum(0.5 * np.stack([np.cos(heading), np.sin(heading)], axis=-1), axis=0)
    kernel = DISPLACEMENT_KERNELS["velocity_matern32"](times, times, np.log(10.0))
    root = np.linalg.cholesky(kernel + 1e-8 * np.eye(len(times)))
    return 1.5 * root @ rng.standard_normal((len(times), 2))


@pytest.mark.slow
def test_each_model_is_found_on_its_own_data():
    """Summed over a few targets of each kind; a single one of 80 s need not tell."""
    times = 0.5 * np.arange(160)
    told = {}
    for kind in ("shape", "velocity"):
        told[kind] = 0.0
        for seed in range(3):
            target = boat(np.random.default_rng(seed), times, kind)
            tracker = fed(built(), times, target, around(target, times), seed)
            shape, velocity = tracker.log_evidence
            told[kind] += shape - velocity
            assert tracker.weights == pytest.approx(
                np.array([1.0, 1.0]) / (1.0 + np.exp([velocity - shape, shape - velocity]))
            )
    assert told["shape"] > 1.0
    assert told["velocity"] < -1.0


# ---- what is foretold -----------------------------------------------------------------------------------------------


class Told:
    """A part that says what it is told to."""

    dimension, range_observable = 2, True
    bins = BearingBins(1.0, 60.0)

    def __init__(self, mean, covariance):
        self.said = Forecast(np.array([mean]), np.array([covariance]))

    def predict(self, times):
        return self.said


def test_moments_are_those_of_samples_of_both():
    first, second = Told([10.0, 0.0], [[4.0, 1.0], [1.0, 2.0]]), Told([14.0, -5.0], [[1.0, 0.0], [0.0, 9.0]])
    tracker = MixtureTracker(first, second, BearingNoise(SIGMA))
    tracker._scores.append((0.0, np.log([0.7, 0.3])))
    assert tracker.weights == pytest.approx([0.7, 0.3])
    rng = np.random.default_rng(3)
    drawn = np.concatenate(
        [
            rng.multivariate_normal(part.said.mean[0], part.said.covariance[0], count)
            for part, count in ((first, 140_000), (second, 60_000))
        ]
    )
    mean, covariance = tracker.predict([0.0])
    assert mean[0] == pytest.approx(drawn.mean(axis=0), abs=0.03)
    assert covariance[0] == pytest.approx(np.cov(drawn.T), abs=0.1)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_run_with_missed_bearings_and_a_gap(dimension):
    """Finite, with a covariance, near the truth, and weights of the bins that are kept."""
    times = np.concatenate([0.5 * np.arange(100), 70.0 + 0.5 * np.arange(20)])
    target = np.array([0.0, 0.0, -5.0])[:dimension] + np.outer(times, [0.6, 0.8, 0.0][:dimension])
    own = around(target, times)
    tracker = built(dimension)
    unseen = tracker.predict([0.0, 5.0])
    assert np.all(np.isfinite(unseen.mean))
    assert not tracker.range_observable

    def look(k):
        mean, covariance = tracker.predict([times[k] - 3.0, times[k], times[k] + 10.0])
        assert np.all(np.isfinite(mean))
        assert np.all(np.linalg.eigvalsh(covariance)[:, 0] > 0.0)
        assert tracker.weights.sum() == pytest.approx(1.0)

    fed(tracker, times, target, own, missed=0.2, after=look)
    assert tracker.range_observable
    assert tracker.restarts == 0
    assert np.linalg.norm(tracker.predict(times[-1:]).mean[0] - target[-1]) < 6.0
    kept = [begins for begins, _ in tracker._scores]
    assert kept == sorted(kept)
    assert kept[0] >= tracker.motion.bins.begins
    assert len(kept) < len(tracker.motion.bins)  # the newest bin is not full yet


def test_a_bearing_that_is_refused_changes_nothing():
    tracker = built()
    times = 0.5 * np.arange(30)
    target = np.outer(times, [0.7, 0.7])
    fed(tracker, times, target, around(target, times))
    before = tracker.predict([20.0]), tracker.weights, len(tracker.motion.bins)
    for time, bearing in ((10.0, [1.0, 0.0]), (16.0, [2.0, 0.0]), (np.nan, [1.0, 0.0])):
        with pytest.raises(ValueError, match=r"found|finite"):
            tracker.update(time, bearing, [0.0, 0.0])
    after = tracker.predict([20.0]), tracker.weights, len(tracker.motion.bins)
    assert before[0].mean == pytest.approx(after[0].mean)
    assert before[1] == pytest.approx(after[1])
    assert before[2] == after[2]


def test_the_keys_of_the_motion_survive_the_change_of_kind():
    """``--set tracker.kind=mixture`` at sea keeps what the problem says of sensor and target."""
    shipped, mixed = load_config("sea2d"), load_config("sea2d", ["tracker.kind=mixture"])
    told, kept = mixed.tracker.model_dump(), shipped.tracker.model_dump()
    shared = kept.keys() & told.keys() - {"kind"}
    assert kept.keys() - shared == {"kind", "size"}  # the mixture takes bearings alone
    assert {name: told[name] for name in shared} == {name: kept[name] for name in shared}
    back = load_config("sea2d", ["tracker.kind=mixture", "tracker.velocity_time_s=9", "tracker.kind=motion_gp"])
    assert back.tracker == shipped.tracker
    replayed = load_config("replay", ["tracker.kind=mixture"])
    tracker = build_tracker(replayed.tracker, np.zeros(2), BearingSensor(0.1))
    assert isinstance(tracker, MixtureTracker)
    assert isinstance(tracker.motion, MotionShapeTracker)
    assert tracker.motion.bins.width == 2.0


def test_parts_of_two_dimensions_are_refused():
    plane, space = built(2), built(3)
    with pytest.raises(ValueError, match="dimension: found 2 and 3"):
        MixtureTracker(plane.motion, space.velocity, BearingNoise(SIGMA))


def test_the_bound_of_an_angle_far_off_is_uniform():
    """Opposite to what both foretell, a bin is worth no less than a direction of which nothing is known."""
    wide = Forecast(np.array([[30.0, 0.0]]), np.array([np.eye(2)]))
    density = log_density(single([-1.0, 0.0], [0.0, 0.0]), wide, BearingNoise(SIGMA), SIGMA**2)
    spread = np.hypot(1.0 / 30.0, SIGMA)
    assert density == pytest.approx(norm.logpdf(np.pi, 0.0, spread), abs=1e-6)


def test_a_range_that_the_motion_does_not_tell_is_left_to_its_prior():
    """From an observer at rest nothing tells the range, and hypotheses over decades have no mean worth saying."""
    times = np.arange(0.0, 24.0, 0.2)
    target = np.array([40.0, 5.0]) + np.outer(times, [0.2, 0.8])
    tracker = fed(built(), times, target, np.zeros((len(times), 2)))
    assert not tracker.range_observable
    assert tracker.weights[1] > 0.01
    ahead = times[-1] + np.array([0.0, 5.0])
    for found, expected in zip(tracker.predict(ahead), tracker.motion.predict(ahead), strict=True):
        np.testing.assert_allclose(found, expected)


# ---- further members ------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_further_members_are_judged_by_the_same_bins_and_fade():
    """Weights by hand: sums of the scores of each bin, faded with the age of the bin."""
    times = 0.1 * np.arange(260)
    target = np.stack([0.6 * times, 4.0 + 0.2 * times], axis=-1)
    own = around(target, times)
    tracker = built(members=["held_turn", "ekf", "imm_ekf"], evidence_s=8.0)
    lasting = built(members=["held_turn", "ekf", "imm_ekf"])
    for one in (tracker, lasting):
        fed(one, times, target, own)
    begins = np.array([begin for begin, _ in tracker._scores])
    scores = np.array([score for _, score in tracker._scores])
    assert scores.shape[1] == 5
    np.testing.assert_allclose(tracker.log_evidence, np.exp((begins - begins[-1]) / 8.0) @ scores)
    np.testing.assert_allclose(lasting.log_evidence, scores.sum(axis=0), rtol=1e-9)
    assert tracker.weights.sum() == pytest.approx(1.0)
    assert tracker.weights.max() < lasting.weights.max()
    ahead = times[-1] + np.array([0.0, 5.0])
    found = tracker.hypotheses_at(ahead)
    mean, covariance = mixed(np.tile(found.weights[:, None], 2), found.means, found.covariances)
    forecast = tracker.predict(ahead)
    np.testing.assert_allclose(mean, forecast.mean, atol=1e-8)
    np.testing.assert_allclose(covariance, forecast.covariance, atol=0.01 * np.abs(covariance).max())
    assert np.linalg.norm(forecast.mean[0] - target[-1]) < 2.0


def test_a_filter_that_lost_its_track_is_made_again():
    times = 0.1 * np.arange(600)
    target = np.stack([0.6 * times, 4.0 + 0.2 * times], axis=-1)
    own = around(target, times)
    target = target + np.where(times[:, None] < 30.0, 0.0, np.array([25.0, -40.0]))
    made = []

    def make(position):
        made.append(position)
        prior = RangedPrior(position.start, position.mean, position.covariance, range=40.0)
        return ExtendedKalmanFilter(FirstGuess(prior, 30.0, 1.0), process_noise=1e-3, bearing_std=SIGMA)

    plain = make(PositionPrior(own[0]))
    watched = WatchedFilter(make, PositionPrior(own[0]), SIGMA)
    for one in (plain, watched):
        fed(one, times, target, own)
    assert watched.restarts == len(made) - 2 == 1
    assert np.linalg.norm(watched.predict([times[-1]]).mean[0] - target[-1]) < 3.0
    steady = WatchedFilter(make, PositionPrior(own[0]), SIGMA)
    fed(steady, times[:300], target[:300], own[:300])
    assert steady.restarts == 0


def test_members_are_named_once():
    with pytest.raises(ConfigurationError, match=r"tracker.members: found .*; allowed: a list of held_turn, imm_ekf"):
        built(members=["ekf", "ekf"])
    with pytest.raises(ValueError, match=r"forgetting: found 0.0; allowed: a number > 0"):
        MixtureTracker(built().motion, built().velocity, BearingNoise(SIGMA), forgetting=0.0)
