"""The same log in five formats and three frames gives the same track; what a log lacks is said in one line."""

import gzip
import math
import re
from pathlib import Path

import log_writers as write
import numpy as np
import pytest

from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.logs.csv_columns import known_columns
from gbt_ocp.experiments.logs.mapping import (
    HeadingEntry,
    LogEntry,
    MeasurementEntry,
    PositionEntry,
    load_mapping,
    ready_mappings,
)
from gbt_ocp.experiments.logs.read import read_log
from gbt_ocp.experiments.replay import replay

ORIGIN = tuple(np.rad2deg([write.LATITUDE, write.LONGITUDE]))

QUICK = {
    "tracker": {
        "kind": "ekf",
        "initial_range_m": 60.0,
        "initial_range_std_m": 20.0,
        "initial_speed_std": 1.0,
        "process_noise": 1e-4,
        "bearing_std_deg": 0.5,
    },
    "replay": {"in_plane": True, "origin_deg": list(ORIGIN), "score_from_s": 10.0},
}

geodesy = pytest.importorskip("pymap3d", reason="pymap3d is not installed (extra geodesy)")

FORMATS = {
    "ros2": ("rosbags", write.ros2_bag, "bag", "x"),
    "mcap": ("mcap_ros2", write.mcap_file, "log.mcap", None),
    "mavlink": ("pymavlink", write.telemetry, "log.tlog", None),
    "imc": ("imcpy", write.lsf, "log.lsf", None),
}


def written(name, folder, log, **more):
    library, writer, file, bearing_from = FORMATS[name]
    pytest.importorskip(library, reason=f"{library} is not installed (extra logs)")
    return writer(folder / file, log, **more), bearing_from


def followed(path, bearing_from, **more):
    return replay(path, QUICK, bearing_from=bearing_from, **more)


@pytest.fixture(scope="module")
def meridian(tmp_path_factory):
    """A log, and what is made of it as a CSV in the plane."""
    log = write.sailed(meridian=True)
    path = write.in_plane(tmp_path_factory.mktemp("log") / "log.csv", log)
    return log, followed(path, "x")


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.long
def test_the_same_log_in_five_formats_gives_the_same_track(tmp_path, meridian, name):
    log, expected = meridian
    path, bearing_from = written(name, tmp_path, log)
    found = followed(path, bearing_from)
    if name == "mcap":  # the fixes that are none are left out there, with their bearings
        kept = np.arange(len(log.times)) % 7 != 3
        fewer = write.Sailed(*(values[kept] for values in vars(log).values()))
        expected = followed(write.in_plane(tmp_path / "fewer.csv", fewer), "x")
    track = found.tracks[0]
    np.testing.assert_allclose(track.times, expected.tracks[0].times, rtol=0.0, atol=1e-6)
    assert np.abs(found.log.own - expected.log.own).max() < 1e-8
    assert np.abs(found.log.bearings - expected.log.bearings).max() < 1e-11
    assert np.abs(track.mean - expected.tracks[0].mean).max() < 1e-6
    assert found.summary["warnings"] == expected.summary["warnings"]
    # and it is a track of the target, not of nothing
    assert np.linalg.norm(track.mean[-1] - log.target[-1]) < 5.0


@pytest.mark.long
def test_the_same_log_in_three_frames_gives_the_same_track(tmp_path):
    log = write.sailed()
    plane = followed(write.in_plane(tmp_path / "plane.csv", log), "x")
    north = followed(write.north_east(tmp_path / "north.csv", log), "north")
    globe = followed(write.on_the_globe(tmp_path / "globe.csv", log), "bow")
    for other in (north, globe):
        assert np.abs(other.log.bearings - plane.log.bearings).max() < 1e-9
        assert np.abs(other.tracks[0].mean - plane.tracks[0].mean).max() < 1e-6
    assert np.linalg.norm(plane.tracks[0].mean[-1] - log.target[-1]) < 5.0
    # without its turn, north there would give another bearing
    _, _, turn = write.geographic(log)
    assert np.abs(turn).max() > 1e-6


