"""``gbt-ocp check``: what is wrong with a problem of the user's is one line, there and before a run."""

from pathlib import Path

import pytest

from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.check_problem import check_problem
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config

TUTORIAL = Path(__file__).resolve().parents[1] / "docs" / "tutorial"

OWN = """
import casadi as ca
import numpy as np

from gbt_ocp import TrackingProblem
from gbt_ocp.models import PlanarPointMass


class Line:
    dimension = 2

    def position(self, times):
        t = np.asarray(times, dtype=float)
        return np.stack([2.0 + 0.3 * t, 1.0 - 0.1 * t], axis=-1)


class Drone(PlanarPointMass):
    def __init__(self):
        super().__init__(1.0, 0.2, (5.0, 5.0))


class Pursuit:
    shapes = {"mean": (2, 1)}

    def value(self, point, parameters):
        return -ca.sumsqr(parameters["mean"] - point.z[:2])

    def bind(self, pieces, data):
        return {"mean": np.asarray(data["forecast"].mean[:pieces])[..., None]}


class Box:
    lower, upper, backoff, scale = -5.0 * np.ones(2), 5.0 * np.ones(2), np.zeros(2), np.ones(2)

    def value(self, point):
        return point.z[:2]


def constrain(problem):
    return problem.subject_to(Box())


problem = TrackingProblem("own", 2, "own", Line, vehicle=Drone, objective=Pursuit, constrain=constrain)
"""

DRONE = "class Drone(PlanarPointMass):\n"

SETTINGS = ["planner.solver=ipopt", "planner.formulation=hard", "duration_s=1"]


def own(folder, before="", after=""):
    assert before in OWN
    path = folder / "own.py"
    path.write_text(OWN.replace(before, after) if before else OWN, encoding="utf-8")
    return str(path)


def test_it_says_what_it_found(tmp_path, capsys):
    assert cli.main(["check", own(tmp_path), "--set", *SETTINGS]) == 0
    lines = [line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines() if line]
    assert [words[0] for words in lines] == [
        "problem", "target", "vehicle", "vehicle", "objective", "objective", "limit", "limit", "codegen", "plan", "no",
    ]  # fmt: skip
    text = {words[0]: words[1] for words in lines}
    assert text["target"] == "Line: starts at (2, 1) m, at most 0.316 m/s"
    assert text["limit"] == "Box: needs no numbers; bounds 2 numbers, hard at 4 intervals a piece"
    assert text["plan"].startswith("one plan with ipopt: solved in")
    assert text["no"] == "fault found"


