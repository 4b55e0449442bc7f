"""Several sensors side by side: in the configuration, in the simulated world, and into the tracker."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from scipy import stats

import gbt_ocp as gbt
from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.build.sensors import build_sensor
from gbt_ocp.experiments.build.tracker_kinds import ALL, TRACKERS
from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.config.sensor import NOISE_KEYS, SensorKind
from gbt_ocp.experiments.config.sensor_faults import taken_by
from gbt_ocp.models.measurements import MeasurementKind, Mounting
from gbt_ocp.models.sensors import SimulatedSensor
from gbt_ocp.simulation.loop import simulate
from gbt_ocp.simulation.sensing import Sensing
from gbt_ocp.tracking.intake import taken_kinds
from gbt_ocp.tracking.polar import ALL_KINDS, BEARINGS, polar_rows
from gbt_ocp.tracking.protocol import Forecast

SONAR = {"name": "sonar", "kind": "azimuth", "period_s": 0.1, "noise_deg": 3.0}
CAMERA = {"name": "camera", "kind": "azimuth", "period_s": 0.3, "noise_deg": 0.5}
PINGER = {"name": "pinger", "kind": "range", "period_s": 1.0, "noise_m": 0.3}


class Listener:
    """Takes all kinds and writes down what arrives."""

    takes = ALL_KINDS

    def __init__(self):
        self.heard = []

    def take(self, sighting):
        if self.heard and sighting.time < self.heard[-1][1].time:
            raise ValueError("out of order")
        self.heard.append((self.now, sighting))

    def predict(self, times):
        self.now = times[0]
        return Forecast(np.ones((len(times), 2)), np.tile(np.eye(2), (len(times), 1, 1)))


def heard(sensors, duration=3.0, tracker="ekf"):
    settings = ["guidance.kind=constant_force", f"duration_s={duration}", f"tracker.kind={tracker}"]
    loop, start = build_loop(gbt.load_config({"problem": "case2", "sensor": sensors}, settings))
    listener = Listener()
    listener.now = -0.1
    recording = simulate(replace(loop, tracker=listener), start, duration)
    return recording, listener.heard


def test_each_sensor_has_its_own_period_missed_share_and_place():
    sensors = [
        {**SONAR, "missed_probability": 0.4},
        {**CAMERA, "frame": "bow", "mounting": [1.0, 0.5], "heading_std_deg": 2.0},
        PINGER,
    ]
    recording, found = heard(sensors, 12.0)
    arrays = recording.arrays
    by_name = {name: [one for _, one in found if one.sensor == name] for name in ("sonar", "camera", "pinger")}
    assert [one.time for one in by_name["camera"]] == pytest.approx(np.arange(0.0, 12.01, 0.3))
    assert [one.time for one in by_name["pinger"]] == pytest.approx(np.arange(0.0, 12.01, 1.0))
    assert stats.binomtest(len(by_name["sonar"]), 121, 0.6).pvalue > 0.01
    # a bearing from the bow has the heading's deviation in it
    assert by_name["camera"][0].std == pytest.approx([np.deg2rad(np.hypot(0.5, 2.0))])
    for one in by_name["camera"]:
        away = one.position - arrays["vehicle_pose"][round(one.time / 0.1), :2]
        assert np.linalg.norm(away) == pytest.approx(np.hypot(1.0, 0.5))
    assert recording.refused_bearings == 0


def test_what_arrives_waits_for_what_was_measured_before_it():
    """In the order of times: the sonar's bearings wait for the camera's, which take half a second."""
    recording, found = heard([SONAR, {**CAMERA, "latency_s": 0.5}])
    assert recording.refused_bearings == 0
    times = [one.time for _, one in found]
    assert times == sorted(times)
    for asked, one in found:
        # the forecast before it was a period earlier
        assert asked + 0.1 >= one.time + (0.5 if one.sensor == "camera" else 0.0) - 1e-9
    prompt, _ = heard([SONAR, CAMERA])
    np.testing.assert_array_equal(recording.arrays["bearing"], prompt.arrays["bearing"])


def test_all_that_has_arrived_can_be_asked_for_at_once():
    late = SimulatedSensor("late", "range", 1.0, std=0.1, latency=1.5)
    prompt = SimulatedSensor("prompt", "range", 1.0, std=0.1)
    rngs = np.random.default_rng(0).spawn(2)
    sensing = Sensing([late, prompt], 1.0, rngs)
    given = []
    for k in range(5):
        sensing.measure(k, float(k), np.array([10.0, 0.0]), np.zeros(3))
        given.append([(one.sensor, one.time) for one in sensing.arrived(float(k), ordered=False)])
    assert given[1] == [("prompt", 1.0)]
    assert given[3] == [("late", 1.0), ("prompt", 3.0)]


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("frame", ["earth", "bow"])
@pytest.mark.long
def test_noise_is_as_large_as_the_sensor_says(dimension, frame):
    """Residuals from the truth over the stated deviations are standard normal, for every kind."""
    target, pose = np.array([20.0, -9.0, 7.0])[:dimension], np.array([3.0, 1.0, -2.0, 0.7])[[0, 1, 2, 3][:dimension]]
    pose = np.append(pose[:dimension], 0.7)
    for kind in get_args(MeasurementKind):
        if dimension == 2 and "elevation" in kind:
            continue
        noise = {"range": {"std": 0.5}, "position": {"std": 0.3}, "size": {"share": 0.05}}.get(kind, {"std": 0.02})
        mounting = Mounting((1.0, 0.5, 0.2)[:dimension], 0.4)
        sensor = SimulatedSensor("s", kind, 1.0, frame=frame, heading_std=0.03, mounting=mounting, size=3.0, **noise)
        rng = np.random.default_rng(4)
        scaled = []
        for _ in range(500):
            sighting = sensor.sight(0.0, target, pose, rng)
            rows = polar_rows(sighting, target, 1.0, np.log(3.0))
            scaled.append(rows.residuals / rows.stds)
        scaled = np.array(scaled)
        turned = frame == "bow" and kind == "position"  # which has the heading's error, and does not say it
        for column in scaled.T if not turned else scaled.T[-1:]:
            assert abs(column.mean()) < 0.16, kind
            assert column.std() == pytest.approx(1.0, rel=0.12), kind


def test_the_seed_of_one_sensor_does_not_depend_on_the_others():
    alone = [one for _, one in heard([SONAR])[1]]
    beside = [one for _, one in heard([SONAR, PINGER])[1] if one.sensor == "sonar"]
    assert [one.value[0] for one in alone] == [one.value[0] for one in beside]


def test_the_loop_has_the_shortest_period_and_the_largest_noise():
    found = gbt.load_config({"sensor": [CAMERA, {**SONAR, "period_s": 0.15}]}, ["tracker.kind=ekf"])
    assert (found.period_s, found.bearing_noise_deg) == (0.15, 3.0)
    again = gbt.load_config(found.to_mapping())
    assert again == found
    one = gbt.load_config("case2", ["sensor.noise_deg=2", "sensor.period_s=0.2"])
    assert (one.period_s, one.bearing_noise_deg) == (0.2, 2.0)
    changed = gbt.load_config(found.to_mapping(), ["sensor.1.noise_deg=4", "sensor.0.kind=azimuth"])
    assert (changed.sensor[1].noise_deg, changed.sensor[0]) == (4.0, found.sensor[0])


@pytest.mark.parametrize(
    ("sensors", "line"),
    [
        ([SONAR, {**CAMERA, "name": "sonar"}], r'sensor\.1\.name: found "sonar"; allowed: a name that no other'),
        ([SONAR, {**CAMERA, "period_s": 0.25}], r"sensor\.1\.period_s: found 0.25; allowed: a whole multiple"),
        ([{**SONAR, "noise_m": 1.0}], r"sensor\.0: found noise_deg and noise_m; allowed: one of noise_deg"),
        ([{"name": "a", "kind": "range"}], r"sensor\.0: found no noise; allowed: one of noise_m, noise_share"),
        ([{**SONAR, "kind": "elevation"}], r'sensor\.0\.kind: found "elevation"; allowed: .* in 2 dimensions'),
        ([{**SONAR, "noise_deg": 0.0}], r"sensor\.0\.noise_deg: found 0.0; allowed: null, or a number > 0"),
        ([{**SONAR, "nois_deg": 0.0}], r"sensor\.0\.nois_deg: found an unknown key; did you mean noise_deg"),
        ([{**SONAR, "mounting": [1.0]}], r"sensor\.0\.mounting: found \[1.0\]; allowed: null, or 2 numbers"),
        ([{**SONAR, "kind": "sonar"}], r'sensor\.0\.kind: found "sonar"; allowed: azimuth, azimuth_elevation'),
        ([], r"sensor: found \[\]; allowed: a mapping with the keys period_s, .* or a list"),
        (3, r"sensor: found 3; allowed: a mapping with the keys period_s, .* or a list"),
    ],
)
def test_a_wrong_list_is_refused_in_one_line(sensors, line):
    with pytest.raises(gbt.ConfigurationError, match=line) as fault:
        gbt.load_config({"problem": "case2", "sensor": sensors, "tracker": {"kind": "ekf"}})
    assert len(fault.value.faults) == 1


@pytest.mark.parametrize(
    ("tracker", "sensor", "line"),
    [
        ({"kind": "plkf"}, PINGER, "azimuth, azimuth_elevation, which tracker.kind: plkf takes"),
        ({"kind": "imm_kf_f"}, SONAR, "position, which tracker.kind: imm_kf_f takes"),
        ({"kind": "ekf"}, {"name": "a", "kind": "size", "noise_share": 0.1}, "for kind size with tracker.size"),
        ({"kind": "gp"}, PINGER, "azimuth, azimuth_elevation, which tracker.kind: gp takes"),
    ],
)
def test_what_a_tracker_does_not_take_is_refused_by_name(tracker, sensor, line):
    with pytest.raises(gbt.ConfigurationError, match=line):
        gbt.load_config({"problem": "case2", "sensor": [sensor], "tracker": tracker})


@pytest.mark.parametrize("name", TRACKERS)
def test_what_the_registry_says_of_a_kind_is_what_the_tracker_takes(name):
    for size in (None, [2.0, 0.3]):
        tracker = {"kind": name}
        if size is not None:
            if "size" not in TRACKERS[name].section.model_fields:
                continue
            tracker["size"] = size
        for sensor in ({"noise_deg": 0.0}, {"noise_deg": 1.0}):
            found = gbt.load_config({"problem": "case2", "sensor": sensor, "tracker": tracker})
            built = build_tracker(found.tracker, np.zeros(2), build_sensor(found))
            assert taken_kinds(built) == taken_by(found.to_mapping())


def test_kinds_have_the_same_names_everywhere():
    assert get_args(SensorKind) == get_args(MeasurementKind) == tuple(NOISE_KEYS) == ALL == ALL_KINDS
    assert ALL_KINDS[:2] == BEARINGS


@pytest.mark.parametrize("kind", ["ekf", "imm_ekf"])
@pytest.mark.long
def test_pings_make_a_run_better(kind):
    errors = []
    for sensors in ([SONAR], [SONAR, PINGER]):
        tracker = {"kind": kind, "bearing_std_deg": 3.0, "initial_range_m": 10.0, "initial_range_std_m": 10.0}
        settings = ["guidance.kind=static", "vehicle.start.range_m=20", "duration_s=15"]
        configuration = gbt.load_config({"problem": "case2", "sensor": sensors, "tracker": tracker}, settings)
        result = gbt.run(configuration)
        errors.append(result.summary["error_settled"])
    assert errors[1] < 0.6 * errors[0]


def test_a_sensor_whose_noise_is_known_is_no_reason_for_a_warning():
    """The tracker's own noise is 0.1°, that of the listed sensor 8°; as the only `sensor` it is warned of."""
    settings = ["duration_s=6", "guidance.kind=static", "tracker.kind=ekf", "tracker.bearing_std_deg=0.1"]
    for sensor, warned in (([{**SONAR, "noise_deg": 8.0}], False), ({"noise_deg": 8.0}, True)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            result = gbt.run(gbt.load_config({"problem": "case2", "sensor": sensor}, settings))
        assert any("a quarter of the bearings" in line for line in result.summary["warnings"]) is warned