@pytest.mark.parametrize("delimiter", [";", "\t"])
@pytest.mark.parametrize("writer", [write.in_plane, write.north_east])
def test_semicolons_and_decimal_commas_read_the_same(tmp_path, delimiter, writer):
    log, stated = write.sailed(), "x" if writer is write.in_plane else "north"
    plain = read_log(writer(tmp_path / "plain.csv", log), stated)
    other = read_log(writer(tmp_path / "other.csv", log, delimiter=delimiter, comma=True), stated)
    points = read_log(writer(tmp_path / "points.csv", log, delimiter=delimiter), stated)
    for found in (other, points):
        np.testing.assert_array_equal(found.times, plain.times)
        np.testing.assert_array_equal(found.own, plain.own)
        np.testing.assert_array_equal(found.bearings, plain.bearings)


@pytest.mark.parametrize(
    ("cell", "line"),
    [
        ("0.5", 'line 3: own_x: found "0.5"'),
        ("1.234,5", 'line 3: own_x: found "1.234,5"'),
        ("1,234,5", 'line 3: own_x: found "1,234,5"'),
        ("1_000", 'line 3: own_x: found "1_000"'),
        ("x", 'line 3: own_x: found "x"'),
        ("", 'line 3: own_x: found ""'),
    ],
)
def test_a_number_that_may_mean_two_things_is_refused_with_its_line(tmp_path, cell, line):
    path = tmp_path / "log.csv"
    path.write_text(
        f"t;own_x;own_y;bearing_deg\n0,0;0,5;1,5;10\n1,0;{cell};1,5;11,5\n2,0;0,5;1,5;12\n", encoding="utf-8"
    )
    with pytest.raises(ConfigurationError) as caught:
        read_log(path, "x")
    assert caught.value.faults[0].startswith(f"{path}: {line}; allowed: ")
    assert len(caught.value.faults) == 1


