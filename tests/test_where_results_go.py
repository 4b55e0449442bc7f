"""The folder that is asked for: refused before the run, or kept as it is and filled; a finished run is never lost."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import ClassVar

import pytest

from gbt_ocp.cli import folders
from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.files import remove_abandoned, temporary_beside, try_folder, whole_folder

pytestmark = pytest.mark.skipif(os.name != "posix", reason="names and links of POSIX")

LONGEST = os.pathconf("/tmp", "PC_NAME_MAX") if os.name == "posix" else 255


class Result:
    """A finished run in place of the simulation."""

    others: ClassVar = {}
    summary: ClassVar = {"violation_max": 0.0, "retries": {"clipped": 0}}

    def save(self, folder, figures):
        with whole_folder(folder) as temporary:
            (temporary / "summary.json").write_text("{}")
            (temporary / "figures").mkdir()
            (temporary / "figures" / "error.png").touch()


@pytest.fixture
def runs(monkeypatch, tmp_path):
    """Count the runs, work in an empty folder, and have the temporary directory of the system in it."""
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.chdir(work)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    calls = []

    def run(configuration, progress):
        calls.append(configuration)
        return Result()

    monkeypatch.setattr("gbt_ocp.experiments.run.run", run)
    return calls


def out_to(folder):
    return cli.main(["run", "case2", "--quiet", "--out", str(folder)])


def check_filled(folder):
    assert sorted(path.name for path in Path(folder).iterdir()) == ["figures", "summary.json"]
    assert (Path(folder) / "figures" / "error.png").is_file()


@pytest.mark.parametrize("name", ["a" * 230, "a" * LONGEST, "é" * (LONGEST // 2), "x" * 100, "x" * 101])
def test_every_name_that_a_folder_can_have_is_filled(runs, name):
    assert out_to(name) == 0
    check_filled(name)
    assert os.listdir() == [name]  # the bytes as they are


TOO_DEEP = "/".join(["b" * 250] * 20)


@pytest.mark.parametrize("name", ["a" * (LONGEST + 1), "é" * (LONGEST // 2 + 1), f"{'a' * 300}/x", TOO_DEEP, "a\0b"])
def test_a_name_that_no_folder_can_have_is_refused_before_the_run(runs, capsys, name):
    assert out_to(name) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("--out: found ")
    assert "which cannot be written (" in line
    assert len(line) < 200
    assert runs == []
    assert list(Path().iterdir()) == []


def test_a_run_whose_own_name_makes_no_folder_is_refused_before_it(runs, capsys):
    assert cli.main(["run", "case2", "--quiet", "--set", f"name={'n' * 250}"]) == 2
    assert "(File name too long); allowed: a writable folder" in capsys.readouterr().err
    assert runs == []
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize(
    ("out", "says"),
    [
        ("dangling", "which is a symbolic link that leads to no folder; allowed: a new or empty folder"),
        ("loop", "which is a symbolic link that leads to no folder; allowed: a new or empty folder"),
        ("to_file", "which is not an empty folder; allowed: a new or empty folder"),
        ("to_full", "which is not an empty folder; allowed: a new or empty folder"),
        ("dangling/out", "which cannot be written (not a folder); allowed: a writable folder"),
        ("loop/out", "which cannot be written (not a folder); allowed: a writable folder"),
        ("to_file/out", "which cannot be written (not a folder); allowed: a writable folder"),
    ],
)
def test_symbolic_links_that_lead_to_no_place_are_refused_before_the_run(runs, capsys, out, says):
    for name, leads_to in (("dangling", "nowhere"), ("loop", "loop"), ("to_file", "file"), ("to_full", "full")):
        Path(name).symlink_to(leads_to)
    Path("file").touch()
    Path("full").mkdir()
    Path("full/theirs").touch()
    before = sorted(Path().rglob("*"))
    assert out_to(out) == 2
    assert capsys.readouterr().err == f"--out: found {out}, {says}\n"
    assert runs == []
    assert sorted(Path().rglob("*")) == before


def test_what_a_symbolic_link_to_an_empty_folder_leads_to_is_filled(runs):
    Path("empty").mkdir()
    Path("link").symlink_to("empty")
    Path("second").symlink_to("link")
    assert out_to("second") == 0
    assert Path("second").is_symlink()
    check_filled("empty")
    assert sorted(path.name for path in Path().iterdir()) == ["empty", "link", "second"]


def test_an_empty_folder_keeps_its_mode_and_its_identity(runs):
    Path("mine").mkdir(mode=0o750)
    before = Path("mine").stat()
    assert out_to("mine") == 0
    check_filled("mine")
    after = Path("mine").stat()
    assert (after.st_ino, after.st_mode) == (before.st_ino, before.st_mode)


def test_the_current_folder_can_be_filled(runs):
    """A shell that stands in it must not stand in a deleted folder afterwards."""
    before = Path().stat().st_ino
    assert out_to(".") == 0
    check_filled(".")
    assert Path.cwd().stat().st_ino == before == os.stat(".").st_ino
    assert [path.name for path in Path("..").iterdir()] == ["work"]


def test_a_finished_run_whose_long_name_was_taken_meanwhile_goes_to_a_short_one(runs, capsys, monkeypatch, tmp_path):
    """``NAME-2`` would be too long here, and so would anything that repeats the name."""
    name = "a" * LONGEST

    def run(configuration, progress):
        Path(name).mkdir()
        (Path(name) / "theirs").touch()
        return Result()

    monkeypatch.setattr("gbt_ocp.experiments.run.run", run)
    assert out_to(name) == 2
    (kept,) = tmp_path.glob("gbt-ocp-*")
    assert len(kept.name) < 20
    check_filled(kept)
    assert [path.name for path in Path(name).iterdir()] == ["theirs"]
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith(f"the results are in {kept}")


def test_a_run_that_can_be_kept_nowhere_is_one_line(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "missing"))
    (tmp_path / "out").touch()
    monkeypatch.setattr(folders, "MOST_RIVALS", 0)
    with pytest.raises(ConfigurationError, match=r"out, which cannot be written \("):
        folders.save_somewhere(Result(), tmp_path / "out", figures=False)


def test_two_that_fill_one_empty_folder_do_not_mix(tmp_path):
    target = tmp_path / "both"
    target.mkdir()
    with pytest.raises(FileExistsError, match="not empty"), whole_folder(target) as slow:  # noqa: PT012
        (slow / "slow").touch()
        with whole_folder(target) as fast:
            (fast / "fast").touch()
    assert [path.name for path in target.iterdir()] == ["fast"]


def test_a_fault_while_an_empty_folder_is_filled_leaves_it_empty(tmp_path, monkeypatch):
    target, rename = tmp_path / "target", os.rename
    target.mkdir()

    def fail_at_the_second(old, new):
        if Path(new).name == "second":
            raise OSError(5, "Input/output error")
        rename(old, new)

    monkeypatch.setattr(os, "rename", fail_at_the_second)
    with pytest.raises(OSError, match="Input/output"), whole_folder(target) as temporary:  # noqa: PT012
        (temporary / "first").mkdir()
        (temporary / "first" / "file").touch()
        (temporary / "second").touch()
    assert list(target.iterdir()) == []


def test_what_a_killed_process_left_in_an_empty_folder_is_removed_by_the_next(tmp_path, monkeypatch):
    target = tmp_path / ("long" * 40)
    target.mkdir()
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    with monkeypatch.context() as context:
        context.setattr(os, "getpid", lambda: child.pid)
        left = temporary_beside(target / target.name)
    left.mkdir()
    (left / "half").touch()
    try_folder(target)  # it counts as empty
    with whole_folder(target) as temporary:
        assert not left.exists()
        (temporary / "done").touch()
    assert [path.name for path in target.iterdir()] == ["done"]
    assert remove_abandoned(target) == []
