"""The public scenarios: what their sources say of them, the laws of motion, the particles, and other packages."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import least_squares

from gbt_ocp.cli.main import main
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.models.turning import TurningTarget
from gbt_ocp.studies.scenarios import bearing_angle, naval
from gbt_ocp.studies.scenarios.at_sea import log_scenarios
from gbt_ocp.studies.scenarios.benchmark import PUBLIC, TRIALS, benchmark
from gbt_ocp.studies.scenarios.contestants import CONTESTANTS
from gbt_ocp.studies.scenarios.motion_laws import HeldTurnLaw, SteadyLaw
from gbt_ocp.studies.scenarios.opponents import turning
from gbt_ocp.studies.scenarios.trial import trial
from gbt_ocp.tracking.intake import take_in

QUICKLY = ("ning_4c", "ristic_manoeuvring", "leong_difficult")
"""Scenarios that every test run tries; the others are slow tests."""

LOGS = Path(__file__).resolve().parents[2] / "shared" / "data" / "bearings"


def cut(recording, count=700):
    """The first measurements of a recording."""
    names = ("times", "own", "target", "ahead", "sightings")
    return replace(recording, **{name: getattr(recording, name)[:count] for name in names})


# ---- what the sources say -------------------------------------------------------------------------------------------


def test_the_paths_of_bearing_and_angle_are_those_of_the_published_runs():
    """Positions and sizes that the authors' programs recorded (data_Fig5a.mat, data_Fig5b.mat)."""
    own, target = bearing_angle.round_the_target(500)
    np.testing.assert_allclose(own[100], [-4.66019543, 8.18821123], atol=1e-8)
    sizes = bearing_angle.turning_square(own, target, 1.5 * np.pi)
    np.testing.assert_allclose(sizes[[0, 10, 100, 300]], [0.70710678, 0.9618584, 0.91527678, 0.94701316], atol=1e-8)
    own, target = bearing_angle.to_and_fro(600, 10.5)
    np.testing.assert_allclose(own[100], [0.0, 9.04], atol=1e-12)
    assert bearing_angle.turning_square(own, target, np.pi / 8.0)[10] == pytest.approx(0.76040597, abs=1e-8)


def test_proportional_navigation_turns_as_fast_as_the_line_of_sight():
    own, target = bearing_angle.in_pursuit(175)
    line, step = target - own, np.diff(own, axis=0)
    sight = np.unwrap(np.arctan2(line[:, 1], line[:, 0]))
    course = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    np.testing.assert_allclose(np.linalg.norm(step, axis=1), 5.0 * bearing_angle.STEP)
    np.testing.assert_allclose(np.diff(course), np.diff(sight)[:-1], atol=1e-12)


def test_ships_go_where_an_integration_of_their_courses_leads():
    def velocity(t, _):
        course = np.deg2rad(np.interp(t / 60.0, [0.0, 13.0, 17.0, 60.0], [140.0, 140.0, 20.0, 20.0]))
        return 5.0 * 1852.0 / 3600.0 * np.array([np.sin(course), np.cos(course)])

    found = naval.RISTIC_OWN(np.array([0.0, 780.0, 900.0, 1800.0]))
    exact = solve_ivp(velocity, (0.0, 1800.0), [0.0, 0.0], t_eval=[0.0, 780.0, 900.0, 1800.0], max_step=5.0, rtol=1e-9)
    np.testing.assert_allclose(found, exact.y.T, atol=0.02)


