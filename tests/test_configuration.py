import json
import math
import pickle
from pathlib import Path

import numpy as np
import pytest
import yaml

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

# key path, what is written (None: the key is not written), problem, a part of what is allowed
FAULTS = [
    ("sensor.period_s", {"sensor": {"period_s": 0.0}}, "a number > 0"),
    ("sensor.period_s", {"sensor": {"period_s": "0.1"}}, "a number > 0"),
    ("sensor.period_s", {"sensor": {"period_s": True}}, "a number > 0"),
    ("sensor.period_s", {"sensor": {"period_s": math.inf}}, "a number > 0"),
    ("sensor.noise_deg", {"sensor": {"noise_deg": -1.0}}, "a number >= 0"),
    ("sensor.noise_deg", {"sensor": {"noise_deg": math.nan}}, "a number >= 0"),
    ("sensor.missed_probability", {"sensor": {"missed_probability": 1.0}}, "[0, 1)"),
    ("sensor.outlier_every_s", {"sensor": {"outlier_every_s": 0}}, "a number > 0"),
    ("sensor.noise_rad", {"sensor": {"noise_rad": 0.1}}, "period_s, noise_deg"),
    ("sensor.period_ms", {"sensor": {"period_ms": 100}}, "period_s, noise_deg"),
    ("sensor", {"sensor": 3}, "a mapping with the keys period_s"),
    ("sensor", {"sensor": None}, "a mapping with the keys period_s"),
    ("tracker.kind", {"tracker": {"kind": "kalman"}}, "gp"),
    ("tracker.window", {"tracker": {"window": 1}}, "a whole number >= 2"),
    ("tracker.window", {"tracker": {"window": 20.5}}, "a whole number >= 2"),
    ("tracker.forecast", {"tracker": {"forecast": 0}}, "a whole number >= 1"),
    ("tracker.kernel", {"tracker": {"kernel": "rbf"}}, "se, matern32, matern52, rq"),
    ("tracker.centre", {"tracker": {"centre": "target"}}, "origin, vehicle"),
    ("tracker.amplitude", {"tracker": {"amplitude": 0.0}}, "tuned, or a number > 0"),
    ("tracker.length_scale", {"tracker": {"length_scale": "fixed"}}, "tuned, or a number > 0"),
    ("tracker.nugget", {"tracker": {"nugget": 0.0}}, "a number > 0"),
    ("tracker.bound_delta", {"tracker": {"bound_delta": 1.5}}, "(0, 1]"),
    ("tracker.prior.position", {"tracker": {"prior": {"position": [1.0], "std": 1.0}}}, "2 numbers"),
    ("tracker.prior.position", {"tracker": {"prior": {"std": 1.0}}}, "2 numbers"),
    ("tracker.prior.std", {"tracker": {"prior": {"position": [0, 0], "std": -3}}}, "a number > 0"),
    ("tracker.prior", {"tracker": {"prior": {"position": [0, 0]}}}, "exactly one of std, covariance"),
    (
        "tracker.prior",
        {"tracker": {"prior": {"position": [0, 0], "std": 1.0, "covariance": [[1, 0], [0, 1]]}}},
        "exactly one of std, covariance",
    ),
    (
        "tracker.prior.covariance",
        {"tracker": {"prior": {"position": [0, 0], "covariance": [[1.0, 0.5], [0.4, 1.0]]}}},
        "symmetric positive definite 2 x 2",
    ),
    (
        "tracker.prior.covariance",
        {"tracker": {"prior": {"position": [0, 0], "covariance": [[1.0, 2.0], [2.0, 1.0]]}}},
        "symmetric positive definite 2 x 2",
    ),
    (
        "tracker.prior.covariance",
        {"tracker": {"prior": {"position": [0, 0], "covariance": [[1.0]]}}},
        "symmetric positive definite 2 x 2",
    ),
    (
        "guidance.kind",
        {"guidance": {"kind": "spiral"}},
        "circumnavigation, constant_force, fim_placement, helical, planner, random, static",
    ),
    (
        "guidance.kind",
        {"guidance": {"kind": ["static"]}},
        "constant_force, fim_placement, helical, planner, random, static",
    ),
    ("guidance.force", {"guidance": {"kind": "constant_force", "force": [1.0, 2.0]}}, "3 numbers"),
    ("guidance.hold_s", {"guidance": {"kind": "random", "hold_s": 0}}, "a number > 0"),
    ("guidance.hold_s", {"guidance": {"kind": "static", "hold_s": 1.0}}, "kind"),
    ("planner.period_s", {"planner": {"period_s": 0.25}}, "null, or a whole multiple of sensor.period_s = 0.1"),
    ("planner.pieces", {"planner": {"period_s": 0.5}}, "at most tracker.forecast = 11 sampling periods"),
    ("limits.range", {"limits": {"range": {}}}, "at least one of nearest_m, farthest_m"),
    ("limits.range.nearest_m", {"limits": {"range": {"nearest_m": 3, "farthest_m": 2}}}, "a number < farthest_m = 2"),
    (
        "limits.range.margin_m",
        {"limits": {"range": {"nearest_m": 3, "farthest_m": 5, "margin_m": 1.0}}},
        "a number < 1, half of what lies between the limits",
    ),
    ("limits.range.margin_m", {"limits": {"range": {"farthest_m": 5, "margin_m": 6.0}}}, "a number < 2.5, half"),
    ("limits.range.margin_m", {"limits": {"range": {"nearest_m": 3, "margin_m": -1.0}}}, "a number >= 0"),
    ("limits.range.confidence", {"limits": {"range": {"nearest_m": 3, "confidence": 1.0}}}, "a number in [0.5, 1)"),
    ("limits.depth", {"limits": {"depth": {"lowest_m": -9.0, "highest_m": -1.0}}}, "null in 2 dimensions"),
    ("limits.keep_out", {"limits": {"keep_out": [{"radius_m": 2.0}]}}, "centre_m and radius_m, or with corners_m"),
    (
        "limits.keep_out.1.radius_m",
        {"limits": {"keep_out": [{"centre_m": [0, 0], "radius_m": 2}, {"centre_m": [0, 0], "radius_m": 0}]}},
        "a number > 0",
    ),
    ("limits.bow_angle_deg", {"limits": {"bow_angle_deg": 180}}, "a number in (0, 180)"),
    ("limits.hard", {"limits": {"hard": ["thrust"]}}, "a list of range, keep_out"),
    ("planner.pieces", {"planner": {"pieces": 12}}, "a whole number from 1 to tracker.forecast = 11 (p <= n)"),
    ("planner.pieces", {"tracker": {"forecast": 4}}, "a whole number from 1 to tracker.forecast = 4 (p <= n)"),
    ("planner.pieces", {"planner": {"pieces": 0}}, "a whole number from 1"),
    ("planner.degree", {"planner": {"degree": 6}}, "from 2 to 5"),
    ("planner.continuity", {"planner": {"degree": 3, "continuity": 3}}, "from 1 to planner.degree - 1 = 2"),
    ("planner.formulation", {"planner": {"formulation": "soft"}}, "penalty, hard"),
    ("planner.nodes", {"planner": {"nodes": 0}}, "a whole number >= 1"),
    ("planner.gamma", {"planner": {"gamma": 0.0}}, "(0, 1]"),
    ("planner.gamma", {"planner": {"gamma": 1.01}}, "(0, 1]"),
    ("planner.width", {"planner": {"width": 0.0}}, "a number > 0"),
    ("planner.weight", {"planner": {"weight": -1.0}}, "a number > 0"),
    ("planner.thrust_units", {"planner": {"thrust_units": "kN"}}, "normalised, newton"),
    ("planner.kappa", {"planner": {"kappa": -2.0}}, "a number > -2"),
    ("planner.range_pull", {"planner": {"range_pull": -0.1}}, "a number >= 0"),
    ("planner.range_reference_m", {"planner": {"range_reference_m": 0}}, "a number > 0"),
    ("planner.solver", {"planner": {"solver": "snopt"}}, "auto, compiled, ipopt"),
    ("planner.solver_options", {"planner": {"solver_options": {"tol": math.inf}}}, "finite numbers"),
    ("planner.gama", {"planner": {"gama": 0.9}}, "pieces, degree"),
    ("desired_bearing.m", {"desired_bearing": {"m": 0}}, "a whole number >= 1"),
    ("desired_bearing.period_s", {"desired_bearing": {"period_s": 0}}, "a number > 0"),
    ("desired_bearing", {"desired_bearing": {"m": 10, "period_s": 20.0}}, "exactly one of m, period_s"),
    ("desired_bearing", {"desired_bearing": {"m": None}}, "exactly one of m, period_s"),
    ("desired_bearing.axis", {"desired_bearing": {"axis": [0, 0, 1]}}, "nothing in 2 dimensions"),
    ("desired_bearing.axis", {"problem": "case5", "desired_bearing": {"axis": [0, 0, 0]}}, "not all zero"),
    ("vehicle.kind", {"vehicle": {"kind": "boat"}}, "fossen, problem"),
    ("vehicle.kind", {"vehicle": {"kind": "problem"}}, "fossen (problem case2 makes no vehicle)"),
    ("vehicle.parameters", {"vehicle": {"parameters": "remus"}}, "falcon, or a mapping with the keys mass"),
    ("vehicle.parameters.mass", {"vehicle": {"parameters": {**PARAMETERS, "mass": 0}}}, "a number > 0"),
    (
        "vehicle.parameters.added_mass",
        {"vehicle": {"parameters": {**PARAMETERS, "added_mass": [167.6, 477.2, 15.9]}}},
        "3 numbers, with mass (inertia in yaw) minus each of them > 0",
    ),
    (
        "vehicle.parameters.linear_drag",
        {"vehicle": {"parameters": {**PARAMETERS, "linear_drag": [1.0]}}},
        "3 numbers >= 0",
    ),
    ("vehicle.thrust_max", {"vehicle": {"thrust_max": [5000, 0, 1500]}}, "3 numbers > 0"),
    ("vehicle.thrust_max", {"problem": "case5", "vehicle": {"thrust_max": [5000, 5000, 1500]}}, "4 numbers > 0"),
    ("vehicle.start.position_m", {"vehicle": {"start": {"position_m": [1, 2, 3]}}}, "null, or 2 numbers"),
    ("vehicle.start.box_m", {"vehicle": {"start": {"box_m": -1}}}, "a number >= 0"),
    ("vehicle.start.yaw", {"vehicle": {"start": {"yaw": 0.5}}}, "yaw_deg"),
    ("vehicle.follow", {"vehicle": {"follow": "loosely"}}, "exact, dynamics"),
    ("target.kind", {"target": {"kind": "submarine"}}, "case1, case2, case3, case4, case5, case6, problem, track"),
    ("target.kind", {"target": {"kind": "case5"}}, "case1, case2, case3, problem, track, turning (the problem has 2"),
    ("target.kind", {"target": {"kind": "problem"}}, "track, turning (problem case2 makes no target)"),
    ("target.turn_rate_step", {"target": {"turn_rate_step": 0.05}}, "kind"),
    ("target.turn_rate_step", {"target": {"kind": "case3", "turn_rate_step": -0.05}}, "a number >= 0"),
    ("target.path", {"target": {"kind": "track"}}, "an existing CSV file"),
    ("target.path", {"target": {"kind": "track", "path": "missing.csv"}}, "a CSV file with the columns t,x,y"),
    ("duration_s", {"duration_s": 0}, "a number of at least two sampling periods"),
    ("duration_s", {"duration_s": 0.15}, "at least two sampling periods, 0.2 s"),
    ("seed", {"seed": -1}, "a whole number >= 0"),
    ("seed", {"seed": 1.5}, "a whole number >= 0"),
    ("preset", {"preset": "fast"}, "default, paper"),
    ("name", {"name": "a/b"}, "letters, digits"),
    ("problem", {"problem": "case7"}, "case1, case2"),
    ("problem", {"problem": "missing.py"}, "a path to an existing .py file"),
    ("problem", {"problem": 2}, "case1, case2"),
    ("plan", {"plan": {}}, "name, problem, preset"),
    ("7", {7: 1}, "name, problem, preset"),
]


