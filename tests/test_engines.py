"""Engines: workers that die, that cannot be started, and that run nothing of the folder they are started in."""

import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path

import pytest

from gbt_ocp.experiments.sweep.engines import SAFE_PATH, Processes
from gbt_ocp.experiments.sweep.task_folder import TaskFolder
from gbt_ocp.files import whole_file

ROOT = Path(__file__).resolve().parents[1]
COMMAND = ["sweep", "case1", "--runs", "1", "--set", "duration_s=0.2", "guidance.kind=random", "--quiet"]

needs_proc = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for child processes in /proc")


def workers():
    """Process numbers of the workers of this process."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            if parent == os.getpid() and b"popen_loky" in (entry / "cmdline").read_bytes():
                found.append(int(entry.name))
        except OSError:  # ended meanwhile
            continue
    return found


class Killing:
    """Kills so many workers as soon as they are started, while they are being loaded."""

    def __init__(self, count):
        self.left, self._spared, self._stop = count, workers(), threading.Event()
        self._thread = threading.Thread(target=self._kill)

    def _kill(self):
        while not self._stop.is_set():
            for pid in workers():
                if self.left > 0 and pid not in self._spared:
                    self._spared.append(pid)
                    self.left -= 1
                    os.kill(pid, signal.SIGKILL)
            time.sleep(0.001)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join()


@pytest.fixture
def fresh():
    """No workers are there that could be taken over."""
    from joblib.externals.loky import get_reusable_executor

    get_reusable_executor(1).shutdown(kill_workers=True)


def made(folder, task):
    """The work of a task: a file."""
    with whole_file(folder / f"{task}.txt") as temporary:
        temporary.write_text("made")
    return True


def carried_out(folder, count):
    """Carry out so many tasks with two workers; those that were yielded."""
    tasks = TaskFolder(lambda task: folder / f"{task}.txt", print, partial(made, folder), print)
    return sorted(task for task, _ in tasks.carried_out(range(count), Processes(2)))


@needs_proc
@pytest.mark.parametrize("killed", [1, 100])
def test_workers_killed_while_they_are_loaded_cost_no_task(fresh, tmp_path, capfd, killed):
    with Killing(killed) as killing:
        assert carried_out(tmp_path, 3) == [0, 1, 2]
    assert killing.left < killed
    told = capfd.readouterr().err
    if killed == 1:  # others are started
        assert told == ""
    else:
        assert told.startswith("--jobs: workers die before they begin (A worker process managed by the executor was ")
        assert told.endswith("; the rest is done in this process\n")
        assert len(told.splitlines()) == 1


def test_no_semaphores_is_one_line(tmp_path, monkeypatch, capfd):
    import _multiprocessing

    def read_only(*arguments):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(_multiprocessing, "SemLock", read_only)
    assert carried_out(tmp_path, 3) == [0, 1, 2]
    assert capfd.readouterr().err == (
        "--jobs: workers cannot be started ([Errno 30] Read-only file system); the rest is done in this process\n"
    )


@pytest.mark.long
def test_read_only_shared_memory_is_one_line(tmp_path):
    """A mount of its own, which this process alone sees."""
    script = f"import sys; sys.path.insert(0, {str(ROOT)!r}); from gbt_ocp.cli.program import main; sys.exit(main())"
    mount = ["unshare", "-rm", "sh", "-c", 'mount -t tmpfs -o ro none /dev/shm && exec "$@"', "sh"]
    try:
        subprocess.run([*mount, "true"], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("needs user namespaces")
    done = subprocess.run(
        [*mount, sys.executable, "-c", script, *COMMAND, "--jobs", "2", "--out", str(tmp_path / "sweep")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr == (
        "--jobs: workers cannot be started ([Errno 30] Read-only file system); the rest is done in this process\n"
    )


def test_an_error_of_a_job_ends_the_others_and_is_raised(fresh):
    with pytest.raises(ZeroDivisionError):
        list(Processes(2).map(_divides, [0, 60, 60, 60]))
    assert workers() == []


def _divides(seconds):
    1 / seconds
    time.sleep(seconds)
    return True


DEPENDENCIES = {
    "casadi", "dask", "distributed", "joblib", "matplotlib", "numpy", "pandas", "pydantic", "scipy", "tqdm", "yaml",
}  # fmt: skip


def trapped(folder, names):
    """A folder with modules of these names: each leaves a trace and ends the process that imports it."""
    folder.mkdir()
    for name in names:
        text = f"open({str(folder / 'executed')!r}, 'a').write('{name} '); raise SystemExit(99)\n"
        (folder / f"{name}.py").write_text(text)
    return folder


def script(place):
    """The program as an installed script: Python puts the folder of the script on the path, not the current one."""
    place.mkdir()
    guarded = 'if __name__ == "__main__":\n    raise SystemExit(main())\n'
    (place / "gbt-ocp").write_text(f"from gbt_ocp.cli.program import main\n\n{guarded}")
    return [sys.executable, str(place / "gbt-ocp")]


@pytest.mark.parametrize(
    ("start", "arguments"),
    [
        ("script", [*COMMAND, "--jobs", "2"]),
        ("-m", ["list"]),
        pytest.param("-m", [*COMMAND, "--jobs", "2"], marks=pytest.mark.slow),
        pytest.param("script", [*COMMAND, "--dask", "local"], marks=pytest.mark.slow),
        pytest.param("script", ["reproduce", "fig5", "--runs", "1", "--jobs", "2", "--quiet"], marks=pytest.mark.slow),
        pytest.param(
            "script",
            ["compare", "case2", "--formulations", "hard", "--solvers", "ipopt", "--runs", "1", "--problems", "2",
             "--set", "duration_s=0.4", "planner.pieces=2", "--jobs", "2", "--quiet"],
            marks=pytest.mark.slow,
        ),
    ],
)  # fmt: skip
@pytest.mark.long
def test_nothing_of_the_current_folder_is_executed(tmp_path, start, arguments):
    if "--dask" in arguments:
        pytest.importorskip("distributed")
    # With -m it is Python that looks for the package in this folder first, and for what it needs for that.
    others = () if start == "-m" else sys.stdlib_module_names - {"__main__"} | {"gbt_ocp"}
    here = trapped(tmp_path / "here", DEPENDENCIES.union(others))
    # as installed: the package is on the path of every process
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop(*SAFE_PATH, None)
    command = script(tmp_path / "bin") if start == "script" else [sys.executable, "-m", "gbt_ocp.cli"]
    out = [] if arguments == ["list"] else ["--out", str(tmp_path / "out")]
    done = subprocess.run(
        [*command, *arguments, *out], cwd=here, env=environment, capture_output=True, text=True, check=False
    )
    assert not (here / "executed").exists(), (here / "executed").read_text()
    assert done.returncode == 0, done.stderr
