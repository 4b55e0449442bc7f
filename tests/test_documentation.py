"""What the documents say is so: examples run, commands parse, names exist, tables are complete."""

import ast
import importlib
import importlib.util
import itertools
import re
import shlex
import sys
import types
from pathlib import Path

import pytest
import yaml

from gbt_ocp.cli import parser as command_line
from gbt_ocp.experiments.build.loop import build_problem, build_vehicle
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.ocp.codegen.options import CompiledOptions
from gbt_ocp.ocp.solvers.base import options_for
from gbt_ocp.ocp.solvers.ipopt import IpoptSolver

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
DOCUMENTS = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for path in [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
}
PAPER = DOCUMENTS["docs/paper.md"]


def blocks(text, language):
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def cells(line):
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


def rows(text, heading):
    """Cells of the table whose header line is ``heading``."""
    lines = text.splitlines()
    below = lines[lines.index(heading) + 2 :]
    return [cells(line) for line in itertools.takewhile(lambda line: line.startswith("|"), below)]


# README


def test_readme_has_two_commands_and_the_continuous_integration_runs_the_second():
    outside = re.sub(r"^```.*?^```$", "", README, flags=re.DOTALL | re.MULTILINE)
    commands = [line.strip() for line in outside.splitlines() if line.startswith("    ")]
    assert len(commands) == 2
    assert commands[0].endswith(" && .venv/bin/gbt-ocp run case2")
    assert commands[1].endswith(" && .venv/bin/pytest")
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    assert commands[1] in script
    assert script.index("set -euo pipefail") < script.index(commands[1])


def test_readme_python_blocks_run_one_after_the_other(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    module = types.ModuleType("readme")
    monkeypatch.setitem(sys.modules, "readme", module)
    found = blocks(README, "python")
    assert len(found) == 2
    for block in found:
        exec(compile(block, "README.md", "exec"), module.__dict__)
    assert module.result.summary["error_settled"] < 0.1
    assert Path("runs/mine/summary.json").is_file()
    # The plan of the second block is what the text beside it says.
    assert module.plan.status == "solved"
    assert module.plan(4.0) == pytest.approx([2.0, 0.0], abs=0.01)
    away = module.plan.endpoints - [1.0, 0.1]
    assert (away**2).sum(axis=1).min() > 0.49**2
    assert abs(module.plan.endpoints[:, 1]).max() > 0.3


@pytest.mark.parametrize("name", DOCUMENTS)
def test_yaml_blocks_are_configurations(name):
    for block in blocks(DOCUMENTS[name], "yaml"):
        load_config(yaml.safe_load(block))
    assert name != "README.md" or blocks(README, "yaml")


SUBCOMMANDS = tuple(command_line.SUBCOMMANDS)
PLACEHOLDERS = {"$case": "1", "$seed": "0"}


@pytest.mark.parametrize("name", DOCUMENTS)
def test_commands_parse(name):
    indented = re.findall(r"^ {4}.*?\bgbt-ocp (.*)$", DOCUMENTS[name], re.MULTILINE)
    for line in [*indented, *re.findall(r"`gbt-ocp ([^`]*)`", DOCUMENTS[name])]:
        for placeholder, value in PLACEHOLDERS.items():
            line = line.replace(placeholder, value)
        words = shlex.split(re.split(r";| > ", line)[0])
        if words[0] in ("--version", "-v"):
            continue
        assert words[0] in SUBCOMMANDS
        if len(words) == 1 or "--help" in words:  # a subcommand that is merely named
            continue
        arguments = command_line.parser().parse_args(words)
        if not hasattr(arguments, "set"):  # a study has no configuration
            continue
        # Words in capitals stand for what a reader puts in.
        overrides = [text for text in arguments.set if not re.search(r"\b[A-Z]{3,}\b", text)]
        configs = arguments.config if isinstance(arguments.config, list) else [arguments.config]
        for config in filter(None, configs):  # a sweep that is taken up needs none
            load_config(source(config, (ROOT / name).parent), overrides=overrides)


def solver_options():
    """Every mapping that a document gives ``planner.solver_options``, with its document."""
    for name, text in DOCUMENTS.items():
        for mapping in re.findall(r"solver_options`?(?: may hold[^{]*|: |=|, for example `)(\{[^`]*\})`", text):
            yield pytest.param(yaml.safe_load(mapping), id=f"{name} {mapping}")


def test_solver_options_are_documented():
    assert len(list(solver_options())) >= 4


@pytest.mark.parametrize("options", list(solver_options()))
def test_documented_solver_options_are_those_of_a_solver(options):
    problem = problem_of_case2()
    refused = []
    for solver in ("compiled", "ipopt"):
        own = options_for(solver, options)
        try:
            CompiledOptions.checked(own, problem.pieces) if solver == "compiled" else IpoptSolver(problem, own)
        except ValueError as fault:
            refused.append(str(fault))
    # those of one solver are not known to the other, unless each stands under the solver's name
    assert len(refused) <= (0 if set(options) <= {"compiled", "ipopt"} else 1), refused


def problem_of_case2():
    configuration = load_config("case2")
    return build_problem(configuration, build_vehicle(configuration))


def test_getting_started_activates_the_environment_before_the_first_command_that_needs_it():
    text = DOCUMENTS["docs/getting-started.md"]
    commands = [line.strip() for line in text.splitlines() if re.match(r" {4}gbt-ocp|.venv/bin/|pip |source ", line)]
    assert commands[:2] == ["source .venv/bin/activate", "pip install ."]
    assert all(not line.startswith(".venv") for line in commands)
    assert sum(line.startswith("gbt-ocp") for line in commands) >= 7


def source(config, folder):
    """A file of the tutorials, or what stands for a reader's own."""
    if not config.endswith((".yaml", ".py")):
        return config
    return next((found for found in (folder / config, ROOT / config) if found.is_file()), {})


@pytest.mark.parametrize("name", DOCUMENTS)
def test_links_lead_to_files_of_a_reasonable_size(name):
    for target in re.findall(r"\]\(([^)#]+)\)", DOCUMENTS[name]):
        if not target.startswith("https://"):
            path = (ROOT / name).parent / target
            assert path.is_file(), target
            assert path.suffix != ".png" or path.stat().st_size < 300_000


# The paper


def cited():
    """Equation labels that the package cites."""
    text = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "gbt_ocp").rglob("*.py"))
    return set(re.findall(r"``(eq\w+|like1|op_bearings)``", text))


