"""The files of the tutorial run unchanged, and do what the page says of them."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.result import Result
from gbt_ocp.experiments.run import run

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "tutorial"
FILES = sorted(path.stem for path in FOLDER.glob("*.py"))


def load(name):
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def result_of(name, tmp_path):
    code = cli.main(["run", str(FOLDER / f"{name}.py"), "--quiet", "--no-figures", "--out", str(tmp_path / name)])
    assert code == 0
    result = Result.load(tmp_path / name)
    assert result.summary["solver_success_rate"] > 0.99
    return result


def test_there_is_a_file_for_each_thing_to_change():
    assert FILES == ["new_constraint", "new_driven_vehicle", "new_objective", "new_target", "new_vehicle"]
    page = (FOLDER / "index.md").read_text(encoding="utf-8")
    for name in FILES:
        assert f'--8<-- "{name}.py"' in page


def test_a_new_target(tmp_path):
    survey = load("new_target").Survey()
    times = np.linspace(0.0, 60.0, 6001)
    velocity = np.diff(survey.position(times), axis=0) / np.diff(times)[:, None]
    np.testing.assert_allclose(np.linalg.norm(velocity, axis=1), survey.speed, rtol=1e-3)  # no jumps
    assert result_of("new_target", tmp_path).summary["error_settled"] == pytest.approx(0.016, abs=0.01)


def test_a_new_vehicle(tmp_path):
    drone = load("new_vehicle").DriftingDrone()
    rng = np.random.default_rng(2)
    z, dz, ddz = rng.normal(size=(3, 2))
    # forward and inverse dynamics, written independently, close the circle
    rates = drone.rates(drone.state(z, dz), drone.inputs(z, dz, ddz))
    np.testing.assert_allclose(rates, np.concatenate([dz, ddz]))
    for found, wanted in zip(drone.flat(drone.state(z, dz)), (z, dz), strict=True):
        np.testing.assert_array_equal(found, wanted)
    result = result_of("new_vehicle", tmp_path)
    assert result.summary["error_settled"] == pytest.approx(0.14, abs=0.03)
    assert result.summary["violation_max"] == 0.0
    dynamics = run(FOLDER / "new_vehicle.py", overrides=["vehicle.follow=dynamics", "duration_s=2"])
    # Later the closed loop makes the integrator's rounding larger.
    np.testing.assert_allclose(dynamics.history.vehicle_pose[:9], result.history.vehicle_pose[:9], atol=1e-5)


@pytest.mark.long
def test_a_new_constraint(tmp_path):
    history = result_of("new_constraint", tmp_path).history
    reach = np.linalg.norm(history.vehicle_pose[:, :2], axis=1).max()
    assert 1.9 < reach <= 2.0
    assert np.linalg.norm(history.target, axis=1).max() > 2.9


@pytest.mark.long
def test_a_new_objective(tmp_path):
    cheap = result_of("new_objective", tmp_path)
    plain = run("case2", overrides=["duration_s=20", "planner.formulation=hard", "planner.pieces=10"])

    def acceleration(result):
        position = result.history.vehicle_pose[20:, :2]
        return np.sqrt(np.mean(np.sum((np.diff(position, 2, axis=0) / 0.1**2) ** 2, axis=1)))

    assert acceleration(cheap) < 0.4 * acceleration(plain)
    assert cheap.summary["error_settled"] < 1.2 * plain.summary["error_settled"]
