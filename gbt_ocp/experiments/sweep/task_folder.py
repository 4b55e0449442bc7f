"""Work that fills a folder: one file or folder a task, and what is there and sound is not made again.

Sweeps (a run folder a run), comparisons (a file a task) and studies (sweeps) are resumed by this alone.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.sweep.engines import Engine, NoWorkersError, Processes, Serial, WorkerDiedError
from gbt_ocp.files import FolderBusyError, alone_in, remove_temporaries, temporaries

Task = TypeVar("Task")

DEATHS = 2
"""Number of times in a row that workers may die before they begin a task, until no further ones are started."""


@contextmanager
def at_work_in(folder: Path, again: str) -> Iterator[None]:
    """Hold a folder that exists while it is filled, and leave no temporary file in it or in its folders.

    Parameters
    ----------
    folder
        The folder.
    again
        What goes on with the work after an error, for example ``--resume FOLDER``.

    Raises
    ------
    ConfigurationError
        If another process is at work in the folder, or it cannot be read or written.
    """
    try:
        with alone_in(folder):
            done = False
            try:
                yield
                done = True
            finally:  # after an interruption, workers of a cluster may still be writing
                with suppress(OSError):
                    for place in (folder, *(entry for entry in folder.iterdir() if entry.is_dir())):
                        remove_temporaries(place, abandoned=not done)
    except FolderBusyError as fault:
        raise ConfigurationError([str(fault)]) from None
    except OSError as fault:
        raise ConfigurationError(
            [f"{folder}: cannot be read or written ({fault}); free space or rights, then {again}"]
        ) from fault


def free_name(folder: Path) -> Path:
    """The first of ``NAME``, ``NAME-2``, ``NAME-3``, ... that does not exist."""
    found, count = folder, 1
    while found.exists():
        count += 1
        found = folder.with_name(f"{folder.name}-{count}")
    return found


@dataclass(frozen=True)
class TaskFolder(Generic[Task]):
    """The tasks of a folder.

    Attributes
    ----------
    place
        Path of the file or folder that a task leaves.
    check
        Reads it; raises ``ValueError``, or that a file is missing or of another kind, if it is not what the task
        leaves.
    work
        Carries out a task, here or in a worker, and returns whether it succeeded. Before it begins, it makes a
        temporary file or folder (:func:`~gbt_ocp.files.whole_file`, :func:`~gbt_ocp.files.whole_folder`): one that is
        left by a worker that died tells which task the worker was at.
    lost
        Called with a task that took its worker down twice, once in a process of its own.
    """

    place: Callable[[Task], Path]
    check: Callable[[Task], Any]
    work: Callable[[Task], bool]
    lost: Callable[[Task], Any]

    def pending(self, tasks: Sequence[Task]) -> list[Task]:
        """Tasks that are still to do. What is damaged is removed, and a line on standard error says so."""
        return [task for task in tasks if not self._is_sound(task)]

    def _is_sound(self, task: Task) -> bool:
        place = self.place(task)
        if not place.exists():
            return False
        try:
            self.check(task)
        except (ValueError, FileNotFoundError, IsADirectoryError, NotADirectoryError) as fault:
            print(f"{place}: damaged ({fault}); it is made again", file=sys.stderr)
            if place.is_dir():
                shutil.rmtree(place)
            else:
                place.unlink()
            return False
        return True

    def carried_out(self, pending: Sequence[Task], engine: Engine) -> Generator[tuple[Task, bool]]:
        """Carry out tasks; yields each as it finishes, with whether it succeeded.

        Tasks during which a worker died are tried again, each in a process of its own. Where workers of this machine
        cannot be started, or die before they begin, the rest is done in this process, and a line on standard error
        says so.

        Raises
        ------
        ConfigurationError
            If workers of a cluster do not see the folder, or die before they begin.
        """
        left, deaths = list(pending), 0
        while left:
            count = len(left)
            try:
                yield from self._yielded(engine, left)
                return
            except WorkerDiedError as fault:
                left = [task for task in left if not self.place(task).exists()]
                begun = [task for task in left if self._temporaries(task)]
                deaths = deaths + 1 if len(left) == count and not begun else 0
                if deaths == DEATHS or isinstance(fault, NoWorkersError):
                    engine = _without_workers(engine, fault)
            for task in begun:
                if (yield from self._alone(task)):
                    left.remove(task)

    def _yielded(self, engine: Engine, tasks: Sequence[Task]) -> Iterator[tuple[Task, bool]]:
        for task, succeeded in engine.map(self.work, tasks):
            if not self.place(task).exists():
                raise ConfigurationError(
                    [f"--dask: found workers that do not see {self.place(task).parent}; allowed: workers that share it"]
                )
            yield task, succeeded

    def _alone(self, task: Task) -> Generator[tuple[Task, bool], None, bool]:
        """Try a task again at which a worker died; whether it is done or lost, and not to be tried once more."""
        place = self.place(task)
        remove_temporaries(place.parent, place.name, abandoned=False)  # what the dead worker left
        try:
            yield from self._yielded(Processes(1), [task])
        except WorkerDiedError:
            if not self._temporaries(task):  # the worker died before it began
                return False
            self.lost(task)
            yield task, False
        return True

    def _temporaries(self, task: Task) -> list[Path]:
        place = self.place(task)
        return temporaries(place.parent, place.name)


def _without_workers(engine: Engine, fault: WorkerDiedError) -> Engine:
    reason = "cannot be started" if isinstance(fault, NoWorkersError) else "die before they begin"
    if not isinstance(engine, Processes):
        raise ConfigurationError([f"found workers that {reason} ({fault}); allowed: workers that live"]) from None
    print(f"--jobs: workers {reason} ({fault}); the rest is done in this process", file=sys.stderr)
    return Serial()
