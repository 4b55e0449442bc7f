"""A prior centred on the origin is warned of before a run or a replay that begins far from it."""

import numpy as np
import pytest

import gbt_ocp as gbt
from gbt_ocp.experiments.build.far_priors import FAR, far_priors
from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.check_problem import check_problem
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.replay import replay
from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.models.sensors import BearingSensor

EXACT = BearingSensor(0.1)


def section(*overrides):
    return load_config("case2", list(overrides)).tracker


@pytest.mark.parametrize("start", [(5.0e5, 7.0e6), (-2.0e4, 0.0), (0.0, 6.0e3)])
@pytest.mark.parametrize(
    "overrides", [["preset=paper"], ["tracker.centre=origin"], ["tracker.kind=lmc", "tracker.centre=origin"]]
)
def test_a_centre_at_the_origin_is_one_line_with_the_key_and_the_remedy(start, overrides):
    (line,) = far_priors(section(*overrides), np.array(start), EXACT)
    assert "tracker.centre" in line
    assert "tracker.centre=vehicle" in line


def test_a_prior_position_at_the_origin_is_warned_of():
    prior = "tracker.prior={position: [1.0, 2.0], std: 3.0}"
    (line,) = far_priors(section(prior), np.array([3.0e5, 5.0e6]), EXACT)
    assert "tracker.prior.position" in line
    near = "tracker.prior={position: [300010.0, 5000020.0], std: 3.0}"
    assert far_priors(section(near), np.array([3.0e5, 5.0e6]), EXACT) == []


@pytest.mark.parametrize(
    ("overrides", "start"),
    [
        (["preset=paper"], (100.0, -50.0)),
        ([], (5.0e5, 7.0e6)),
        (["tracker.kind=ekf"], (5.0e5, 7.0e6)),
        (["tracker.kind=motion_gp"], (5.0e5, 7.0e6)),
    ],
)
def test_what_does_no_harm_is_not_warned_of(overrides, start):
    assert far_priors(section(*overrides), np.array(start), EXACT) == []


def error(overrides, away):
    """Median error in metres of a tracker of exact bearings, with vehicle and target so far from the origin."""
    offset = away * np.array([0.6, 0.8])
    tracker, errors = None, []
    for t in 0.1 * np.arange(50):
        own = offset + 3.0 * np.array([np.cos(2.0 * t), np.sin(2.0 * t)])
        target = offset + np.array([0.5 * t, np.sin(0.5 * t)])
        tracker = tracker or build_tracker(section(*overrides), own, EXACT)
        tracker.update(t, unit_bearing(target, own), own)
        if t > 3.0:
            errors.append(np.linalg.norm(tracker.predict([t + 0.1]).mean[0] - target))
    return np.median(errors)


def test_the_distance_is_where_nothing_is_lost_yet():
    assert error(["preset=paper"], FAR) < 0.2
    assert error(["preset=paper"], 200.0 * FAR) > 5.0
    assert error(["tracker.centre=vehicle"], 200.0 * FAR) < 0.2


def test_a_run_is_warned_of_before_it_begins():
    far = "vehicle.start={position_m: [500000.0, 7000000.0]}"
    with pytest.warns(RuntimeWarning, match=r"case2: tracker\.centre: origin"):
        result = gbt.run("case2", overrides=["preset=paper", far, "duration_s=0.2", "planner.solver=ipopt"])
    assert any("tracker.centre" in line for line in result.summary["warnings"])


def test_check_says_it_too():
    far = "vehicle.start={position_m: [500000.0, 7000000.0]}"
    found = check_problem(load_config("case2", ["preset=paper", far, "planner.solver=ipopt"]))
    (line,) = [one for one in found if one.topic == "tracker"]
    assert line.doubtful
    assert "tracker.centre=vehicle" in line.text


def test_a_replay_at_map_coordinates_is_warned_of(tmp_path):
    log = tmp_path / "utm.csv"
    rows = [f"{0.5 * k},{5.0e5 + k},{7.0e6 + 0.1 * k**2},{30.0 - k}" for k in range(20)]
    log.write_text("t,own_x,own_y,bearing_deg\n" + "\n".join(rows) + "\n")
    with pytest.warns(RuntimeWarning, match=r"utm\.csv: gp: tracker\.centre"):
        found = replay(log, "case2", bearing_from="x", overrides=["tracker.centre=origin"])
    assert sum("tracker.centre" in line for line in found.summary["warnings"]) == 1
