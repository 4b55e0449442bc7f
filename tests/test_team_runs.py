"""Runs of several vehicles: what the loop shares between them, and what a run leaves."""

import json

import numpy as np
import pytest

import gbt_ocp as gbt
from gbt_ocp.cli.main import main
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.reporting.glossary import RUN_NUMBERS, TEAM_NUMBERS
from gbt_ocp.reporting.run_report import report_page
from gbt_ocp.simulation.columns import columns
from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.team_summary import OF_EACH

CHEAP = ["guidance={kind: random}", "tracker={kind: ekf, bearing_std_deg: 1.0}", "duration_s=12", "link.period_s=1"]
"""Thrusts at random and a filter: the loop of several vehicles without the cost of plans."""


def differing(first, second):
    """Names of the arrays in which two histories differ, those measured by a clock left out."""
    names = [one.name for one in columns(History) if not one.clock]
    pairs = [(name, getattr(first, name), getattr(second, name)) for name in names]
    return [name for name, a, b in pairs if a.tobytes() != b.tobytes()]


@pytest.mark.long
def test_a_vehicle_that_hears_nothing_runs_as_if_it_were_alone():
    """Byte by byte, with plans: the first of two has the random draws of one, and its tracker no late bearings."""
    settings = ["limits.hard=[range, speed, yaw_rate]", "limits.separation_m=null", "planner.objective=similarity"]
    settings += ["duration_s=6", "guidance={startup_deviation: 0.25, startup_speed: 3.0}"]
    settings += ["limits.speed=3.4", "desired_bearing.speed_mps=2.7"]
    alone = gbt.run("sea2d", overrides=["duration_s=6", "tracker.kind=motion_gp"])
    deaf = gbt.run("sea2d_two", overrides=[*settings, "link.loss=1.0"])
    assert differing(alone.history, deaf.history) == []
    assert deaf.summary["team"]["packets_lost"] == deaf.summary["team"]["packets_sent"] == 2 * 13
    other = deaf.others["two"].history
    assert np.array_equal(other.target, alone.history.target)
    assert "bearing" in differing(alone.history, other)
    hearing = gbt.run("sea2d_two", overrides=settings)
    assert hearing.history.bearings_heard.sum() > 0
    assert "forecast_mean" in differing(alone.history, hearing.history)


@pytest.mark.long
def test_what_is_heard_is_what_was_sent_and_repeats():
    result, again = (gbt.run("sea2d_two", overrides=CHEAP) for _ in range(2))
    for name, other in {"one": result, **result.others}.items():
        history = other.history
        # a packet a second, the first at once; each bearing counts once
        assert history.packets_heard.sum() == 13
        assert set(np.flatnonzero(history.packets_heard)) == {10 * k for k in range(13)}
        assert 13 <= history.bearings_heard.sum() <= 26
        assert other.summary["retries"]["refused_bearings"] == 0, name
    assert differing(result.history, again.history) == []
    assert differing(result.others["two"].history, again.others["two"].history) == []
    lossy = gbt.run(
        "sea2d_two", overrides=[*CHEAP, "link.loss=0.5", "link.period_s=10", "link.latency_s=1.5", "seed=1"]
    )
    team = lossy.summary["team"]
    assert team["packets_sent"] == 4
    heard = sum(int(one.history.packets_heard.sum()) for one in (lossy, *lossy.others.values()))
    assert heard == team["packets_sent"] - team["packets_lost"]
    times = lossy.history.t[lossy.history.packets_heard > 0]
    assert np.allclose(times % 10.0, 1.5)


def test_two_vehicles_are_surer_than_one_from_the_first_packet_on():
    one, two = gbt.run("sea2d", overrides=CHEAP[:-1]), gbt.run("sea2d_two", overrides=CHEAP)
    spread = [np.sqrt(result.history.forecast_cov[20:, 0].trace(axis1=1, axis2=2)) for result in (one, two)]
    assert np.median(spread[1]) < 0.5 * np.median(spread[0])


