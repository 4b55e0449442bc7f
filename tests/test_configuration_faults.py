"""Wrong configurations: every fault is one line with file, key, what was found and what is allowed."""

import copy
import json
import math
import pickle
import re
from typing import Annotated

import pytest
import yaml
from mutations import VARIANTS
from pydantic import TypeAdapter, ValidationError

from gbt_ocp.experiments.config.allowed import allowed, with_sizes
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.keys import Section
from gbt_ocp.experiments.config.loading import load_config

PARAMETERS = {
    "mass": 116.0,
    "inertia": 13.1,
    "added_mass": [-167.6, -477.2, -15.9],
    "linear_drag": [26.9, 35.8, 3.5],
    "quadratic_drag": [241.3, 503.8, 76.9],
}


# Every key, by what is derived


def keys(section, path=()):
    """Key paths of a loaded section, each with its declaration."""
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if isinstance(value, Section):
            yield from keys(value, (*path, name))
        else:
            yield (*path, name), field


def every_key():
    """Every key of every kind of a section: path, declaration, a configuration that has it, sizes of its problem."""
    found = {}
    for name in ("case2", "case5", "recorded"):
        for overrides in [*VARIANTS, ["target.kind=turning"], [f"vehicle={{parameters: {PARAMETERS}}}"]]:
            try:
                configuration = load_config(name, overrides)
            except ConfigurationError:  # a helix in the plane, three thrusters in space
                continue
            tree, d = configuration.to_mapping(), configuration.dimension
            for path, field in keys(configuration):
                kind = tree[path[0]].get("kind") if isinstance(tree[path[0]], dict) else None
                found.setdefault((kind, *path), (path, field, tree, {"d": d, "n": d + 1}))
    return list(found.values())


TEXTS = (("name",), ("problem",), ("target", "path"), ("replay", "mapping"))
"""Keys for which a text is no value of another type."""


def test_every_key_refuses_a_value_of_another_type_and_says_what_is_allowed():
    entries = every_key()
    assert len({path for path, *_ in entries}) > 120
    for path, field, tree, sizes in entries:
        if path in TEXTS:
            continue
        spoilt = copy.deepcopy(tree)
        section = spoilt
        for part in path[:-1]:
            section = section[part]
        section[path[-1]] = "no such value"
        with pytest.raises(ConfigurationError) as caught:
            load_config(spoilt)
        head = f'configuration: {".".join(path)}: found "no such value"; allowed: '
        lines = [line for line in caught.value.faults if line.startswith(head)]
        if path[-1] != "kind":  # the kinds of all sections that may stand there
            assert lines == [head + with_sizes(allowed(field), sizes)]
        else:
            assert allowed(field).split(", ")[0] in lines[0]


BOUNDS = re.compile(r"numbers?(?: (>=?) ([\d.e-]+)| in ([\[(])([\d.]+), ([\d.]+)([\])])| from (\d+) to (\d+))$")


def bounds(text):
    """Each bound in the words for a number, whether it belongs to what is allowed, and the direction inwards."""
    sign, number, left, low, high, right, first, last = BOUNDS.search(text).groups()
    if sign:
        yield float(number), sign == ">=", 1.0
    if left:
        yield from ((float(low), left == "[", 1.0), (float(high), right == "]", -1.0))
    if first:
        yield from ((float(first), True, 1.0), (float(last), True, -1.0))


def test_the_bounds_in_words_are_those_of_the_check():
    """Read back from the words, without the declaration that they are derived from."""
    judged = 0
    for path, field, *_ in every_key():
        text = allowed(field)
        if not BOUNDS.search(text) or field.json_schema_extra:
            continue
        whole, several = "whole" in text, "list" in text or "{" in text
        check = TypeAdapter(Annotated[field.annotation, *field.metadata, "as declared"])
        for bound, inclusive, inwards in bounds(text):
            step = 1 if whole else 1e-6
            for value, fits in ((bound, inclusive), (bound + inwards * step, True), (bound - inwards * step, False)):
                number = int(value) if whole else value
                try:
                    check.validate_python([number] if several else number, strict=True)
                    accepted = True
                except ValidationError:
                    accepted = False
                assert accepted is fits, (path, text, number)
                judged += 1
    assert judged > 150


# What no single type shows: key path, what is written, a part of what is allowed

