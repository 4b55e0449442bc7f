import json
import pickle
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from gbt_ocp.experiments.config.desired_bearing import DesiredBearingSection
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.json_schema import json_schema
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.config.schema import Configuration

PARAMETERS = {
    "mass": 116.0,
    "inertia": 13.1,
    "added_mass": [-167.6, -477.2, -15.9],
    "linear_drag": [26.9, 35.8, 3.5],
    "quadratic_drag": [241.3, 503.8, 76.9],
}
CASES = [f"case{number}" for number in range(1, 7)]


@pytest.mark.parametrize("text", ["1e-10", "1.0e-10", "1E-10", "+1e-10", "0.0000000001", ".1e-9"])
def test_every_spelling_of_a_small_number_is_a_number(tmp_path, text):
    file = tmp_path / "small.yaml"
    file.write_text(f"tracker: {{nugget: {text}}}\n")
    assert load_config(file).tracker.nugget == pytest.approx(1e-10, rel=1e-12)
    assert load_config({}, overrides=[f"tracker.nugget={text}"]).tracker.nugget == pytest.approx(1e-10, rel=1e-12)
    file.write_text(f"tracker: {{nugget: '{text}'}}\n")
    with pytest.raises(ConfigurationError, match=r"tracker\.nugget: found \""):
        load_config(file)


def test_one_line_runs_with_every_default_written_out(tmp_path):
    file = tmp_path / "one line.yaml"
    file.write_text("problem: case2\n")
    configuration = load_config(file)
    assert (configuration.name, configuration.problem, configuration.preset) == ("one-line", "case2", "default")
    assert configuration.target.kind == "case2"
    # the defaults of the keys are those of docs/configuration.md; layers above them fill in nothing but the turn
    for name, field in Configuration.model_fields.items():
        if field.default_factory is not None and name != "desired_bearing":
            assert getattr(configuration, name) == field.default_factory()
    assert configuration.desired_bearing == DesiredBearingSection(m=10)
    file.write_text("# nothing is written\n")
    assert load_config(file) == configuration


def test_three_dimensions_have_the_sizes_of_the_paper():
    configuration = load_config("case5")
    assert configuration.dimension == 3
    assert configuration.tracker.window == 12
    assert configuration.desired_bearing.m == 4
    assert configuration.desired_bearing.axis == (0.0, 0.0, 1.0)
    assert configuration.vehicle.thrust_max == (5000.0, 5000.0, 5000.0, 1500.0)
    assert load_config("case5", overrides=["planner.kappa=-2.5"]).planner.kappa == -2.5


def test_preset_paper_is_the_papers_tracker_and_planner():
    configuration = load_config("case2", overrides=["preset=paper"])
    tracker = configuration.tracker
    assert (tracker.centre, tracker.amplitude, tracker.nugget, tracker.prior) == ("origin", 1.0, 1e-8, None)
    assert configuration.planner.range_pull == 0.02  # a tenth of the default: none at all loses the target
    assert configuration.planner.pieces == 5


PROBLEM = """
from gbt_ocp.experiments.config.tracking_problem import TrackingProblem
from gbt_ocp.models.targets import case_target
from gbt_ocp.models.vehicles import PlanarPointMass

problem = TrackingProblem(
    name="mine", dimension=2, description="mine",
    target=lambda: case_target(1), vehicle=PlanarPointMass,
    defaults={"seed": 1, "duration_s": 7.0, "tracker": {"nugget": 1e-3, "window": 9, "forecast": 8}},
)
"""


