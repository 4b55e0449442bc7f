"""Pauses and clocks that are set: time and memory are bounded by the window, and a new track begins and says so."""

import csv
import json
import sys
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.build.trackers import TRACKERS, build_tracker
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.replay import replay
from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.simulation.loop import simulate
from gbt_ocp.tracking.gaps import ENOUGH_INTERVALS, FILTER_WINDOW, LONGEST_UNKNOWN, WINDOWS, Gaps, gap_warning
from gbt_ocp.tracking.protocol import PositionTracker

ROOM = 300 * 2**20
"""Bytes that a tracker may take beyond what the process has; where memory grew with the pause, motion_gp took 1.2 GB
for half an hour."""

MINUTE, HOUR, DAY = 60.0, 3600.0, 86400.0
linux = pytest.mark.skipif(sys.platform != "linux", reason="a limit on memory that holds")
KINDS = {
    **{name: [f"tracker.kind={name}"] for name in TRACKERS},
    "lmc": ["tracker.kind=lmc", "tracker.length_scale=2.0", "tracker.nugget=0.001"],
    "noisy gp": ["tracker.kind=gp", "tracker.noise={std_deg: 1.0}"],
    "binned gp": ["tracker.kind=gp", "tracker.noise={std_deg: 1.0, bin_s: 2.0, window_s: 30.0}"],
}
# the noisy kinds share their class with the mixture, and take seconds
EVERY = [pytest.param(name, marks=[pytest.mark.slow] if name.endswith(" gp") else []) for name in KINDS]

SMALL = [
    "tracker.window_s=20",
    "tracker.bin_s=2",
    "tracker.update_s=2",
    "tracker.turn_rate_std=[0.03]",
    "tracker.turn_time_s=[8]",
    "tracker.speed_change_std=[0.1]",
]


def built(name):
    overrides = [
        *KINDS[name],
        *(["tracker.window_s=20", "tracker.bin_s=2"] if name in ("motion_gp", "mixture") else []),
    ]
    section = load_config("case2", overrides).tracker
    return build_tracker(section, np.zeros(2), BearingSensor(0.5))


def sailed(times):
    """Own positions and the target, both slow and bounded however long it takes."""
    own = 15.0 * np.stack([np.cos(0.1 * times), np.sin(0.1 * times)], axis=-1)
    return own, np.array([40.0, 10.0]) + 3.0 * np.stack([np.sin(0.02 * times), np.cos(0.02 * times)], axis=-1)


def fed(tracker, times):
    """Feed bearings, and ask for the track as replay does."""
    for t, own, target in zip(times, *sailed(times), strict=True):
        if isinstance(tracker, PositionTracker):
            tracker.update_position(t, target)
        else:
            tracker.predict([t])
            tracker.update(t, rotate_bearing(unit_bearing(target, own), np.array([0.01 * np.sin(7.0 * t)])), own)
        forecast = tracker.predict([t, t + 10.0])
        assert np.all(np.isfinite(forecast.mean))