@pytest.mark.parametrize(("path", "written", "allowed"), FAULTS)
def test_fault_names_file_key_value_and_allowed(tmp_path, path, written, allowed):
    file = tmp_path / "bad.yaml"
    file.write_text(yaml.safe_dump({"problem": "case2"} | written))
    with pytest.raises(ConfigurationError) as caught:
        load_config(file)
    assert len(caught.value.faults) == 1
    (fault,) = caught.value.faults
    head, _, tail = fault.partition("; allowed: ")
    assert head.startswith(f"{file}: {path}: found ")
    assert allowed in tail
    assert "\n" not in fault
    value = {"problem": "case2"} | written
    for key in path.split("."):
        value = value.get(int(key) if key == "7" else key, None) if isinstance(value, dict) else None
    if isinstance(value, str | int | float) and math.isfinite(float(value) if not isinstance(value, str) else 0):
        assert json.dumps(value) in head or str(value) in head or "unknown key" in head


def test_at_least_25_kinds_of_faults():
    assert len({(path, allowed) for path, _, allowed in FAULTS}) >= 25


@pytest.mark.parametrize(
    ("section", "key", "meant"),
    [
        ("sensor", "noise_rad", "noise_deg"),
        ("sensor", "period_ms", "period_s"),
        ("vehicle", "yaw", "start.yaw_deg"),
        ("tracker", "lengthscale", "length_scale"),
    ],
)
def test_unknown_key_suggests_the_known_one(section, key, meant):
    with pytest.raises(ConfigurationError, match=f"{section}.{key}: found an unknown key; did you mean {meant};"):
        load_config({section: {key: 1.0}})