def test_precedence_from_problem_to_seed(tmp_path):
    (tmp_path / "mine.py").write_text(PROBLEM)
    file = tmp_path / "mine.yaml"
    file.write_text("problem: mine.py\npreset: paper\nduration_s: 8.0\ntracker: {forecast: 9}\n")
    configuration = load_config(file)
    assert configuration.tracker.nugget == 1e-8  # preset over problem
    assert configuration.tracker.window == 9  # problem over defaults
    assert configuration.tracker.forecast == 9  # file over problem
    assert configuration.duration_s == 8.0
    assert configuration.seed == 1
    again = load_config(file, overrides=["seed=2", "duration_s=9", "duration_s=10", "tracker.nugget=1e-5"])
    assert (again.seed, again.duration_s, again.tracker.nugget) == (2, 10.0, 1e-5)
    assert load_config(file, overrides=["seed=2"], seed=3).seed == 3
    # A user's target and vehicle are taken without being asked for, and the path is absolute.
    assert configuration.target.kind == configuration.vehicle.kind == "problem"
    assert configuration.problem == str(tmp_path / "mine.py")
    assert configuration.problem_object.target().dimension == 2


def test_fault_of_a_problems_defaults_names_the_problem(tmp_path):
    (tmp_path / "mine.py").write_text(PROBLEM.replace('"seed": 1', '"seed": "one"'))
    with pytest.raises(ConfigurationError, match=r"mine\.py: seed: found \"one\"; allowed: a whole number"):
        load_config({"problem": str(tmp_path / "mine.py")})


def test_constant_force_is_500_newton_on_each_axis_and_no_moment(tmp_path):
    assert load_config("case2", ["guidance.kind=constant_force"]).guidance.force == (500.0, 500.0, 0.0)
    assert load_config("case5", ["guidance.kind=constant_force"]).guidance.force == (500.0, 500.0, 500.0, 0.0)
    # The thrusters of a user's vehicle are not known.
    (tmp_path / "mine.py").write_text(PROBLEM)
    with pytest.raises(ConfigurationError, match=r"guidance\.force: found nothing"):
        load_config({"problem": str(tmp_path / "mine.py"), "guidance": {"kind": "constant_force"}})


def test_another_kind_or_alternative_replaces_the_weaker_layers_keys(tmp_path):
    file = tmp_path / "c.yaml"
    file.write_text(
        "problem: case3\ntarget: {kind: case3, turn_rate_step: 0.1}\nguidance: {kind: random, hold_s: 2}\n"
        "desired_bearing: {m: 7}\ntracker: {prior: {position: [1, 2], std: 3}}\n"
    )
    overrides = [
        "target.kind=case1",
        "guidance.kind=static",
        "desired_bearing.period_s=20",
        "tracker.prior.covariance=[[4,1],[1,4]]",
    ]
    configuration = load_config(file, overrides)
    assert configuration.target.kind == "case1"
    assert configuration.guidance.kind == "static"
    assert (configuration.desired_bearing.m, configuration.desired_bearing.period_s) == (None, 20.0)
    assert configuration.tracker.prior.std is None
    assert configuration.tracker.prior.position == (1.0, 2.0)
    assert configuration.tracker.prior.covariance == ((4.0, 1.0), (1.0, 4.0))


def write_track(folder: Path, columns: str = "t,x,y", seconds: float = 40.0) -> Path:
    times = np.arange(0.0, seconds + 0.5, 1.0)
    path = folder / "boat.csv"
    rows = [columns, *(",".join(f"{t * (k + 1):.3f}" if k else f"{t:.3f}" for k in range(3)) for t in times)]
    path.write_text("\n".join(rows) + "\n")
    return path


def test_track_path_is_relative_to_the_file_then_to_the_current_folder(tmp_path, monkeypatch):
    beside, current = tmp_path / "beside", tmp_path / "current"
    beside.mkdir()
    current.mkdir()
    write_track(current)
    file = beside / "c.yaml"
    file.write_text("problem: case2\ntarget: {kind: track, path: boat.csv}\n")
    monkeypatch.chdir(current)
    assert load_config(file).target.path == str(current / "boat.csv")
    write_track(beside)
    assert load_config(file).target.path == str(beside / "boat.csv")


