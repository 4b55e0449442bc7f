import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import gbt_ocp as gbt
from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.result import Result
from gbt_ocp.models.targets import TrackTarget

ROOT = Path(__file__).parents[1]
TRACKS = ROOT.parent / "shared" / "data" / "tracks"
BOATS = sorted(TRACKS.glob("boat_*.csv")) + sorted(TRACKS.glob("ais_*.csv"))
NO_TRACKS = pytest.param(None, marks=pytest.mark.skip(reason="no folder shared beside the checkout"))

OWN = '''
import casadi as ca
import numpy as np

from gbt_ocp.experiments.config.tracking_problem import TrackingProblem
from gbt_ocp.guidance.objectives import BearingSimilarity
from gbt_ocp.models.vehicles import PlanarPointMass, Unicycle


class Line:
    dimension = 2

    def position(self, times):
        t = np.asarray(times, dtype=float)
        return np.stack([2.0 + 0.3 * t, 1.0 - 0.1 * t], axis=-1)


class Pursuit:
    """Own objective: minus the squared distance to the forecast."""

    shapes = {"mean": (2, 1)}

    def value(self, point, parameters):
        return -ca.sumsqr(parameters["mean"] - point.z[:2])

    def bind(self, pieces, data):
        return {"mean": np.asarray(data["forecast"].mean[:pieces])[..., None]}


class Overloaded(PlanarPointMass):
    """Held by a spring so stiff that no piece of its length keeps the second input within its limit."""

    def inputs(self, z, dz, ddz):
        return ca.vertcat(ddz[0], ddz[1] + 1e4 * (z[1] - 100.0))


class Volume(Line):
    dimension = 3


problem = TrackingProblem("own", DIMENSION, "own", TARGET, vehicle=VEHICLE, objective=OBJECTIVE)
'''


def own_problem(folder, vehicle=None, objective=None, target="Line", dimension=2):
    """A configuration beside a problem file of the user's own."""
    text = OWN.replace("DIMENSION", str(dimension)).replace("TARGET", target)
    text = text.replace("VEHICLE", f"lambda: {vehicle}" if vehicle else "None").replace("OBJECTIVE", str(objective))
    (folder / "own.py").write_text(text, encoding="utf-8")
    path = folder / "own.yaml"
    path.write_text("problem: own.py\nduration_s: 2.0\nplanner: {formulation: hard, solver: ipopt}\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("vehicle", ["PlanarPointMass(2.0, 0.5, (8.0, 8.0))", "Unicycle((4.0, 4.0))"])
@pytest.mark.parametrize("override", ["vehicle.follow=exact", "vehicle.follow=dynamics", "guidance.kind=random"])
@pytest.mark.long
def test_a_problem_of_the_users_own_runs_to_its_figures(tmp_path, vehicle, override):
    result = gbt.run(own_problem(tmp_path, vehicle), overrides=[override])
    result.save(tmp_path / "out")
    history = Result.load(tmp_path / "out").history
    np.testing.assert_allclose(history.target, np.stack([2.0 + 0.3 * history.t, 1.0 - 0.1 * history.t], axis=-1))
    # Poses have a yaw whether or not the flat output has one; thrust has the axes of the vehicle.
    assert history.vehicle_pose.shape == (21, 3)
    assert history.plan.shape == (21, 0 if "random" in override else 5, 3)
    assert history.thrust.shape == (21, 2)
    assert np.all(np.isfinite(history.vehicle_pose))
    assert history.piece_thrust_peak.max() <= 1.0
    assert len(list((tmp_path / "out" / "figures").glob("*.png"))) == 6


def test_an_objective_of_the_users_own_is_what_is_pursued(tmp_path):
    path = own_problem(tmp_path, objective="Pursuit")
    overrides = ["planner.range_pull=0", "duration_s=1.5", "vehicle.start.position_m=[0, 1]"]
    # Who heads straight for a target does not see its range: it must be known.
    overrides.append("tracker.prior={position: [2, 1], std: 0.01}")
    history = gbt.run(path, overrides=overrides).history
    distance = np.linalg.norm(history.vehicle_pose[:, :2] - history.target, axis=1)
    assert distance[0] == pytest.approx(2.0)
    assert distance[-1] < 0.5


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"dimension": 3}, r"own: Line.dimension: found 2; allowed: 3, the problem's"),
        ({"target": "Volume"}, r"own: Volume.dimension: found 3; allowed: 2, the problem's"),
        (
            {"dimension": 3, "target": '{"kind": "case4"}', "vehicle": "PlanarPointMass()"},
            r"own: PlanarPointMass.position_dimension: found 2; allowed: 3, the problem's",
        ),
    ],
)
def test_parts_that_do_not_fit_the_problem_are_refused(tmp_path, wrong, says):
    with pytest.raises(gbt.ConfigurationError, match=says):
        gbt.run(own_problem(tmp_path, **wrong))


