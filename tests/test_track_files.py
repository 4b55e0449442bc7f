"""Tracks of a log as files of others, read back by other means: CSV, GeoJSON, GPX, MCAP, and the page with the map."""

import csv
import json
import re
import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import log_writers as write
import numpy as np
import pytest

from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.replay import replay
from gbt_ocp.frames import seconds_of_utc
from gbt_ocp.simulation.sensor_residuals import track_residuals

pymap3d = pytest.importorskip("pymap3d", reason="pymap3d is not installed (extra geodesy)")

QUICK = {
    "tracker": {
        "kind": "ekf",
        "initial_range_m": 60.0,
        "initial_range_std_m": 20.0,
        "initial_speed_std": 1.0,
        "process_noise": 1e-4,
        "bearing_std_deg": 0.5,
    },
    "replay": {"score_from_s": 10.0, "trackers": {"loose": {"kind": "ekf", "process_noise": 0.01}}},
}


@pytest.fixture(scope="module")
def globe(tmp_path_factory):
    """A log on the globe with its tracks, and the folder that they were saved in."""
    folder = tmp_path_factory.mktemp("log")
    log = write.sailed(60.0)
    found = replay(write.on_the_globe(folder / "log.csv", log), QUICK, bearing_from="bow", trackers=["all"])
    found.save(folder / "out", figures=False)
    return found, folder / "out"


def plane_of(found, longitude, latitude):
    """East and north of places, by the library for geodesy and not by the package."""
    plane = found.log.plane
    origin = (plane.latitude, plane.longitude, plane.height)
    there = pymap3d.geodetic2enu(np.deg2rad(latitude), np.deg2rad(longitude), 0.0, *origin, deg=False)
    return np.column_stack(there[:2])


def test_all_files_are_written_where_the_log_is_on_the_globe(globe):
    found, out = globe
    names = {path.name for path in out.iterdir()}
    expected = {"config.yaml", "summary.json", "scores.md", "tracks.geojson", "tracks.gpx", "map.html"}
    expected |= {f"{name}{end}.csv" for name in ("ekf", "loose") for end in ("", "-residuals")}
    assert names - {"tracks.mcap"} == expected
    assert found.exports[:3] == ("csv", "geojson", "gpx")


def test_geojson_has_the_tracks_and_their_ellipses(globe):
    found, out = globe
    features = json.loads((out / "tracks.geojson").read_text(encoding="utf-8"))["features"]
    lines = {one["properties"]["name"]: one for one in features if one["geometry"]["type"] == "LineString"}
    assert list(lines) == ["own vehicle", "ekf", "loose"]
    places = np.array(lines["ekf"]["geometry"]["coordinates"])
    assert np.abs(plane_of(found, *places.T) - found.tracks[0].mean).max() < 1e-5
    assert lines["ekf"]["properties"]["times"] == found.log.times.tolist()
    rings = [one for one in features if one["geometry"]["type"] == "Polygon"]
    assert len(rings) == 24
    for ring in rings[:12]:
        corners = np.array(ring["geometry"]["coordinates"][0])
        assert corners[0].tolist() == corners[-1].tolist()
        k = found.log.times.tolist().index(ring["properties"]["time"])
        away = plane_of(found, *corners.T) - found.tracks[0].mean[k]
        squared = np.einsum("ki,ij,kj->k", away, np.linalg.inv(found.tracks[0].covariance[k]), away)
        np.testing.assert_allclose(squared, 5.9915, rtol=1e-3)  # 95 % of a chi-squared with two degrees


def test_gpx_has_places_and_times(globe):
    found, out = globe
    space = {"g": "http://www.topografix.com/GPX/1/1"}
    root = ElementTree.fromstring((out / "tracks.gpx").read_bytes())
    assert [name.text for name in root.findall("g:trk/g:name", space)] == ["own vehicle", "ekf", "loose"]
    points = root.findall("g:trk", space)[1].findall("g:trkseg/g:trkpt", space)
    places = np.array([[float(point.get("lon")), float(point.get("lat"))] for point in points])
    assert np.abs(plane_of(found, *places.T) - found.tracks[0].mean).max() < 1e-5
    times = [seconds_of_utc(point.find("g:time", space).text) for point in points]
    np.testing.assert_allclose(times, found.log.times, rtol=0.0, atol=1e-6)


