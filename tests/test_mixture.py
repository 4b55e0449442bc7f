"""The mixture of trackers, against densities and moments of scipy and targets that each of them knows."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.models.bearings import rotate_bearing, tangent_basis, unit_bearing
from gbt_ocp.models.measurements import Sighting
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.models.turning import TurningTarget
from gbt_ocp.tracking.bins import BinnedBearings
from gbt_ocp.tracking.displacement.fit import Anchor, DisplacementFit, Node
from gbt_ocp.tracking.displacement.kernels import DISPLACEMENT_KERNELS
from gbt_ocp.tracking.displacement.rows import bearing_rows
from gbt_ocp.tracking.filters.binned import BinnedFilter
from gbt_ocp.tracking.filters.ekf import ExtendedKalmanFilter, FirstGuess
from gbt_ocp.tracking.mixture import ASTRAY, MixtureTracker, log_density
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.priors import RangedPrior
from gbt_ocp.tracking.protocol import Forecast, mixed

SIGMA = np.deg2rad(1.0)
SETTINGS = {"kind": "mixture", "noise": {"std_deg": 1.0}}


def built(dimension=2, **changes):
    problem = "case2" if dimension == 2 else "case5"
    section = load_config({"problem": problem, "tracker": {"engine": "numpy", **SETTINGS, **changes}}).tracker
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
    tracker = built(evidence_s=None)
    times = 0.1 * np.arange(300)
    target = np.outer(times, [0.7, 0.7])
    fed(tracker, times, target, around(target, times))
    before = tracker.log_evidence
    away = unit_bearing(np.array([0.0, -1.0]), np.zeros(2))
    for k in range(10):
        tracker.update(30.0 + 0.1 * k, away, np.array([0.0, 60.0]))
    tracker.update(31.0, away, np.array([0.0, 60.0]))
    gained = tracker.log_evidence - before
    least = np.log(ASTRAY / (2.0 * np.pi))
    assert np.all(gained >= 2.0 * least)  # the bin of the strays, and that before it, which was not full
    assert np.all(gained <= least + 6.0)


def boat(seed, kind, duration):
    """A boat that holds its turn rates, or one at rest that starts straight ahead, as few held turns do."""
    times = 0.1 * np.arange(int(10 * duration))
    if kind == "held":
        return times, TurningTarget(2, np.random.default_rng(seed), duration=duration, start=np.zeros(2)).position(
            times
        )
    gone = 0.04 * np.maximum(times - 0.5 * duration, 0.0) ** 2
    return times, np.outer(gone, [np.cos(seed), np.sin(seed)])


@pytest.mark.long
def test_each_model_is_found_on_its_own_data():
    found = {}
    for kind in ("held", "starts"):
        gains = []
        for seed in range(1, 2):
            times, target = boat(seed, kind, 60.0)
            tracker = built(evidence_s=None)
            fed(tracker, times, target, around(target, times, rate=0.12), seed)
            held, models = tracker.log_evidence
            gains.append(held - models)
            assert tracker.weights[0] == pytest.approx(1.0 / (1.0 + np.exp(models - held)))
        found[kind] = sum(gains)
    assert found["held"] > 1.0
    assert found["starts"] < -1.0


# ---- what is foretold -----------------------------------------------------------------------------------------------


class Told:
    """A part that says what it is told to."""

    range_observable = True

    def __init__(self, mean, covariance):
        self.said = Forecast(np.array([mean]), np.array([covariance]))

    def predict(self, times):
        return self.said


def test_moments_are_those_of_samples_of_both():
    first, second = Told([10.0, 0.0], [[4.0, 1.0], [1.0, 2.0]]), Told([14.0, -5.0], [[1.0, 0.0], [0.0, 9.0]])
    tracker = MixtureTracker(2, {"first": first, "second": second}, BearingNoise(SIGMA))
    tracker._evidence = np.log([0.7, 0.3])
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
    """Finite, with a covariance, near the truth, and begun again after a long pause."""
    times = np.concatenate([0.2 * np.arange(200), 60.0 + 0.2 * np.arange(50), 1000.0 + 0.2 * np.arange(3)])
    target = np.array([0.0, 0.0, -5.0])[:dimension] + np.outer(times, [0.6, 0.8, 0.0][:dimension])
    own = around(target, times)
    tracker = built(dimension)
    unseen = tracker.predict([0.0, 5.0])
    assert np.all(np.isfinite(unseen.mean))
    assert not tracker.range_observable

    def look(k):
        if k % 10 == 3 or k > 248:
            mean, covariance = tracker.predict([times[k], times[k] + 10.0])
            assert np.all(np.isfinite(mean))
            assert np.all(np.linalg.eigvalsh(covariance)[:, 0] > 0.0)
            assert tracker.weights.sum() == pytest.approx(1.0)

    fed(tracker, times[:250], target[:250], own[:250], missed=0.2, after=look)
    assert tracker.range_observable
    assert tracker.restarts == 0
    assert np.linalg.norm(tracker.predict(times[249:250]).mean[0] - target[249]) < 6.0
    fed(tracker, times[250:], target[250:], own[250:])
    assert tracker.new_tracks == 1
    assert not tracker.range_observable
    np.testing.assert_array_equal(tracker.weights, 0.5)


def test_a_bearing_that_is_refused_changes_nothing():
    tracker = built()
    times = 0.5 * np.arange(30)
    target = np.outer(times, [0.7, 0.7])
    fed(tracker, times, target, around(target, times))
    before = tracker.predict([20.0]), tracker.weights
    for time, bearing in ((10.0, [1.0, 0.0]), (16.0, [2.0, 0.0]), (np.nan, [1.0, 0.0])):
        with pytest.raises(ValueError, match=r"found|finite"):
            tracker.update(time, bearing, [0.0, 0.0])
    np.testing.assert_array_equal(before[0].mean, tracker.predict([20.0]).mean)
    np.testing.assert_array_equal(before[1], tracker.weights)


def test_the_keys_of_the_motion_survive_the_change_of_kind():
    """``--set tracker.kind=motion_gp`` at sea keeps what the problem says of sensor and target."""
    shipped, alone = load_config("sea2d"), load_config("sea2d", ["tracker.kind=motion_gp"])
    told, kept = alone.tracker.model_dump(), shipped.tracker.model_dump()
    shared = kept.keys() & told.keys() - {"kind", "engine"}  # their engines differ by default
    assert told.keys() - shared == {"kind", "engine"}
    assert {name: told[name] for name in shared} == {name: kept[name] for name in shared}
    back = load_config("sea2d", ["tracker.evidence_s=9", "tracker.kind=motion_gp", "tracker.kind=mixture"])
    assert back.tracker == shipped.tracker


def test_a_range_that_the_members_do_not_tell_is_mixed_at_its_median():
    """From an observer at rest nothing tells the range: the geometric mean of the members' ranges, by their weights."""
    times = np.arange(0.0, 24.0, 0.2)
    target = np.array([40.0, 5.0]) + np.outer(times, [0.2, 0.8])
    tracker = fed(built(), times, target, np.zeros((len(times), 2)))
    assert not tracker.range_observable
    weights = tracker.weights
    assert weights.min() > 0.01
    said = [member.predict([times[-1]]) for member in tracker.members.values()]
    ranges = [np.linalg.norm(forecast.mean[0]) for forecast in said]
    found = tracker.predict([times[-1]])
    assert np.linalg.norm(found.mean[0]) == pytest.approx(np.exp(weights @ np.log(ranges)))
    direction = found.mean[0] / np.linalg.norm(found.mean[0])
    shares = [np.sqrt(direction @ one.covariance[0] @ direction) / r for one, r in zip(said, ranges, strict=True)]
    variance = weights @ (np.square(shares) + (np.log(ranges) - weights @ np.log(ranges)) ** 2)
    spread = np.sqrt(direction @ found.covariance[0] @ direction) / np.linalg.norm(found.mean[0])
    assert spread == pytest.approx(np.sqrt(variance), rel=0.02)