def test_all_faults_come_at_once_with_their_origins(tmp_path):
    file = tmp_path / "bad.yaml"
    file.write_text("problem: case9\nplanner: {gamma: 2, pieces: 30, foo: 1}\nplanner.x: 1\nseed: 1\nseed: 2\n")
    with pytest.raises(ConfigurationError) as caught:
        load_config(file, overrides=["sensor.period_s=-1", "nonsense"], seed=-3)
    faults = "\n".join(caught.value.faults)
    for start in (
        f"{file}:5: seed: found the key a second time",
        f"{file}: problem: found 'case9'",
        f"{file}: planner.gamma: found 2",
        f"{file}: planner.pieces: found 30",
        f"{file}: planner.foo: found an unknown key",
        f"{file}: planner.x: found an unknown key",
        "--set: sensor.period_s: found -1",
        '--set: found "nonsense"',
        "--seed: seed: found -3",
    ):
        assert start in faults
    assert len(caught.value.faults) == 9
    assert str(caught.value) == faults
    assert pickle.loads(pickle.dumps(caught.value)).faults == caught.value.faults


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ("planner:\n  gamma: [1, 2\nseed: 3\n", 3, "expected ',' or ']'"),
        ("seed: 0\nplanner:\n  gamma: 0.9\n  gamma: 0.8\n", 4, "planner.gamma: found the key a second time"),
        ("seed: 0\ntarget: !!python/object:os.system {}\n", 2, "could not determine a constructor"),
        ("planner: &p\n  solver_options: *p\n", 1, "contains itself"),
        ("seed: 0\n---\nseed: 1\n", 2, "found another document"),
    ],
)
def test_yaml_faults_name_file_and_line(tmp_path, text, line, says):
    file = tmp_path / "bad.yaml"
    file.write_text(text)
    with pytest.raises(ConfigurationError) as caught:
        load_config(file)
    (fault,) = caught.value.faults
    assert fault.startswith(f"{file}:{line}: ")
    assert says in fault


