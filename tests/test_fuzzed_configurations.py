"""Configurations spoilt at random are refused in clear lines, or can be built and run: nothing in between."""

import math
import warnings
from collections import Counter

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mutations import bases, mappings, overrides, texts

from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.build import loop as build
from gbt_ocp.experiments.build.desired import build_desired_bearing
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.sweep.sweep_plan import plan_sweep, read_axis, read_entries

LONGEST_LINE = 1500
FOREIGN = ("pydantic", "validation error", "Traceback", "errno", "object at 0x")


def check_lines(faults):
    """Each fault is one line that says where, what was found and what is allowed."""
    assert faults
    for line in faults:
        assert line.isprintable(), line
        assert "found" in line, line
        assert "allowed: " in line or "missing: " in line, line
        assert len(line) < LONGEST_LINE, line
        assert not any(word in line for word in FOREIGN), line


def build_parts(configuration):
    """Everything of a run but its solver, which takes seconds to compile."""
    streams = build.Streams.of(configuration.seed)
    vehicle = build.build_vehicle(configuration)
    target = build.build_target(configuration, streams.target)
    sensor = build.build_sensor(configuration)
    start = build.build_start(configuration, vehicle, streams.start, target.position(0.0))
    assert np.all(np.isfinite(start))
    tracker = build.build_tracker(configuration.tracker, start[0, : configuration.dimension], sensor)
    desired = build.paced(configuration, build_desired_bearing(configuration, vehicle), vehicle)
    if configuration.guidance.kind == "planner":
        build.build_problem(configuration, vehicle)
    else:
        build.build_guidance(configuration, vehicle, desired, streams.guidance, tracker)


def outcome(load):
    """``refused`` or ``accepted``; anything else is an assertion or an exception."""
    try:
        configuration = load()
    except ConfigurationError as fault:
        check_lines(fault.faults)
        return "refused"
    try:
        build_parts(configuration)
    except ValueError as fault:  # gbt_ocp.run puts the name of the configuration before it
        check_lines([f"{configuration.name}: {fault}"])
        return "refused"
    return "accepted"


def fuzz(strategy, judged, examples):
    counts = Counter()

    @settings(
        max_examples=examples, deadline=None, database=None, derandomize=True, suppress_health_check=list(HealthCheck)
    )
    @given(strategy)
    def once(drawn):
        counts[judged(drawn)] += 1

    once()
    print(dict(counts))
    return counts


def few_and_many(few, many):
    return pytest.mark.parametrize("examples", [few, pytest.param(many, marks=pytest.mark.slow)])


@few_and_many(150, 4000)
@pytest.mark.long
def test_changed_values_and_keys(examples):
    counts = fuzz(mappings(), lambda tree: outcome(lambda: load_config(tree)), examples)
    assert min(counts["refused"], counts["accepted"]) > 0.15 * examples


@pytest.mark.long
@few_and_many(100, 3000)
def test_damaged_text(tmp_path, examples):
    path = tmp_path / "spoilt.yaml"

    def judged(text):
        path.write_bytes(text)
        return outcome(lambda: load_config(path))

    counts = fuzz(texts(), judged, examples)
    assert counts["refused"] > 0.3 * examples
    assert counts["accepted"] > 0.05 * examples


@pytest.mark.long
@few_and_many(100, 3000)
def test_set_lines(examples):
    counts = fuzz(overrides(), lambda pair: outcome(lambda: load_config(*pair)), examples)
    assert min(counts["refused"], counts["accepted"]) > 0.05 * examples