FAULTS = [
    # strict types, finite numbers
    ("sensor.period_s", {"sensor": {"period_s": True}}, "a number > 0"),
    ("sensor.period_s", {"sensor": {"period_s": math.inf}}, "a number > 0"),
    ("sensor.noise_deg", {"sensor": {"noise_deg": math.nan}}, "a number >= 0"),
    ("tracker.window", {"tracker": {"window": 20.5}}, "a whole number >= 2"),
    ("planner.solver_options", {"planner": {"solver_options": {"tol": math.inf}}}, "finite numbers"),
    # keys that do not exist, sections that are none
    ("sensor.noise_rad", {"sensor": {"noise_rad": 0.1}}, "period_s, noise_deg"),
    ("planner.gama", {"planner": {"gama": 0.9}}, "pieces, form, thrust"),
    ("vehicle.start.yaw", {"vehicle": {"start": {"yaw": 0.5}}}, "yaw_deg"),
    ("guidance.hold_s", {"guidance": {"kind": "static", "hold_s": 1.0}}, "kind"),
    ("target.turn_rate_step", {"target": {"turn_rate_step": 0.05}}, "kind"),
    ("plan", {"plan": {}}, "name, problem, preset"),
    ("7", {7: 1}, "name, problem, preset"),
    ("sensor", {"sensor": 3}, "a mapping with the keys period_s"),
    ("sensor", {"sensor": None}, "a mapping with the keys period_s"),
    # kinds
    ("guidance.kind", {"guidance": {"kind": ["static"]}}, "constant_force, fim_placement, helical, planner, random"),
    ("vehicle.kind", {"vehicle": {"kind": "problem"}}, "fossen (problem case2 makes no vehicle)"),
    ("target.kind", {"target": {"kind": "submarine"}}, "case1, case2, case3, case4, case5, case6, problem, track"),
    ("target.kind", {"target": {"kind": "case5"}}, "case1, case2, case3, problem, track, turning (the problem has 2"),
    ("target.kind", {"target": {"kind": "problem"}}, "track, turning (problem case2 makes no target)"),
    # sizes of the problem
    ("tracker.prior.position", {"tracker": {"prior": {"position": [1.0], "std": 1.0}}}, "2 numbers"),
    ("tracker.prior.position", {"tracker": {"prior": {"std": 1.0}}}, "2 numbers"),
    ("guidance.force", {"guidance": {"kind": "constant_force", "force": [1.0, 2.0]}}, "3 numbers"),
    ("vehicle.thrust_max", {"problem": "case5", "vehicle": {"thrust_max": [5000, 5000, 1500]}}, "4 numbers > 0"),
    ("vehicle.thrust_max", {"vehicle": {"thrust_max": [5000, 0, 1500]}}, "3 numbers > 0"),
    ("vehicle.start.position_m", {"vehicle": {"start": {"position_m": [1, 2, 3]}}}, "null, or 2 numbers"),
    ("planner.kappa", {"planner": {"kappa": -2.0}}, "a number > -2"),
    ("limits.depth", {"limits": {"depth": {"lowest_m": -9.0, "highest_m": -1.0}}}, "null in 2 dimensions"),
    ("desired_bearing.axis", {"desired_bearing": {"axis": [0, 0, 1]}}, "nothing in 2 dimensions"),
    # values that belong together
    ("desired_bearing.axis", {"problem": "case5", "desired_bearing": {"axis": [0, 0, 0]}}, "not all zero"),
    ("desired_bearing", {"desired_bearing": {"m": 10, "period_s": 20.0}}, "exactly one of m, period_s"),
    ("desired_bearing", {"desired_bearing": {"m": None}}, "exactly one of m, period_s"),
    ("tracker.prior", {"tracker": {"prior": {"position": [0, 0]}}}, "exactly one of std, covariance"),
    (
        "tracker.prior",
        {"tracker": {"prior": {"position": [0, 0], "std": 1.0, "covariance": [[1, 0], [0, 1]]}}},
        "exactly one of std, covariance",
    ),
    *(
        (
            "tracker.prior.covariance",
            {"tracker": {"prior": {"position": [0, 0], "covariance": covariance}}},
            "symmetric positive definite 2 x 2",
        )
        for covariance in ([[1.0, 0.5], [0.4, 1.0]], [[1.0, 2.0], [2.0, 1.0]], [[1.0]])
    ),
    (
        "vehicle.parameters.added_mass",
        {"vehicle": {"parameters": {**PARAMETERS, "added_mass": [167.6, 477.2, 15.9]}}},
        "3 numbers, with mass (inertia in yaw) minus each of them > 0",
    ),
    ("planner.period_s", {"planner": {"period_s": 0.25}}, "null, or a whole multiple of sensor.period_s = 0.1"),
    ("planner.pieces", {"planner": {"period_s": 0.5}}, "at most tracker.forecast = 11 sampling periods"),
    ("planner.pieces", {"planner": {"pieces": 12}}, "a whole number from 1 to tracker.forecast = 11 (p <= n)"),
    ("planner.pieces", {"tracker": {"forecast": 4}}, "a whole number from 1 to tracker.forecast = 4 (p <= n)"),
    ("planner.continuity", {"planner": {"degree": 3, "continuity": 3}}, "from 1 to planner.degree - 1 = 2"),
    ("duration_s", {"duration_s": 0}, "a number of at least two sampling periods"),
    ("duration_s", {"duration_s": 0.15}, "at least two sampling periods, 0.2 s"),
    ("limits.range", {"limits": {"range": {}}}, "at least one of nearest_m, farthest_m"),
    ("limits.range.nearest_m", {"limits": {"range": {"nearest_m": 3, "farthest_m": 2}}}, "a number < farthest_m = 2"),
    (
        "limits.range.margin_m",
        {"limits": {"range": {"nearest_m": 3, "farthest_m": 5, "margin_m": 1.0}}},
        "a number < 1, half of what lies between the limits",
    ),
    ("limits.range.margin_m", {"limits": {"range": {"farthest_m": 5, "margin_m": 6.0}}}, "a number < 2.5, half"),
    ("limits.keep_out", {"limits": {"keep_out": [{"radius_m": 2.0}]}}, "centre_m and radius_m, or with corners_m"),
    (
        "limits.keep_out.1.radius_m",
        {"limits": {"keep_out": [{"centre_m": [0, 0], "radius_m": 2}, {"centre_m": [0, 0], "radius_m": 0}]}},
        "a number > 0",
    ),
    # texts and files
    ("name", {"name": "a/b"}, "letters, digits"),
    ("problem", {"problem": "case7"}, "case1, case2"),
    ("problem", {"problem": "missing.py"}, "a path to an existing .py file"),
    ("problem", {"problem": 2}, "case1, case2"),
    ("target.path", {"target": {"kind": "track"}}, "an existing CSV file"),
    ("target.path", {"target": {"kind": "track", "path": "missing.csv"}}, "a CSV file with the columns t,x,y"),
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