@pytest.mark.parametrize(
    "content", [b"- a\n- b\n", b"word", b"\xff\xfe\xfa", b"seed: \x00"], ids=["list", "word", "binary", "control"]
)
def test_a_file_that_is_no_mapping_is_one_fault(tmp_path, content):
    file = tmp_path / "bad.yaml"
    file.write_bytes(content)
    with pytest.raises(ConfigurationError) as caught:
        load_config(file)
    assert len(caught.value.faults) == 1
    assert str(file) in caught.value.faults[0]
    assert "allowed: " in caught.value.faults[0]


def test_unknown_configuration_lists_the_shipped_ones():
    with pytest.raises(ConfigurationError, match=r"case9: found no such file; allowed: case1, case2"):
        load_config("case9")
    with pytest.raises(ConfigurationError, match="a name, a path, or a mapping"):
        load_config(3)


@pytest.mark.parametrize("text", ["1e-10", "1.0e-10", "1E-10", "+1e-10", "0.0000000001", ".1e-9"])
def test_every_spelling_of_a_small_number_is_a_number(tmp_path, text):
    file = tmp_path / "small.yaml"
    file.write_text(f"tracker: {{nugget: {text}}}\n")
    assert load_config(file).tracker.nugget == pytest.approx(1e-10, rel=1e-12)
    assert load_config({}, overrides=[f"tracker.nugget={text}"]).tracker.nugget == pytest.approx(1e-10, rel=1e-12)
    file.write_text(f"tracker: {{nugget: '{text}'}}\n")
    with pytest.raises(ConfigurationError, match=r"tracker\.nugget: found \""):
        load_config(file)


