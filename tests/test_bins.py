"""Bins against means computed at once, the noise against simulated samples."""

import numpy as np
import pytest

from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.tracking.bins import BearingBins
from gbt_ocp.tracking.noise import BearingNoise


def filled(times, bearings, own, width=1.5, window=30.0):
    bins = BearingBins(width, window)
    for sample in zip(times, bearings, own, strict=True):
        bins.append(*sample)
    return bins


def sampled(dimension, seed=0, duration=20.0, noise=0.02):
    """Irregular samples of a straight run past a point, with a silence in the middle."""
    rng = np.random.default_rng(seed)
    times = np.sort(rng.uniform(0.0, duration, 150))
    times = times[(times < 0.4 * duration) | (times > 0.6 * duration)]
    own = np.outer(times, np.arange(1.0, dimension + 1.0))
    bearings = unit_bearing(np.full(dimension, 100.0), own)
    return times, rotate_bearing(bearings, noise * rng.standard_normal((len(times), dimension - 1))), own


@pytest.mark.parametrize("dimension", [2, 3])
def test_means_are_those_of_the_samples_in_each_interval(dimension):
    times, bearings, own = sampled(dimension)
    means = filled(times, bearings, own).means()
    bin_of = np.floor(times / 1.5).astype(int)
    kept = [np.flatnonzero(bin_of == index) for index in np.unique(bin_of)]
    assert np.diff(np.unique(bin_of)).max() > 1  # the silence leaves no bins
    assert means.counts.tolist() == [len(one) for one in kept]
    for row, one in enumerate(kept):
        assert means.times[row] == pytest.approx(times[one].mean())
        assert means.own_positions[row] == pytest.approx(own[one].mean(axis=0))
        total = bearings[one].sum(axis=0)
        assert means.bearings[row] == pytest.approx(total / np.linalg.norm(total))


def test_old_bins_are_dropped_and_time_must_increase():
    times = np.arange(0.0, 100.0, 0.1)
    bins = filled(times, np.tile([1.0, 0.0], (1000, 1)), np.zeros((1000, 2)), width=1.0, window=20.0)
    means = bins.means()
    assert means.times[0] >= times[-1] - 21.0
    assert len(means) in (20, 21)
    with pytest.raises(ValueError, match="time must increase"):
        bins.append(99.0, [1.0, 0.0], [0.0, 0.0])
    assert len(bins.means()) == len(means)


def test_of_few_bearings_a_minority_of_suspects_is_left_out_and_a_majority_is_not():
    straight, stray = [1.0, 0.0], [0.0, 1.0]
    bins = BearingBins(1.0, 10.0)
    for k, bearing in enumerate([straight, stray, straight]):
        bins.append(0.1 * k, bearing, [0.0, 0.0], suspect=k == 1)
    assert bins.means().bearings[0] == pytest.approx(straight)
    assert bins.means().counts[0] == 2
    assert (bins.samples, bins.strays) == (3, 1)
    for k, suspect in enumerate([True, True, False]):
        bins.append(1.0 + 0.1 * k, stray, [0.0, 0.0], suspect=suspect)
    assert bins.means().counts[1] == 3


def test_of_three_bearings_the_one_far_from_the_median_is_left_out_though_nothing_suspects_it():
    bins = BearingBins(1.0, 10.0, 0.1)
    for k, bearing in enumerate([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0]]):
        bins.append(0.1 * k, bearing, [0.0, 0.0])
    assert bins.means().bearings[0] == pytest.approx([1.0, 0.0])
    assert (bins.samples, bins.strays) == (3, 1)