def test_every_equation_the_code_cites_is_in_the_document_of_the_paper():
    assert len(cited()) > 15
    assert cited() <= set(re.findall(r"`(\w+)`", PAPER))


def test_every_label_of_the_paper_is_in_the_document():
    source = ROOT.parent / "shared" / "paper" / "gbt-paper.tex"
    if not source.is_file():
        pytest.skip("the paper's source does not lie beside the checkout")
    labels = set(re.findall(r"\\label\{(eq\w*|like1|op_bearings)\}", source.read_text(encoding="utf-8")))
    written = set(re.findall(r"`(\w+)`", PAPER))
    for prefix, first, last in re.findall(r"`(eq[AB])(\d+)` to `eq[AB](\d+)`", PAPER):
        written |= {f"{prefix}{number}" for number in range(int(first), int(last) + 1)}
    assert labels <= written


def resolve(name):
    """The object called ``name``, relative to the package."""
    parts = ["gbt_ocp", *name.split(".")]
    for cut in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:cut]))
        except ModuleNotFoundError:
            continue
        for part in parts[cut:]:
            found = getattr(found, part)
        return found
    raise AssertionError(name)


def test_what_implements_an_equation_exists():
    names = [name for *_, where in rows(PAPER, "| label | what | where |") for name in re.findall(r"`([^`]+)`", where)]
    assert len(names) > 35
    for name in names:
        resolve(name)


def test_every_misprint_has_its_row_and_its_test():
    table = rows(PAPER, "| | paper | here | test |")
    assert [row[0] for row in table] == [f"E{number}" for number in range(1, 18)]
    tests = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").glob("test_*.py"))
    for number, *_, test in table:
        assert test.startswith(f"`test_{number.lower()}_")
        assert f"def {test.strip('`')}(" in tests


# The configuration


def keys_page():
    spec = importlib.util.spec_from_file_location("write_keys", ROOT / "docs" / "write_keys.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_the_tables_of_keys_are_those_of_the_models():
    """After a change: ``python docs/write_keys.py``."""
    module = keys_page()
    every = module.keys()
    assert DOCUMENTS["docs/configuration.md"] == module.page(), "run: python docs/write_keys.py"
    assert {module.section_of(key) for key in every} == {module.TOP, *module.TITLES}


def test_the_tables_of_keys_say_which_kinds_have_a_key():
    all_keys = keys_page().keys()
    kinds = {(key.path, key.default): of for key, of in all_keys.items()}
    assert kinds["tracker.jerk_noise", "0.1"] == ["imm_plkf", "imm_ekf", "imm_kf_f"]
    assert kinds["sensor.period_s", "0.1"] == ["one alone"]
    assert kinds["planner.pieces", "5"] == []


def test_every_key_is_read():
    """A key whose name stands nowhere as an attribute or a text is one that does nothing."""
    named = set()
    for path in (ROOT / "gbt_ocp" / "experiments").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Attribute):
                named.add(node.attr)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                named.add(node.value)
    every = keys_page().keys()
    assert [key.path for key in every if key.path.rpartition(".")[2] not in named] == []
