"""Kinds of trackers: one entry each, in the package and from outside."""

import pickle
import re
import textwrap
from pathlib import Path

import numpy as np
import pytest

import gbt_ocp as gbt
from gbt_ocp.experiments.build.tracker_kinds import TRACKERS, kept_keys
from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.config import catalogue, schema
from gbt_ocp.experiments.config.json_schema import json_schema
from gbt_ocp.experiments.config.tracker import BaselineSection, GaussianProcessSection
from gbt_ocp.models.sensors import BearingSensor

DOCUMENTED = (Path(__file__).resolve().parents[1] / "docs" / "tracker.md").read_text(encoding="utf-8")

PROBLEM = re.findall(r"```python\n(.*?)```", DOCUMENTED, re.DOTALL)[-1] + textwrap.dedent(
    """
    problem = gbt.TrackingProblem("mine", 2, "a tracker of its own", {"kind": "case2"})
    """
)
"""A problem's file with the tracker of docs/tracker.md."""


@pytest.fixture
def problem(tmp_path):
    """A problem's file that registers a kind; the kinds of the package are all there are afterwards."""
    before = dict(TRACKERS)
    path = tmp_path / "mine.py"
    path.write_text(PROBLEM)
    yield path
    TRACKERS.clear()
    TRACKERS.update(before)
    schema.accept_registered()


@pytest.fixture
def file(problem):
    path = problem.with_suffix(".yaml")
    path.write_text("problem: mine.py\nduration_s: 1.0\ntracker: {kind: fixed_range, window: 7, range_m: 3.0}\n")
    return path


def test_a_tracker_from_outside_is_loaded_from_yaml_and_run(file):
    loaded = gbt.load_config(file)
    assert (loaded.tracker.range_m, loaded.tracker.window) == (3.0, 7)
    history = gbt.run(loaded).history
    place = history.vehicle_pose[:, :2] + 3.0 * history.bearing
    np.testing.assert_allclose(history.forecast_mean[:, 0], place, atol=1e-12)
    assert "fixed_range" in str(json_schema())


def test_its_keys_are_checked_and_shared_like_those_of_the_package(file):
    with pytest.raises(gbt.ConfigurationError, match=r"tracker\.range_m: found -1"):
        gbt.load_config(file, ["tracker.range_m=-1"])
    with pytest.raises(gbt.ConfigurationError, match=r"tracker\.range: found an unknown key; did you mean range_m"):
        gbt.load_config(file, ["tracker.range=1"])
    other = gbt.load_config(file, ["tracker.kind=ekf"]).tracker
    assert (other.kind, other.window) == ("ekf", 7)
    with pytest.raises(gbt.ConfigurationError, match="ekf, fixed_range, gp"):
        gbt.load_config(file, ["tracker.kind=nothing"])


def test_it_replays_a_log(file, tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("t,own_x,own_y,bearing_rad\n0,0,0,0\n1,1,0,1.5707963267948966\n")
    track = gbt.replay(log, file, bearing_from="x").tracks[0]
    np.testing.assert_allclose(track.mean, [[3.0, 0.0], [1.0, 3.0]], atol=1e-12)


def test_a_configuration_with_it_is_unpickled_where_it_was_never_registered(file):
    loaded = gbt.load_config(file)
    written, mapping = pickle.dumps(loaded), loaded.to_mapping()
    del TRACKERS["fixed_range"]
    schema.accept_registered()
    catalogue._execute.cache_clear()  # as in a new process
    again = pickle.loads(written)
    assert again.tracker.range_m == 3.0
    assert again.to_mapping() == mapping


def test_kinds_of_the_package_are_not_replaced():
    kind = gbt.TrackerKind(GaussianProcessSection, lambda section, prior, sensor: None, "another")
    with pytest.raises(ValueError, match="'gp', which is a kind of this package"):
        gbt.register_tracker(kind)


def test_a_kind_needs_a_name_and_a_family_of_its_own():
    with pytest.raises(ValueError, match="without a kind"):
        gbt.TrackerKind(gbt.TrackerSection, lambda section, prior, sensor: None, "nameless")
    with pytest.raises(ValueError, match="family: found BaselineSection"):
        gbt.TrackerKind(GaussianProcessSection, lambda section, prior, sensor: None, "odd", BaselineSection)


@pytest.mark.parametrize("kind", TRACKERS)
def test_every_kind_is_built_from_its_section(kind):
    """The registry names the functions that build, which are looked up when they are called."""
    section = gbt.load_config("case2", [f"tracker.kind={kind}"]).tracker
    assert callable(build_tracker(section, np.zeros(2), BearingSensor(0.1)).predict)


def test_kinds_of_a_family_share_its_keys():
    shared = {"window", "forecast", "forecast_period_s", "prior"}
    assert kept_keys(TRACKERS["gp"], TRACKERS["ekf"]) == kept_keys(None, TRACKERS["ekf"]) == shared
    assert kept_keys(TRACKERS["ekf"], TRACKERS["imm_ekf"]) == shared
    assert kept_keys(TRACKERS["lmc"], TRACKERS["gp"]) == shared | {"centre", "length_scale", "nugget", "bound_delta"}
    assert kept_keys(TRACKERS["mixture"], TRACKERS["motion_gp"]) >= shared | {"noise", "speed", "range", "memory"}
    assert "evidence_s" not in kept_keys(TRACKERS["mixture"], TRACKERS["motion_gp"])


@pytest.mark.parametrize(
    "written", [["tracker.noise={std_deg: 1}"], ["sensor.noise_deg=1"], ["sensor.noise_deg=1", "tracker.noise=sensor"]]
)
@pytest.mark.parametrize(
    "line", ["kernel=matern32", "centre=origin", "amplitude=3", "length_scale=2", "nugget=1e-8", "bound_delta=0.1"]
)
def test_keys_without_effect_beside_noise_are_refused(written, line):
    key = line.partition("=")[0]
    with pytest.raises(
        gbt.ConfigurationError, match=rf"^--set: tracker\.{key}: found .* only with tracker\.noise: null"
    ):
        gbt.load_config("case2", [*written, f"tracker.{line}"])
    gbt.load_config("case2", [f"tracker.{line}"])
    gbt.load_config("case2", [*written[:1], "tracker.noise=null", f"tracker.{line}"])


def test_a_written_out_configuration_and_a_preset_are_not_keys_without_effect():
    for changes in (["sensor.noise_deg=1"], ["preset=paper", "tracker.noise={std_deg: 1}"]):
        loaded = gbt.load_config("case2", changes)
        assert gbt.load_config(loaded.to_mapping()) == loaded
