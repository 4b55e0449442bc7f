"""What a user's type checker and editor see."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from gbt_ocp.experiments.config import catalogue
from gbt_ocp.experiments.config.json_schema import json_schema

ROOT = Path(__file__).resolve().parents[1]

RIGHT = """
from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import gbt_ocp as gbt
from gbt_ocp.ocp import ThrustLimit, TrajectoryProblem
from gbt_ocp.models.vehicles import PlanarPointMass

result = gbt.run("case2", overrides=["duration_s=5"], seed=1)
assert_type(result, gbt.Result)
assert_type(result.history.forecast_mean, NDArray[np.float64])
error: float = result.summary["error_settled"]
configuration = gbt.load_config("case2")
assert_type(configuration.planner.pieces, int)
vehicle = PlanarPointMass()
problem = TrajectoryProblem(vehicle, pieces=5, period=0.1).subject_to(ThrustLimit(vehicle), nodes=2)
assert_type(problem, TrajectoryProblem)


class Circle:
    dimension = 2

    def position(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.stack([np.cos(times), np.sin(times)], axis=-1)


own = gbt.TrackingProblem(name="own", dimension=2, description="a circle", target=Circle)
"""

WRONG = {
    'gbt.run("case2", duration=5)\n': 'Unexpected keyword argument "duration"',
    'gbt.run("case2").histroy\n': '"Result" has no attribute "histroy"',
    "gbt.load_config(3)\n": "Argument 1",
    'gbt.TrackingProblem(name="a", dimension="2", description="", target={})\n': 'Argument "dimension"',
}


def check(tmp_path, text):
    pytest.importorskip("mypy", reason="mypy is not installed")
    script = tmp_path / "script.py"
    script.write_text(text)
    cache = ROOT / ".mypy_cache" / "user"
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file=", f"--cache-dir={cache}", str(script)]
    # Of the package only its types count here, as if it were installed; its own faults are those of another check.
    command += ["--follow-imports=silent", "--ignore-missing-imports"]
    environment = {"MYPYPATH": str(ROOT), "PATH": "/usr/bin:/bin"}
    return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a_users_script_passes_mypy_strict_and_its_mistakes_do_not(tmp_path):
    done = check(tmp_path, RIGHT)
    assert done.returncode == 0, done.stdout + done.stderr
    done = check(tmp_path, "import gbt_ocp as gbt\n\n" + "".join(WRONG))
    for line, says in enumerate(WRONG.values(), start=3):
        assert f"script.py:{line}: error: {says}" in done.stdout


def test_the_schema_beside_the_configurations_is_the_current_one():
    """After a change: ``gbt-ocp schema > configs/schema.json``."""
    written = json.loads((catalogue.configs_folder() / "schema.json").read_text(encoding="utf-8"))
    assert written == json_schema(), "run: gbt-ocp schema > configs/schema.json"


@pytest.mark.parametrize("name", catalogue.config_names())
def test_every_shipped_configuration_names_the_schema_and_fits_it(name):
    path = catalogue.configs_folder() / f"{name}.yaml"
    first = path.read_text(encoding="utf-8").partition("\n")[0]
    target = first.removeprefix(catalogue.SCHEMA_LINE)
    assert target != first
    tree = json.loads((path.parent / target).read_text(encoding="utf-8"))
    validator = pytest.importorskip("jsonschema", reason="jsonschema is not installed").Draft202012Validator(tree)
    assert list(validator.iter_errors(yaml.safe_load(path.read_text(encoding="utf-8")))) == []
    assert list(validator.iter_errors({"problem": name, "planner": {"peices": 5}})) != []
