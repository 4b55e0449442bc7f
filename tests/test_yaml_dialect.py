"""YAML as the configuration reads it: texts that look like something else, and aliases that stand for too much."""

import itertools
import tracemalloc
from collections import defaultdict

import pytest
import yaml
from test_configuration_faults import every_key

from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.config import yaml_dialect as dialect
from gbt_ocp.experiments.config.allowed import holds_texts
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.config.schema import is_text
from gbt_ocp.experiments.sweep.plan import plan_sweep, read_axis, read_entries

LOOK_ALIKES = ["2024-05-01", "007", "1e5", "1.0", "no", "on", "True", "0x1F", "1_000", "-3", "0b11", "2024"]


@pytest.mark.parametrize("name", LOOK_ALIKES)
def test_a_name_that_looks_like_something_else_is_a_name(tmp_path, name):
    file = tmp_path / "config.yaml"
    file.write_text(f"problem: case2\nname: {name}\n")
    configuration = load_config(file)
    assert configuration.name == load_config("case2", [f"name={name}"]).name == name
    # it is written so that it is read as the same, here and by any other reader
    file.write_text(configuration.to_yaml())
    assert load_config(file) == configuration
    assert yaml.safe_load(configuration.to_yaml())["name"] == name


def test_a_target_whose_file_has_a_date_for_a_name_is_found(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "2024-05-01").write_text("t,x,y\n0,0,0\n20,4,0\n40,8,0\n60,12,0\n")
    (tmp_path / "config.yaml").write_text("target: {kind: track, path: 2024-05-01}\nduration_s: 10\n")
    assert load_config("config.yaml").target.path == str(tmp_path / "2024-05-01")
    dotted = load_config("case2", ["target={kind: track, path: 2024-05-01}", "duration_s=10"])
    assert dotted.target.path == str(tmp_path / "2024-05-01")


def test_every_key_for_texts_takes_them_as_they_stand_and_no_other_key_does():
    judged = defaultdict(list)
    for path, field, *_ in every_key():
        judged[path].append(holds_texts(field))
    paths = {path: all(texts) for path, texts in judged.items()}
    assert {("name",), ("target", "path"), ("planner", "solver"), ("limits", "hard")} <= {p for p in paths if paths[p]}
    for path, texts in paths.items():
        value, _ = dialect.parse("[007, no, 1e5, null]", "", is_text=is_text, at=path)
        assert value == (["007", "no", "1e5", None] if texts else [7, False, 1e5, None]), path
        nested = "".join(f"{'  ' * depth}{part}:\n" for depth, part in enumerate(path[:-1]))
        written = f"{nested}{'  ' * (len(path) - 1)}{path[-1]}: 007\n"
        found, _ = dialect.parse(written, "", is_text=is_text)
        for part in path:
            found = found[part]
        assert found == ("007" if texts else 7), path


def test_one_anchor_may_stand_for_a_text_and_for_a_number():
    value, _ = dialect.parse("name: &x 007\nseed: *x\n", "", is_text=is_text)
    assert value == {"name": "007", "seed": 7}


def test_keys_are_texts():
    value, _ = dialect.parse("{007: a, no: b, 2024-05-01: c, ~: d}", "")
    assert value == {"007": "a", "no": "b", "2024-05-01": "c", "~": "d"}
    configuration = load_config("replay", ["replay.trackers={007: {kind: ekf}, no: {kind: pr}}"])
    assert list(configuration.replay.trackers)[-2:] == ["007", "no"]


def test_merged_mappings_are_still_merged():
    value, _ = dialect.parse("base: &b {name: 007, seed: 3}\nmore: {<<: *b, seed: 4}\n", "")
    assert value["more"] == {"name": 7, "seed": 4}


def test_names_in_a_sweep_are_texts_too(tmp_path):
    key, values = read_axis("name=2024-05-01,007")
    assert values == ["2024-05-01", "007"]
    (tmp_path / "list.yaml").write_text("- {name: 007}\n- name: no\n  planner.pieces: 4\n")
    entries = read_entries(tmp_path / "list.yaml")
    assert entries == [{"name": "007"}, {"name": "no", "planner.pieces": 4}]
    plan = plan_sweep("case2", runs=1, grid={key: values})
    assert [variant.configuration.name for variant in plan.variants] == values


def doubled(last, levels=26):
    """Aliases that stand for 2 to the power of `levels` values, in a few hundred bytes."""
    names = "abcdefghijklmnopqrstuvwxyz"[:levels]
    lines = [f"{here}: &{here} {last % (before, before)}" for before, here in itertools.pairwise(names)]
    return "\n".join(["a: &a {x: 1}", *lines, ""])


BOMBS = {
    "lists": doubled("[*%s, *%s]"),
    "mappings": doubled("{p: *%s, q: *%s}"),
    "merges": doubled("{<<: [*%s, *%s]}"),
}


@pytest.mark.parametrize("kind", BOMBS)
def test_aliases_that_stand_for_too_much_are_refused_in_one_line(tmp_path, capsys, kind):
    file = tmp_path / "many.yaml"
    file.write_text(BOMBS[kind])
    assert len(BOMBS[kind]) < 700
    says = f"{file}: found aliases for more than 100000 values; allowed: fewer"
    tracemalloc.start()
    with pytest.raises(ConfigurationError) as caught:
        load_config(file)
    with pytest.raises(ConfigurationError) as listed:
        read_entries(file)
    assert tracemalloc.get_traced_memory()[1] < 5e6
    tracemalloc.stop()
    assert caught.value.faults == listed.value.faults == [says]
    assert cli.main(["run", str(file)]) == 2
    assert capsys.readouterr().err == f"{says}\n"
    inline = ", ".join(BOMBS[kind].splitlines())
    with pytest.raises(ConfigurationError, match="--set limits: found aliases for more than 100000 values"):
        load_config("case2", [f"limits={{{inline}}}"])


def test_a_long_file_without_aliases_is_read(monkeypatch):
    monkeypatch.setattr(dialect, "MOST_VALUES", 100)
    value, _ = dialect.parse("[" + "1, " * 1000 + "1]", "long")
    assert len(value) == 1001


def test_aliases_within_reason_are_values(tmp_path):
    file = tmp_path / "config.yaml"
    file.write_text("tracker: {prior: {position: &p [1, 2], std: 3}}\nvehicle: {start: {position_m: *p}}\n")
    assert load_config(file).vehicle.start.position_m == (1.0, 2.0)