def test_the_bound_of_an_angle_far_off_is_uniform():
    """Opposite to what both foretell, a bin is worth no less than a direction of which nothing is known."""
    wide = Forecast(np.array([[30.0, 0.0]]), np.array([np.eye(2)]))
    density = log_density(single([-1.0, 0.0], [0.0, 0.0]), wide, BearingNoise(SIGMA), SIGMA**2)
    spread = np.hypot(1.0 / 30.0, SIGMA)
    assert density == pytest.approx(norm.logpdf(np.pi, 0.0, spread), abs=1e-6)


# ---- members -----------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_members_are_judged_by_the_same_bins_and_fade():
    """Evidence by hand: the density of each full bin under what each member said before it began, faded."""
    times = 0.1 * np.arange(261)  # the last one fills the bin before
    target = np.stack([0.6 * times, 4.0 + 0.2 * times], axis=-1)
    own = around(target, times, rate=0.06)
    tracker = built(members=["held_turn", "ekf", "imm_ekf"], evidence_s=8.0, gate=None)
    rng = np.random.default_rng(0)
    bearings = rotate_bearing(unit_bearing(target, own), SIGMA * rng.standard_normal((len(times), 1)))
    total, noise = np.zeros(3), BearingNoise(SIGMA)
    for k, time in enumerate(times):
        if k % 10 == 0 and k:
            said = [member.predict([time, time + 1.0]) for member in tracker.members.values()]
        tracker.update(float(time), bearings[k], own[k])
        if k % 10 == 9 and k > 10:
            mean = bearings[k - 9 : k + 1].mean(axis=0)
            one = single(mean / np.linalg.norm(mean), own[k - 9 : k + 1].mean(axis=0), 10.0)
            late = [Forecast(*(0.55 * v[:1] + 0.45 * v[1:] for v in forecast)) for forecast in said]
            density = np.array([log_density(one, forecast, noise, SIGMA**2) for forecast in late])
            scores = np.logaddexp(np.log1p(-ASTRAY) + density, np.log(ASTRAY / (2.0 * np.pi)))
            total = (total + scores) * np.exp(-1.0 / 8.0)
    np.testing.assert_allclose(tracker.log_evidence, total, atol=1e-6)
    ahead = times[-1] + np.array([0.0, 5.0])
    found = tracker.hypotheses_at(ahead)
    mean, covariance = mixed(np.tile(found.weights[:, None], 2), found.means, found.covariances)
    forecast = tracker.predict(ahead)
    np.testing.assert_allclose(mean, forecast.mean, atol=1e-8)
    np.testing.assert_allclose(covariance, forecast.covariance, atol=1e-8)
    assert np.linalg.norm(forecast.mean[0] - target[-1]) < 2.0


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_filter_of_bins_is_the_filter_of_their_means(dimension):
    """By hand: each mean as a measurement, with the deviation of a mean."""
    times = 0.1 * np.arange(100)
    target = np.array([30.0, 4.0, -8.0])[:dimension] + np.outer(times, [0.6, 0.2, 0.0][:dimension])
    own = around(target, times)

    def make(position):
        return ExtendedKalmanFilter(FirstGuess(position, 30.0, 1.0), process_noise=1e-3, bearing_std=SIGMA)

    prior = RangedPrior(own[0], range=40.0)
    rng = np.random.default_rng(0)
    bearings = rotate_bearing(unit_bearing(target, own), SIGMA * rng.standard_normal((len(times), dimension - 1)))
    binned, plain = BinnedFilter(make, prior, BearingNoise(SIGMA), bin_width=0.5), make(prior)
    for k, time in enumerate(times):
        binned.update(float(time), bearings[k], own[k])
        if k % 5 == 4 and k < 99:  # the last bin is not full before the next begins
            rows = slice(k - 4, k + 1)
            mean = bearings[rows].mean(axis=0)
            seen = Sighting.of_bearing(times[rows].mean(), mean / np.linalg.norm(mean), own[rows].mean(axis=0))
            std = np.full(dimension - 1, SIGMA / np.sqrt(5.0))
            if dimension == 3:
                std[0] /= np.cos(seen.value[1])
            plain.take(replace(seen, std=std))
    for found, expected in zip(binned.predict([10.0, 15.0]), plain.predict([10.0, 15.0]), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert binned.range_observable


def test_a_filter_that_lost_its_track_is_made_again():
    times = 0.1 * np.arange(600)
    target = np.stack([0.6 * times, 4.0 + 0.2 * times], axis=-1)
    own = around(target, times)
    moved = target + np.where(times[:, None] < 30.0, 0.0, np.array([25.0, -40.0]))
    made = []

    def make(position):
        made.append(position)
        return ExtendedKalmanFilter(FirstGuess(position, 30.0, 1.0), process_noise=1e-3, bearing_std=SIGMA)

    prior = RangedPrior(own[0], range=40.0)
    watched = fed(BinnedFilter(make, prior, BearingNoise(SIGMA)), times, moved, own)
    assert watched.restarts == len(made) - 1 >= 1
    assert np.linalg.norm(watched.predict([times[-1]]).mean[0] - moved[-1]) < 6.0
    steady = fed(BinnedFilter(make, prior, BearingNoise(SIGMA)), times[:300], target[:300], own[:300])
    assert steady.restarts == 0


def test_members_are_named_once():
    for wrong in (["ekf", "ekf"], []):
        with pytest.raises(ConfigurationError, match=r"tracker.members: found .*; allowed: a list of held_turn"):
            built(members=wrong)
    with pytest.raises(ValueError, match=r"forgetting: found 0.0; allowed: a number > 0"):
        MixtureTracker(2, {"one": Told([0.0, 0.0], np.eye(2))}, BearingNoise(SIGMA), forgetting=0.0)
    with pytest.raises(ValueError, match=r"members: found none; allowed: at least one"):
        MixtureTracker(2, {}, BearingNoise(SIGMA))
