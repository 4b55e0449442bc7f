import json

import pytest

from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.sweep.sweep_plan import SweepPlan, plan_sweep, read_axis, read_entries, variant


def overrides(plan):
    return [entry.overrides for entry in plan.variants]


def test_runs_are_variants_times_seeds_in_order():
    plan = plan_sweep("case1", runs=3, seed_from=5, grid={"planner.pieces": [4, 5], "planner.gamma": [0.9, 1.0]})
    assert overrides(plan) == [
        {"planner.pieces": pieces, "planner.gamma": gamma} for pieces in (4, 5) for gamma in (0.9, 1.0)
    ]
    runs = list(plan.runs())
    assert len(runs) == len(plan) == 12
    assert [run.number for run in runs] == list(range(12))
    assert [run.seed for run in runs] == [5, 6, 7] * 4
    assert runs[-1].identifier == "000011"
    one = runs[4].configuration
    assert (one.seed, one.planner.pieces, one.planner.gamma) == (6, 4, 1.0)
    assert one == load_config("case1", overrides=["planner.pieces=4", "planner.gamma=1.0"], seed=6)


def test_a_grid_over_problems_takes_each_problems_own_defaults():
    plan = plan_sweep("case2", runs=1, grid={"problem": ["case1", "case6"]})
    assert [entry.configuration.target.kind for entry in plan.variants] == ["case1", "case6"]
    assert plan.variants[1].configuration.tracker.window == 12


def test_entries_take_every_point_of_the_grid_and_overrides_hold_for_all():
    plan = plan_sweep(
        "case1",
        runs=1,
        grid={"planner.pieces": [4, 5]},
        entries=[{"guidance.kind": "static"}, {"guidance.kind": "random"}],
        overrides=["duration_s=2.0"],
    )
    assert [tuple(entry.values()) for entry in overrides(plan)] == [
        ("static", 4),
        ("static", 5),
        ("random", 4),
        ("random", 5),
    ]
    assert {entry.configuration.duration_s for entry in plan.variants} == {2.0}


def test_a_plan_comes_back_from_its_file():
    plan = plan_sweep("case3", runs=2, grid={"tracker.prior": [None, {"position": [0.0, 0.0], "std": 3.0}]})
    again = SweepPlan.from_json(plan.to_json())
    assert again == plan
    assert again.to_json() == plan.to_json()


@pytest.mark.parametrize("text", ["[]", "{}", '{"format": 7}', "no json"])
def test_what_is_no_plan_is_refused(text):
    with pytest.raises(ValueError):  # noqa: PT011  # the callers only need a line
        SweepPlan.from_json(text)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ({"runs": 0}, "runs: found 0"),
        ({"runs": 1, "seed_from": -1}, "seed_from: found -1"),
        ({"runs": 1, "grid": {"planner.gamma": []}}, "grid: planner.gamma: found []"),
        ({"runs": 1, "grid": {"seed": [1, 2]}}, "seed: found among the changed keys"),
        ({"runs": 1, "grid": {"planner.gamma": [0.9, 2.0]}}, "--set: planner.gamma: found 2.0"),
        ({"runs": 1, "grid": {"planner.gama": [0.9]}}, "did you mean gamma"),
        ({"runs": 1, "entries": []}, "entries: found none"),
    ],
)
def test_a_wrong_sweep_is_one_line(arguments, line):
    with pytest.raises(ConfigurationError) as caught:
        plan_sweep("case1", **arguments)
    assert len(caught.value.faults) == 1
    assert line in caught.value.faults[0]


def test_a_variant_may_be_labelled_otherwise():
    made = variant("case1", {"guidance.kind": "static"}, labels={"mode": "anchored"})
    assert made.overrides == {"mode": "anchored"}
    assert made.configuration.guidance.kind == "static"


def test_axes_are_yaml():
    assert read_axis("planner.pieces=5,10") == ("planner.pieces", [5, 10])
    assert read_axis("vehicle.start.position_m=[1, 0],null") == ("vehicle.start.position_m", [[1, 0], None])
    assert read_axis("tracker.nugget=1e-10,tuned") == ("tracker.nugget", [1e-10, "tuned"])
    for text in ("planner.pieces", "planner.pieces=", "=1", "planner.pieces=[1"):
        with pytest.raises(ConfigurationError, match="--grid: found"):
            read_axis(text)


def test_lists_are_mappings_nested_or_not(tmp_path):
    path = tmp_path / "list.yaml"
    path.write_text("- {planner.pieces: 4}\n- {planner: {pieces: 5, gamma: 0.9}}\n")
    assert read_entries(path) == [{"planner.pieces": 4}, {"planner.pieces": 5, "planner.gamma": 0.9}]
    for text in ("{planner.pieces: 4}", "[]", "- 3", "- {a: 1, a: 2}", "["):
        path.write_text(text)
        with pytest.raises(ConfigurationError):
            read_entries(path)
    with pytest.raises(ConfigurationError, match="cannot be read"):
        read_entries(tmp_path / "none.yaml")


def test_the_plan_is_plain_json():
    assert json.loads(plan_sweep("case1", runs=1).to_json())["variants"][0]["configuration"]["problem"] == "case1"
