"""Replay from a CSV file to a folder: conventions of angles, latency, faults of a log, scores, and recorded logs."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.bearing_log import read_log
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.replay import replay
from gbt_ocp.models.bearings import rotate_bearing, unit_bearing

RECORDED = Path(__file__).resolve().parents[2] / "shared" / "data" / "bearings"

QUICK = {
    "problem": "case2",
    "tracker": {
        "kind": "motion_gp",
        "noise": {"std_deg": 1.0},
        "bin_s": 2.0,
        "window_s": 30.0,
        "update_s": 3.0,
        "range": {"median_m": 40.0},
    },
    "replay": {
        "score_from_s": 30.0,
        "constant_range_m": [60.0],
        "trackers": {
            "ekf": {"kind": "ekf", "initial_range_m": 40.0, "initial_range_std_m": 20.0, "bearing_std_deg": 1.0}
        },
    },
}


def sailed(dimension=2, duration=60.0, seed=0):
    """Times, own positions, target and bearings: a circle of 30 m around a target at 1 m/s."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, duration, 0.25)
    target = np.stack([100.0 + 0.8 * times, -50.0 + 0.5 * times, 0.1 * times], axis=-1)[:, :dimension]
    circle = np.stack([np.cos(0.1 * times), np.sin(0.1 * times), 0.3 * np.sin(0.2 * times)], axis=-1)
    own = target + 30.0 * circle[:, :dimension]
    noise = np.deg2rad(1.0) * rng.standard_normal((len(times), dimension - 1))
    return times, own, target, rotate_bearing(unit_bearing(target, own), noise)


def written(path, columns):
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    return path


def log_of(path, dimension=2, north=False, degrees=False, truth=True, **sailing):
    times, own, target, bearings = sailed(dimension, **sailing)
    angle = np.arctan2(bearings[:, 1], bearings[:, 0])
    angle = np.mod(0.5 * np.pi - angle, 2.0 * np.pi) if north else angle
    unit, scale = ("deg", 180.0 / np.pi) if degrees else ("rad", 1.0)
    columns = {"t": times, "sensor": ["a"] * len(times), f"bearing_{unit}": scale * angle}
    for i, axis in enumerate("xyz"[:dimension]):
        columns[f"own_{axis}"] = own[:, i]
        if truth:
            columns[f"true_{axis}"] = target[:, i]
    if dimension == 3:
        columns[f"elevation_{unit}"] = scale * np.arcsin(bearings[:, 2])
    return written(path, columns)


@pytest.mark.parametrize("dimension", [2, 3])
def test_all_conventions_of_angles_read_the_same(tmp_path, dimension):
    _, own, target, bearings = sailed(dimension)
    for north in (False, True):
        for degrees in (False, True):
            path = log_of(tmp_path / "log.csv", dimension, north, degrees)
            log = read_log(path, "north" if north else "x")
            assert log.bearings == pytest.approx(bearings, abs=1e-9)
            assert log.own == pytest.approx(own)
            assert log.truth == pytest.approx(target)
            assert log.period == pytest.approx(0.25)
    wrong = read_log(path, "x")
    assert np.abs(wrong.bearings - bearings).max() > 0.5


def test_latency_puts_bearings_and_own_positions_earlier(tmp_path):
    path = log_of(tmp_path / "log.csv")
    plain, late = read_log(path, "x"), read_log(path, "x", latency=0.5)
    assert late.times == pytest.approx(plain.times[2:] - 0.5)
    assert late.bearings == pytest.approx(plain.bearings[2:])
    assert late.own == pytest.approx(plain.own[:-2])
    assert late.truth == pytest.approx(plain.truth[:-2])