def test_one_line_runs_with_the_defaults_of_the_design(tmp_path):
    file = tmp_path / "one line.yaml"
    file.write_text("problem: case2\n")
    expected = {
        "name": "one-line",
        "problem": "case2",
        "preset": "default",
        "seed": 0,
        "duration_s": 30.0,
        "target": {"kind": "case2"},
        "sensor": {
            "period_s": 0.1,
            "noise_deg": 0.0,
            "missed_probability": 0.0,
            "outlier_deg": 0.0,
            "outlier_every_s": 10.0,
            "latency_s": 0.0,
        },
        "tracker": {
            "kind": "gp",
            "window": 20,
            "forecast": 11,
            "forecast_period_s": None,
            "kernel": "se",
            "centre": "vehicle",
            "amplitude": "tuned",
            "length_scale": "tuned",
            "nugget": "tuned",
            "noise": "sensor",
            "prior": None,
            "bound_delta": 0.05,
        },
        "guidance": {
            "kind": "planner",
            "startup_deviation": 0.0,
            "startup_speed": 3.0,
            "startup_leg_s": 8.0,
            "startup_opening": 1.2,
        },
        "planner": {
            "pieces": 5,
            "degree": 2,
            "continuity": None,
            "period_s": None,
            "formulation": "penalty",
            "nodes": 4,
            "gamma": 0.98,
            "width": 0.01,
            "weight": 1000.0,
            "thrust_units": "normalised",
            "kappa": 1.0,
            "objective": "similarity",
            "similarity": "signed",
            "range_pull": 0.2,
            "range_reference_m": 1.0,
            "solver": "auto",
            "solver_options": {},
        },
        "limits": {
            "range": None,
            "keep_out": [],
            "depth": None,
            "speed": None,
            "yaw_rate_deg": None,
            "bow_angle_deg": None,
            "hard": [],
            "weight": 100.0,
            "width": 0.01,
            "nodes": 4,
        },
        "desired_bearing": {
            "m": 10,
            "period_s": None,
            "speed_mps": "sensor",
            "target_speed": 1.0,
            "phase": "fixed",
            "axis": None,
        },
        "vehicle": {
            "kind": "fossen",
            "parameters": "falcon",
            "thrust_max": [5000.0, 5000.0, 1500.0],
            "start": {"position_m": None, "range_m": None, "box_m": 5.0, "yaw_deg": 0.0},
            "follow": "exact",
        },
        "replay": {
            "bearing_from": None,
            "latency_s": 0.0,
            "ahead_s": 10.0,
            "score_from_s": 30.0,
            "constant_range_m": [],
            "trackers": {},
        },
    }
    assert load_config(file).to_mapping() == expected
    file.write_text("# nothing is written\n")
    assert load_config(file).to_mapping() == expected


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