def test_track_faults(tmp_path):
    track = {"kind": "track", "path": str(write_track(tmp_path))}
    with pytest.raises(ConfigurationError, match=r"duration_s: found 39.*; allowed: at most 38\.9 s"):
        load_config({"target": track, "duration_s": 39})
    assert load_config({"target": track, "duration_s": 38.9}).target.start_m is None
    with pytest.raises(ConfigurationError, match=r"allowed: at most 18\.9 s"):
        load_config({"target": track | {"time_scale": 0.5}, "duration_s": 30})
    with pytest.raises(ConfigurationError, match=r"target\.start_m: found \[1\]; allowed: null, or 2 numbers"):
        load_config({"target": track | {"start_m": [1]}})
    write_track(tmp_path, columns="time,x,y")
    with pytest.raises(ConfigurationError, match=r"target\.path: .*columns time, x, y.*allowed: .*t,x,y"):
        load_config({"target": track})


RESOLVED = [
    *((case, [f"preset={preset}", f"planner.formulation={form}"]) for case in CASES
      for preset, form in (("default", "penalty"), ("paper", "hard"))),
    ("case2", ["tracker.prior={position: [1, 2], std: 3}", "tracker.amplitude=2", "tracker.length_scale=1e-1"]),
    ("case2", ["tracker.prior={position: [1, 2], covariance: [[4, 1], [1, 4]]}", "name='1e5'"]),
    ("case3", ["target.turn_rate_step=0.05", "desired_bearing.period_s=20", "guidance.kind=random"]),
    ("case4", ["guidance.kind=constant_force", "desired_bearing.axis=[0, 1, 0]", "vehicle.start.position_m=[1,2,3]"]),
    ("case1", [f"vehicle.parameters={json.dumps(PARAMETERS)}", "planner.solver_options={ipopt.tol: 1e-7, a: [x, 1]}"]),
]  # fmt: skip


@pytest.mark.parametrize(("case", "overrides"), RESOLVED)
def test_the_resolved_configuration_loads_again_as_the_same(tmp_path, case, overrides):
    configuration = load_config(case, overrides, seed=11)
    file = tmp_path / "config.yaml"
    file.write_text(configuration.to_yaml())
    again = load_config(file)
    assert again == configuration
    assert again.to_yaml() == configuration.to_yaml()
    assert load_config(configuration.to_mapping()) == configuration
    # Any YAML reader sees the same values.
    assert yaml.safe_load(configuration.to_yaml()) == configuration.to_mapping()


def test_the_resolved_configuration_of_a_users_problem_loads_from_elsewhere(tmp_path, monkeypatch):
    (tmp_path / "mine.py").write_text(PROBLEM)
    write_track(tmp_path)
    monkeypatch.chdir(tmp_path)
    configuration = load_config({"problem": "mine.py", "target": {"kind": "track", "path": "boat.csv"}})
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "config.yaml").write_text(configuration.to_yaml())
    monkeypatch.chdir(elsewhere)
    assert load_config("config.yaml") == configuration


def test_configuration_is_frozen_and_pickles():
    configuration = load_config("case2")
    with pytest.raises(ValueError, match="frozen"):
        configuration.seed = 3
    with pytest.raises(ValueError, match="frozen"):
        configuration.planner.gamma = 0.5
    assert pickle.loads(pickle.dumps(configuration)) == configuration


def test_a_mapping_is_not_changed_and_numpy_numbers_are_numbers():
    written = {"seed": np.int64(3), "vehicle": {"thrust_max": np.array([1.0, 2.0, 3.0])}}
    configuration = load_config(written)
    assert configuration.seed == 3
    assert configuration.vehicle.thrust_max == (1.0, 2.0, 3.0)
    assert set(written) == {"seed", "vehicle"}


def leaves(node: dict, tree: dict, path: str = ""):
    """Every key of the schema with its description, unions and references followed."""
    if "$ref" in node:
        node = tree["$defs"][node["$ref"].rpartition("/")[2]]
    for branch in node.get("anyOf", []):
        yield from leaves(branch, tree, path)
    for key, value in node.get("properties", {}).items():
        yield f"{path}{key}", value
        yield from leaves(value, tree, f"{path}{key}.")