def test_a_row_of_semicolons_that_is_too_wide_is_refused_with_its_line(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t;own_x;own_y;bearing_deg\n0,0;0,5;1,5;10\n1,0;0,5;1,5;11;5\n", encoding="utf-8")
    with pytest.raises(ConfigurationError, match="line 3: found 5 cells; allowed: 4, as in the header"):
        read_log(path, "x")


@pytest.mark.parametrize(
    ("cells", "asked", "chosen"),
    [
        (["7.0", "8.0"], "007", [0]),
        (["007", "7"], "007", [0]),
        (["007", "7"], "7", [1]),
        (["7.0", "8.0"], 7, [0]),
        (["7", "7.0"], 7.0, [0, 1]),
        (["007", "abc"], "007", [0]),
        (["1_000", "1000"], "1000", [1]),
        (["nan", "7"], "007", [1]),
    ],
)
def test_an_identity_is_a_text_where_it_stands_so_and_a_number_otherwise(tmp_path, cells, asked, chosen):
    log = write.sailed(10.0)
    columns = {"t": log.times, "own_x": log.own[:, 0], "own_y": log.own[:, 1], "bearing_rad": log.azimuth}
    columns["id"] = [cells[k % 2] for k in range(len(log.times))]
    found = read_log(write.table(tmp_path / "log.csv", columns), "x", where={"id": asked})
    np.testing.assert_array_equal(found.times, [time for k, time in enumerate(log.times) if k % 2 in chosen])


def test_ranges_sizes_and_deviations_of_several_sensors(tmp_path):
    log = write.sailed(10.0)
    n = len(log.times)
    every = np.arange(n) % 4 == 0
    columns = {
        "t": log.times,
        "own_x": log.own[:, 0],
        "own_y": log.own[:, 1],
        "bow.bearing_rad": log.azimuth,
        "bow.std_deg": [0.5 + 0.01 * k for k in range(n)],
        "mast.bearing_deg": [f"{math.degrees(log.azimuth[k]) + 1.0!r}" if every[k] else "" for k in range(n)],
        "ping.range_m": ["55.5" if every[k] else "" for k in range(n)],
        "ping.range_std_m": ["2" if every[k] else "" for k in range(n)],
        "mast.size_deg": ["3" if every[k] else "" for k in range(n)],
    }
    found = read_log(write.table(tmp_path / "log.csv", columns), "x")
    by_sensor = {}
    for one in found.sightings:
        by_sensor.setdefault((one.sensor, one.kind), []).append(one)
    assert {key: len(ones) for key, ones in by_sensor.items()} == {
        ("bow", "azimuth"): n,
        ("mast", "azimuth"): every.sum(),
        ("ping", "range"): every.sum(),
        ("mast", "size"): every.sum(),
    }
    first = by_sensor["bow", "azimuth"]
    np.testing.assert_allclose([one.std[0] for one in first], np.deg2rad(0.5 + 0.01 * np.arange(n)), rtol=1e-12)
    assert all(np.isnan(one.std[0]) for one in by_sensor["mast", "azimuth"])
    assert {(one.value[0], one.std[0]) for one in by_sensor["ping", "range"]} == {(55.5, 2.0)}
    assert np.isnan(found.bearings[[one.kind == "range" for one in found.sightings]]).all()
    assert np.all(np.diff(found.times) > 0.0)
    # as measurements of the public kind, which say the same
    for one, measurement in zip(found.sightings, found.measurements, strict=True):
        again = measurement.placed(np.append(one.position, 0.3))
        np.testing.assert_array_equal(again.value, one.value)
        assert (again.sensor, again.kind, again.time) == (one.sensor, one.kind, one.time)


def test_usbl_fixes_of_an_azimuth_alone_and_of_a_range_alone(tmp_path):
    log = write.sailed(20.0)
    types = np.arange(len(log.times)) % 3
    ranges = np.full(len(log.times), 50.25)
    pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed (extra mcap)")
    found = read_log(write.mcap_file(tmp_path / "log.mcap", log, types, ranges))
    kinds = [one.kind for one in found.sightings]
    fixed = (np.arange(len(log.times)) % 7 != 3) | (types != 1)
    assert kinds.count("range") == np.sum(fixed & (types != 1))
    assert kinds.count("azimuth") == np.sum(fixed & (types != 0))
    assert {one.value[0] for one in found.sightings if one.kind == "range"} == {50.25}


def test_a_camera_of_mavlink_gives_azimuth_elevation_size_and_range(tmp_path):
    log = write.sailed(10.0)
    path, _ = written("mavlink", tmp_path, log, size=0.125, distance=48.5)
    found = read_log(path)
    kinds = {
        kind: [one for one in found.sightings if one.kind == kind] for kind in ("azimuth_elevation", "size", "range")
    }
    assert all(len(ones) == len(log.times) for ones in kinds.values())
    np.testing.assert_allclose([one.value[0] for one in kinds["azimuth_elevation"]], log.azimuth, atol=1e-9)
    assert {one.value[0] for one in kinds["size"]} == {0.125}
    assert {one.value[0] for one in kinds["range"]} == {48.5}
    assert {one.sensor for one in found.sightings} == {"camera"}
    assert found.own[0].tolist() == [*log.own[0], -2.0]


def test_a_log_of_an_autopilot_by_a_mapping_of_ones_own(tmp_path):
    pytest.importorskip("pymavlink", reason="pymavlink is not installed (extra mavlink)")
    log = write.sailed(20.0)
    mapping = tmp_path / "mine.yaml"
    mapping.write_text(
        "own: [{message: POS, fields: [Lat, Lng], frame: lat_lon_height, angle_unit: deg}]\n"
        "heading: [{message: ATT, fields: [Yaw], frame: north, unit: deg}]\n"
        "measurements:\n"
        "- {message: BRG, kind: azimuth, fields: [Rel], frame: bow, unit: deg, std_fields: [Std], sensor: sonar}\n",
        encoding="utf-8",
    )
    found = read_log(write.autopilot(tmp_path / "log.bin", log), mapping=mapping, origin_deg=ORIGIN)
    assert np.abs(found.own - log.own).max() < 0.02  # the format has ten-millionths of a degree
    expected = np.column_stack([np.cos(log.azimuth), np.sin(log.azimuth)])
    assert np.abs(found.bearings - expected).max() < 1e-7
    assert {round(math.degrees(one.std[0]), 9) for one in found.sightings} == {0.5}
    assert np.diff(found.times) == pytest.approx(np.diff(log.times), abs=1e-5)


def test_an_accuracy_of_imc_is_a_deviation_and_names_a_contact(tmp_path):
    log = write.sailed(10.0, meridian=True)
    path, _ = written("imc", tmp_path, log, accuracy=0.03125)
    found = read_log(path, in_plane=True, where={"target": "buoy"})
    assert {float(one.std[0]) for one in found.sightings} == {0.03125}
    with pytest.raises(
        ConfigurationError, match="where: found no measurement with target=ship; allowed: target is buoy"
    ):
        read_log(path, where={"target": "ship"})


def test_a_bag_with_mcap_inside_is_a_bag(tmp_path):
    pytest.importorskip("rosbags", reason="rosbags is not installed (extra ros)")
    log = write.sailed(10.0)
    one = read_log(write.ros2_bag(tmp_path / "a", log), "x")
    other = read_log(write.ros2_bag(tmp_path / "b", log, storage="mcap"), "x")
    np.testing.assert_array_equal(one.bearings, other.bearings)
    np.testing.assert_array_equal(one.own, other.own)
    assert one.own.shape == (len(log.times), 3)  # it has a height, and its bearings an elevation
    inside = next((tmp_path / "b").glob("*.mcap"))
    pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed (extra mcap)")
    np.testing.assert_array_equal(read_log(inside, "x").bearings, one.bearings)
    np.testing.assert_array_equal(read_log(next((tmp_path / "a").glob("*.db3")), "x").bearings, one.bearings)


def test_a_bag_of_ros_1_reads_as_one_of_ros_2(tmp_path):
    pytest.importorskip("rosbags", reason="rosbags is not installed (extra ros)")
    log = write.sailed(10.0)
    found = read_log(write.ros1_bag(tmp_path / "log.bag", log), "x")
    np.testing.assert_array_equal(
        found.bearings[:, :2], read_log(write.ros2_bag(tmp_path / "bag", log), "x").bearings[:, :2]
    )
    np.testing.assert_array_equal(found.times, log.times)


def test_stamps_that_are_not_set_are_refused(tmp_path):
    pytest.importorskip("rosbags", reason="rosbags is not installed (extra ros)")
    log = write.sailed(5.0)
    path = write.ros2_bag(tmp_path / "bag", write.Sailed(**{**vars(log), "times": 0.0 * log.times}))
    with pytest.raises(ConfigurationError, match=r"/odom: header.stamp: found 0 in all messages; allowed: stamps"):
        read_log(path, "x")


def test_a_packed_log_of_imc_reads_and_one_that_unpacks_to_far_more_is_refused(tmp_path, monkeypatch):
    path, _ = written("imc", tmp_path, write.sailed(5.0))
    packed = tmp_path / "log.lsf.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    np.testing.assert_array_equal(read_log(packed).bearings, read_log(path).bearings)
    monkeypatch.setattr("gbt_ocp.experiments.logs.imc_log.UNPACKED", 1000)
    monkeypatch.setattr("gbt_ocp.experiments.logs.imc_log.PACKED", 1)
    with pytest.raises(ConfigurationError, match=r"cannot be read \(more than .* bytes when it is unpacked\)"):
        read_log(packed)


def test_where_bearings_are_from_is_not_said_twice(tmp_path):
    path, _ = written("mavlink", tmp_path, write.sailed(5.0))
    assert read_log(path).warnings == ()
    (line,) = read_log(path, "north").warnings
    assert line == f"{path}: bearings from north are not asked for: the mapping says where they are counted from"


@pytest.mark.parametrize("name", FORMATS)
def test_a_damaged_log_is_one_line(tmp_path, name):
    log = write.sailed(5.0)
    path, bearing_from = written(name, tmp_path, log)
    file = next(path.glob("*.db3")) if path.is_dir() else path
    data = file.read_bytes()
    for spoilt in (b"", data[:50], b"no log at all " * 20):
        file.write_bytes(spoilt)
        with pytest.raises(ConfigurationError) as caught:
            read_log(path, bearing_from)
        assert len(caught.value.faults) == 1
        assert caught.value.faults[0].startswith(f"{path}: found ")


def test_what_messages_lack_is_one_line(tmp_path):
    pytest.importorskip("rosbags", reason="rosbags is not installed (extra ros)")
    path = write.ros2_bag(tmp_path / "bag", write.sailed(5.0))
    for options, words in (
        ({}, ["--bearing-from: found nothing, which geometry_msgs/msg/Vector3Stamped (/sonar/bearing) needs", "bow"]),
        ({"topics": ["/odom"], "bearing_from": "x"}, ["no measurement; allowed: geometry_msgs/msg/Vector3Stamped"]),
        ({"topics": ["/sonar/bearing"], "bearing_from": "x"}, ["no own position; allowed: nav_msgs/msg/Odometry"]),
        ({"mapping": "imc"}, ["found messages nav_msgs/msg/Odometry", "no own position; allowed: EstimatedState"]),
        ({"mapping": "nothing"}, ["mapping: found nothing", "allowed: imc, mavlink, ros, or a path"]),
    ):
        with pytest.raises(ConfigurationError) as caught:
            read_log(path, **options)
        assert len(caught.value.faults) == 1
        for word in words:
            assert word in caught.value.faults[0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("own: 3", ["own: found 3"]),
        ("owned: []", ["owned: found an unknown key; did you mean own"]),
        ("own: [{fields: [x, y], frame: utm}]", ['own.0.frame: found "utm"; allowed: enu, ned, lat_lon_height']),
        ("own: [{frame: enu}]", ["own.0.fields: found nothing"]),
        ("own: [{fields: [x], frame: enu}]", ["own.0.fields: found 1; allowed: 2 or 3"]),
        (
            "measurements: [{kind: azimuth, fields: [a], unit: rad}]",
            ["measurements.0.frame: found nothing; allowed: north, x, bow, bow_port, stated"],
        ),
        (
            "measurements: [{kind: azimuth_elevation, fields: [a, b], unit: rad, frame: x}]",
            ["measurements.0.elevation: found nothing; allowed: up, down"],
        ),
        ("measurements: [{kind: range, fields: [a], unit: deg}]", ["measurements.0.unit: found deg; allowed: m, km"]),
        ("heading: [{fields: [a], unit: quaternion, frame: x}]", ["heading.0.fields: found 1; allowed: 4"]),
        ("[1, 2]", ["found no mapping"]),
        ("own: [", ["allowed: YAML"]),
    ],
)
def test_a_wrong_mapping_is_refused_by_key(tmp_path, text, words):
    path = tmp_path / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError) as caught:
        load_mapping(path)
    for word in (str(path), *words):
        assert word in caught.value.faults[0]


