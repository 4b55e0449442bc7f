import json
import os
import subprocess
import sys
import tempfile
import types
from importlib.metadata import version
from pathlib import Path
from typing import ClassVar

import pytest

from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.config.faults import ConfigurationError


class Result:
    """A finished run in place of the simulation."""

    undrawable = False
    others: ClassVar = {}
    clipped = 0

    def __init__(self, configuration, violation=0.0):
        self.configuration = configuration
        self.summary = {
            "error_settled": 0.0123456,
            "violation_max": violation,
            "steps": 300,
            "retries": {"clipped": self.clipped},
        }

    def save(self, out, figures):
        out = Path(out)
        if figures and self.undrawable:
            raise ValueError("no such colour")
        out.mkdir(parents=True, exist_ok=True)
        (out / "config.yaml").write_text(self.configuration.to_yaml())
        (out / f"figures-{figures}").touch()


@pytest.fixture
def runs(monkeypatch, tmp_path):
    """Record the calls of the run, and work in an empty folder."""
    monkeypatch.chdir(tmp_path)
    module = types.ModuleType("gbt_ocp.experiments.run")
    module.calls, module.violation, module.fails = [], 0.0, None

    def run(configuration, progress):
        module.calls.append((configuration, progress))
        if module.fails is not None:
            raise module.fails
        return Result(configuration, module.violation)

    module.run = run
    monkeypatch.setitem(sys.modules, "gbt_ocp.experiments.run", module)
    return module


def test_run_writes_the_folder_and_prints_the_summary(runs, capsys):
    arguments = ["run", "case2", "--set", "planner.formulation=hard", "preset=paper", "--set", "seed=1", "--seed", "4"]
    assert cli.main([*arguments, "--no-figures"]) == 0
    (configuration, progress), folder = runs.calls[0], Path("runs/case2-paper-hard-seed4")
    assert progress is True
    assert (configuration.planner.formulation, configuration.preset, configuration.seed) == ("hard", "paper", 4)
    assert (folder / "figures-False").exists()
    assert (folder / "config.yaml").read_text() == configuration.to_yaml()
    out, err = capsys.readouterr()
    assert "error_settled              0.01235 m\n" in out
    assert out.endswith(f"\n{folder}\n")
    assert err == ""


def test_default_folders_are_never_reused(runs):
    for name in ("case1-default-penalty-seed0", "case1-default-penalty-seed0-2", "case1-default-penalty-seed0-3"):
        assert cli.main(["run", "case1", "--quiet"]) == 0
        assert (Path("runs") / name / "figures-True").exists()
    assert [progress for _, progress in runs.calls] == [False] * 3


def test_out_may_be_new_or_empty_only(runs, capsys):
    assert cli.main(["run", "case1", "--out", "new/deep"]) == 0
    assert Path("new/deep/config.yaml").exists()
    Path("empty").mkdir()
    assert cli.main(["run", "case1", "--out", "empty"]) == 0
    capsys.readouterr()
    Path("file").touch()
    for taken in ("new/deep", "file"):
        assert cli.main(["run", "case1", "--out", taken]) == 2
        out, err = capsys.readouterr()
        assert err == f"--out: found {taken}, which is not an empty folder; allowed: a new or empty folder\n"
        assert out == ""
    assert len(runs.calls) == 2


def test_a_folder_that_cannot_be_written_is_wrong_input(runs, capsys):
    Path("file").touch()
    assert cli.main(["run", "case1", "--out", "file/below"]) == 2
    assert capsys.readouterr().err.startswith("--out: found file/below, which cannot be written")


def test_wrong_input_is_one_line_a_fault_and_no_traceback(runs, capsys):
    Path("bad.yaml").write_text("planner: {gamma: 2}\nsensor: {noise_rad: 1}\n")
    assert cli.main(["run", "bad.yaml", "--set", "seed=-1"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert sorted(line.split(": found")[0] for line in err.splitlines()) == [
        "--set: seed",
        "bad.yaml: planner.gamma",
        "bad.yaml: sensor.noise_rad",
    ]
    assert runs.calls == []
    assert not Path("runs").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["run", "nowhere"], "nowhere: found no such file; allowed: case1"),
        (["run", "case1", "--seed", "-1"], "found '-1'; allowed: a whole number >= 0"),
        (["run"], "CONFIG"),
        (["fly"], "invalid choice: 'fly'"),
        ([], "SUBCOMMAND"),
        (["run", "case1", "--fast"], "unrecognized arguments: --fast"),
    ],
)
def test_wrong_arguments_are_one_line(runs, capsys, arguments, says):
    assert cli.main(arguments) == 2
    out, err = capsys.readouterr()
    assert says in err
    assert len(err.splitlines()) == 1
    assert out == ""


@pytest.mark.parametrize(("violation", "code"), [(0.0, 0), (1e-10, 0), (2e-9, 3), (0.5, 3), (None, 3)])
def test_a_broken_limit_is_exit_3_and_the_folder_is_kept(runs, capsys, violation, code):
    runs.violation = violation
    assert cli.main(["run", "case1", "--out", "kept"]) == code
    assert Path("kept/config.yaml").exists()
    assert ("broken" in capsys.readouterr().err) is (code == 3)


def test_thrust_that_had_to_be_clipped_is_exit_3(runs, capsys, monkeypatch):
    monkeypatch.setattr(Result, "clipped", 2)
    assert cli.main(["run", "case1", "--out", "kept"]) == 3
    assert capsys.readouterr().err == "the thrust limits were kept only by clipping, in 2 steps\n"
    assert Path("kept/config.yaml").exists()