@few_and_many(60, 500)
def test_sweeps(tmp_path, examples):
    """A grid and a list of variants, as ``gbt-ocp sweep`` reads them."""
    path = tmp_path / "list.yaml"

    def judged(drawn):
        grid, lines, text = drawn
        path.write_bytes(text if text is not None else "".join(f"- {{{line}}}\n" for line in lines).encode())
        try:
            axis = dict([read_axis(grid)])
            plan = plan_sweep("case2", runs=2, grid=axis, entries=read_entries(path))
        except ConfigurationError as fault:
            check_lines(fault.faults)
            return "refused"
        assert len(plan) >= 2
        return "accepted"

    keys = st.sampled_from(
        ["tracker.window", "duration_s", "planner.nodes"] * 8 + ["seed", "tracker", "sensor.period_s"]
    )
    some = st.sampled_from(["5", "7", "12", "20"] * 15 + ["0.1", "-1", "gp", "{kind: ekf}", ".nan", "[1", "1e30"])
    grids = st.tuples(keys, st.lists(some, min_size=1, max_size=2).map(",".join)).map("=".join)
    entries = st.lists(
        st.sampled_from(["tracker.forecast: 12", "tracker: {forecast: 20}"] * 12 + ["x: 1", "a"]),
        min_size=1,
        max_size=2,
    )
    grids = st.one_of(grids, grids, grids, grids, st.text(max_size=8))
    lists = st.integers(0, 5).flatmap(lambda k: texts() if k == 0 else st.none())
    counts = fuzz(st.tuples(grids, entries, lists), judged, examples)
    assert min(counts["refused"], counts["accepted"]) > 0.05 * examples


def shortened(tree, law):
    """A configuration of three steps, with this guidance where it planned; ``None`` if that is too much for a test."""
    try:
        found = load_config(tree)
        period = found.period_s
        changes = [f"duration_s={3 * period}", *([f"guidance.kind={law}"] if found.guidance.kind == "planner" else [])]
        found = load_config(found.to_mapping(), changes)
        build_parts(found)
    except ValueError:
        return None
    size = max(found.tracker.window, found.tracker.forecast, found.planner.pieces * found.planner.nodes)
    thrust = max(getattr(found.vehicle, "thrust_max", None) or (0.0,))
    return found if size <= 200 and period < 100.0 and thrust < 1e6 else None