def test_ready_mappings_are_right():
    assert ready_mappings() == ["imc", "mavlink", "ros"]
    for name in ready_mappings():
        mapping = load_mapping(name)
        assert mapping.own
        assert mapping.measurements


def test_columns_of_other_names_by_a_mapping(tmp_path):
    log = write.sailed(10.0)
    path = write.table(
        tmp_path / "log.csv",
        {"Time": 1000.0 * log.times, "N": log.own[:, 1], "E": log.own[:, 0], "Brg": np.rad2deg(log.bearing)},
        delimiter=";",
        comma=True,
    )
    mapping = tmp_path / "mine.yaml"
    mapping.write_text(
        "own: [{fields: [N, E], frame: ned, time: Time, time_unit: ms}]\n"
        "measurements: [{kind: azimuth, fields: [Brg], frame: north, unit: deg, std: 0.5}]\n",
        encoding="utf-8",
    )
    found = read_log(path, mapping=mapping)
    expected = read_log(write.in_plane(tmp_path / "plane.csv", log), "x")
    np.testing.assert_allclose(found.times, expected.times, rtol=0.0, atol=1e-6)
    np.testing.assert_array_equal(found.own, expected.own)
    assert np.abs(found.bearings - expected.bearings).max() < 1e-12
    assert {float(one.std[0]) for one in found.sightings} == {math.radians(0.5)}
    mapping.write_text(mapping.read_text().replace("[Brg]", "[Bearing]"), encoding="utf-8")
    with pytest.raises(ConfigurationError, match="found the columns Time, N, E, Brg; missing: Bearing"):
        read_log(path, mapping=mapping)


