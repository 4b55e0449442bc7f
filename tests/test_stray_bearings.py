"""Stray bearings within a bin: none of them moves the estimate of a tracker that bins, and none is taken for a turn."""

import numpy as np
import pytest

from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.models.sensors import BearingSensor

KINDS = {
    "gp": {"kind": "gp", "noise": {"std_deg": 1.0, "bin_s": 1.5, "kernel": "velocity_matern32", "window_s": 40.0,
           "range": {"median_m": 40.0}}},
    "motion_gp": {"kind": "motion_gp", "noise": {"std_deg": 1.0}, "bin_s": 1.5, "window_s": 40.0, "update_s": 1.5},
}  # fmt: skip


@pytest.mark.parametrize("kind", [pytest.param("gp", marks=pytest.mark.slow), "motion_gp"])
def test_one_bearing_in_twenty_off_by_twenty_degrees_is_no_harm(kind):
    rng = np.random.default_rng(0)
    times = np.arange(0.0, 50.0, 0.1)
    target = np.array([25.0, 5.0]) + np.outer(times, [0.3, 0.8])
    own = target - 30.0 * np.stack([np.cos(0.12 * times), np.sin(0.12 * times)], axis=-1)
    noise = np.deg2rad(1.0) * rng.standard_normal((len(times), 1))
    stray = np.zeros((len(times), 1))
    stray[7::20] = np.deg2rad(20.0) * rng.choice([-1.0, 1.0], (len(stray[7::20]), 1))
    errors = {}
    for name, turns in (("clean", noise), ("stray", noise + stray)):
        tracker = build_tracker(
            load_config({"problem": "case2", "tracker": KINDS[kind]}).tracker, own[0], BearingSensor(0.1)
        )
        off = []
        for t, bearing, place, truth in zip(times, unit_bearing(target, own), own, target, strict=True):
            tracker.update(float(t), rotate_bearing(bearing, turns[round(t / 0.1)]), place)
            if t > 30.0:
                off.append(np.linalg.norm(tracker.predict([t]).mean[0] - truth))
        errors[name] = np.mean(off)
    assert errors["clean"] < 3.0
    assert errors["stray"] < errors["clean"] + 0.7
