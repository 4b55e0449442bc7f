"""Paths between the samples, and the figure of a run that keeps a range."""

import dataclasses

import numpy as np
import pytest
import synthetic_run

from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.ocp.solvers.base import GIVEN_UP
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.reporting.figures import draw_figures
from gbt_ocp.reporting.smooth_paths import BETWEEN, vehicle_path
from gbt_ocp.reporting.trajectories import ELLIPSES


def followed(dimension):
    """A history whose poses and velocities are those of a flat trajectory of random pieces, and the trajectory."""
    rng = np.random.default_rng(3)
    size = dimension + 1
    vehicle = FossenVehicle(FALCON_2D if dimension == 2 else FALCON_3D, np.full(size, 1e4))
    start, endpoints = rng.normal(size=(2, size)), []
    place, rate = start
    for acceleration in rng.normal(size=(30, size)):
        place, rate = place + 0.1 * rate + 0.005 * acceleration, rate + 0.1 * acceleration
        endpoints.append(place)
    trajectory = FlatTrajectory.from_endpoints(0.1, start, endpoints)
    history = synthetic_run.history(dimension, steps=30)
    pose, velocity = np.empty_like(history.vehicle_pose), np.empty_like(history.vehicle_velocity)
    for k, t in enumerate(history.t):
        state = vehicle.state(trajectory(t), trajectory(t, 1))
        pose[k], velocity[k] = vehicle.pose(state), vehicle.velocity(state)
    return dataclasses.replace(history, vehicle_pose=pose, vehicle_velocity=velocity), trajectory


@pytest.mark.parametrize("dimension", [2, 3])
def test_between_the_samples_the_path_is_the_flat_trajectory(dimension):
    history, trajectory = followed(dimension)
    path = vehicle_path(history)
    times = np.linspace(0.0, history.t[-1], BETWEEN * 30 + 1)
    assert path == pytest.approx(np.array([trajectory(t)[:dimension] for t in times]), abs=1e-9)
    straight = np.stack(
        [np.interp(times, history.t, values) for values in history.vehicle_pose[:, :dimension].T], axis=1
    )
    assert np.abs(path - straight).max() > 1e-4  # which a polygon is not


def test_where_velocities_do_not_fit_the_path_is_straight():
    history, _ = followed(2)
    pose = history.vehicle_pose.copy()
    pose[10:, :2] += [5.0, 0.0]  # put somewhere else
    path = vehicle_path(dataclasses.replace(history, vehicle_pose=pose))
    jump = path[9 * BETWEEN : 10 * BETWEEN + 1]
    assert jump == pytest.approx(np.linspace(pose[9, :2], pose[10, :2], BETWEEN + 1))


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_run_with_a_standoff_has_its_range_what_gave_way_and_energy(dimension):
    history = synthetic_run.history(dimension)
    status = history.solver_status.astype("U20").copy()
    status[[20, 40, 60]] = GIVEN_UP
    history = dataclasses.replace(history, solver_status=status, power=np.full(history.t.shape, 50.0))
    configuration = {
        "sensor": {"period_s": 0.1},
        "vehicle": {"thrust_max": [5000.0] * dimension + [1500.0]},
        "tracker": {"forecast_period_s": 1.0},
        "limits": {"range": {"nearest_m": 0.5}},
    }
    figures = draw_figures(history, configuration, synthetic_run.summary(history))
    range_, errors, power, _ = figures["range"].axes
    lines = {line.get_label(): np.asarray(line.get_ydata()) for line in range_.get_lines()}
    line = history.target - history.vehicle_pose[:, :dimension]
    assert lines["true"] == pytest.approx(np.linalg.norm(line, axis=1))
    assert lines["standoff"] == pytest.approx(0.5)
    (gave,) = (label for label in lines if label.startswith("a limit gave way"))
    assert f"3 of {np.count_nonzero(history.planned)} plans" in gave
    assert [line.get_label() for line in errors.get_lines()] == ["10 s ahead", "now"]
    ahead = errors.get_lines()[0].get_ydata()[5]
    assert ahead == pytest.approx(100.0 * history.error[5, 10] / np.linalg.norm(line[5]))
    assert "energy, to 1.5e+03 J" in [line.get_label() for line in power.get_lines()]  # 50 W for 30 s
    patches = figures["trajectories"].axes[-1].patches
    assert sum(type(patch).__name__ == "Ellipse" for patch in patches) == ELLIPSES
    assert [patch.radius for patch in patches if type(patch).__name__ == "Circle"] == [0.5]
    del configuration["limits"]
    assert "range" not in draw_figures(history, configuration, synthetic_run.summary(history))
