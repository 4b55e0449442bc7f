"""Bearings that disagree with the noise that was configured are warned of, for every tracker; honest ones are not."""

import log_writers
import numpy as np
import pytest

import gbt_ocp as gbt
from gbt_ocp.experiments.config.loading import load_tracker
from gbt_ocp.experiments.logs.read import read_log
from gbt_ocp.experiments.noise_check import replay_noise_warnings
from gbt_ocp.experiments.replay import replay
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.simulation.replayed_track import ReplayedTrack
from gbt_ocp.tracking.disagreement import MANY_TIMES, standardised_innovations, standardised_kinks
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.protocol import Forecast

TRACKERS = ["ekf", "imm_ekf", "pr", "oe_cv", "motion_gp"]
FAST = [
    "tracker.window_s=20",
    "tracker.turn_rate_std=[0.03]",
    "tracker.turn_time_s=[8]",
    "tracker.speed_change_std=[0.1]",
    "replay.constant_range_m=[]",
    "replay.score_from_s=0",
]


def write_log(path, apart=0.0, std=2.5, share=0.5, seed=0, count=120):
    """Bearings in degrees to a target that is passed slowly, of which a share is seen so many degrees away."""
    rng = np.random.default_rng(seed)
    t = 0.5 * np.arange(count)
    own = np.stack([2.0 * t, 5.0 * np.sin(0.1 * t)], axis=-1)
    line = np.array([60.0, 80.0]) - own
    angle = np.rad2deg(np.arctan2(line[:, 1], line[:, 0])) + std * rng.standard_normal(count)
    angle = angle + apart * (rng.random(count) < share)
    rows = [f"{a},{b},{c},{e}" for a, (b, c), e in zip(t, own, angle, strict=True)]
    path.write_text("t,own_x,own_y,bearing_deg\n" + "\n".join(rows) + "\n")
    return path


def warned(found):
    return {line.split(":")[0] for line in found.summary["warnings"] if "a quarter of the bearings" in line}


@pytest.mark.long
@pytest.mark.parametrize("apart", [60.0, 140.0])
def test_two_contacts_without_a_column_are_warned_of_for_every_tracker(tmp_path, apart):
    log = write_log(tmp_path / "log.csv", apart)
    with pytest.warns(RuntimeWarning, match="a quarter of the bearings"):
        found = replay(log, trackers=TRACKERS, bearing_from="x", overrides=FAST)
    assert warned(found) == set(TRACKERS)


@pytest.mark.long
@pytest.mark.parametrize("apart", [4.0, 8.0])
def test_contacts_that_are_near_are_told_apart_by_a_sensor_of_little_noise(tmp_path, apart):
    log = write_log(tmp_path / "log.csv", apart, std=0.3)
    little = ["tracker.noise={std_deg: 0.3, correlated_deg: 0.0}"]
    with pytest.warns(RuntimeWarning, match="mixture: a quarter of the bearings"):
        replay(log, bearing_from="x", overrides=[*FAST, *little])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.long
def test_honest_logs_are_not_warned_of(tmp_path, seed):
    log = write_log(tmp_path / "log.csv", seed=seed)
    assert warned(replay(log, trackers=["motion_gp", "ekf", "imm_ekf"], bearing_from="x", overrides=FAST)) == set()


def test_a_run_whose_tracker_is_given_too_little_noise_is_warned_of():
    usual = ["duration_s=6", "planner.solver=ipopt", "guidance.kind=static", "tracker.kind=ekf"]
    with pytest.warns(RuntimeWarning, match="case2: ekf: a quarter of the bearings"):
        result = gbt.run("case2", overrides=[*usual, "sensor.noise_deg=8", "tracker.bearing_std_deg=0.1"])
    assert any("a quarter" in line for line in result.summary["warnings"])
    # the noise of the sensor where none is stated
    honest = gbt.run("case2", overrides=[*usual, "sensor.noise_deg=8"])
    assert not any("a quarter" in line for line in honest.summary["warnings"])


@pytest.mark.parametrize("dimension", [2, 3])
def test_both_measures_are_standard_normal_where_the_noise_is_as_configured(dimension):
    """Bearings from the definition of the noise: white, and correlated in time."""
    rng = np.random.default_rng(3)
    noise = BearingNoise(0.02, correlated_std=0.03, correlation_time=5.0)
    times, count = np.sort(rng.uniform(0.0, 900.0, 1500)), 1500
    root = np.linalg.cholesky(noise.correlated(times) + noise.std**2 * np.eye(count))
    angles = root @ rng.standard_normal((count, dimension - 1))
    bearings = np.concatenate([np.ones((count, 1)), angles], axis=1)
    bearings /= np.linalg.norm(bearings, axis=1, keepdims=True)
    far = np.zeros(dimension)
    far[0] = 1000.0
    exact = Forecast(np.tile(far, (count, 1)), np.zeros((count, dimension, dimension)))
    innovations = standardised_innovations(exact, np.zeros((count, dimension)), bearings, noise)
    kinks = standardised_kinks(times, bearings, noise)
    for found in (innovations, kinks):
        assert np.sqrt(np.mean(found**2)) == pytest.approx(1.0, abs=0.15)
        assert np.quantile(found, 0.75) < 0.4 * MANY_TIMES


def test_bearings_that_say_their_noise_are_judged_by_it(tmp_path):
    """Two sensors of which one is ten times as noisy as what is configured, and says so, or does not."""
    log = log_writers.sailed(90.0)
    rng = np.random.default_rng(0)
    columns = {"t": log.times, "own_x": log.own[:, 0], "own_y": log.own[:, 1], "good.bearing_rad": log.azimuth}
    columns["poor.bearing_rad"] = log.azimuth + np.deg2rad(10.0) * rng.standard_normal(len(log.times))
    config = {"tracker": {"kind": "ekf", "initial_range_m": 60.0, "bearing_std_deg": 0.5}}
    for stds, lines in ((None, 1), (10.0, 0), (0.5, 1)):
        if stds is not None:
            columns["poor.std_deg"] = np.full(len(log.times), stds)
            columns["good.std_deg"] = np.full(len(log.times), 0.5)
        log_read = read_log(log_writers.table(tmp_path / "log.csv", columns), "x")
        section = load_tracker(config, [], 2)
        sensor = BearingSensor(log_read.period, np.deg2rad(0.5))
        # a track that is right, so that only the noise counts
        target = np.stack([np.interp(log_read.times, log.times, axis) for axis in log.target.T], axis=-1)
        sharp = np.tile(1e-6 * np.eye(2), (len(target), 1, 1))
        empty = np.full((len(target), 1), np.nan)
        track = ReplayedTrack(
            "ekf", log_read.times, target, sharp, target, sharp, Forecast(target, sharp), empty, empty
        )
        assert len(replay_noise_warnings(track, log_read, section, sensor)) == lines
