"""Held turn rates, filters in bins and their mixture with all kinds: products of densities, order, other vehicles."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from test_polar import bound, sighted, straight_leg
from test_replay import QUICK, sailed, written

import gbt_ocp as gbt
from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.models.measurements import Sighting
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.tracking.filters.binned import BinnedFilter
from gbt_ocp.tracking.filters.ekf import ExtendedKalmanFilter, FirstGuess
from gbt_ocp.tracking.held.bank import ELEVATION, LOG_RANGE, LOG_SIZE, HeldTurnPrior
from gbt_ocp.tracking.held.held_turn import HeldTurnTracker
from gbt_ocp.tracking.intake import take_in
from gbt_ocp.tracking.mixture import MixtureTracker
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.polar import ALL_KINDS, WITHOUT_SIZE
from gbt_ocp.tracking.priors import LogNormal, RangedPrior

SIGMA = float(np.deg2rad(1.0))


def held_turn(dimension=2, start=60.0, size=None):
    prior = HeldTurnPrior(LogNormal(1.0, 0.7), LogNormal(start, 1.0), size=size)
    return HeldTurnTracker(dimension, noise=BearingNoise(SIGMA), prior=prior)


def binned(start=60.0):
    def make(position):
        return ExtendedKalmanFilter(FirstGuess(position, 50.0, 1.0), process_noise=1e-4, bearing_std=SIGMA)

    return BinnedFilter(make, RangedPrior(np.zeros(2), range=start), BearingNoise(SIGMA))


def mixture(start=60.0):
    members = {"held_turn": held_turn(start=start), "ekf": binned(start)}
    return MixtureTracker(2, members, BearingNoise(SIGMA))


def moments(found, at):
    weights = found.weights
    mean = weights @ found.means[:, at]
    return mean, weights @ (found.covariances[:, at, at] + (found.means[:, at] - mean) ** 2)


@pytest.mark.parametrize("first", [True, False])
def test_a_ping_is_the_product_of_the_densities_of_log_range(first):
    """A still target with one bearing and one ping: the product of both densities, by brute force on a grid.

    The ping may come before the bearing of its time.
    """
    tracker, still = held_turn(), np.array([40.0, 12.0])
    bearing = Sighting.of_bearing(0.0, unit_bearing(still, np.zeros(2)), np.zeros(2))
    tracker.update(0.0, bearing.bearing, np.zeros(2))
    prior = tracker._found
    ping = sighted("range", 2, still, 2.0, 0.0, np.zeros(2))
    if not first:
        tracker = held_turn()
        for one in (ping, bearing):
            take_in(tracker, one)
    else:
        take_in(tracker, ping)
    x = np.linspace(np.log(1.0), np.log(2000.0), 400_001)
    density = np.zeros_like(x)
    places, which = np.unique(prior.means[:, LOG_RANGE], return_inverse=True)
    variance = prior.covariances[0, LOG_RANGE, LOG_RANGE]
    for mean, weight in zip(places, np.bincount(which, prior.weights), strict=True):
        density += weight * np.exp(-0.5 * (x - mean) ** 2 / variance)
    value, found = ping.value[0], moments(tracker._found, LOG_RANGE)
    # the ping as it is taken, normal in its logarithm, but for starts that are forgotten; and as it is, normal in
    # metres, of which it is 5 %
    for off, close in (((np.log(value) - x) * value / 2.0, 1e-5), ((value - np.exp(x)) / 2.0, 0.1)):
        posterior = density * np.exp(-0.5 * off**2)
        posterior /= posterior.sum()
        mean = posterior @ x
        variance = posterior @ (x - mean) ** 2
        assert found[0] == pytest.approx(mean, abs=close * np.sqrt(variance))
        assert found[1] == pytest.approx(variance, rel=max(close, 1e-5))


@pytest.mark.parametrize("dimension", [2, 3])
def test_an_angular_size_is_the_product_of_the_densities_of_range_and_size(dimension):
    """A still target with one bearing and one angle that it fills, by brute force on a grid of both logarithms."""
    tracker, own = held_turn(dimension, size=LogNormal(3.0, 0.4)), np.zeros(dimension)
    still = np.array([40.0, 12.0, -9.0])[:dimension]
    tracker.update(0.0, unit_bearing(still, own), own)
    prior = tracker._found
    seen = sighted("size", dimension, still, 0.004, 0.0, own)
    take_in(tracker, seen)
    x, y = np.linspace(np.log(1.0), np.log(4000.0), 3001)[:, None], np.log(3.0) + np.linspace(-2.4, 2.4, 801)
    density = np.zeros_like(x)
    places, which = np.unique(prior.means[:, LOG_RANGE], return_inverse=True)
    variance = prior.covariances[0, LOG_RANGE, LOG_RANGE]
    for mean, weight in zip(places, np.bincount(which, prior.weights), strict=True):
        density += weight * np.exp(-0.5 * (x - mean) ** 2 / variance)
    angle = float(seen.value[0])
    residual = (np.log(2.0 * np.tan(0.5 * angle)) - (y - x)) * np.sin(angle) / 0.004
    posterior = density * np.exp(-0.5 * ((y - np.log(3.0)) / 0.4) ** 2 - 0.5 * residual**2)
    posterior /= posterior.sum()
    for values, place in ((x, LOG_RANGE), (y, LOG_SIZE)):
        mean = np.sum(posterior * values)
        found, spread = moments(tracker._found, place)
        assert found == pytest.approx(mean, abs=1e-4)
        assert spread == pytest.approx(np.sum(posterior * (values - mean) ** 2), rel=1e-3)


def test_an_elevation_alone_is_the_product_of_two_gaussians():
    tracker, still, own = held_turn(3), np.array([30.0, 20.0, -15.0]), np.zeros(3)
    tracker.update(0.0, unit_bearing(still, own), own)
    before, variance = moments(tracker._found, ELEVATION)
    one = sighted("elevation", 3, still, 0.01, 0.0, own)
    one.value[0] += 0.02
    take_in(tracker, one)
    found, spread = moments(tracker._found, ELEVATION)
    share = variance / (variance + 0.01**2)
    assert found == pytest.approx(before + share * (one.value[0] - before), abs=1e-9)
    assert spread == pytest.approx(variance * (1.0 - share), rel=1e-6)


def test_a_filter_in_bins_takes_all_in_the_order_of_time_and_tells_it_at_once():
    """Against the filter by itself, which is given the means of the bins: of two bearings each, 0.1 s apart."""
    tracker, target = binned(), np.array([40.0, 20.0])
    alone = ExtendedKalmanFilter(
        FirstGuess(RangedPrior(np.zeros(2), range=60.0), 50.0, 1.0), process_noise=1e-4, bearing_std=SIGMA
    )
    for k in range(12):
        t, own = 1.0 * k, np.array([0.9 * k, 0.0])
        mean = replace(sighted("azimuth", 2, target, SIGMA / np.sqrt(2.0), t + 0.05, own), sensor="bins")
        ping = sighted("range", 2, target, 1.0, t + (0.02 if k % 2 else 0.08), own, sensor="ping")
        other = sighted("azimuth", 2, target, SIGMA, t + 0.12, np.array([0.0, 60.0]), sensor="two")
        seen = [sighted("azimuth", 2, target, SIGMA, t + late, own) for late in (0.0, 0.1)]
        seen = sorted([*seen, *[ping] * (k % 3 == 1), replace(other, platform="two")], key=lambda one: one.time)
        for one in seen:
            take_in(tracker, one)
        further = sorted([*[ping] * (k % 3 == 1), other], key=lambda one: one.time)
        if k:
            early = deepcopy(alone)
            for one in further:
                early.take(one)
            for mine, its in zip(tracker.predict([t, t + 3.0]), early.predict([t, t + 3.0]), strict=True):
                np.testing.assert_allclose(mine, its, rtol=1e-7, atol=1e-7)
        for one in sorted([mean, *further], key=lambda one: one.time):
            alone.take(one)


@pytest.mark.parametrize("make", [held_turn, binned, mixture])
def test_measurements_that_say_nothing_change_nothing(make):
    """Neither by when they come: nothing counts twice. The last bearing begins a bin, so that all others count."""
    forecasts = []
    for pings in (False, True):
        tracker, rng = make(), np.random.default_rng(0)
        for k in range(101):
            t = 0.1 * k
            own, target = np.array([8.0 * np.sin(0.5 * t), t]), np.array([50.0 + 0.5 * t, 5.0])
            angle = SIGMA * rng.standard_normal()
            line = unit_bearing(target, own)
            bearing = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ line
            tracker.update(t, bearing, own)
            if pings and k % 3 == 1:
                take_in(tracker, sighted("range", 2, target, 1e5, t + 0.03, own))
        forecasts.append(tracker.predict([10.0]))
    without, with_pings = forecasts
    deviation = np.sqrt(np.diag(without.covariance[0]))
    np.testing.assert_allclose((with_pings.mean[0] - without.mean[0]) / deviation, 0.0, atol=0.05)
    np.testing.assert_allclose(with_pings.covariance[0], without.covariance[0], atol=0.03 * deviation.max() ** 2)


@pytest.mark.parametrize("make", [held_turn, binned, mixture])
def test_bearings_of_another_vehicle_tell_the_range(make):
    """From two places at rest, where the own bearings alone tell no range."""
    tracker, still, there = make(start=150.0), np.array([40.0, 10.0]), np.array([20.0, -30.0])
    for k in range(60):
        take_in(tracker, sighted("azimuth", 2, still, SIGMA, 0.1 * k, np.zeros(2)))
        if k % 5 == 0:
            take_in(tracker, replace(sighted("azimuth", 2, still, SIGMA, 0.1 * k, there), platform="two"))
    mean, covariance = (values[0] for values in tracker.predict([6.0]))
    np.testing.assert_allclose(mean, still, atol=2.5)
    assert np.sqrt(np.trace(covariance)) < 3.0
    assert tracker.range_observable


@pytest.mark.parametrize("make", [held_turn, binned, mixture])
def test_a_bearing_that_states_its_noise_counts_by_its_worth(make):
    """As many as it is worth: one of half the noise as four with one mean."""
    target, found = np.array([40.0, 10.0]), []
    for times, std in ((1, 0.5 * SIGMA), (4, SIGMA)):
        tracker = make()
        for k in range(20):
            own = np.array([0.0, 2.0 * k])
            for _ in range(times):
                take_in(tracker, sighted("azimuth", 2, target, std, 0.5 * k + 0.1, own))
        found.append(tracker.predict([10.0]))
    for mine, its in zip(*found, strict=True):
        np.testing.assert_allclose(mine, its, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", ["held_turn", "mixture"])
def test_sensors_of_all_kinds_are_configured_beside_it(name):
    sensors = [
        {"name": "sonar", "kind": "azimuth", "period_s": 0.5, "noise_deg": 1.0},
        {"name": "pinger", "kind": "range", "period_s": 5.0, "noise_m": 1.0},
        {"name": "fix", "kind": "position", "period_s": 10.0, "noise_m": 3.0},
    ]
    section = {"kind": name}
    config = load_config({"problem": "sea2d", "sensor": sensors, "tracker": section})
    built = build_tracker(config.tracker, np.zeros(2), BearingSensor(0.5))
    assert built.takes == WITHOUT_SIZE
    camera = {"name": "camera", "kind": "size", "period_s": 1.0, "noise_share": 0.1}
    with pytest.raises(ConfigurationError, match=r"sensor.3.kind: found .size.; .*for kind size with tracker.size"):
        load_config({"problem": "sea2d", "sensor": [*sensors, camera], "tracker": section})
    section["size"] = [2.0, 0.3]
    config = load_config({"problem": "sea2d", "sensor": [*sensors, camera], "tracker": section})
    assert build_tracker(config.tracker, np.zeros(2), BearingSensor(0.5)).takes == ALL_KINDS


@pytest.mark.long
@pytest.mark.parametrize("kind", ["range", "size"])
def test_on_a_straight_leg_the_tracker_at_sea_has_the_range_of_pings_and_sizes(kind):
    """4 logs; benchmarks/measurement_kinds.py has the leg."""
    section = load_config("sea2d", ["tracker.size=[2.0, 0.3]"]).tracker
    squares = []
    for seed in range(4):
        seen, target, _ = straight_leg(kind, seed)
        tracker = build_tracker(section, np.zeros(2), BearingSensor(1.0, noise=SIGMA))
        for one in seen:
            take_in(tracker, one)
        squares.append(np.sum((tracker.predict([60.0]).mean[0] - target) ** 2))
    assert np.sqrt(np.mean(squares) / np.trace(bound(kind, 60.0))) < 1.6


@pytest.mark.long
def test_a_pilot_at_sea_takes_a_ping():
    pilot = gbt.Pilot("sea2d")
    target = np.array([50.0, 20.0])
    for k in range(40):
        t = 0.1 * k
        pose = np.array([0.0, 1.0 * t, 0.0])
        pilot.navigate(t, pose, np.array([0.0, 1.0, 0.0]))
        line = target - pose[:2]
        assert pilot.measure(gbt.Measurement(t, "azimuth", np.arctan2(line[1], line[0]))) == "taken"
        if k == 30:
            assert pilot.measure(gbt.Measurement(t, "range", np.linalg.norm(line), 0.5, "ping")) == "taken"
    command = pilot.command(4.0)
    assert command.range_known
    np.testing.assert_allclose(command.forecast.mean[0], target, atol=2.0)


@pytest.mark.long
def test_a_log_with_ranges_is_replayed_with_a_mixture(tmp_path):
    """The mixture of ``replay``, motion_gp and a filter in bins; from a place at rest, where bearings tell no range."""
    times, _, target, _ = sailed(duration=30.0)
    still, own = target[0], np.tile(target[0] - [30.0, 10.0], (len(times), 1))
    rng = np.random.default_rng(0)
    line = still - own
    columns = {
        "t": times,
        "own_x": own[:, 0],
        "own_y": own[:, 1],
        "bearing_rad": np.arctan2(line[:, 1], line[:, 0]) + SIGMA * rng.standard_normal(len(times)),
        "range_m": [
            f"{np.hypot(30.0, 10.0) + rng.standard_normal():.3f}" if k % 20 == 0 else "" for k in range(len(times))
        ],
        "range_std_m": ["1.0" if k % 20 == 0 else "" for k in range(len(times))],
    }
    log = written(tmp_path / "log.csv", columns)
    tracker = {
        "kind": "mixture",
        "members": ["motion_gp", "ekf"],
        "noise": {"std_deg": 1.0},
        "range": {"median_m": 90.0},
    }
    result = gbt.replay(log, {**QUICK, "tracker": tracker}, bearing_from="x")
    assert np.linalg.norm(result.tracks[0].mean[-1] - still) < 3.0


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_mixture_of_replay_takes_all_that_a_log_can_hold(dimension):
    problem = "case2" if dimension == 2 else "case5"
    section = {"kind": "mixture", "members": ["motion_gp", "ekf"], "noise": {"std_deg": 1.0}}
    tracker = build_tracker(
        load_config({"problem": problem, "tracker": section}).tracker, np.zeros(dimension), BearingSensor(0.5)
    )
    target = np.array([25.0, 14.0, -9.0])[:dimension]
    kinds = (
        ["azimuth", "range", "position"] if dimension == 2 else ["azimuth_elevation", "elevation", "range", "position"]
    )
    for k in range(16):
        for place, kind in enumerate(kinds):
            std = {"range": 0.5, "position": 1.0}.get(kind, SIGMA)
            take_in(tracker, sighted(kind, dimension, target, std, 0.5 * k + 0.01 * place, np.zeros(dimension)))
    np.testing.assert_allclose(tracker.predict([8.0]).mean[0], target, atol=1.0)