@contextmanager
def little_memory():
    """A limit on the memory of the process (Linux has one that holds)."""
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    has = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (has + ROOM, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def with_gaps(*gaps):
    """Fifteen bearings before each gap (s), and after the last."""
    one, times = 0.5 * np.arange(15), [0.5 * np.arange(15)]
    for gap in gaps:
        times.append(times[-1][-1] + gap + one)
    return np.concatenate(times)


@linux
@pytest.mark.parametrize("name", EVERY)
@pytest.mark.long
def test_memory_does_not_grow_with_a_gap_nor_with_a_forecast_far_ahead(name):
    """Clocks that are set by a little, pauses of 30 minutes and of a week, and a time of the calendar instead of 0."""
    tracker = built(name)
    with little_memory():
        fed(tracker, with_gaps(20.0, 190.0, 450.0))
        for ahead in (HOUR, DAY, 1.7e9):
            assert np.all(np.isfinite(tracker.predict([ahead]).mean))
    before = tracker.new_tracks
    assert before <= 2
    tracker = built(name)
    long = [30 * MINUTE, 7 * DAY, 1.7e9]
    with little_memory():
        fed(tracker, with_gaps(*long))
    assert tracker.new_tracks == len(long)


@linux
def test_the_limit_on_memory_bites():
    with little_memory(), pytest.raises(MemoryError):
        np.ones(ROOM // 4)


@pytest.mark.parametrize("name", EVERY)
def test_a_track_after_a_gap_is_that_of_a_tracker_that_has_seen_nothing_before(name):
    """The prior position belongs to the first track alone, so here there is none."""
    after = with_gaps(DAY)[15:]
    went_on, fresh = built(name), built(name)
    fed(went_on, with_gaps(DAY))
    fed(fresh, after)
    for at in (after[-1], after[-1] + 5.0):
        for found, wanted in zip(went_on.predict([at]), fresh.predict([at]), strict=True):
            np.testing.assert_allclose(found, wanted, rtol=1e-3, atol=1e-3, equal_nan=True)


def test_bearings_that_always_come_seldom_are_one_track():
    """A window of bearings counts them, not seconds: only the first interval of a day can be taken for a gap."""
    gaps = Gaps()
    for time in DAY * np.arange(40):
        gaps.ended(time)
    assert gaps.count == 1


def test_the_longest_gap_is_ten_windows():
    by_time, by_bearings = Gaps(span=30.0), Gaps(bearings=20)
    assert by_time.longest == WINDOWS * 30.0
    assert by_bearings.longest == LONGEST_UNKNOWN
    for time in 0.25 * np.arange(ENOUGH_INTERVALS + 1):
        assert not by_bearings.ended(time)
    assert by_bearings.longest == pytest.approx(WINDOWS * 20 * 0.25)
    assert Gaps()._bearings == FILTER_WINDOW


# ---- replay ---------------------------------------------------------------------------------------------------------


def write_log(path, times):
    own, target = sailed(times)
    line = target - own
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["t", "own_x", "own_y", "bearing_deg"])
        writer.writerows(np.column_stack([times, own, np.rad2deg(np.arctan2(line[:, 1], line[:, 0]))]).tolist())
    return path


QUICK = [*SMALL, "replay.constant_range_m=[]", "replay.score_from_s=0"]


@pytest.mark.parametrize("more", [{}, {"latency": 0.4}])
def test_a_replay_says_how_many_new_tracks_there_are_and_when(tmp_path, more):
    times = np.repeat(with_gaps(DAY, 1.7e9), 2)  # two sensors, one clock
    log = write_log(tmp_path / "log.csv", times)
    with pytest.warns(RuntimeWarning, match="new track") as caught:
        found = replay(log, trackers=["motion_gp", "ekf", "pr"], bearing_from="x", overrides=QUICK, **more)
    lines = [str(one.message) for one in caught if "new track" in str(one.message)]
    late = more.get("latency", 0.0)
    assert len(lines) == 1
    assert "motion_gp, ekf, pr: 2 new tracks" in lines[0]
    for begun in found.tracks[0].new_tracks:
        assert np.min(np.abs(np.array([86407.0, 1700086414.0]) - begun)) <= 0.5 + late
    assert [found.summary["trackers"][name]["new_tracks"] for name in ("motion_gp", "ekf", "pr")] == [2, 2, 2]
    assert any("2 new tracks" in line for line in found.summary["warnings"])


def test_a_log_without_a_pause_has_one_track_and_no_warning(tmp_path, recwarn):
    log = write_log(tmp_path / "log.csv", 0.5 * np.arange(80))
    found = replay(log, trackers=["motion_gp", "ekf"], bearing_from="x", overrides=QUICK)
    assert found.summary["trackers"]["motion_gp"]["new_tracks"] == 0
    assert not [one for one in recwarn if "new track" in str(one.message)]


def test_a_clock_that_is_set_back_is_one_line(tmp_path, capsys):
    times = np.concatenate([1000.0 + 0.5 * np.arange(20), 0.5 * np.arange(20)])
    log = write_log(tmp_path / "log.csv", times)
    arguments = ["replay", str(log), "--bearing-from", "x", "--quiet", "--no-figures", "--out", str(tmp_path / "out")]
    assert cli.main(arguments) == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert len(error) == 1
    assert "line 22: t: found 0.0 after 1009.5; allowed: increasing times" in error[0]


def test_the_summary_on_disk_has_the_number(tmp_path):
    log = write_log(tmp_path / "log.csv", with_gaps(DAY))
    with pytest.warns(RuntimeWarning, match="ekf: 1 new track, at t = 86407 s"):
        replay(log, trackers=["ekf"], bearing_from="x", overrides=QUICK).save(tmp_path / "out", figures=False)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["trackers"]["ekf"]["new_tracks"] == 1


def test_a_run_says_it_too():
    overrides = ["tracker.kind=gp", "tracker.window=2"]
    loop, start = build_loop(load_config("case2", [*overrides, "guidance.kind=static"]))

    class Pauses(BearingSensor):
        def measure(self, step, target, own, rng):
            return None if 40 <= step < 100 else super().measure(step, target, own, rng)

    recording = simulate(replace(loop, sensor=Pauses(0.1)), start, 12.0)
    assert recording.new_tracks == pytest.approx([10.0])
    assert "1 new track, at t = 10 s" in gap_warning("gp", recording.new_tracks)