def test_csv_has_the_places_and_the_residuals(globe):
    found, out = globe
    with (out / "ekf.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    places = np.array([[float(row["lon_deg"]), float(row["lat_deg"])] for row in rows])
    assert np.abs(plane_of(found, *places.T) - found.tracks[0].mean).max() < 1e-5
    with (out / "ekf-residuals.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {(row["sensor"], row["kind"], row["unit"]) for row in rows} == {("sensor", "azimuth", "deg")}
    residuals = [float(row["residual_1"]) for row in rows[1:]]
    np.testing.assert_allclose(residuals, np.rad2deg(found.tracks[0].residual[1:, 0]), atol=1e-9)
    assert rows[0]["residual_1"] == ""


def test_mcap_reads_back(globe):
    found, out = globe
    reader = pytest.importorskip("mcap.reader", reason="mcap is not installed (extra mcap)")
    topics = {}
    with (out / "tracks.mcap").open("rb") as stream:
        for schema, channel, message in reader.make_reader(stream).iter_messages():
            assert channel.message_encoding == "json"
            assert schema.encoding == "jsonschema"
            content = json.loads(message.data)
            stamp = content["timestamp"]
            assert message.log_time == stamp["sec"] * 10**9 + stamp["nsec"]
            topics.setdefault((channel.topic, schema.name), []).append(content)
    assert set(topics) == {
        *((f"/{name}/pose", "foxglove.PoseInFrame") for name in ("own_vehicle", "ekf", "loose")),
        *((f"/{name}/fix", "foxglove.LocationFix") for name in ("own_vehicle", "ekf", "loose")),
        *((f"/{name}/range", "gbt_ocp.Range") for name in ("ekf", "loose")),
    }
    poses = topics["/ekf/pose", "foxglove.PoseInFrame"]
    places = [[one["pose"]["position"][axis] for axis in "xy"] for one in poses]
    np.testing.assert_array_equal(places, found.tracks[0].mean)
    times = [one["timestamp"]["sec"] + one["timestamp"]["nsec"] / 1e9 for one in poses]
    np.testing.assert_allclose(times, found.log.times, rtol=0.0, atol=1e-6)
    ranges = topics["/ekf/range", "gbt_ocp.Range"]
    deviation = found.tracks[0].range_std_over_range(found.log.own)
    np.testing.assert_allclose([one["range_std"] / one["range"] for one in ranges], deviation, rtol=1e-12)


def test_the_summary_and_the_scores_say_the_residuals_by_sensor(tmp_path, capsys):
    log = write.sailed(90.0)
    columns = {"t": log.times, "own_x": log.own[:, 0], "own_y": log.own[:, 1], "good.bearing_rad": log.azimuth}
    columns["biased.bearing_rad"] = log.azimuth + np.deg2rad(4.0)
    path = write.table(tmp_path / "log.csv", columns)
    config = {**QUICK, "tracker": {**QUICK["tracker"], "bearing_std_deg": 3.0}}
    found = replay(path, config, bearing_from="x")
    found.save(tmp_path / "out", figures=False)
    rows = {row["sensor"]: row for row in found.summary["trackers"]["ekf"]["sensors"]}
    assert set(rows) == {"good", "biased"}
    assert rows["biased"]["mean"][0] - rows["good"]["mean"][0] == pytest.approx(4.0, abs=0.2)
    assert rows["good"]["count"] == np.sum(log.times >= log.times[0] + 10.0)
    # by hand, from the predicted positions
    mean = found.tracks[0].before.mean[1:]
    line = mean - found.log.own[1:]
    by_hand = np.angle(
        np.exp(1j * (np.array([one.value[0] for one in found.log.sightings[1:]]) - np.arctan2(*line.T[::-1])))
    )
    np.testing.assert_allclose(np.concatenate(track_residuals(found.tracks[0], found.log)[1:]), by_hand, atol=1e-12)
    text = (tmp_path / "out" / "scores.md").read_text(encoding="utf-8")
    for words in ("- observable %: share of the time", "| ekf | good, azimuth |", "- mean: of the measurements less"):
        assert words in text
    heads = [cell.strip() for cell in text.splitlines()[0].split("|")[2:-1]]
    assert all(f"- {head}: " in text for head in heads)
    assert "geojson" not in found.exports


def test_a_log_needs_no_problem(tmp_path):
    """Also one in space, with settings in space."""
    pytest.importorskip("rosbags", reason="rosbags is not installed (extra ros)")
    path = write.ros2_bag(tmp_path / "bag", write.sailed(20.0))
    config = {"tracker": {**QUICK["tracker"], "prior": {"position": [60.0, -10.0, 0.0], "std": 30.0}}}
    found = replay(path, config, bearing_from="x")
    out = found.save(tmp_path / "out", figures=False)
    text = (out / "config.yaml").read_text(encoding="utf-8")
    assert not re.search(r"^(problem|vehicle|planner|guidance|target):", text, re.MULTILINE)
    again = replay(path, out / "config.yaml")
    np.testing.assert_array_equal(again.tracks[0].mean, found.tracks[0].mean)


def test_exports_that_cannot_be_are_refused_before_the_run(tmp_path, capsys):
    path = write.in_plane(tmp_path / "log.csv", write.sailed(10.0))
    common = ["replay", str(path), "--bearing-from", "x", "--quiet", "--no-figures", "--tracker", "ekf"]
    for arguments, words in (
        (["--export", "gpx"], ["--export: gpx: found positions without a place on the globe", "--origin LAT,LON"]),
        (["--export", "kml"], ["replay.export: found", "csv, geojson, gpx, mcap, page"]),
        (["--origin", "95,10"], ["--origin: found 95.0, 10.0; allowed: latitude from -90 to 90"]),
        (["--origin", "95"], ["found '95'; allowed: LAT,LON in degrees"]),
    ):
        assert cli.main([*common, *arguments]) == 2
        lines = capsys.readouterr().err.strip().splitlines()
        assert len(lines) == 1, lines
        for word in words:
            assert word in lines[0]
    out = tmp_path / "out"
    assert cli.main([*common, "--export", "gpx,page", "--origin", "63.4,10.4", "--out", str(out)]) == 0
    assert {"tracks.gpx", "map.html"} <= {file.name for file in out.iterdir()}
    assert not (out / "ekf.csv").exists()
    assert b"<time>" not in (out / "tracks.gpx").read_bytes()  # t may count from anywhere


def test_measurements_that_a_tracker_does_not_take_are_said(tmp_path):
    log = write.sailed(20.0)
    columns = {"t": log.times, "own_x": log.own[:, 0], "own_y": log.own[:, 1], "bearing_rad": log.azimuth}
    plain = replay(write.table(tmp_path / "plain.csv", columns), {"tracker": {"kind": "oe_cv"}}, bearing_from="x")
    columns["range_m"] = [50.0 if k % 8 == 4 else "" for k in range(len(log.times))]
    path = write.table(tmp_path / "log.csv", columns)
    with pytest.warns(RuntimeWarning, match=r"oe_cv: 10 of 10 measurements of the kind range were left out"):
        found = replay(path, {"tracker": {"kind": "oe_cv"}}, bearing_from="x")
    assert found.summary["measurements"] == {"azimuth": 80, "range": 10}
    assert found.summary["bearings"] == 80
    seen = np.isfinite(found.log.bearings[:, 0])
    np.testing.assert_allclose(found.tracks[0].mean[seen], plain.tracks[0].mean, rtol=1e-9)
    del columns["bearing_rad"]
    ranges = write.table(tmp_path / "ranges.csv", columns)
    with pytest.raises(ConfigurationError, match="oe_cv: 10 of 10 measurements of the kind range were left out"):
        replay(ranges, {"tracker": {"kind": "oe_cv"}})


def test_times_that_no_date_can_have_are_no_dates(tmp_path):
    """A clock of IMC that was never set, or is broken, ends no replay that is finished."""
    pytest.importorskip("imcpy", reason="imcpy is not installed (extra imc)")
    log = write.sailed(10.0)
    for begin, dates in ((0.0, True), (1e12, False), (write.START, True)):
        moved = write.Sailed(**{**vars(log), "times": log.times - log.times[0] + begin})
        found = replay(write.lsf(tmp_path / "log.lsf", moved), QUICK)
        assert found.log.since_epoch == dates
        out = found.save(tmp_path / f"{begin:.0f}", figures=False)
        assert (b"<time>" in (out / "tracks.gpx").read_bytes()) == dates


STAGE = """
const fs = require("fs");
const text = fs.readFileSync(process.argv[2], "utf8");
const take = (pattern) => text.match(pattern)[1];
const calls = { count: 0 };
const pen = new Proxy({}, { get: (_, name) => () => { calls[name] = (calls[name] || 0) + 1; }, set: () => true });
const listeners = {};
function element(id) {
  const made = { id, children: [], style: { setProperty() {} }, value: "0", textContent: "",
    getBoundingClientRect: () => ({ width: 800, height: 400 }), getContext: () => pen,
    addEventListener: (name, act) => { listeners[`${id}.${name}`] = act; },
    append(child) { this.children.push(child); }, replaceChildren(...children) { this.children = children; },
    insertCell() { const cell = element("cell"); this.children.push(cell); return cell; } };
  return made;
}
const elements = { data: { textContent: take(/<script id="data"[^>]*>([^]*?)<\\/script>/) } };
global.document = { getElementById: (id) => (elements[id] = elements[id] || element(id)), createElement: element };
global.window = { devicePixelRatio: 1, addEventListener() {} };
eval(take(/<script>([^]*?)<\\/script>\\s*<\\/body>/));
const read = () => elements.readout.children.map((row) => row.children.map((cell) => cell.textContent));
const end = read();
elements.when.value = "7";
listeners["when.input"]();
listeners["map.wheel"]({ preventDefault() {}, deltaY: 100 });
listeners["map.pointermove"]({ buttons: 1, movementX: 5, movementY: 3 });
listeners["map.dblclick"]();
const legend = elements.legend.children.map((one) => one.textContent);
console.log(JSON.stringify({ end, seventh: read(), legend, calls }));
"""


def test_the_page_needs_no_network_and_draws(globe, tmp_path):
    found, out = globe
    page = (out / "map.html").read_text(encoding="utf-8")
    assert not re.search(r"(src|href)\s*=|https?://|@import|url\(", page)
    assert "{{" not in page
    assert "| ekf" not in page  # tables are tables here
    assert "observable %" in page
    if shutil.which("node") is None:
        pytest.skip("node is not installed")
    stage = tmp_path / "stage.js"
    stage.write_text(STAGE, encoding="utf-8")
    done = subprocess.run(
        ["node", str(stage), str(out / "map.html")], check=True, capture_output=True, text=True, timeout=60
    )
    shown = json.loads(done.stdout)
    assert shown["legend"] == ["own vehicle", "ekf", "loose"]
    track = found.tracks[0]
    for k, rows in ((-1, shown["end"]), (7, shown["seventh"])):
        by_name = {row[0]: row[1] for row in rows[2:]}
        x, y = map(float, by_name["ekf"].removesuffix(" m").split(", "))
        np.testing.assert_allclose([x, y], track.mean[k], atol=0.051)
        assert rows[0][1].startswith("2026-11-")
        assert rows[1][1] == "azimuth by sensor, azimuth"
    assert shown["calls"]["ellipse"] >= 4
    assert shown["calls"]["lineTo"] > len(found.log.times)


def test_a_title_cannot_break_the_page(tmp_path):
    log = write.sailed(10.0)
    path = write.in_plane(tmp_path / "a <b> & {{data}}.csv", log)
    found = replay(path, QUICK, bearing_from="x")
    page = (found.save(tmp_path / "out", figures=False) / "map.html").read_text(encoding="utf-8")
    assert "a &lt;b&gt; &amp; " in page
    assert page.count('"times":') == 1


def test_the_files_are_packaged():
    """The page is made of files beside the modules, and so are the ready mappings."""
    root = Path(__file__).resolve().parents[1] / "gbt_ocp"
    assert {path.name for path in (root / "reporting" / "map_page").iterdir()} == {"map.html", "map.css", "map.js"}