def test_the_ranges_of_the_naval_scenarios_are_the_published_ones():
    moderate, manoeuvring = (PUBLIC[name].record(0) for name in ("ristic_moderate", "ristic_manoeuvring"))
    difficult = PUBLIC["leong_difficult"].record(0)
    line = moderate.target - moderate.own
    assert np.linalg.norm(line[0]) == pytest.approx(5000.0)
    assert np.rad2deg(np.arctan2(*line[0])) == pytest.approx(80.0)
    assert np.linalg.norm(manoeuvring.target[-1] - manoeuvring.own[-1]) == pytest.approx(2910.0, abs=5.0)
    assert np.linalg.norm(difficult.target[0] - difficult.own[0]) == pytest.approx(10_000.0, abs=10.0)
    assert len(moderate.times) == 31
    assert len(manoeuvring.times) == 41


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in QUICKLY else pytest.mark.slow) for name in PUBLIC]
)
def test_a_run_is_the_same_each_time_and_its_bearings_have_the_noise(name):
    scenario = PUBLIC[name]
    first, again, other = (cut(scenario.record(run)) for run in (0, 0, 1))
    for one, two in ((first.target, again.target), (first.own, again.own)):
        np.testing.assert_array_equal(one, two)
    seen = [one for at in first.sightings for one in at if one.kind != "size"]
    same = [one for at in again.sightings for one in at if one.kind != "size"]
    differing = [one for at in other.sightings for one in at if one.kind != "size"]
    assert all(np.array_equal(a.value, b.value) for a, b in zip(seen, same, strict=True))
    assert not np.array_equal(seen[3].value, differing[3].value)
    places = {float(t): k for k, t in enumerate(first.times)}
    angles = []
    for one in seen:
        line = first.target[places[one.time]] - one.position
        angles.append(np.arccos(np.clip(one.bearing @ line / np.linalg.norm(line), -1.0, 1.0)))
    ratio = np.sqrt(np.mean(np.square(angles)) / (scenario.dimension - 1)) / first.knowledge.bearing_std
    assert ratio == pytest.approx(1.0, abs=max(0.25, 3.0 / np.sqrt(2.0 * len(seen))))


# ---- laws of motion and particles -----------------------------------------------------------------------------------


def test_white_noise_of_the_acceleration_has_its_covariance():
    law, duration = SteadyLaw(0.0, 0.0, density=2.0), 3.0
    found = law.moved(np.zeros((100_000, 4)), duration, np.random.default_rng(0))
    exact = 2.0 * np.array([[duration**3 / 3.0, duration**2 / 2.0], [duration**2 / 2.0, duration]])
    np.testing.assert_allclose(np.cov(found[:, [0, 2]].T), exact, rtol=0.03)


@pytest.mark.parametrize(("dimension", "varies"), [(2, 0.0), (3, 0.2)])
def test_particles_move_like_the_targets_at_sea(dimension, varies):
    """Mean squares of the way gone after 40 s, of 150 targets and of particles."""
    squares = []
    for seed in range(150):
        rng = np.random.default_rng(seed)
        target = TurningTarget(dimension, rng, duration=40.0, start=np.zeros(dimension), speed_std=varies)
        squares.append(target.position(40.0) ** 2)
    rng = np.random.default_rng(0)
    law = HeldTurnLaw(1.0, 0.0, 0.05, (20.0, 40.0), speed_change=varies)
    states = law.begun(np.zeros((2000, dimension)), np.ones((2000, dimension)), rng)
    for _ in range(40):
        states = law.moved(states, 1.0, rng)
    level, theirs = states[:, :2] ** 2, np.array(squares)
    deviation = theirs[:, :2].sum(axis=1).std() / np.sqrt(len(theirs))
    assert level.sum(axis=1).mean() == pytest.approx(theirs[:, :2].sum(axis=1).mean(), abs=4.0 * deviation)
    if dimension == 3:
        deviation = theirs[:, 2].std() / np.sqrt(len(theirs))
        assert (states[:, 2] ** 2).mean() == pytest.approx(theirs[:, 2].mean(), abs=4.0 * deviation)


def test_a_held_turn_is_a_circle():
    law = HeldTurnLaw(2.0, 0.0, 0.05, (1e6, 2e6))
    start = np.array([[1.0, 2.0, 0.3, np.log(2.0), 0.04, 1e6]])
    (found,) = law.moved(start, 25.0, np.random.default_rng(0))
    radius = 2.0 / 0.04
    exact = [1.0 + radius * (np.sin(1.3) - np.sin(0.3)), 2.0 - radius * (np.cos(1.3) - np.cos(0.3))]
    np.testing.assert_allclose(found[:3], [*exact, 1.3], rtol=1e-12)