def test_a_force_for_another_vehicle_is_refused(tmp_path):
    path = own_problem(tmp_path, "PlanarPointMass()")
    with pytest.raises(gbt.ConfigurationError, match=r"guidance\.force: found \[1\.0, 2\.0, 3\.0\]; allowed: 2"):
        gbt.run(path, overrides=["guidance={kind: constant_force, force: [1, 2, 3]}"])


def command(*arguments):
    return [sys.executable, "-m", "gbt_ocp.cli", *map(str, arguments)]


def called(*arguments, **options):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(command(*arguments), env=environment, capture_output=True, text=True, **options)


IPOPT = ("--set", "planner.solver=ipopt", "planner.formulation=hard")


@pytest.mark.long
def test_command_line_from_end_to_end(tmp_path):
    out = tmp_path / "out"
    done = called("run", "case2", "--set", "duration_s=0.5", *IPOPT, "--out", out)
    assert done.returncode == 0, done.stderr
    names = {"trajectories", "error", "condition_number", "hyperparameters", "thrust", "solver_time"}
    assert {path.name for path in (out / "figures").iterdir()} == {f"{name}.png" for name in names}
    assert sorted(path.name for path in out.iterdir()) == ["config.yaml", "figures", "history.npz", "summary.json"]

    summary = json.loads((out / "summary.json").read_text())
    with np.load(out / "history.npz") as arrays:
        history = dict(arrays)
    assert summary["steps"] == 5 == len(history["t"]) - 1
    error = np.linalg.norm(history["forecast_mean"][:, 0] - history["target"], axis=1)
    np.testing.assert_allclose(history["error"][:, 0], error, rtol=1e-12)
    assert summary["error_mean"] == pytest.approx(history["error"].mean())
    assert summary["error_final"] == pytest.approx(history["error"][-1].mean())
    assert summary["error_settled"] is None  # the run ends before it settles
    distance = np.linalg.norm(history["vehicle_pose"][:, :2] - history["target"], axis=1)
    assert summary["distance_min"] == pytest.approx(distance.min())
    assert summary["violation_max"] == max(0.0, history["piece_thrust_peak"].max() - 1.0) == 0.0
    assert summary["solver_success_rate"] == np.mean(history["solver_status"] == "solved")
    assert summary["thrust_max"] == [5000.0, 5000.0, 1500.0]

    # The written configuration runs again to the same numbers.
    again = ["run", str(out / "config.yaml"), "--out", str(tmp_path / "again"), "--no-figures", "--quiet"]
    assert cli.main(again) == 0
    with np.load(tmp_path / "again" / "history.npz") as arrays:
        for name in set(history) - {"solver_time", "tracker_time"}:
            np.testing.assert_array_equal(arrays[name], history[name])


@pytest.mark.slow
def test_limits_that_cannot_be_kept_are_exit_3_and_the_folder_is_kept(tmp_path):
    path = own_problem(tmp_path, "Overloaded(1.0, 0.0, (1.0, 1.0))")
    done = called("run", path, "--set", "duration_s=0.3", "--out", tmp_path / "out", "--quiet", "--no-figures")
    assert done.returncode == 3, done.stderr
    assert done.stderr == "the thrust limits were kept only by clipping, in 4 steps\n"
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["violation_max"] == 0.0  # what was applied
    assert summary["retries"]["clipped"] == 4
    assert summary["solver_success_rate"] == 0.0
    assert summary["fallbacks"]["braking"] == 4