def test_two_sensors_may_share_a_time_and_truth_may_be_missing(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(
        "t,own_x,own_y,bearing_deg,true_x,true_y\n0,0,0,10,5,1\n1,0,0,11,,\n1,0,0,12,nan,\n2,0,0,13,5,2\n",
        encoding="utf-8",
    )
    log = read_log(path, "x")
    assert np.all(np.diff(log.times) > 0.0)
    assert log.times == pytest.approx([0.0, 1.0, 1.0, 2.0], abs=1e-5)
    assert np.isnan(log.truth).any(axis=1).tolist() == [False, True, True, False]


HEAD = "t,own_x,own_y,bearing_rad\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["allowed: at least 2"]),
        (HEAD + "0,0,0,0\n", ["found 1 rows"]),
        ("t,own_x,bearing_rad\n0,0,0\n1,0,0\n", ["missing: own_y"]),
        ("t,own_x,own_y,heading\n0,0,0,0\n1,0,0,0\n", ["allowed: one of bearing_rad, bearing_deg"]),
        ("t,own_x,own_y,bearing_rad,bearing_deg\n0,0,0,0,0\n1,0,0,0,0\n", ["one of bearing_rad, bearing_deg"]),
        ("t,own_x,own_y,bearing_rad,elevation_rad\n0,0,0,0,0\n1,0,0,0,0\n", ["missing: own_z"]),
        (HEAD + "0,0,0,0\n1,0,zero,0\n", ["line 3", "own_y", '"zero"', "a finite number"]),
        (HEAD + "0,0,0,0\n1,0,nan,0\n", ["line 3", "own_y"]),
        (HEAD + "0,0,0,0\n1,0,0\n", ["line 3", "bearing_rad", '""']),
        (HEAD + "5,0,0,0\n1,0,0,0\n", ["line 3", "found 1 after 5", "increasing"]),
        ("t,t,own_x,own_y,bearing_rad\n0,0,0,0,0\n1,0,0,0,0\n", ["the column t twice"]),
    ],
)
def test_a_bad_log_is_one_clear_line(tmp_path, text, words):
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError) as caught:
        read_log(path, "x")
    assert len(caught.value.faults) == 1
    for word in (str(path), *words):
        assert word in caught.value.faults[0]


def test_other_faults_are_one_line_and_exit_code_2(tmp_path, capsys):
    path = log_of(tmp_path / "log.csv")
    for arguments, words in (
        ([str(path)], ["--bearing-from: found nothing", "north"]),
        ([str(tmp_path / "none.csv"), "--bearing-from", "x"], ["none.csv", "cannot be read"]),
        (
            [str(path), "--bearing-from", "x", "--tracker", "magic"],
            ["--tracker: found magic", "motion_gp, mixture, ekf"],
        ),
        (
            [str(path), "--bearing-from", "x", "--set", "replay.trackers={a: {kind: nothing}}", "--tracker", "a"],
            ["kind"],
        ),
        ([str(path), "--bearing-from", "x", "--latency", "1000"], ["after a latency of 1000 s"]),
        ([str(path), "--bearing-from", "x", "--out", str(tmp_path)], ["not an empty folder"]),
    ):
        assert cli.main(["replay", "--quiet", *arguments]) == 2
        lines = capsys.readouterr().err.strip().splitlines()
        assert len(lines) == 1, lines
        for word in words:
            assert word in lines[0]
    many = tmp_path / "many.csv"
    many.write_text(HEAD + "\n".join("0,x,0,0" for _ in range(20)), encoding="utf-8")
    assert cli.main(["replay", "--quiet", str(many), "--bearing-from", "x"]) == 2
    assert capsys.readouterr().err.strip().splitlines()[-1].endswith("and 15 more")


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_log_becomes_a_track_a_table_and_figures(tmp_path, capsys, dimension):
    path = log_of(tmp_path / "log.csv", dimension, north=True, degrees=True)
    config = tmp_path / "quick.yaml"
    config.write_text(yaml.safe_dump(QUICK), encoding="utf-8")
    out = tmp_path / "out"
    arguments = ["replay", str(path), "--config", str(config), "--bearing-from", "north", "--tracker", "motion_gp,ekf"]
    assert cli.main([*arguments, "--out", str(out), "--quiet"]) == 0
    said = capsys.readouterr().out
    assert "| motion_gp |" in said
    assert "| constant 60 m |" in said
    assert (out / "scores.md").read_text(encoding="utf-8").strip() in said
    assert {file.name for file in (out / "figures").iterdir()} == {"track.png", "range.png", "residuals.png"}

    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    found = summary["trackers"]["motion_gp"]
    assert found["error_median"] < 0.08
    assert found["coverage"] > 0.8
    assert found["ahead_error_median"] < 0.3
    assert found["observable_share"] > 0.9
    assert 0.7 < found["residual_std_deg"] < 3.0
    assert summary["trackers"]["constant 60 m"]["error_median"] == pytest.approx(1.0, abs=0.05)
    # the numbers of the table are those of the file: recomputed here from the track and the truth
    track = np.genfromtxt(out / "motion_gp.csv", delimiter=",", names=True)
    _, own, target, _ = sailed(dimension)
    assert len(track) == len(target)
    position = np.stack([track[axis] for axis in "xyz"[:dimension]], axis=-1)
    scored = track["t"] >= 30.0
    share = (np.linalg.norm(position - target, axis=1) / np.linalg.norm(target - own, axis=1))[scored]
    assert np.median(share) == pytest.approx(found["error_median"], rel=1e-3)
    assert track["range"] == pytest.approx(np.linalg.norm(position - own, axis=1), rel=1e-3)
    # the folder says what it was made with, and that can be done again
    again = replay(path, out / "config.yaml", trackers=["motion_gp"])
    assert again.tracks[0].mean[-1] == pytest.approx(position[-1], rel=1e-4)


