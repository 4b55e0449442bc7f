"""Objectives and limits that need no numbers from outside (``shapes = {}``), with every solver."""

from typing import ClassVar

import casadi as ca
import numpy as np
import pytest

from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.result import Result
from gbt_ocp.models import PlanarPointMass
from gbt_ocp.ocp import Planner, ShootingPlanner, ThrustLimit, TrajectoryProblem, write_c
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.ocp.codegen.problem_source import from_moments
from gbt_ocp.ocp.export.verification import verify_folder
from gbt_ocp.ocp.limit_classes import LimitClass, limit_class

VEHICLE = PlanarPointMass(mass=1.0, drag=0.2, thrust_max=(2.0, 2.0))
PLAIN = TrajectoryProblem(VEHICLE, 10, 0.2).subject_to(ThrustLimit(VEHICLE))
REST = np.zeros((2, 2))
SOLVERS = ["ipopt", pytest.param("compiled", marks=pytest.mark.skipif(find_compiler() is None, reason="no compiler"))]


class Home:
    """A fixed goal."""

    shapes: ClassVar = {}

    def value(self, point, parameters):
        return -ca.sumsqr(point.z - ca.DM([1.0, 0.5]))

    def bind(self, pieces, data):
        return {}


class Together:
    """The same, as one term of all endpoints."""

    shapes: ClassVar = {}
    bind = Home.bind

    def total(self, points, parameters):
        return sum(Home().value(point, given) for point, given in zip(points, parameters, strict=True))


class Goal:
    """A goal from the data of a solve."""

    shapes: ClassVar = {"goal": (2, 1)}

    def value(self, point, parameters):
        return -ca.sumsqr(point.z - parameters["goal"])

    def bind(self, pieces, data):
        return {"goal": np.tile(np.reshape(data["goal"], (2, 1)), (pieces, 1, 1))}


class Below:
    """``y <= top``, in the form of a limit that could have numbers."""

    lower, backoff, scale = np.array([-np.inf]), np.zeros(1), np.ones(1)
    shapes: ClassVar = {}
    bind = Home.bind

    def __init__(self, top=0.3):
        self.upper = np.array([top])

    def value(self, point, parameters):
        return point.z[1]


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_fixed_goal_is_reached_alone_and_beside_another(solver):
    same = PLAIN.maximize(Goal()).compile(solver).solve(REST, goal=(1.0, 0.5))
    alone = PLAIN.maximize(Home()).compile(solver).solve(REST)
    assert alone.solved
    np.testing.assert_allclose(alone.endpoints, same.endpoints, atol=1e-6)
    # the sum of two squared distances is least half way between the goals, as far as the end is concerned
    both = PLAIN.maximize(Goal()).maximize(Home()).compile(solver).solve(REST, goal=(0.0, 1.0))
    middle = PLAIN.maximize(Goal()).compile(solver).solve(REST, goal=(0.5, 0.75))
    assert both.solved
    np.testing.assert_allclose(both.endpoints, middle.endpoints, atol=2e-3)


def test_a_joint_objective_and_multiple_shooting_take_it():
    joint = PLAIN.maximize(Together()).compile("ipopt").solve(REST)
    assert joint.solved
    np.testing.assert_allclose(
        joint.endpoints, PLAIN.maximize(Home()).compile("ipopt").solve(REST).endpoints, atol=1e-5
    )
    held = ShootingPlanner(PLAIN.maximize(Home())).solve(REST)
    assert held.solved
    np.testing.assert_allclose(held.endpoints[-1], [1.0, 0.5], atol=0.05)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("verb", ["subject_to", "subject_to_penalty"])
def test_a_moving_limit_without_numbers_is_a_limit(verb, solver):
    problem = getattr(PLAIN.maximize(Home()), verb)(Below())
    assert limit_class(problem, problem.constraints[-1]) == LimitClass.CERTAIN, "nothing of it is only believed"
    plan = problem.compile(solver).solve(REST)
    assert plan.solved
    assert plan(np.linspace(0.0, 2.0, 200))[:, 1].max() == pytest.approx(0.3, abs=0.01)
    assert plan.violation < 0.01


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
@pytest.mark.long
def test_it_is_generated_with_the_whole_step(tmp_path):
    problem = PLAIN.maximize(Home()).subject_to(Below(9.0))
    assert from_moments(problem)
    found = verify_folder(write_c(Planner(problem, "compiled"), tmp_path / "planner"))
    assert found.faults == ()
    assert found.vectors == 20
    assert found.difference < 1e-12


PROBLEM = '''
"""Go home."""
import casadi as ca
from gbt_ocp import TrackingProblem

class Home:
    shapes = {}
    def value(self, point, parameters):
        return -0.1 * ca.sumsqr(point.z[:2])
    def bind(self, pieces, data):
        return {}

problem = TrackingProblem(name="home", dimension=2, description="go home", target={"kind": "case2"}, objective=Home,
                          defaults={"duration_s": 4.0, "vehicle": {"start": {"position_m": [3.0, -2.0]}}})
'''


@pytest.mark.long
def test_a_run_and_the_generated_planner_of_such_a_problem(tmp_path, capsys):
    path = tmp_path / "home.py"
    path.write_text(PROBLEM)
    assert cli.main(["run", str(path), "--quiet", "--no-figures", "--out", str(tmp_path / "run")]) == 0
    result = Result.load(tmp_path / "run")
    # the default pull leads to the target besides, whose figure eight stays within 3 m of home
    assert np.linalg.norm(result.history.vehicle_pose[-1, :2]) < 1.0
    if find_compiler() is not None:
        assert cli.main(["codegen", str(path), "--out", str(tmp_path / "c"), "--verify"]) == 0
        assert "0 faults" in capsys.readouterr().out
