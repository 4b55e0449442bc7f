import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from gbt_ocp.experiments.config import catalogue
from gbt_ocp.experiments.config.catalogue import ProblemError, load_problem
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.config.tracking_problem import TrackingProblem
from gbt_ocp.models.targets import case_target

ROOT = Path(__file__).resolve().parents[1]
GOOD = """
from __future__ import annotations
from dataclasses import dataclass
from gbt_ocp.experiments.config.tracking_problem import TrackingProblem

@dataclass
class Thing:
    x: float = 1.0

problem = TrackingProblem(name="{name}", dimension=2, description="d", target={{"kind": "case1"}})
"""


def test_the_six_cases_and_the_recorded_track_are_shipped():
    wanted = {*(f"case{number}" for number in range(1, 7)), "recorded"}
    assert wanted <= set(catalogue.problem_names())
    assert wanted <= set(catalogue.config_names())
    for name in wanted:
        assert load_problem(name).name == name
        assert load_problem(name).description
        assert len(catalogue.config_description(name)) > 10


# First and a later point of each motion, from the equations of section 5.2 worked by hand at t = 0 and t = 4.
POINTS = {
    "case1": ([-1, -1], [3, 3]),
    "case2": ([3, 0], [0, 0]),
    "case3": ([4, 0], [4 * np.cos(1.7 - 0.5 * np.cos(1.6)), 4 * np.sin(1.7 - 0.5 * np.cos(1.6))]),
    "case4": ([-1, -1, 0], [3, 3, 0.4]),
    "case5": ([3, 0, 0], [0, 0, 3]),
    "case6": (
        [4, 0, 0],
        [4 * np.cos(1.7 - 0.5 * np.cos(1.6)), 4 * np.sin(1.7 - 0.5 * np.cos(1.6)), 5 * np.sin(0.8) ** 2],
    ),
}


@pytest.mark.parametrize("name", POINTS)
def test_a_case_points_at_the_papers_motion(name):
    configuration = load_config(name)
    target = case_target(int(configuration.target.kind.removeprefix("case")))
    assert target.dimension == configuration.dimension == len(POINTS[name][0])
    np.testing.assert_allclose(target.position([0.0, 4.0]), POINTS[name], atol=1e-12)


@pytest.mark.skipif(
    not (ROOT / "problems" / "recorded_track.csv").is_file(), reason="the example track has not been made"
)
def test_the_recorded_configuration_loads():
    configuration = load_config("recorded")
    assert configuration.target.kind == "track"
    assert Path(configuration.target.path).is_file()


def test_the_recorded_configuration_takes_another_track(tmp_path):
    track = tmp_path / "boat.csv"
    track.write_text("t,x,y\n" + "".join(f"{t},{0.5 * t},{0.1 * t}\n" for t in range(0, 60, 5)))
    configuration = load_config("recorded", [f"target.path={track}"])
    assert (configuration.target.path, configuration.target.start_m) == (str(track), (3.0, 0.0))


def test_folders_lie_inside_the_package_of_a_wheel_and_beside_it_in_a_checkout(tmp_path):
    package = tmp_path / "gbt_ocp"
    package.mkdir()
    assert catalogue.problems_folder(package) == tmp_path / "problems"
    assert catalogue.configs_folder(package) == tmp_path / "configs"
    (package / "_problems").mkdir()
    (package / "_configs").mkdir()
    assert catalogue.problems_folder(package) == package / "_problems"
    assert catalogue.configs_folder(package) == package / "_configs"


def test_names_are_found_from_an_installation_outside_the_checkout(tmp_path):
    # The tree a wheel installs, by the list that builds the wheel.
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    site, elsewhere = tmp_path / "site", tmp_path / "elsewhere"
    elsewhere.mkdir()
    skip = shutil.ignore_patterns("__pycache__")
    for package in build["packages"]:
        shutil.copytree(ROOT / package, site / package, ignore=skip)
    for source, place in build["force-include"].items():
        shutil.copytree(ROOT / source, site / place, ignore=skip)
    code = (
        "from gbt_ocp.experiments.config import catalogue, loading; c = loading.load_config('case5');"
        "print(catalogue.problem_path(c.problem), c.dimension)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=elsewhere,
        env=os.environ | {"PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == [str(site / "gbt_ocp" / "_problems" / "case5.py"), "3"]


def test_two_files_of_one_name_and_a_changed_file_are_told_apart(tmp_path):
    paths = []
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        paths.append(tmp_path / folder / "mine.py")
        paths[-1].write_text(GOOD.format(name=folder))
    assert [load_problem(str(path)).name for path in paths] == ["a", "b"]
    assert load_problem(str(paths[0])) is load_problem(str(paths[0]))
    paths[0].write_text(GOOD.format(name="c"))
    os.utime(paths[0], ns=(1, 1))
    assert load_problem(str(paths[0])).name == "c"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x = 1\n", "found nothing named `problem`"),
        ("problem = 3\n", "found a int named `problem`"),
        ("x = 1\ny = x / 0\n", "line 2: ZeroDivisionError"),
        ("def f(:\n", "line 1: SyntaxError"),
        (GOOD.format(name="m").replace("dimension=2", "dimension=4"), "dimension: found 4; allowed: 2, 3"),
        (GOOD.format(name="m").replace('{"kind": "case1"}', "3"), "target: found 3; allowed: a mapping"),
    ],
)
def test_a_faulty_problem_module_is_one_clear_line(tmp_path, text, says):
    path = tmp_path / "mine.py"
    path.write_text(text)
    with pytest.raises(ProblemError) as caught:
        load_problem(str(path))
    assert str(path) in str(caught.value)
    assert says in str(caught.value)
    assert "allowed: " in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_problem_is_frozen():
    problem = load_problem("case1")
    assert isinstance(problem, TrackingProblem)
    with pytest.raises(AttributeError):
        problem.name = "other"