@pytest.mark.parametrize("dimension", [2, 3])
def test_of_many_bearings_those_far_from_their_median_are_left_out_wherever_it_lies(dimension):
    """A fifth is turned by 20 degrees; the own motion alone turns the bearing by twice that within a bin."""
    times = 0.1 * np.arange(60)
    own = np.stack([0.0 * times, 3.0 * times, 0.0 * times], axis=-1)[:, :dimension]
    target = np.array([8.0, 9.0, 2.0])[:dimension]
    true = unit_bearing(target, own)
    rng = np.random.default_rng(0)
    turned = 0.01 * rng.standard_normal((60, dimension - 1))
    turned[::5, 0] += np.deg2rad(20.0)
    # what is expected is wrong by a tenth of a radian, as in a manoeuvre
    expected = rotate_bearing(true, np.full((60, dimension - 1), 0.1))
    bins = BearingBins(1.5, 10.0, stray=0.05)
    for k, bearing in enumerate(rotate_bearing(true, turned)):
        bins.append(times[k], bearing, own[k], expected=expected[k], suspect=True)
    means = bins.means()
    assert bins.strays == 12
    assert np.sum(means.bearings * unit_bearing(target, means.own_positions), axis=1) == pytest.approx(1.0, abs=2e-3)
    assert bins.scatter()[0] == pytest.approx(0.01**2, rel=0.4)


def test_opposite_bearings_in_a_bin_leave_the_first():
    bins = filled([0.1, 0.2], [[1.0, 0.0], [-1.0, 0.0]], np.zeros((2, 2)))
    assert bins.means().bearings[0] == pytest.approx([1.0, 0.0])


@pytest.mark.long
@pytest.mark.parametrize("dimension", [2, 3])
def test_the_scatter_in_the_bins_is_the_noise_whatever_the_motion(dimension):
    found = []
    for seed in range(20):
        times = np.arange(0.0, 60.0, 0.1)
        own = 30.0 * np.stack([np.cos(0.1 * times), np.sin(0.1 * times), 0.0 * times], axis=-1)[:, :dimension]
        target = np.array([2.0, 3.0, 8.0])[:dimension]
        rng = np.random.default_rng(seed)
        noise = 0.02 * rng.standard_normal((len(times), dimension - 1)) + 0.3
        found.append(filled(times, rotate_bearing(unit_bearing(target, own), noise), own, window=60.0).scatter()[0])
    # 600 samples give the variance within about 6 per cent each
    assert np.mean(found) == pytest.approx(0.02**2, rel=0.05)


def test_the_noise_of_means_is_that_of_simulated_means():
    """Means of white and slowly varying errors, and of an own position that errs, over many draws."""
    rng = np.random.default_rng(1)
    width, per_bin, draws = 1.5, 15, 4000
    times = 0.1 * np.arange(4 * per_bin)
    noise = BearingNoise(0.02, correlated_std=0.03, correlation_time=5.0, own_std=0.5)
    own, target = np.zeros((len(times), 2)), np.array([40.0, 0.0])
    means = filled(times, np.tile([1.0, 0.0], (len(times), 1)), own, width=width).means()
    wanted = noise.covariance(means, np.full(4, 40.0))
    slow = np.linalg.cholesky(noise.correlated(times) + 1e-12 * np.eye(len(times))) @ rng.standard_normal((60, draws))
    angle = slow + 0.02 * rng.standard_normal((60, draws))
    across = 0.5 * rng.standard_normal((60, draws)) / target[0]
    found = np.cov((angle + across).reshape(4, per_bin, draws).mean(axis=1))
    # a correlated error is averaged a little within a bin, which the model leaves out
    assert found == pytest.approx(wanted, rel=0.12)


def test_an_estimated_deviation_follows_the_scatter():
    times, bearings, own = sampled(2, noise=0.05)
    bins = filled(times, bearings, own)
    assert BearingNoise(0.01).white_variance(bins) == 0.01**2
    estimated = BearingNoise(0.01, estimated=True).white_variance(bins)
    assert 0.04**2 < estimated < 0.055**2
    empty = filled(times[:1], bearings[:1], own[:1])
    assert BearingNoise(0.01, estimated=True).white_variance(empty) == 0.01**2


@pytest.mark.parametrize("keys", [{"width": 0.0, "window": 10.0}, {"width": 2.0, "window": 3.0}])
def test_wrong_sizes_are_refused(keys):
    with pytest.raises(ValueError, match="allowed"):
        BearingBins(**keys)


def test_wrong_noise_is_refused():
    with pytest.raises(ValueError, match="must be > 0"):
        BearingNoise(0.0)