def mode_and_covariance(scenario, recording):
    """The largest posterior density of position and velocity at the start, and Laplace's covariance of the last."""
    law, times, own = scenario.law, recording.times, recording.own
    angles = np.unwrap([at[0].value[0] for at in recording.sightings])
    known = recording.knowledge
    share = np.sqrt(np.log1p((known.range_std / known.range) ** 2))

    def residuals(state):
        places = state[:2] + times[:, None] * state[2:]
        seen = np.unwrap(np.arctan2(*(places - own).T[::-1]))
        off = np.mod(seen - angles + np.pi, 2.0 * np.pi) - np.pi
        far, speed = np.linalg.norm(state[:2] - own[0]), np.linalg.norm(state[2:])
        course = np.arctan2(-state[3], -state[2]) - np.arctan2(*(state[:2] - own[0])[::-1])
        course = np.mod(course + np.pi, 2.0 * np.pi) - np.pi
        prior = [np.log(far / known.range) / share, (speed - law.speed) / law.speed_std, course / law.course_std]
        return np.append(off / known.bearing_std, prior)

    first = np.concatenate([recording.target[0], (recording.target[1] - recording.target[0]) / times[1]])
    scale = np.array([1e3, 1e3, 1.0, 1.0])
    found = least_squares(residuals, first, x_scale=scale)
    last = np.hstack([np.eye(2), times[-1] * np.eye(2)])
    return last @ found.x, last @ np.linalg.inv(found.jac.T @ found.jac) @ last.T


def test_particles_have_the_posterior_of_a_batch_estimate():
    """Half an hour of Ristic's scenario: mean within a third of a deviation, deviations within a sixth."""
    scenario = PUBLIC["ristic_moderate"]
    recording = scenario.record(3)
    tracker = CONTESTANTS["particles_exact"].make(scenario, recording, 3)
    for at in recording.sightings:
        take_in(tracker, at[0])
    said = tracker.predict([recording.times[-1]])
    mean, covariance = mode_and_covariance(scenario, recording)
    whitened = np.linalg.solve(np.linalg.cholesky(covariance), said.mean[0] - mean)
    assert np.abs(whitened).max() < 1.0 / 3.0
    ratio = np.sqrt(np.linalg.eigvalsh(np.linalg.solve(covariance, said.covariance[0])))
    assert np.abs(np.log(ratio)).max() < np.log(7.0 / 6.0)


@pytest.mark.slow
def test_the_exact_law_reaches_the_bound_of_ristics_scenario():
    """Root mean square error at 30 min over 60 runs, against the bound from the Fisher information and the prior."""
    scenario, errors, bounds = PUBLIC["ristic_moderate"], [], []
    for run in range(60):
        recording = scenario.record(run)
        tracker = CONTESTANTS["particles_exact"].make(scenario, recording, run)
        for at in recording.sightings:
            take_in(tracker, at[0])
        errors.append(np.sum((tracker.predict([recording.times[-1]]).mean[0] - recording.target[-1]) ** 2))
        bounds.append(np.trace(mode_and_covariance(scenario, recording)[1]))
    ratio = np.sqrt(np.mean(errors) / np.mean(bounds))
    print(f"error over bound {ratio:.2f}, bound {np.sqrt(np.mean(bounds)):.0f} m")
    assert 0.8 < ratio < 1.25


# ---- other packages -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("rate", [0.0, 0.3])
def test_turns_of_the_interacting_models_are_those_of_their_differential_equation(dimension, rate):
    drift = np.zeros((2 * dimension, 2 * dimension))
    drift[range(0, 2 * dimension, 2), range(1, 2 * dimension, 2)] = 1.0
    drift[1, 3], drift[3, 1] = -rate, rate
    np.testing.assert_allclose(turning(2.5, rate, dimension, 0.1)[0], expm(2.5 * drift), atol=1e-12)