HEAD = "t,lat_deg,lon_deg,bearing_deg"


@pytest.mark.parametrize(
    ("text", "bearing_from", "words"),
    [
        ("t,own_x,own_y,bearing_deg\n0,0,0,1\n1,0,0,1\n", "bow", ["missing: heading_deg"]),
        (f"{HEAD}\n0,63,10,1\n1,93,10,1\n", "north", ['line 3: lat_deg: found "93"; allowed: degrees from -90 to 90']),
        (f"{HEAD},own_x,own_y\n0,63,10,1,0,0\n1,63,10,1,0,0\n", "north", ["allowed: one of own_x, own_y and lat_deg"]),
        ("utc,own_x,own_y,bearing_deg\n12:00:00,0,0,1\n12:00:01,0,0,1\n", "x", ['line 2: utc: found "12:00:00"']),
        ("t,utc,own_x,own_y,bearing_deg\n0,0,0,0,1\n1,0,0,0,1\n", "x", ["allowed: one of t, utc"]),
        ("t,own_x,own_y,range_m\n0,0,0,1\n1,0,0,-5\n", "x", ['line 3: range_m: found "-5"; allowed: a number > 0']),
        ("t,own_x,own_y,bearing_deg,std_deg\n0,0,0,1,1\n1,0,0,1,0\n", "x", ['line 3: std_deg: found "0"']),
        ("t,own_north,own_y,bearing_deg\n0,0,0,1\n1,0,0,1\n", "x", ["allowed: one of own_x, own_y and own_north"]),
        ("t,lat_deg,bearing_deg\n0,0,1\n1,0,1\n", "north", ["missing: lon_deg"]),
        ("t,own_x,own_y,bearing_deg,heading_deg\n0,0,0,1,\n1,0,0,1,\n", "bow", ["found no heading"]),
    ],
)
def test_columns_that_do_not_fit_are_one_line(tmp_path, text, bearing_from, words):
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError) as caught:
        read_log(path, bearing_from)
    for word in (str(path), *words):
        assert word in caught.value.faults[0]


