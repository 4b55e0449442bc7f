"""Runs that differ in their seed alone share the trajectory problem; others do not."""

import gc

import gbt_ocp as gbt
from gbt_ocp.experiments.build.loop import build_loop, build_problem, build_vehicle
from gbt_ocp.guidance.startup import planner_of
from gbt_ocp.ocp.codegen.problem_source import _GENERATED, generate_problem


def problem_of(*overrides, seed=0):
    loop, _ = build_loop(gbt.load_config("case2", ["planner.pieces=3", *overrides], seed=seed))
    return planner_of(loop.guidance).problem


def test_a_problem_is_shared_by_seeds_and_by_nothing_else():
    first = problem_of()
    assert problem_of(seed=7) is first
    assert problem_of("planner.range_pull=0.3") is not first
    assert problem_of("vehicle.thrust_max=[1000.0, 1000.0, 100.0]").vehicle.thrust_max[0] == 1000.0
    # one that learns the current is made anew
    learning = ["vehicle.current=unknown", "vehicle.follow=dynamics"]
    assert problem_of(*learning) is not problem_of(*learning)


def test_what_was_generated_of_a_problem_is_kept_as_long_as_the_problem():
    configuration = gbt.load_config("case2", ["planner.pieces=3"])
    problem = build_problem(configuration, build_vehicle(configuration))
    key, made = id(problem), generate_problem(problem)
    assert generate_problem(problem) is made
    assert key in _GENERATED
    del problem
    gc.collect()
    assert key not in _GENERATED