@pytest.mark.long
def test_the_run_folder_has_all_vehicles(tmp_path):
    result = gbt.run("sea2d_two", overrides=[*CHEAP, "vehicles.1.start={range_m: 60}"])
    folder = result.save(tmp_path / "run")
    assert (folder / "figures" / "vehicles.png").is_file()
    for place in (folder, folder / "vehicles" / "two"):
        assert {path.name for path in place.iterdir()} >= {"config.yaml", "summary.json", "history.npz", "figures"}
    assert not (folder / "vehicles" / "two" / "figures" / "vehicles.png").exists()
    back = gbt.Result.load(folder)
    assert list(back.others) == ["two"]
    assert np.array_equal(back.history.bearings_heard, result.history.bearings_heard)
    assert np.array_equal(back.others["two"].history.bearings_heard, result.others["two"].history.bearings_heard)
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert set(summary) <= set(RUN_NUMBERS)
    assert set(summary["team"]) == set(TEAM_NUMBERS)
    assert list(summary["vehicles"]) == ["one", "two"]
    own = json.loads((folder / "vehicles" / "two" / "summary.json").read_text(encoding="utf-8"))
    for key in set(OF_EACH) & set(own):
        assert summary["vehicles"]["two"][key] == own[key]
        assert summary["vehicles"]["one"][key] == summary[key]
    assert own["error_start"] == pytest.approx(result.others["two"].history.error[:, 0].mean())
    places = [one.history.vehicle_pose[:, :2] for one in (result, result.others["two"])]
    assert summary["team"]["separation_min"] == pytest.approx(np.linalg.norm(places[0] - places[1], axis=1).min())
    # drawn 40 m from the target, and 60 m for the second
    ranges = [np.linalg.norm(place[0] - result.history.target[0]) for place in places]
    assert ranges == pytest.approx([40.0, 60.0])
    page = report_page(folder)
    assert "<h2>Vehicles</h2>" in page
    assert TEAM_NUMBERS["separation_min"][1] in page
    again = load_config(folder / "config.yaml")
    assert [one.name for one in again.vehicles] == ["one", "two"]


def test_vehicles_start_apart_and_may_be_of_another_kind():
    for seed in range(3):
        result = gbt.run("sea2d_two", overrides=[*CHEAP, "duration_s=0.2", "limits.separation_m=60"], seed=seed)
        assert result.summary["team"]["separation_min"] > 59.0
        assert result.summary["team"]["steps_below_separation"] == 0
    slow = ["target.speed=0.3", "desired_bearing.target_speed=0.3", "duration_s=0.2"]
    mixed = gbt.run("sea2d_two", overrides=[*CHEAP, *slow, "vehicles.1.model=bluerov2_heavy"])
    assert mixed.summary["thrust_max"] == [5000.0, 5000.0, 1500.0]
    assert max(mixed.others["two"].summary["thrust_max"]) < 500.0
    with pytest.raises(
        ConfigurationError, match=r"vehicles\.1: start: found no place 10 m from the vehicles before it"
    ):
        gbt.run("sea2d_two", overrides=[*CHEAP, "vehicle.start.position_m=[40, 0]"])


@pytest.mark.parametrize(
    ("settings", "line"),
    [
        (["vehicles=[{name: one}]"], "vehicles: found 1 of them; allowed: 2 to 8 vehicles, or none for one alone"),
        (["vehicles=[{name: a}, {name: a}]"], 'vehicles: found 2 with the name "a"; allowed: a name of its own'),
        (["vehicles=[{name: a/b}, {name: c}]"], 'vehicles.0.name: found "a/b"; allowed: letters, digits and under'),
        (["vehicles=[{name: a, sensor: 3}, {name: c}]"], "vehicles.0.sensor: found an unknown key"),
        (["link.packet_bytes=39"], "link.packet_bytes: found 39; allowed: at least 40, the size of a packet with a"),
        (["link.loss=1.5"], "link.loss: found 1.5; allowed: a number in [0, 1]"),
        (["tracker.kind=imm_kf_f"], 'tracker.kind: found "imm_kf_f"; allowed: beside vehicles, gp'),
        (["tracker.kind=mixture", "tracker.engine=compiled"], "tracker.engine: found 'compiled'; allowed: beside"),
        (["vehicle.kind=problem", "vehicles.1.model=falcon"], 'vehicles.1.model: found "falcon"; allowed: null beside'),
    ],
)
def test_faults_of_several_vehicles_are_one_line_each(settings, line):
    with pytest.raises(ConfigurationError) as caught:
        load_config("sea2d_two", settings)
    assert any(line in fault for fault in caught.value.faults), caught.value.faults


@pytest.mark.parametrize("command", ["codegen", "compare"])
def test_commands_for_one_vehicle_refuse_several(command, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main([command, "sea2d_two", "--out", str(tmp_path / "out")]) == 2
    assert "vehicles: found 2; allowed: none here" in capsys.readouterr().err


def test_a_pilot_is_for_one_vehicle():
    with pytest.raises(ValueError, match="vehicles: found 2; allowed: none for a pilot"):
        gbt.Pilot("sea2d_two")
