"""Every shipped planner as C: the recorded steps of its closed loop, planned again by the generated folder."""

from pathlib import Path

import pytest

from gbt_ocp.experiments.build.loop import build_problem, build_vehicle
from gbt_ocp.experiments.config.guidance import PlannerGuidanceSection
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.recorded_steps import recorded_steps
from gbt_ocp.ocp import Planner, write_c
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.ocp.export.vectors import OFFERED, record
from gbt_ocp.ocp.export.verification import verify_folder
from gbt_ocp.ocp.solvers.base import options_for

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

CONFIGURATIONS = sorted(
    path.stem
    for path in (Path(__file__).resolve().parents[1] / "configs").glob("*.yaml")
    if path.stem != "replay" and isinstance(load_config(path.stem).guidance, PlannerGuidanceSection)
    if not load_config(path.stem).vehicles  # which codegen refuses
)


def verified(name, formulation, degree, count, folder):
    configuration = load_config(name, [f"planner.formulation={formulation}", f"planner.degree={degree}"])
    problem = build_problem(configuration, build_vehicle(configuration))
    planner = Planner(problem, "compiled", options_for("compiled", configuration.planner.solver_options))
    steps = recorded_steps(configuration, planner, count)
    write_c(planner, folder, steps)
    found = verify_folder(folder)
    assert found.faults == ()
    assert found.vectors >= min(5, count // 3)
    assert found.difference < 1e-9
    return planner, steps


def test_there_are_as_many_configurations_as_documented():
    assert len(CONFIGURATIONS) >= 11


@pytest.mark.slow
@pytest.mark.parametrize("degree", [2, 3, 4])
@pytest.mark.parametrize("formulation", ["hard", "penalty"])
@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_generated_c_plans_as_python_does(name, formulation, degree, tmp_path):
    verified(name, formulation, degree, OFFERED, tmp_path / "planner")


@pytest.mark.parametrize(("name", "degree"), [("sea2d", 2), ("case5", 3)])
@pytest.mark.long
def test_the_steps_are_those_of_the_closed_loop(name, degree, tmp_path):
    """The quick form: one configuration with limits on the target, one of a higher degree."""
    planner, steps = verified(name, "hard", degree, 6, tmp_path / "planner")
    recorded = record(planner, steps)
    assert len(steps) == 6
    states = {tuple(row) for row in recorded.arrays["state"].tolist()}
    assert states <= {tuple(step["state"].ravel().tolist()) for step in steps}