def test_without_a_truth_there_are_no_errors_and_still_a_track(tmp_path):
    path = log_of(tmp_path / "log.csv", truth=False, duration=20.0)
    found = replay(path, QUICK, bearing_from="x")
    assert found.log.truth is None
    scores = found.summary["trackers"]["motion_gp"]
    assert "error_median" not in scores
    found.save(tmp_path / "out")
    assert "median" not in (tmp_path / "out" / "scores.md").read_text(encoding="utf-8")
    with pytest.raises(FileExistsError):
        found.save(tmp_path / "out")


def test_trackers_of_positions_are_refused(tmp_path):
    path = log_of(tmp_path / "log.csv", duration=10.0)
    with pytest.raises(ConfigurationError, match="needs positions"):
        replay(path, {"tracker": {"kind": "imm_kf_f"}}, bearing_from="x")


recorded = pytest.mark.skipif(not RECORDED.is_dir(), reason=f"no recorded bearings in {RECORDED}")


@recorded
def test_a_recorded_log_is_followed_where_a_recursive_filter_claims_to_know():
    found = replay(RECORDED / "boat_s06_gunnerus.csv", bearing_from="x", trackers=["motion_gp", "ekf"])
    gp, ekf = (found.summary["trackers"][name] for name in ("motion_gp", "ekf"))
    assert gp["error_median"] < 0.3
    assert gp["coverage"] > 0.9
    assert gp["observable_share"] < 0.1
    assert ekf["error_median"] > 0.5


@recorded
@pytest.mark.slow
def test_recorded_logs_together_keep_what_is_promised():
    errors, inside = [], []
    for path in sorted(RECORDED.glob("*.csv")):
        found = replay(path, bearing_from="x")
        track, log = found.tracks[0], found.log
        scored = log.times >= log.times[0] + 30.0
        offset = (track.mean - log.truth)[scored]
        share = np.linalg.norm(offset, axis=1) / np.linalg.norm(log.truth - log.own, axis=1)[scored]
        solved = np.linalg.solve(track.covariance[scored], offset[..., None])[..., 0]
        assert np.median(share) < 0.7
        errors.append(share)
        inside.append(np.sum(offset * solved, axis=1) < 5.991)
    pooled = np.concatenate(errors)
    assert np.median(pooled) < 0.3
    assert np.sqrt(np.mean(pooled**2)) < 0.55
    assert np.mean(np.concatenate(inside)) > 0.9
