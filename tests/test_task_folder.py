"""Tasks in a folder: made once, made again where they are damaged, and never lost with a worker."""

import os
import signal
import time
from functools import partial
from pathlib import Path

import pytest

from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.sweep.engines import NoWorkersError, Processes, Serial, WorkerDiedError
from gbt_ocp.experiments.sweep.task_folder import TaskFolder, at_work_in, free_name
from gbt_ocp.files import temporaries, whole_file

posix = pytest.mark.skipif(os.name != "posix", reason="kills processes")


def place(folder, task):
    return folder / f"{task}.txt"


def check(folder, task):
    if place(folder, task).read_text(encoding="utf-8") != f"task {task}":
        raise ValueError(f"is not of task {task}")


def work(folder, deadly, home, task):
    """Write the file of a task, or die at it; what is written elsewhere counts the attempts."""
    with whole_file(place(folder, task)) as temporary:
        temporary.touch()
        with (folder / "attempts").open("a", encoding="utf-8") as stream:
            stream.write(f"{task} ")
        if task in deadly:
            assert os.getpid() != home, "carried out in the process of the tests"
            os.kill(os.getpid(), signal.SIGKILL)
        temporary.write_text(f"task {task}", encoding="utf-8")
    return task != 3  # a task may fail and still leave its file


def tasks(folder, deadly=(), lost=None):
    return TaskFolder(
        partial(place, folder), partial(check, folder), partial(work, folder, deadly, os.getpid()), lost or print
    )


def attempts(folder):
    return sorted((folder / "attempts").read_text().split())


def test_what_is_there_is_kept_and_what_is_damaged_is_made_again(tmp_path, capsys):
    there = tasks(tmp_path)
    assert there.pending(range(4)) == [0, 1, 2, 3]
    assert list(there.carried_out([0, 3], Serial())) == [(0, True), (3, False)]
    place(tmp_path, 1).write_text("something else", encoding="utf-8")
    place(tmp_path, 2).mkdir()
    assert capsys.readouterr().err == ""
    assert there.pending(range(4)) == [1, 2]
    first, second = capsys.readouterr().err.splitlines()
    assert first == f"{place(tmp_path, 1)}: damaged (is not of task 1); it is made again"
    assert second.startswith(f"{place(tmp_path, 2)}: damaged (")
    assert list(there.carried_out([1, 2], Serial())) == [(1, True), (2, True)]
    assert there.pending(range(4)) == []


@posix
def test_a_task_that_kills_its_worker_twice_is_lost_and_no_other(tmp_path):
    lost = []
    found = list(tasks(tmp_path, deadly={1}, lost=lost.append).carried_out(range(4), Processes(2)))
    assert lost == [1]
    assert (1, False) in found
    assert [place(tmp_path, task).exists() for task in range(4)] == [True, False, True, True]
    assert attempts(tmp_path).count("1") == 2


class Dies:
    """An engine whose workers die before the first of its tasks, so many times."""

    def __init__(self, times, fault=WorkerDiedError):
        self.times, self.fault = times, fault

    def map(self, function, jobs):
        if self.times:
            self.times -= 1
            raise self.fault("gone")
        yield from Serial().map(function, jobs)


class DyingProcesses(Dies, Processes):
    """The same, on this machine."""


def test_workers_that_die_once_before_they_begin_are_replaced(tmp_path, capsys):
    for engine in (Dies(1), DyingProcesses(1)):
        folder = tmp_path / type(engine).__name__
        folder.mkdir()
        assert len(list(tasks(folder).carried_out(range(3), engine))) == 3
    assert capsys.readouterr().err == ""


def test_workers_that_go_on_dying_are_replaced_by_this_process_or_refused(tmp_path, capsys):
    with pytest.raises(ConfigurationError) as caught:
        list(tasks(tmp_path).carried_out(range(3), Dies(2)))
    assert caught.value.faults == ["found workers that die before they begin (gone); allowed: workers that live"]
    engine = DyingProcesses(2)
    assert len(list(tasks(tmp_path).carried_out(range(3), engine))) == 3
    assert capsys.readouterr().err == "--jobs: workers die before they begin (gone); the rest is done in this process\n"
    engine = DyingProcesses(1, NoWorkersError)
    assert len(list(tasks(tmp_path).carried_out(range(3, 6), engine))) == 3
    assert capsys.readouterr().err == "--jobs: workers cannot be started (gone); the rest is done in this process\n"


def test_workers_that_do_not_see_the_folder_are_refused(tmp_path):
    class Elsewhere:
        def map(self, function, jobs):
            yield jobs[0], True

    with pytest.raises(ConfigurationError, match="--dask: found workers that do not see"):
        list(tasks(tmp_path).carried_out(range(3), Elsewhere()))


def test_a_folder_at_work_is_held_and_left_without_temporary_files(tmp_path):
    (tmp_path / "parts").mkdir()
    left = tmp_path / "parts" / ".1.txt.partial-elsewhere-1-ab.txt"
    left.touch()
    with at_work_in(tmp_path, "go on"):
        with pytest.raises(ConfigurationError, match="another process at work in it"), at_work_in(tmp_path, "go on"):
            pass
        assert left.exists()
    assert not left.exists()
    left.touch()
    with pytest.raises(KeyboardInterrupt), at_work_in(tmp_path, "go on"):
        raise KeyboardInterrupt
    assert left.exists()  # perhaps a worker on another machine writes it
    with pytest.raises(ConfigurationError) as caught, at_work_in(tmp_path, "go on"):
        raise OSError(28, "No space left on device")
    assert caught.value.faults == [
        f"{tmp_path}: cannot be read or written ([Errno 28] No space left on device); free space or rights, then go on"
    ]


def test_what_a_dead_process_was_writing_is_removed_after_an_interruption(tmp_path):
    pid = os.fork() if hasattr(os, "fork") else pytest.skip("forks a process")
    if pid == 0:
        with whole_file(tmp_path / "a.csv") as temporary:
            temporary.touch()
            os._exit(0)
    os.waitpid(pid, 0)
    assert len(temporaries(tmp_path, "a.csv")) == 1
    assert temporaries(tmp_path, "b.csv") == []
    with pytest.raises(KeyboardInterrupt), at_work_in(tmp_path, "go on"):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_names_are_counted_on(tmp_path):
    assert free_name(tmp_path / "a") == tmp_path / "a"
    (tmp_path / "a").mkdir()
    (tmp_path / "a-2").touch()
    assert free_name(tmp_path / "a") == tmp_path / "a-3"


def slow_work(task):
    time.sleep(0.2)
    return Path(task).name != ""


def test_engines_yield_each_job_as_it_finishes():
    jobs = ["b", "a", "c"]
    assert list(Serial().map(slow_work, jobs)) == [(job, True) for job in jobs]
    assert sorted(Processes(2).map(slow_work, jobs)) == [(job, True) for job in sorted(jobs)]