@pytest.mark.parametrize("fault", [OSError(28, "No space left on device"), OSError(30, "Read-only file system")])
def test_a_disk_that_cannot_be_written_does_not_cost_a_finished_result(runs, capsys, monkeypatch, tmp_path, fault):
    save = Result.save

    def saved(self, out, figures):
        if Path(out) == Path("asked"):
            raise fault
        save(self, out, figures)

    monkeypatch.setattr(Result, "save", saved)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    assert cli.main(["run", "case1", "--out", "asked"]) == 2
    out, err = capsys.readouterr()
    (kept,) = tmp_path.glob("gbt-ocp-*")
    assert (kept / "config.yaml").is_file()
    assert err == f"--out: asked cannot be written ({fault.strerror}); the results are in {kept}\n"
    assert out.endswith(f"\n{kept}\n")


def test_a_folder_that_another_run_filled_meanwhile_is_left_alone(runs, capsys, monkeypatch):
    save = Result.save

    def saved(self, out, figures):
        if Path(out).name == "asked":
            raise FileExistsError(f"{out}: the folder exists and is not empty")
        save(self, out, figures)

    monkeypatch.setattr(Result, "save", saved)
    assert cli.main(["run", "case1", "--out", "asked"]) == 2
    assert Path("asked-2/figures-True").exists()
    assert "the results are in asked-2" in capsys.readouterr().err


def test_figures_that_cannot_be_drawn_do_not_cost_the_results(runs, capsys, monkeypatch):
    monkeypatch.setattr(Result, "undrawable", True)
    assert cli.main(["run", "case1", "--out", "kept"]) == 1
    assert sorted(path.name for path in Path("kept").iterdir()) == ["config.yaml", "figures-False"]
    out, err = capsys.readouterr()
    assert err == "figures: not drawn (ValueError: no such colour); the results are kept\n"
    assert out.endswith("\nkept\n")


@pytest.mark.parametrize("given", [None, "3"])
def test_linear_algebra_has_one_thread_unless_the_user_says_otherwise(given):
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
    environment = {key: value for key, value in os.environ.items() if key not in names}
    if given is not None:
        environment |= dict.fromkeys(names, given)
    # The value at the moment numpy is first looked for is the one that counts.
    script = (
        "import os, sys\n"
        "class Watch:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'numpy':\n"
        f"            print(*(os.environ.get(key) for key in {names}))\n"
        "sys.meta_path.insert(0, Watch())\n"
        "import gbt_ocp.cli.main\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=Path(__file__).parents[1],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == [given or "1"] * 3


def test_interruption_is_exit_4(runs, capsys):
    runs.fails = KeyboardInterrupt()
    assert cli.main(["run", "case1", "--out", "none"]) == 4
    assert "interrupted" in capsys.readouterr().err
    assert not Path("none").exists()


def test_a_fault_of_the_program_is_exit_1_with_a_traceback(runs, capsys):
    runs.fails = RuntimeError("broken inside")
    assert cli.main(["run", "case1"]) == 1
    err = capsys.readouterr().err
    assert "Traceback" in err
    assert "RuntimeError: broken inside" in err


def test_a_run_may_refuse_the_configuration_too(runs, capsys):
    runs.fails = ConfigurationError(["case1: planner.solver: found compiled; allowed: ipopt"])
    assert cli.main(["run", "case1"]) == 2
    assert capsys.readouterr().err == "case1: planner.solver: found compiled; allowed: ipopt\n"


def test_schema_is_json(capsys):
    assert cli.main(["schema"]) == 0
    tree = json.loads(capsys.readouterr().out)
    assert "planner" in tree["properties"]
    assert tree["$schema"].startswith("https://json-schema.org/")


def test_list_names_everything_with_a_description(capsys):
    assert cli.main(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    titles = [line for line in lines if line and not line.startswith(" ")]
    assert titles == ["problems", "configurations", "trackers", "guidance laws", "vehicles", "solvers"]
    entries = [line.split(maxsplit=1) for line in lines if line.startswith("  ")]
    assert all(len(entry) == 2 for entry in entries)
    names = [name for name, _ in entries]
    assert names.count("case1") == names.count("recorded") == 2
    assert {"gp", "planner", "static", "constant_force", "random", "ipopt"} <= set(names)


def test_one_list_is_shown_alone(capsys):
    assert cli.main(["list", "vehicles"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "vehicles"
    assert [line.split()[0] for line in lines[1:]] == ["falcon", "bluerov2_heavy", "torpedo2d", "torpedo3d", "vessel"]


def test_help_is_exit_0(capsys):
    assert cli.main(["--help"]) == 0
    assert "run one experiment" in capsys.readouterr().out


@pytest.mark.parametrize("option", ["--version", "-v"])
def test_the_version_is_that_of_the_package(capsys, option):
    assert cli.main([option]) == 0
    assert capsys.readouterr().out == f"gbt-ocp {version('gbt_ocp')}\n"


def test_a_fault_before_the_run_shows_no_progress_bar(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text("t,own_x,own_y,bearing_deg\n0,0,0,x\n")
    Path("bad.yaml").write_text("planner: {gamma: 2}\n")
    Path("own.py").write_text("from problems import none\n")
    wrong = (
        ["run", "bad.yaml"],
        ["run", "own.py"],
        ["run", "case2", "--set", "planner.solver_options={no_such: 1}"],
        ["replay", "log.csv", "--bearing-from", "x"],
        ["replay", "missing.csv", "--bearing-from", "x"],
        ["sweep", "bad.yaml", "--runs", "2"],
        ["compare", "bad.yaml"],
        ["compare", "case2", "--formulations", "none"],
    )
    for arguments in wrong:
        assert cli.main(arguments) == 2, arguments
        out, err = capsys.readouterr()
        assert out == ""
        assert all("; allowed" in line for line in err.splitlines()), err