@pytest.mark.parametrize("name", ["ristic_moderate", "ning_4c"])
def test_extended_filters_of_two_packages_agree(name):
    """Ours without sizes, and Stone Soup's, from the same guess: the same estimates."""
    pytest.importorskip("stonesoup", reason="Stone Soup comes with the extra bench")
    scenario = PUBLIC[name]
    recording = scenario.record(0)
    ours, theirs = (CONTESTANTS[one].make(scenario, recording, 0) for one in ("ekf", "stonesoup_ekf"))
    for at in recording.sightings:
        for sighting in at[:1]:
            ours.update(sighting.time, sighting.bearing, sighting.position)
            theirs.update(sighting.time, sighting.bearing, sighting.position)
    end = [recording.times[-1], recording.times[-1] + scenario.ahead]
    found, expected = ours.predict(end), theirs.predict(end)
    deviation = np.sqrt(np.trace(expected.covariance[0]))
    np.testing.assert_allclose(found.mean, expected.mean, atol=0.02 * deviation)
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=0.02, atol=0.01 * deviation**2)


@pytest.mark.parametrize("name", ["ristic_moderate", "sea3d"])
def test_interacting_models_that_do_not_turn_are_an_extended_filter(name):
    """FilterPy's with a turn rate of zero, and our extended filter, from the same guess."""
    pytest.importorskip("filterpy", reason="FilterPy comes with the extra bench")
    scenario = PUBLIC[name]
    recording = scenario.record(0)
    recording = replace(recording, knowledge=replace(recording.knowledge, turn_rate=0.0))
    ours, theirs = (CONTESTANTS[one].make(scenario, recording, 0) for one in ("ekf", "filterpy_imm"))
    seen = [one for at in recording.sightings[:300] for one in at]
    for one in seen:
        ours.update(one.time, one.bearing, one.position)
        theirs.update(one.time, one.bearing, one.position)
    end = [seen[-1].time, seen[-1].time + scenario.ahead]
    found, expected = ours.predict(end), theirs.predict(end)
    np.testing.assert_allclose(found.mean, expected.mean, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-5, atol=1e-8)


# ---- the benchmark --------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_benchmark_is_measured_reported_and_resumed(tmp_path):
    chosen = {"scenarios": ["ristic_moderate", "ning_5b"], "trackers": ["ekf", "particles_exact"], "runs": 2}
    done = benchmark(**chosen, out=tmp_path / "one", jobs=1)
    pairs = [(row["scenario"], row["tracker"], row["runs"]) for row in done.rows]
    # nothing is known of the law of a square that turns
    assert pairs == [("ristic_moderate", "ekf", 2), ("ristic_moderate", "particles_exact", 2), ("ning_5b", "ekf", 2)]
    found = json.loads((done.folder / "benchmark.json").read_text())
    assert {"command", "commit", "date", "versions", "rows", "scenarios", "notes"} <= set(found)
    assert found["scenarios"][0]["seeds"] == [0, 1]
    assert found["rows"] == done.rows
    assert len((done.folder / "benchmark.csv").read_text().splitlines()) == 4
    report = (done.folder / "report.md").read_text()
    assert "## ning_5b" in report
    assert PUBLIC["ning_5b"].source in report
    assert "| ning_5b (2) | " in report
    row = done.rows[0]
    alone = [trial(PUBLIC["ristic_moderate"], CONTESTANTS["ekf"], run) for run in range(2)]
    assert row["error"] == pytest.approx(np.median([one["error"] for one in alone]))
    assert row["error_low"] <= row["error"] <= row["error_high"]
    kept, removed = (done.folder / TRIALS / f"ristic_moderate-ekf-00{run}.json" for run in range(2))
    before = kept.stat().st_mtime_ns
    removed.unlink()
    again = benchmark(resume=done.folder, jobs=1)
    assert kept.stat().st_mtime_ns == before
    assert [one["error"] for one in again.rows] == [one["error"] for one in done.rows]
    with pytest.raises(ConfigurationError, match="or that of the same benchmark"):
        benchmark(**{**chosen, "runs": 1}, out=done.folder, jobs=1)
    assert benchmark(**chosen, out=done.folder, jobs=1).rows == again.rows