CASES = Path(__file__).resolve().parents[2] / "shared" / "cases" / "06-body-bearings-latlon"


@pytest.mark.skipif(not CASES.is_dir(), reason=f"no inputs in {CASES}")
def test_bearings_from_the_bow_and_positions_on_the_globe_are_those_of_the_same_log():
    body, globe = read_log(CASES / "body.csv", "bow"), read_log(CASES / "latlon.csv", "north")
    np.testing.assert_allclose(body.bearings, globe.bearings, atol=1e-5)  # north turns by so much over 60 m
    assert np.abs(body.own - globe.own).max() < 0.1  # they were laid out on a sphere, and this is an ellipsoid
    assert body.own[-1].tolist() == [17.4, 55.1]


PAGE = Path(__file__).resolve().parents[1] / "docs" / "howto" / "logs.md"


def test_the_page_about_logs_says_what_is_so(tmp_path, monkeypatch, capsys):
    """Its mappings load, and its table in German and its Python do what it says."""
    text = PAGE.read_text(encoding="utf-8")
    mappings = re.findall(r"^```yml\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    assert len(mappings) == 2
    monkeypatch.chdir(tmp_path)
    for name, mapping in zip(("sonar.yaml", "tabelle.yaml"), mappings, strict=True):
        Path(name).write_text(mapping, encoding="utf-8")
        load_mapping(name)
    log = write.sailed(10.0)
    columns = {"Zeit": 1000.0 * (log.times - log.times[0]), "Nord": log.own[:, 1], "Ost": log.own[:, 0]}
    columns |= {"Peilung": np.rad2deg(log.bearing), "Fehler": np.full(len(log.times), 0.5)}
    write.table("tabelle.csv", columns, delimiter=";", comma=True)
    exec(re.search(r"^```python\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)[1], {})
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(log.times)
    first = lines[0].split()
    assert first[:2] == ["0.0", "azimuth"]
    assert float(first[2]) == pytest.approx(log.azimuth[0], abs=1e-12)
    # every column and key that the page names is one that is read
    named = re.findall(r"^\| (`.*?)\|", text[text.index("## Columns") : text.index("## Ready")], re.MULTILINE)
    words = [word for cell in named for word in re.findall(r"`(\w+)`", cell) if not word.startswith("_")]
    assert len(words) > 25
    assert known_columns(words) == len(words)
    keys = {
        name for section in (LogEntry, PositionEntry, HeadingEntry, MeasurementEntry) for name in section.model_fields
    }
    table = re.findall(r"^\| (`.*?)\|", text[text.index("| key | what |") :], re.MULTILINE)
    assert {word for cell in table for word in re.findall(r"`(\w+)`", cell)} == keys - {"units", "std_units"}