def run_and_judge(configuration, folder):
    """Run it as the command line does; the exit code, with the states of the vehicle checked."""
    folder.mkdir()
    (folder / "c.yaml").write_text(configuration.to_yaml(), encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # what the user is warned of is no failure
        code = cli.main(["run", str(folder / "c.yaml"), "--quiet", "--no-figures", "--out", str(folder / "out")])
    assert code in (0, 2, 3), configuration.to_yaml()
    assert (folder / "out").exists() == (code != 2)
    if code != 2:
        with np.load(folder / "out" / "history.npz") as arrays:
            for name in ("vehicle_pose", "vehicle_velocity", "target"):
                assert np.all(np.isfinite(arrays[name])), configuration.to_yaml()
    return code


@few_and_many(20, 300)
def test_what_is_accepted_runs(tmp_path, examples, capsys):
    """Three steps under random thrust, of those that are small enough."""
    number = iter(range(10**9))

    def judged(tree):
        found = shortened(tree, "random")
        if found is None:
            return "not run"
        return run_and_judge(found, tmp_path / str(next(number)))

    counts = fuzz(mappings(), judged, examples)
    assert counts[0] >= 0.1 * examples


@pytest.mark.slow
def test_what_is_accepted_can_be_planned_for(tmp_path, capsys):
    number = iter(range(10**9))

    def judged(tree):
        found = shortened(tree, "planner")
        if found is None or found.guidance.kind != "planner" or found.planner.solver == "ipopt":
            return "not run"
        return run_and_judge(found, tmp_path / str(next(number)))

    counts = fuzz(mappings(), judged, 60)
    assert counts[0] > 0


TOO_LARGE = "or a number of a size from 1e-30 to 1e+12"
FOUND = [
    # each ended in an exception, or filled the memory, before it was refused
    (["tracker.window=10000000000000000000"], "tracker.window", TOO_LARGE),
    (["tracker.window=1000000000"], "tracker.window", "at most 10000"),
    (["tracker.forecast_period_s=5.0e-324"], "tracker.forecast_period_s", TOO_LARGE),
    (["planner.period_s=1.7e+308"], "planner.period_s", TOO_LARGE),
    (["vehicle.start.box_m=1.7e+308"], "vehicle.start.box_m", TOO_LARGE),
    (["tracker.prior={position: [0, 0], std: 1.7e+308}"], "tracker.prior.std", TOO_LARGE),
    (["limits.keep_out=[{corners_m: [[1.7e+308, 0], [1, 1], [0, 1]]}]"], "limits.keep_out.0.corners_m", TOO_LARGE),
    (["tracker={kind: motion_gp, bin_s: 1.0e-9}"], "tracker.window_s", "at most 2000 bins"),
    (["tracker={kind: motion_gp, window_s: 1.0e+9}"], "tracker.window_s", "at most 2000 bins"),
    (["tracker={kind: motion_gp, window_s: 3.0}"], "tracker.window_s", "at least 4 bins"),
    (["guidance={kind: random, hold_s: 1.0e-9}"], "guidance.hold_s", "at least sensor.period_s / 1000"),
    (["duration_s=1.0e+7", "sensor.period_s=0.1"], "duration_s", "at most 10000000 sampling periods"),
    (["seed=!!int ''"], "--set seed", "YAML"),
    (["seed=!!timestamp x"], "--set seed", "YAML"),
    (["a\nb=1"], "a\\nb", "name, problem"),
    ([f"seed={'[' * 1000}"], "--set seed", "YAML"),
    ([f"problem={'a' * 3000}"], "problem", "a path to an existing .py file"),
    ([f"problem={'a' * 3000}.py"], "problem", "a path to an existing .py file"),
    (['problem="a\\0.py"'], "problem", "a path to an existing .py file"),
    (["problem=~nobody-of-this-name/x.py"], "problem", "a path to an existing .py file"),
    ([f"target={{kind: track, path: {'a' * 3000}}}"], "target.path", "a CSV file with the columns"),
    (['target={kind: track, path: "\\0"}'], "target.path", "a CSV file with the columns"),
]


@pytest.mark.parametrize(("overrides", "where", "allowed"), FOUND)
def test_what_the_fuzz_found_is_refused_in_one_line(overrides, where, allowed):
    with pytest.raises(ConfigurationError) as caught:
        load_config("case2", overrides)
    check_lines(caught.value.faults)
    (line,) = caught.value.faults
    assert where in line
    assert allowed in line


@pytest.mark.parametrize("name", ["a" * 3000, "\0", "~nobody-of-this-name/x", "\ud800.yaml"])
def test_a_name_that_no_file_can_have_is_no_such_file(name):
    with pytest.raises(ConfigurationError, match="found no such file") as caught:
        load_config(name)
    check_lines(caught.value.faults)


def test_a_track_too_short_is_refused_where_null_is_written_out():
    resolved = load_config("recorded").to_mapping()
    assert resolved["tracker"]["forecast_period_s"] is None
    with pytest.raises(ConfigurationError, match="the track lasts 12 s"):
        load_config(resolved, ["target.time_scale=0.1"])


def test_turns_that_cannot_be_drawn_are_refused():
    tiny = load_config("sea2d", ["target={kind: turning, hold_s: [1.0e-9, 1.0e-9]}"])
    with pytest.raises(ValueError, match=r"target: found a motion of 320 s; allowed: at most 0.001 s"):
        build.build_target(tiny)


@pytest.mark.long
def test_the_bases_are_right_and_reach_every_section():
    trees = bases()
    assert len(trees) > 200
    for tree in trees:
        load_config(tree)
    for section, union in (("tracker", 13), ("guidance", 7)):
        assert len({tree[section]["kind"] for tree in trees if "kind" in tree.get(section, {})}) == union
    assert all(math.isfinite(tree.get("duration_s", 1.0)) for tree in trees)
