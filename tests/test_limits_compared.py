"""The comparison with limits besides those on thrust: on the target, which is only believed, and on the state."""

import dataclasses

import numpy as np
import pytest

import gbt_ocp as gbt
from gbt_ocp.experiments.build.loop import build_problem, build_vehicle
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.ocp import Planner
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.ocp.limit_classes import LimitClass
from gbt_ocp.ocp.solvers.base import GIVEN_UP
from gbt_ocp.studies.limits.formulations import COMPILED, limits_in
from gbt_ocp.studies.limits.problems import draw
from gbt_ocp.studies.limits.solves import Judge, solve_chunk
from gbt_ocp.studies.limits.treatments import Pair, treated, unfit
from gbt_ocp.studies.limits.unyielding import NOT_KEPT

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

# plans from the first step on, and few pieces: seconds instead of minutes
SHORT = ["duration_s=4", "planner.pieces=3", "guidance.startup_deviation=10", "vehicle.start.range_m=33"]
# deeper inside the range, the thrust of a single cold solve runs over its limit by 1 % between the nodes
SHORT += ["limits.range.target_speed_max=null"]
FORMULATIONS = ["mixed", "exchange", "soft"]


@pytest.fixture(scope="module")
def sea():
    return load_config("sea2d", SHORT)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("comparison") / "sea"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gbt_ocp.studies.limits.solves.STARTS", 2)
        return gbt.compare(
            "sea2d", formulations=FORMULATIONS, solvers=["compiled"], runs=1, problems=4, overrides=SHORT, out=folder,
            jobs=1,
        )  # fmt: skip


def test_limits_are_found_with_their_classes(sea):
    found = limits_in(sea)
    assert found == {
        "range": LimitClass.BELIEVED, "speed": LimitClass.CERTAIN, "yaw_rate": LimitClass.CERTAIN,
    }  # fmt: skip
    assert limits_in(load_config("case2")) == {}


@pytest.mark.parametrize(
    ("formulation", "thrust", "hard"),
    [
        ("hard", "hard", {"range", "speed", "yaw_rate"}),
        ("soft", "hard", {"range", "speed", "yaw_rate"}),
        ("mixed", "hard", {"speed", "yaw_rate"}),
        ("elastic", "penalty", set()),
    ],
)
def test_a_formulation_treats_all_limits(sea, formulation, thrust, hard):
    changed = treated(sea, formulation)
    assert changed.planner.formulation == thrust
    assert set(changed.limits.hard) == hard
    problem = build_problem(changed, build_vehicle(changed))
    assert len(problem.hard) == len(hard) + (thrust == "hard")
    assert len(problem.hard) + len(problem.penalties) == 4


@pytest.mark.slow
def test_what_does_not_fit_is_left_out_and_named(sea, done):
    assert "thrust only" in unfit(sea, Pair("exchange", COMPILED))
    assert "so it is hard" in unfit(load_config("case2"), Pair("mixed", COMPILED))
    assert {row["formulation"] for row in done.tables["runs"]} == {"mixed", "soft"}
    meanings = [row["meaning"] for row in done.tables["formulations"] if row["formulation"] == "exchange"]
    assert "not for sea2d: it takes limits on thrust only" in meanings
    with pytest.raises(ConfigurationError, match=r"case2: --formulations: found none that fits"):
        gbt.compare("case2", formulations=["mixed"])


def test_a_hard_limit_that_cannot_be_kept_fails_and_an_l1_one_gives(sea):
    """At 33 m and flying at the target with 3.9 m/s, no thrust within the limits keeps a distance of 31.5 m."""
    problems = draw(sea, 1)
    start, mean = problems.start.copy(), problems.mean.copy()
    mean[0] = 0.0
    start[0, 0] = [32.0, 0.0, 0.0]
    start[0, 1] = [-3.9, 0.0, 0.0]
    problems = dataclasses.replace(problems, start=start, mean=mean, covariance=1e-6 + 0.0 * problems.covariance)
    (hard,) = solve_chunk(sea, problems, [0], Pair("hard", COMPILED), "cold")
    (soft,) = solve_chunk(sea, problems, [0], Pair("soft", COMPILED), "cold")
    assert (hard["solved"], hard["status"]) == (0, NOT_KEPT)
    assert (soft["solved"], soft["status"]) == (1, GIVEN_UP)
    assert soft["violation_believed"] > 0.001


def test_limits_are_judged_however_they_are_treated(sea):
    """The rest of a plan that coasts at 5 m/s breaks the speed limit of 4 m/s by a quarter, in either problem."""
    found = []
    for formulation in ("hard", "elastic"):
        changed = treated(sea, formulation)
        planner = Planner(build_problem(changed, build_vehicle(changed)), "compiled")
        start = np.zeros((2, 3))
        start[0, 0], start[1, 1] = 100.0, 5.0
        data = draw(sea, 1)[0].data
        limits = planner._binding.limit_parameters(data)
        parameters = planner._binding.objective_parameters(data)
        coasting = gbt.ocp.FlatTrajectory(planner.problem.period, start, np.zeros((3, 3)))
        found.append(Judge(planner)(coasting, parameters, limits))
    for judged in found:
        # SpeedLimit measures the square of the speed: 25/16 - 1
        assert judged.classes[LimitClass.CERTAIN] == pytest.approx(found[0].classes[LimitClass.CERTAIN], rel=1e-12)
        assert judged.classes[LimitClass.CERTAIN] > 0.2
        assert judged.between == pytest.approx(max(judged.classes.values()))


def test_random_problems_lie_at_the_distance_of_the_start(sea):
    problems = draw(sea, 40)
    away = np.linalg.norm(problems.start[:, 0, :2] - problems.mean[:, 0], axis=1)
    assert np.all((away > 0.59 * 33.0) & (away < 1.61 * 33.0))
    assert away.max() > 1.3 * 33.0


@pytest.mark.long
def test_the_report_has_classes_closed_loops_and_a_verdict(done):
    text = (done.folder / "report.md").read_text(encoding="utf-8")
    assert "## Table classes" in text
    assert "## Table at_a_distance" in text
    for row in done.tables["at_a_distance"]:
        assert row["plans"] == 5
        assert (
            row["answered_first"]
            + row["fallbacks_shifted"]
            + row["fallbacks_cold"]
            + row["fallbacks_unfinished"]
            + row["fallbacks_braking"]
            == 5
        )
    for row in done.tables["classes"]:
        # between the nodes of pieces beyond the first, which are planned again before they are followed
        assert not row["thrust_broken"] or row["thrust_worst"] < 0.03
    said = [line for line in done.verdict if "(table at_a_distance)" in line]
    assert len(said) == 3  # two pairs, and which to prefer
    assert "the least error: " in said[-1]
    # nothing is said of a pair that was not compared
    assert not any(line.startswith("exchange, compiled: solved no problem") for line in done.verdict)
