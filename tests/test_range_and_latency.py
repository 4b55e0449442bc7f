"""What is recorded of the range, and bearings that arrive late."""

from dataclasses import replace

import numpy as np
import pytest

import gbt_ocp as gbt
from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.simulation.loop import simulate
from gbt_ocp.tracking.protocol import Forecast, relative_range_std


class Listener:
    """Writes down what arrives."""

    def __init__(self):
        self.heard = []

    def update(self, time, bearing, own_position):
        self.heard.append((time, np.array(bearing), np.array(own_position)))

    def predict(self, times):
        return Forecast(np.ones((len(times), 2)), np.tile(np.eye(2), (len(times), 1, 1)))


def moving(latency):
    settings = ["guidance.kind=constant_force", "duration_s=2", f"sensor.latency_s={latency}", "sensor.noise_deg=1"]
    loop, start = build_loop(gbt.load_config("case2", settings))
    listener = Listener()
    return simulate(replace(loop, tracker=listener), start, 2.0).arrays, listener


@pytest.mark.parametrize(("latency", "late"), [(0.0, 0), (0.3, 3), (0.25, 3)])
def test_a_late_bearing_comes_with_its_own_time_and_the_position_of_then(latency, late):
    arrays, listener = moving(latency)
    count = len(arrays["t"])
    assert len(listener.heard) == count - late
    for k, (time, bearing, own) in enumerate(listener.heard):
        assert time == pytest.approx(arrays["t"][k])
        assert bearing == pytest.approx(arrays["bearing"][k])
        assert own == pytest.approx(arrays["vehicle_pose"][k, :2])
    # what is measured does not depend on when it arrives
    assert arrays["bearing"] == pytest.approx(moving(0.0)[0]["bearing"])


def test_the_deviation_of_the_range_is_that_of_samples():
    rng = np.random.default_rng(0)
    mean, own = np.array([30.0, 40.0, 5.0]), np.array([2.0, -3.0, 1.0])
    root = 0.3 * rng.standard_normal((3, 3))
    samples = mean + rng.standard_normal((200_000, 3)) @ root.T
    distances = np.linalg.norm(samples - own, axis=1)
    found = relative_range_std(mean, root @ root.T, own)
    assert found == pytest.approx(distances.std() / distances.mean(), rel=0.02)
    assert np.isnan(relative_range_std(mean, np.full((3, 3), np.nan), own))
    assert relative_range_std(own, np.eye(3), own) == np.inf


def test_a_run_records_whether_its_range_is_observable():
    settings = ["tracker.kind=motion_gp", "duration_s=3", "guidance.kind=static", "sensor.noise_deg=1"]
    result = gbt.run(gbt.load_config("case2", settings))
    history, summary = result.history, result.summary
    assert history.range_std_over_range.shape == history.t.shape
    assert not history.range_observable[0]
    assert summary["range_std_over_range_final"] == pytest.approx(history.range_std_over_range[-1])
    # the vehicle lies still: nothing tells the range, and nobody says so
    assert summary["range_observable_from_s"] is None
    tracker = build_loop(gbt.load_config("case2", settings))[0].tracker
    assert not tracker.range_observable
    exact = gbt.run(gbt.load_config("case2", ["duration_s=5", "planner.solver=ipopt", "planner.formulation=hard"]))
    assert 0.0 < exact.summary["range_observable_from_s"] < 5.0