def stopped(tmp_path, number):
    """A run that is sent a signal a second after its first step; its exit code and what it wrote on standard error."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    arguments = command("run", "case2", "--set", "duration_s=300", *IPOPT, "--out", tmp_path / "out")
    process = subprocess.Popen(arguments, env=environment, stderr=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        text = b""
        while b"error" not in text:
            piece = os.read(process.stderr.fileno(), 4096)
            assert piece, text
            text += piece
        time.sleep(1.0)
        process.send_signal(number)
        out, rest = process.communicate(timeout=60)
        return process.returncode, (text + rest).decode(), out.decode()
    finally:
        process.kill()
        process.wait()


@pytest.mark.long
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_killed_run_leaves_nothing(tmp_path):
    code, _, out = stopped(tmp_path, signal.SIGKILL)
    assert code == -signal.SIGKILL
    assert out == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.long
def test_an_interrupted_run_is_exit_4_and_leaves_nothing(tmp_path):
    code, errors, out = stopped(tmp_path, signal.SIGINT)
    assert code == 4, errors
    assert errors.rstrip().endswith("interrupted: nothing was written")
    assert "Traceback" not in errors
    assert out == ""
    assert list(tmp_path.iterdir()) == []


KILLED_WHILE_WRITING = """
import os, signal, sys
import gbt_ocp.reporting.figures as figures
figures.write_figures = lambda folder: os.kill(os.getpid(), signal.SIGKILL)
from gbt_ocp.cli.main import main
main(sys.argv[1:])
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.long
def test_a_run_killed_while_it_writes_leaves_no_folder_and_the_next_one_cleans_up(tmp_path):
    arguments = ["run", "case1", "--quiet", "--out", str(tmp_path / "out"), "--set", "duration_s=0.3", *IPOPT[1:]]
    killed = subprocess.run([sys.executable, "-c", KILLED_WHILE_WRITING, *arguments], cwd=ROOT, check=False)
    assert killed.returncode == -signal.SIGKILL
    assert not (tmp_path / "out").exists()
    assert len(list(tmp_path.glob(".out.partial-*"))) == 1
    assert cli.main([*arguments, "--no-figures"]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_the_example_track_is_what_its_script_makes(tmp_path):
    spec = importlib.util.spec_from_file_location("make_recorded_track", ROOT / "scripts" / "make_recorded_track.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.main(tmp_path / "track.csv")
    shipped, made = ROOT / "problems" / "recorded_track.csv", tmp_path / "track.csv"
    assert shipped.read_text().startswith("t,x,y\n0.0,0.0000,0.0000\n")
    rows = np.loadtxt(shipped, delimiter=",", skiprows=1)
    # another processor's last bit may round the other way
    np.testing.assert_allclose(rows, np.loadtxt(made, delimiter=",", skiprows=1), atol=1.01e-4)
    np.testing.assert_allclose(np.diff(rows[:, 0]), 0.5)
    track = TrackTarget.from_csv(shipped, 2)
    assert track.duration >= 60.0
    velocity = np.gradient(track.position(np.arange(0.0, track.duration, 0.05)), 0.05, axis=0)
    speed = np.linalg.norm(velocity, axis=1)
    assert 1.0 <= speed.min() < 1.2
    assert 1.8 < speed.max() <= 2.0
    turn = np.gradient(np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0])), 0.05)
    assert turn.max() > 0.2
    assert turn.min() < -0.2


@pytest.mark.slow
def test_the_example_track_is_followed():
    summary = gbt.run(
        "recorded", overrides=["duration_s=8", "planner.formulation=hard", "planner.solver=ipopt"]
    ).summary
    assert summary["error_settled"] < 0.05
    assert summary["violation_max"] == 0.0


def followed(path, seconds, seed):
    """Summary of a run after a boat, its length scaled so that it never moves faster than 1.5 m/s."""
    t, *position = np.loadtxt(path, delimiter=",", skiprows=1, usecols=(0, 1, 2)).T
    speed = np.linalg.norm(np.diff(np.transpose(position), axis=0), axis=1) / np.diff(t)
    overrides = [
        f"target.path={path}",
        f"target.length_scale={min(1.0, 1.5 / float(speed.max())):.6f}",
        f"duration_s={seconds}",
        "planner.formulation=hard",
        "planner.solver=ipopt",
    ]
    return gbt.run(gbt.load_config("recorded", overrides=overrides, seed=seed)).summary


@pytest.mark.parametrize("path", [BOATS[0]] if BOATS else [NO_TRACKS], ids=lambda path: getattr(path, "stem", None))
def test_a_boat_is_followed(path):
    assert followed(path, 5.0, seed=0)["error_settled"] < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("path", BOATS or [NO_TRACKS], ids=lambda path: getattr(path, "stem", None))
def test_every_boat_is_followed_for_half_a_minute(path, seed):
    summary = followed(path, 30.0, seed)
    assert summary["error_settled"] < 0.05
    assert summary["violation_max"] == 0.0


@pytest.mark.parametrize(("law", "solver", "recorded"), [("planner", "ipopt", "ipopt"), ("static", "auto", None)])
def test_the_summary_says_which_solver_ran(law, solver, recorded):
    overrides = ["duration_s=0.3", f"guidance.kind={law}", f"planner.solver={solver}"]
    assert gbt.run("case2", overrides=overrides).summary["solver"] == recorded