def test_schema_describes_every_key_and_allows_no_other():
    tree = json_schema()
    text = json.dumps(tree)
    assert '"required"' not in text
    assert '"oneOf"' not in text
    for node in [tree, *tree["$defs"].values()]:
        assert node["additionalProperties"] is False
    described = dict(leaves(tree, tree))
    assert all(value.get("description") for value in described.values())

    def keys(mapping, path=""):
        for key, value in mapping.items():
            yield f"{path}{key}"
            if isinstance(value, dict) and key != "solver_options":
                yield from keys(value, f"{path}{key}.")

    for case, overrides in RESOLVED:
        assert set(keys(load_config(case, overrides).to_mapping())) <= set(described)
    assert "in degrees" in described["sensor.noise_deg"]["description"]
    assert "Allowed: a number in (0, 1]." in described["planner.gamma"]["description"]
    assert list(tree["properties"]) == list(Configuration.model_fields)


def test_legs_of_a_slow_vehicle_are_as_long_as_those_of_a_fast_one() -> None:
    """In metres: 24 across the line of sight, and for the desired bearing 12 s at 3 m/s round the target."""
    slow = ["desired_bearing.target_speed=0.3", "limits.speed=0.7"]
    for overrides in (["vehicle.parameters=bluerov2_heavy", *slow], slow):
        found = load_config("sea2d", overrides=overrides)
        assert found.guidance.startup_speed < 0.7, "it keeps its own limit while it crosses"
        assert found.guidance.startup_speed * found.guidance.startup_leg_s == pytest.approx(24.0, abs=0.5)
        assert (0.7 - 0.3) * found.desired_bearing.reverse_s == pytest.approx(36.0, abs=0.5)
    weak = load_config("sea2d", overrides=["vehicle.parameters=bluerov2_heavy", "desired_bearing.target_speed=0.3"])
    assert weak.guidance.startup_speed < 0.84, "what its thrusters keep up, without a limit of its speed"
    told = load_config("sea2d", overrides=[*slow, "guidance.startup_leg_s=9", "desired_bearing.reverse_s=null"])
    assert (told.guidance.startup_leg_s, told.desired_bearing.reverse_s) == (9.0, None), "what is written stands"
    fast, at_once = load_config("sea2d"), load_config("case2", overrides=["limits.speed=0.7"])
    assert (fast.guidance.startup_speed, fast.guidance.startup_leg_s, fast.desired_bearing.reverse_s) == (
        3.0,
        8.0,
        8.0,
    )
    assert at_once.guidance.startup_speed == 3.0, "it does not cross"


@pytest.mark.parametrize(
    ("idle", "beside", "words"),
    [
        ("planner.degree=3", "planner.form=shooting", "planner.form: flat"),
        ("planner.continuity=1", "planner.form=shooting", "planner.form: flat"),
        ("planner.thrust=linear", None, "planner.form: shooting"),
        ("planner.steps=2", None, "planner.form: shooting"),
        ("planner.kappa=2", "planner.objective=fisher_trace", "planner.objective: similarity"),
        ("planner.stages=3", None, "planner.objective: motion_logdet or motion_trace"),
        ("planner.weight=3", "planner.formulation=hard", "planner.formulation: penalty"),
        ("guidance={kind: planner, startup_speed: 2}", None, "guidance.startup_deviation above 0"),
        ("limits.weight=5", None, "one of the limits"),
        ("limits.separation_m=5", None, "vehicles"),
        ("link.loss=0.5", None, "vehicles"),
        ("plant.current_time_s=30", None, "plant.current_std above 0"),
    ],
)
def test_a_key_that_something_else_leaves_without_effect_is_refused(idle, beside, words):
    changes = [idle] if beside is None else [idle, beside]
    with pytest.raises(ConfigurationError, match=rf": found .*; allowed: only with {re.escape(words)}.*without effect"):
        load_config("case2", changes)


def test_what_a_problem_or_a_default_says_is_no_key_without_effect():
    load_config("sea2d", ["guidance.startup_deviation=0"])  # which has a startup_speed of its own
    load_config("case2", ["planner.form=shooting", "planner.degree=2"])
    load_config("case2", ["limits.speed=2", "limits.weight=3", "planner.weight=3"])
    for name in ("torpedo2d", "sea2d_two"):
        loaded = load_config(name)
        assert load_config(loaded.to_mapping()) == loaded
