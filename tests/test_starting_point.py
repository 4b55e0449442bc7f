"""``gbt-ocp new``, and a problem's Python file in place of a configuration."""

from pathlib import Path

import pytest

from gbt_ocp import ConfigurationError, TrackingProblem, load_config
from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.build.loop import build_problem, build_vehicle
from gbt_ocp.experiments.config.catalogue import load_problem
from gbt_ocp.experiments.result import Result
from gbt_ocp.ocp import KeepOut


def test_the_starting_point_runs_as_it_is(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["new", "own_target.py"]) == 0
    assert capsys.readouterr().out == "own_target.py\nrun it: gbt-ocp run own_target.py\n"
    assert load_problem("own_target.py").name == "own_target"
    assert cli.main(["run", "own_target.py", "--quiet", "--no-figures"]) == 0
    result = Result.load("runs/own_target-default-hard-seed0")
    assert result.summary["error_settled"] < 0.01
    assert result.summary["solver_success_rate"] == 1.0


def test_new_never_replaces_a_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text("mine")
    for name, says in (
        ("mine.py", "found mine.py, which exists already; allowed: a new file"),
        ("mine.txt", "found mine.txt; allowed: a name that ends in .py"),
        ("nowhere/mine.py", "found nowhere/mine.py"),
    ):
        assert cli.main(["new", name]) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert says in err
        assert len(err.splitlines()) == 1
    assert Path("mine.py").read_text() == "mine"


def problem_file(path, fields):
    path.write_text(
        "from gbt_ocp import TrackingProblem\n"
        "from gbt_ocp.ocp import KeepOut\n"
        "problem = TrackingProblem(name='short', dimension=2, description='d', target={'kind': 'case2'},\n"
        f"    defaults={{'duration_s': 3.0}}, {fields})\n"
    )
    return path


def test_a_python_file_stands_for_a_configuration_with_all_its_defaults(tmp_path):
    path = problem_file(tmp_path / "short.py", "")
    configuration = load_config(path, overrides=["planner.pieces=7"], seed=4)
    assert (configuration.name, configuration.duration_s, configuration.planner.pieces) == ("short", 3.0, 7)
    assert (configuration.seed, configuration.problem) == (4, str(path))
    again = tmp_path / "again.yaml"
    again.write_text(configuration.to_yaml())
    assert load_config(again) == configuration


def test_a_problem_may_constrain_the_planner(tmp_path):
    path = problem_file(tmp_path / "own.py", "constrain=lambda p: p.subject_to(KeepOut((9.0, 9.0), 1.0), nodes=2)")
    configuration = load_config(path, overrides=["limits.speed=3"])
    problem = build_problem(configuration, build_vehicle(configuration))
    assert problem.hard[-1].constraint == KeepOut((9.0, 9.0), 1.0)
    assert len(problem.constraints) == 3  # thrust, speed, and its own


def test_a_constrain_that_returns_nothing_is_told(tmp_path):
    configuration = load_config(problem_file(tmp_path / "own.py", "constrain=lambda p: None"))
    with pytest.raises(ValueError, match="constrain: found nothing returned; allowed: a function that returns"):
        build_problem(configuration, build_vehicle(configuration))
    with pytest.raises(ValueError, match="constrain: found 3; allowed: a function, or None"):
        TrackingProblem("a", 2, "b", {"kind": "case1"}, constrain=3)
    with pytest.raises(ConfigurationError, match="found no such file; allowed: case1"):
        load_config("nowhere.py")