def test_a_tracker_that_fails_is_lost(monkeypatch):
    class Failing:
        def update(self, time, bearing, own):
            if time > 1500.0:
                raise np.linalg.LinAlgError("not positive definite")

        def predict(self, times):
            raise ValueError("no estimate")

    one = CONTESTANTS["ekf"]
    numbers = trial(PUBLIC["ristic_moderate"], type(one)(one.name, one.says, lambda *_: Failing()), 0)
    assert numbers["lost"]
    assert numbers["fault"] == "ValueError: no estimate"


@pytest.mark.parametrize(
    ("given", "line"),
    [
        (["--scenarios", "case2"], "--scenarios: found case2; allowed: ning_4a"),
        (["--trackers", "imm"], "--trackers: found imm; allowed: ekf"),
        (["--resume", "nowhere"], "which holds no benchmark"),
        (["--logs", "nowhere"], "--logs: found no CSV file in "),
        (["--resume", "nowhere", "--quick"], "found --quick beside it"),
    ],
)
def test_what_is_wrong_is_one_line(given, line, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["benchmark", *given]) == 2
    assert line in capsys.readouterr().err


def test_quick_is_a_tenth_of_the_runs_and_the_list_has_all(tmp_path, capsys):
    folder = tmp_path / "quick"
    given = ["--scenarios", "ristic_moderate,ning_4c", "--trackers", "plkf", "--quick", "--quiet", "--jobs", "1"]
    assert main(["benchmark", *given, "--out", str(folder)]) == 0
    names = sorted(path.name for path in (folder / TRIALS).iterdir())
    assert names == ["ning_4c-plkf-000.json", *(f"ristic_moderate-plkf-00{run}.json" for run in range(2))]
    capsys.readouterr()
    assert main(["benchmark", "--list"]) == 0
    listed = capsys.readouterr().out
    assert len(PUBLIC) >= 8
    assert all(f"{name}: " in listed for name in (*PUBLIC, *CONTESTANTS))


def test_logs_are_scenarios_where_the_truth_is_known(tmp_path):
    phase = 0.2 * np.arange(0.0, 60.0, 0.5)
    own = 20.0 * np.stack([np.cos(phase), np.sin(phase)], axis=-1)
    angles = np.arctan2(50.0 - own[:, 1], -own[:, 0])
    rows = [
        f"{0.5 * k},{x},{y},{a},0,50" for k, ((x, y), a) in enumerate(zip(own.tolist(), angles.tolist(), strict=True))
    ]
    path = tmp_path / "still.csv"
    path.write_text("\n".join(["t,own_x,own_y,bearing_rad,true_x,true_y", *rows]) + "\n")
    (scenario,) = log_scenarios(tmp_path)
    numbers = trial(scenario, CONTESTANTS["ekf"], 0)
    assert scenario.name == "log_still"
    assert numbers["error"] < 10.0
    path.write_text("\n".join(line.rsplit(",", 2)[0] for line in path.read_text().splitlines()) + "\n")
    with pytest.raises(ConfigurationError, match="no true positions"):
        log_scenarios(tmp_path)


@pytest.mark.slow
@pytest.mark.skipif(not LOGS.is_dir(), reason="recorded logs are not part of the project")
def test_recorded_logs_are_followed():
    found = log_scenarios(LOGS)
    numbers = [trial(scenario, CONTESTANTS["imm_ekf"], 0) for scenario in found]
    assert all(one["measurements"] > 50 and not one["fault"] for one in numbers)
