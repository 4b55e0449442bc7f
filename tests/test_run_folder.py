import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import synthetic_run

from gbt_ocp.experiments.result import Result
from gbt_ocp.files import remove_abandoned, whole_folder
from gbt_ocp.reporting import figures
from gbt_ocp.simulation import run_folder
from gbt_ocp.simulation.history import History

HERE = Path(__file__).parent


def result(steps: int = 20) -> Result:
    history = synthetic_run.history(steps=steps)
    return Result(synthetic_run.configuration(2), history, synthetic_run.summary(history))


def python(code: str, *arguments: object) -> subprocess.Popen:
    path = os.pathsep.join([str(HERE), str(HERE.parent), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.Popen(command, env={**os.environ, "PYTHONPATH": path}, stdout=subprocess.PIPE, text=True)


def test_the_final_name_appears_only_when_the_folder_is_whole(tmp_path):
    target = tmp_path / "run"
    with whole_folder(target) as temporary:
        assert temporary.parent == tmp_path
        (temporary / "first").write_text("1")
        assert not target.exists()
    assert (target / "first").read_text() == "1"
    assert [entry.name for entry in tmp_path.iterdir()] == ["run"]


@pytest.mark.parametrize("fault", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_an_exception_leaves_nothing(tmp_path, fault):
    def write_half():
        with whole_folder(tmp_path / "run") as temporary:
            (temporary / "half").write_text("1")
            raise fault

    with pytest.raises(fault):
        write_half()
    assert list(tmp_path.iterdir()) == []


def test_an_exception_while_drawing_leaves_nothing(tmp_path, monkeypatch):
    def fail(*_):
        raise RuntimeError("no ink")

    monkeypatch.setattr(figures, "trajectories", fail)
    with pytest.raises(RuntimeError, match="no ink"):
        result().save(tmp_path / "run")
    assert list(tmp_path.iterdir()) == []


def test_an_occupied_target_is_refused_and_kept(tmp_path):
    target = tmp_path / "run"
    target.mkdir()
    (target / "mine").write_text("precious")
    with pytest.raises(FileExistsError, match="run: the folder exists and is not empty"):
        result().save(target)
    assert [entry.name for entry in target.iterdir()] == ["mine"]
    with pytest.raises(FileExistsError, match="a file of this name exists"):
        result().save(target / "mine")
    assert (target / "mine").read_text() == "precious"
    assert [entry.name for entry in tmp_path.iterdir()] == ["run"]


def test_a_target_that_was_filled_meanwhile_is_refused_and_kept(tmp_path):
    target = tmp_path / "run"

    def be_slower_than_another():
        with whole_folder(target):
            target.mkdir()
            (target / "theirs").write_text("first")

    with pytest.raises(FileExistsError, match="not empty"):
        be_slower_than_another()
    assert [entry.name for entry in tmp_path.iterdir()] == ["run"]
    assert (target / "theirs").read_text() == "first"


def test_an_empty_target_is_taken(tmp_path):
    (tmp_path / "run").mkdir()
    folder = result().save(tmp_path / "run", figures=False)
    assert (folder / "summary.json").exists()


def test_a_run_folder_is_as_open_as_any_other_folder(tmp_path):
    (tmp_path / "plain").mkdir()
    folder = result().save(tmp_path / "run", figures=False)
    assert folder.stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.long
@pytest.mark.skipif(os.name != "posix", reason="SIGKILL is POSIX")
def test_killed_while_writing_leaves_no_run_and_the_next_save_clears_up(tmp_path):
    # The child stops in the middle: history and summary are written, figures are not.
    child = python(
        "import sys, time, test_run_folder as tests\n"
        "from gbt_ocp.reporting import figures\n"
        "def wait(folder):\n"
        "    print('drawing', flush=True)\n"
        "    time.sleep(60)\n"
        "figures.write_figures = wait\n"
        "tests.result().save(sys.argv[1])\n",
        tmp_path / "run",
    )
    assert child.stdout is not None
    assert child.stdout.readline() == "drawing\n"
    (busy,) = tmp_path.iterdir()
    assert busy.name.startswith(".run.partial-")
    assert remove_abandoned(tmp_path / "run") == []  # its writer lives: hands off
    child.kill()
    child.wait()
    child.stdout.close()
    assert [entry.name for entry in tmp_path.iterdir()] == [busy.name]

    (tmp_path / ".other.partial-elsewhere-1-ab").mkdir()  # another run's, from another machine
    result().save(tmp_path / "run", figures=False)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == [".other.partial-elsewhere-1-ab", "run"]


@pytest.mark.long
@pytest.mark.skipif(os.name != "posix", reason="SIGKILL is POSIX")
def test_killed_at_any_moment_every_final_folder_is_whole(tmp_path):
    child = python(
        "import sys, itertools, test_run_folder as tests\n"
        "result = tests.result()\n"
        "print('start', flush=True)\n"
        "for count in itertools.count():\n"
        "    result.save(f'{sys.argv[1]}/run{count}', figures=False)\n",
        tmp_path,
    )
    assert child.stdout is not None
    assert child.stdout.readline() == "start\n"
    deadline = time.monotonic() + 30.0
    while not (tmp_path / "run5").exists() and time.monotonic() < deadline:
        time.sleep(0.003)
    child.send_signal(signal.SIGKILL)
    child.wait()
    child.stdout.close()
    final = [entry for entry in tmp_path.iterdir() if not entry.name.startswith(".")]
    assert len(final) >= 6
    for folder in final:
        assert History.load_npz(folder / "history.npz").t.size == 21
        assert run_folder.read_summary(folder)["steps"] == 20
        assert (folder / "config.yaml").read_text() == synthetic_run.configuration(2).to_yaml()


def test_json_is_strict(tmp_path):
    run_folder.write_summary(
        tmp_path,
        {"a": np.float64("nan"), "b": [np.inf, 1.5], "c": {"d": np.int64(3), "e": np.bool_(True)}, "f": -np.inf},
    )
    text = (tmp_path / "summary.json").read_text()
    assert json.loads(text) == {"a": None, "b": [None, 1.5], "c": {"d": 3, "e": True}, "f": None}
    assert "NaN" not in text
    assert "Infinity" not in text
    with pytest.raises(TypeError):
        run_folder.write_summary(tmp_path, {"a": object()})


def test_a_damaged_summary_says_which_file(tmp_path):
    (tmp_path / "summary.json").write_text("{")
    with pytest.raises(ValueError, match=r"summary\.json: not valid JSON"):
        run_folder.read_summary(tmp_path)
    (tmp_path / "summary.json").write_text("[]")
    with pytest.raises(ValueError, match="found list; allowed: a JSON object"):
        run_folder.read_summary(tmp_path)
