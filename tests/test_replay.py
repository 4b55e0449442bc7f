"""Replay from a CSV file to a folder: conventions of angles, latency, faults of a log, scores, and recorded logs."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.logs.read import read_log
from gbt_ocp.experiments.replay import replay
from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.reporting import glossary
from gbt_ocp.reporting.replay_figures import draw_replay, score_table, sensor_table
from gbt_ocp.reporting.style import CURVES

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
        (HEAD + "0,0,0,0\n1,0,0\n", ["line 3: found 3 cells", "allowed: 4"]),
        (HEAD + "0,0,0,0\n1,0,0,0,7\n", ["line 3: found 5 cells", "allowed: 4"]),
        ("t,own_x,depth,own_y,bearing_rad\n0,0,5,0,0\n1,0,0,0\n", ["line 3: found 4 cells", "allowed: 5"]),
        ("t,own_x,own_y,bearing_rad,note\n0,0,0,0,a\n1,0,0,0,a, b\n", ["line 3: found 6 cells", "allowed: 5"]),
        (HEAD + "0,0,0,0\n" + '1,"0,5",0,0\n', ["line 3", "own_x", '"0,5"', "a finite number"]),
        (HEAD + "0,0,0,\n1,0,0,nan\n2,0,0,0\n", ["found 1 bearings", "at least 2"]),
        ("t,own_x,own_y,own_z,bearing_rad,elevation_rad\n0,0,0,0,0,0\n1,0,0,0,0,\n", ["line 3", "elevation_rad", '""']),
        ("t,own_x,own_y,own_z,bearing_rad,elevation_rad\n0,0,0,0,0,0\n1,0,0,0,,0\n", ["line 3", "bearing_rad", '""']),
        (
            "t,own_x,own_y,own_z,bearing_rad,elevation_rad,elevation_deg\n0,0,0,0,0,0,0\n1,0,0,0,0,0,0\n",
            ["one of elevation_rad, elevation_deg"],
        ),
        (
            "t,own_x,own_y,own_z,bearing_rad,elevation_rad,true_x,true_y\n0,0,0,0,0,0,0,0\n1,0,0,0,0,0,0,0\n",
            ["found true_x, true_y without true_z", "allowed: all of true_x, true_y, true_z, or none"],
        ),
        ("t,own_x,own_y,bearing_rad,true_y\n0,0,0,0,1\n1,0,0,0,1\n", ["found true_y without true_x"]),
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
            ["--tracker: found magic", "mixture, motion_gp, ekf"],
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
@pytest.mark.long
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
    assert set(summary) == set(glossary.REPLAY_NUMBERS)
    assert set(summary["trackers"]["motion_gp"]) == set(glossary.SCORE_NUMBERS)
    assert set(score_table(summary).columns) - {"tracker"} == set(glossary.SCORE_COLUMNS)
    assert set(sensor_table(summary).columns) - {"tracker"} == set(glossary.SENSOR_COLUMNS)
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


@pytest.mark.long
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


def test_every_tracker_is_in_every_figure(tmp_path):
    """Also where there are more of them than colours."""
    path, names = log_of(tmp_path / "log.csv", duration=10.0), [f"method {k}" for k in range(len(CURVES) + 2)]
    found = replay(path, {"problem": "case2", "tracker": {"kind": "ekf"}}, bearing_from="x")
    figures = draw_replay(found.log, [replace(found.tracks[0], name=name) for name in names], 0.0)
    for name in ("track", "range"):
        labels = {text.get_text() for legend in figures[name].legends for text in legend.get_texts()}
        assert labels >= {*names}, name
    assert all(axes.has_data() for axes in figures["residuals"].axes)


def test_trackers_of_positions_are_refused(tmp_path):
    path = log_of(tmp_path / "log.csv", duration=10.0)
    with pytest.raises(ConfigurationError, match="needs positions"):
        replay(path, {"tracker": {"kind": "imm_kf_f"}}, bearing_from="x")


# Rows that are wider, coordinates of a map, rows without a bearing, several contacts


def test_a_log_with_decimal_commas_is_refused_where_it_stands(tmp_path):
    path = tmp_path / "log.csv"
    rows = [f"{t:.1f},{0.3 * t:.1f},{0.9 * t:.1f},{80.0 + t:.1f}".replace(".", ",") for t in range(8)]
    path.write_text("t,own_x,own_y,bearing_deg\n" + "\n".join(rows), encoding="utf-8")
    with pytest.raises(ConfigurationError) as caught:
        read_log(path, "north")
    assert caught.value.faults[0] == f"{path}: line 2: found 8 cells; allowed: 4, as in the header"
    assert caught.value.faults[-1] == f"{path}: and 3 more"


def test_absolute_times_and_map_coordinates_come_out_as_exactly_as_they_went_in(tmp_path):
    times, own, target, bearings = sailed(duration=20.0)
    # sums of powers of two, so that moving the log there and back is exact
    origin, start = np.array([565_248.0, 7_034_880.0]), 1.7e9
    own, target = np.round(own * 256.0) / 256.0, np.round(target * 256.0) / 256.0
    angle = np.arctan2(bearings[:, 1], bearings[:, 0])

    def track(name, shift, begin):
        columns = {"t": begin + times, "bearing_rad": angle}
        for i, axis in enumerate("xy"):
            columns[f"own_{axis}"], columns[f"true_{axis}"] = (own + shift)[:, i], (target + shift)[:, i]
        found = replay(written(tmp_path / f"{name}.csv", columns), QUICK, bearing_from="x", trackers=["ekf"])
        found.save(tmp_path / name, figures=False)
        with (tmp_path / name / "ekf.csv").open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        read = {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}
        # what is in the file is what was computed, to the last bit
        np.testing.assert_array_equal(read["t"], found.tracks[0].times)
        np.testing.assert_array_equal(np.stack([read["x"], read["y"]], axis=-1), found.tracks[0].mean)
        np.testing.assert_array_equal(read["cov_xy"], found.tracks[0].covariance[:, 0, 1])
        return read

    here, there = track("here", np.zeros(2), 0.0), track("there", origin, start)
    np.testing.assert_allclose(there["t"] - start, here["t"], atol=1e-6)
    np.testing.assert_allclose(there["x"] - origin[0], here["x"], atol=1e-4)
    np.testing.assert_allclose(there["y"] - origin[1], here["y"], atol=1e-4)


def test_times_that_fall_are_named_in_full(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(HEAD + "1700000000.25,0,0,0\n1700000000.125,0,0,0\n", encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"line 3: t: found 1700000000\.125 after 1700000000\.25;"):
        read_log(path, "x")


def turning(path, every, own_only=True, latency=0.0, nan=""):
    """A vehicle that turns every 10 s with its position at 10 Hz, a bearing now and then that is some seconds old."""
    times = np.arange(0.0, 60.0, 0.1)
    heading = np.deg2rad(np.where(times % 20.0 < 10.0, 30.0, 100.0))
    own = np.cumsum(0.2 * np.stack([np.sin(heading), np.cos(heading)], axis=-1), axis=0)
    target = np.array([90.0, -20.0])
    seen = (np.arange(len(times)) % every == every - 1) & (times >= latency)
    then = np.stack([np.interp(times - latency, times, values) for values in own.T], axis=-1)
    line = target - then
    angle = np.arctan2(line[:, 1], line[:, 0])
    rows = np.flatnonzero(seen | own_only)
    columns = {
        "t": times[rows],
        "own_x": own[rows, 0],
        "own_y": own[rows, 1],
        "bearing_rad": [angle[k] if seen[k] else nan for k in rows],
    }
    return written(path, columns), times[seen] - latency, then[seen]


@pytest.mark.parametrize("nan", ["", "nan", " NaN "])
def test_a_row_without_a_bearing_is_one_of_own_position(tmp_path, nan):
    path, times, own = turning(tmp_path / "log.csv", every=80, latency=3.0, nan=nan)
    log = read_log(path, "x", 3.0)
    np.testing.assert_allclose(log.times, times, atol=1e-9)
    np.testing.assert_allclose(log.own, own, atol=1e-6)
    line = np.array([90.0, -20.0]) - log.own
    np.testing.assert_allclose(log.bearings, line / np.linalg.norm(line, axis=1, keepdims=True), atol=1e-6)
    assert log.own_rows == 600 - len(times)
    # between bearings alone the position is metres off, as the vehicle turned meanwhile
    sparse, *_ = turning(tmp_path / "sparse.csv", every=80, own_only=False, latency=3.0)
    coarse = read_log(sparse, "x", 3.0)
    assert np.linalg.norm(coarse.own - own[-len(coarse.own) :], axis=1).max() > 1.0


def test_rows_without_a_bearing_do_not_change_what_is_made_of_the_others(tmp_path):
    dense, *_ = turning(tmp_path / "dense.csv", every=20)
    sparse, *_ = turning(tmp_path / "sparse.csv", every=20, own_only=False)
    with_rows, without = (replay(path, QUICK, bearing_from="x", trackers=["ekf"]) for path in (dense, sparse))
    np.testing.assert_array_equal(with_rows.tracks[0].mean, without.tracks[0].mean)
    assert with_rows.summary["rows_without_bearing"] == 570
    assert without.summary["rows_without_bearing"] == 0


def test_the_truth_of_rows_without_a_bearing_is_used_where_there_is_one(tmp_path):
    head = "t,own_x,own_y,bearing_rad,true_x,true_y\n"
    path = tmp_path / "log.csv"
    path.write_text(head + "0,0,0,0,8,0\n1,0,0,,,\n2,0,0,,9,0\n4,0,0,0,,\n6,0,0,0,12,0\n", encoding="utf-8")
    log = read_log(path, "x", 2.5)
    np.testing.assert_array_equal(log.times, [1.5, 3.5])
    # at 1.5 s between 0 and 2 s; at 3.5 s beside a bearing whose truth is not known
    np.testing.assert_array_equal(log.truth, [[8.75, 0.0], [np.nan, np.nan]])


def contacts(path, apart=0.0, names=("1", "2"), own_rows=False):
    """Two targets seen in turn, the second ``apart`` seconds after the first."""
    times, own, target, bearings = sailed(duration=30.0)
    other = unit_bearing(np.array([60.0, 90.0]) + 0.0 * target, own)
    lines = []
    for k, t in enumerate(times):
        place = f"{own[k, 0]},{own[k, 1]}"
        for name, seen, later in ((names[0], bearings[k], 0.0), (names[1], other[k], apart)):
            lines.append(f"{t + later},{name},{place},{np.arctan2(seen[1], seen[0])}")
        if own_rows:
            lines.append(f"{t + 0.15},,{place},")
    path.write_text("t,contact,own_x,own_y,bearing_rad\n" + "\n".join(lines), encoding="utf-8")
    return path, bearings, other


@pytest.mark.parametrize("names", [("1", "2"), ("bow wave", "7.0")])
@pytest.mark.parametrize("own_rows", [False, True])
@pytest.mark.parametrize("apart", [0.0, 0.1])
def test_one_contact_of_several_is_chosen_by_a_column(tmp_path, names, own_rows, apart):
    path, first, second = contacts(tmp_path / "log.csv", apart, names, own_rows)
    for name, expected in zip(names, (first, second), strict=True):
        log = read_log(path, "x", where={"contact": name})
        np.testing.assert_allclose(log.bearings, expected, atol=1e-12)
        assert log.own_rows == (len(expected) if own_rows else 0)
        assert log.warnings == ()
    assert len(read_log(path, "x", where={"contact": float(names[1])} if names[1] == "7.0" else {}).times) > 0
    everything = read_log(path, "x")
    assert len(everything.times) == 2 * len(first)
    (line,) = everything.warnings
    assert line.startswith(f"{path}: bearings with another contact ({', '.join(sorted(names))}) lie ")
    assert line.endswith("the log seems to hold several contacts; --where contact=VALUE chooses one")


def test_the_command_line_and_the_configuration_choose_a_contact(tmp_path, capsys):
    path, *_ = contacts(tmp_path / "log.csv")
    config = tmp_path / "quick.yaml"
    config.write_text(
        yaml.safe_dump({"tracker": {"kind": "ekf", "bearing_std_deg": 1.0}, "replay": {"where": {"contact": 2}}}),
        encoding="utf-8",
    )
    common = ["replay", str(path), "--bearing-from", "x", "--no-figures", "--quiet", "--config"]
    assert cli.main([*common, str(config), "--out", str(tmp_path / "a")]) == 0
    assert cli.main([*common, str(config), "--where", "contact=1", "--out", str(tmp_path / "b")]) == 0
    counts = [json.loads((tmp_path / name / "summary.json").read_text())["bearings"] for name in "ab"]
    assert counts == [120, 120]
    chosen = [yaml.safe_load((tmp_path / name / "config.yaml").read_text())["replay"]["where"] for name in "ab"]
    assert chosen == [{"contact": 2}, {"contact": "1"}]
    capsys.readouterr()
    for arguments, words in (
        (["--where", "contact=3"], ["found 0 bearings with contact=3", "allowed: contact is 1, 2"]),
        (["--where", "ship=1"], ["found the column ship", "allowed: t, contact, own_x"]),
        (["--where", "contact=1", "--where", "contact=2"], ["--where: found contact twice"]),
        (["--where", "contact"], ["--where: found 'contact'", "COLUMN=VALUE"]),
        (["--set", "replay.where=3"], ["replay.where: found 3", "a mapping of columns"]),
    ):
        assert cli.main([*common, str(config), *arguments]) == 2
        lines = capsys.readouterr().err.strip().splitlines()
        assert len(lines) == 1, lines
        for word in words:
            assert word in lines[0]


def test_a_log_that_seems_to_hold_several_contacts_is_warned_of(tmp_path):
    path, *_ = contacts(tmp_path / "log.csv")
    with (
        pytest.warns(RuntimeWarning, match="a quarter of the bearings"),
        pytest.warns(RuntimeWarning, match="seems to hold several contacts"),
    ):
        found = replay(path, QUICK, bearing_from="x", trackers=["ekf"])
    assert len(found.summary["warnings"]) == 2
    assert "--where contact=VALUE" in found.summary["warnings"][0]


def test_columns_that_tell_no_contacts_apart_are_not_warned_of(tmp_path):
    """Two sensors with a bias, a measurement, a counter, a state that changes once."""
    times, own, _, bearings = sailed(duration=30.0)
    angle = np.arctan2(bearings[:, 1], bearings[:, 0]) + np.deg2rad(8.0) * (np.arange(len(times)) % 2)
    columns = {
        "t": times,
        "own_x": own[:, 0],
        "own_y": own[:, 1],
        "bearing_rad": angle,
        "sensor": ["IR" if k % 2 else "EO" for k in range(len(times))],
        "battery": np.round(12.0 + 0.1 * np.sin(times), 1),
        "ping": np.arange(len(times)),
        "mode": np.where(times < 12.0, "search", "follow"),
    }
    assert read_log(written(tmp_path / "log.csv", columns), "x").warnings == ()


recorded = pytest.mark.skipif(not RECORDED.is_dir(), reason=f"no recorded bearings in {RECORDED}")


@recorded
def test_two_cameras_on_one_boat_are_not_taken_for_two_contacts():
    for path in sorted(RECORDED.glob("*.csv")):
        assert read_log(path, "x").warnings == ()


@pytest.mark.slow
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