@pytest.mark.parametrize("name", ["new_target", "new_vehicle", "new_constraint", "new_objective"])
def test_the_tutorial_has_no_fault(name):
    found = check_problem(load_config(TUTORIAL / f"{name}.py", ["planner.solver=ipopt"]))
    assert not [finding for finding in found if finding.doubtful]


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        ("    dimension = 2\n", "", "own: Line.dimension: found nothing of this name; allowed: the dimension"),
        ("    def position(", "    def place(", "own: Line.position: found nothing of this name"),
        ("axis=-1)\n", "axis=0)[..., :1]\n", "own: Line.position at 2 times: found shape (2, 1)"),
        ('"own", Line,', '"own", lambda: Line,', "own: Line: found the class"),
        ('"own", Line,', '"own", lambda: 1 / 0,', "own: target: found ZeroDivisionError: division by zero"),
        ('"own", Line,', '"own", lambda: None,', "own: target: found nothing returned"),
        ("(1.0, 0.2, (5.0, 5.0))\n", "()\n        del self.mass\n", "own: Drone.inputs: found AttributeError"),
        ("(5.0, 5.0))\n", "(5.0, 5.0))\n        self.flat_dimension = 3\n", "own: Drone.thrust_max: found shape (2,)"),
        (DRONE, f"{DRONE}    rates = None\n", "own: Drone.rates: found None"),
        (DRONE, f"{DRONE}    pose = PlanarPointMass.flat\n", "own: Drone.pose: found a tuple"),
        ("    def bind(", "    def binding(", "own: Pursuit.bind: found nothing of this name"),
        ("point.z[:2])\n\n    def bind", "point.z)[0:0]\n\n    def bind", "own: Pursuit.value: found shape (1, 0)"),
        ('data["forecast"].mean[:pieces]', 'data["goal"]', "own: Pursuit.bind: found KeyError: 'goal'; allowed: num"),
        ("[..., None]}", "}", "own: Pursuit.bind, 'mean': found shape (5, 2)"),
        ("-5.0 * np.ones(2),", "-5.0 * np.ones(1),", "own: constrain: Box.lower: found shape (1,)"),
        ("-5.0 * np.ones(2),", "5.0 * np.ones(2),", "own: constrain: Box.lower: found 5.0 beside upper 5.0"),
        ("return problem.subject_to(Box())", "problem.subject_to(Box())", "own: constrain: found nothing returned"),
        ("return problem.subject_to(Box())", "return Box()", "own: constrain: found a Box returned"),
        ("problem.subject_to(Box())", "problem.subject(Box())", "own: constrain: found AttributeError"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line_and_found_before_a_run(before, after, says, tmp_path, capsys):
    path = own(tmp_path, before, after)
    for arguments in (["check", path], ["run", path, "--quiet", "--out", str(tmp_path / "out")]):
        assert cli.main([*arguments, "--set", *SETTINGS]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(says)
    assert not (tmp_path / "out").exists()


def test_codegen_says_the_same(tmp_path, capsys):
    path = own(tmp_path, "    def bind(", "    def binding(")
    assert cli.main(["codegen", path, "--out", str(tmp_path / "c")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "Pursuit.bind: found nothing of this name" in line


def test_a_target_is_followed_to_the_end_of_the_run(tmp_path, capsys):
    """What fails only later is found, too: here at 0.5 s."""
    path = own(tmp_path, "2.0 + 0.3 * t", "np.where(t < 0.5, 2.0, np.nan)")
    assert cli.main(["check", path, "--set", *SETTINGS]) == 2
    assert "Line.position from 0 to 2.1 s: found nan at (48, 0) of shape (201, 2)" in capsys.readouterr().err


def test_what_is_doubtful_is_said_and_accepted(tmp_path, capsys):
    path = own(tmp_path, DRONE, f"{DRONE}    rates = lambda self, *given: PlanarPointMass(2.0, 0.2).rates(*given)\n")
    assert cli.main(["check", path, "--set", *SETTINGS]) == 0
    text = capsys.readouterr().out
    assert "doubtful: forward and inverse dynamics differ by" in text
    assert "no fault found, 1 doubtful" in text


def test_a_missing_compiler_is_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("CC", str(tmp_path / "none"))
    for arguments in (["check", own(tmp_path)], ["run", own(tmp_path), "--quiet", "--out", str(tmp_path / "out")]):
        assert cli.main([*arguments, "--set", *SETTINGS, "planner.solver=compiled"]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("own: ")
        assert "no C compiler" in line
    found = check_problem(load_config(own(tmp_path), [*SETTINGS, "planner.solver=auto"]))
    assert [finding.text for finding in found if finding.doubtful and "auto takes ipopt" in finding.text]


def test_other_strategies_are_checked_as_far_as_they_go():
    (*_, last) = check_problem(load_config("case2", ["guidance.kind=static"]))
    assert last.text == "Static, which plans nothing"
    sums = check_problem(load_config("case2", ["planner.objective=fisher_logdet", "planner.pieces=3"]))
    assert "one plan with compiled: solved" in sums[-1].text
    with pytest.raises(ConfigurationError, match=r"case2: planner\.objective"):
        check_problem(load_config("case2", ["planner.objective=posterior_variance", "tracker.kind=plkf"]))
