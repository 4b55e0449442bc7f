"""Who carries out the runs: this process, processes of this machine (joblib), or a cluster (dask.distributed).

An engine maps a function over jobs and yields each job with what became of it, in the order in which they finish.
"""

from __future__ import annotations

import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol, TypeVar

from tqdm import tqdm

Job = TypeVar("Job")


class WorkerDiedError(RuntimeError):
    """A worker process died; jobs that were not yielded are not done."""


class Engine(Protocol):
    """Carries out jobs."""

    def map(self, function: Callable[[Job], bool], jobs: Sequence[Job]) -> Iterator[tuple[Job, bool]]:
        """Yield each job with its result as it finishes.

        Raises
        ------
        WorkerDiedError
            If a worker died and with it an unknown job.
        """


class Serial:
    """One job after the other, in this process."""

    def map(self, function: Callable[[Job], bool], jobs: Sequence[Job]) -> Iterator[tuple[Job, bool]]:
        """See :class:`Engine`."""
        for job in jobs:
            yield job, function(job)


class Processes:
    """Processes of this machine, through joblib; BLAS and OpenMP get one thread in each.

    Parameters
    ----------
    count
        How many, at least two.
    """

    def __init__(self, count: int) -> None:
        self._count = count

    def map(self, function: Callable[[Job], bool], jobs: Sequence[Job]) -> Iterator[tuple[Job, bool]]:
        """See :class:`Engine`."""
        from joblib import Parallel, delayed, parallel_config
        from joblib.externals.loky.process_executor import TerminatedWorkerError

        with parallel_config(backend="loky", inner_max_num_threads=1):
            # One job a task: runs take seconds, and a batch would be lost whole. With a count of one, joblib would
            # take this process.
            parallel = Parallel(n_jobs=max(2, self._count), return_as="generator_unordered", batch_size=1)
            home = os.getpid()
            done: Any = None
            try:
                with _interrupts_held():
                    done = parallel(delayed(_numbered)(function, index, job, home) for index, job in enumerate(jobs))
                for index, result in done:
                    yield jobs[index], result
            except TerminatedWorkerError as fault:
                raise WorkerDiedError(str(fault).partition("\n")[0]) from fault
            except (GeneratorExit, KeyboardInterrupt):  # nobody wants the rest: joblib need not say that it ends it
                if done is not None:
                    with warnings.catch_warnings():
                        warnings.simplefilter("ignore")
                        done.close()
                raise


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Workers that are started in here never hear Ctrl-C: their parent ends them, and has the word.

    Ctrl-C goes to all processes of a terminal. One that is being loaded would answer with a traceback.
    """
    if os.name != "posix" or threading.current_thread() is not threading.main_thread():
        yield
        return
    from joblib.externals.loky.backend import resource_tracker

    resource_tracker.ensure_running()  # it would let go of what is held
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _numbered(function: Callable[[Any], bool], index: int, job: Any, home: int) -> tuple[int, bool]:
    if os.name == "posix" and os.getppid() != home:  # killed: nobody waits for this, and who resumes would run it too
        os._exit(1)
    # Progress bars share a lock between processes, a semaphore that an interrupted worker would leave behind.
    tqdm.set_lock(threading.RLock())
    return index, function(job)


class Cluster:
    """Workers of a dask.distributed scheduler; they must see the sweep folder under the same path.

    Parameters
    ----------
    address
        Of the scheduler, or ``local`` for a cluster of this machine's cores.

    Raises
    ------
    ValueError
        If dask is not installed or nobody answers at the address.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client, LocalCluster
        except ImportError as fault:
            raise ValueError(
                f"found {address}, but dask is not installed; allowed: pip install gbt_ocp[dask]"
            ) from fault
        self._local: Any = None
        if address == "local":
            self._local = LocalCluster(threads_per_worker=1, dashboard_address=None)
        try:
            self._client: Any = Client(self._local or address, timeout="10s")
        except (OSError, ValueError) as fault:
            raise ValueError(
                f"found {address}, where no scheduler answers ({fault}); allowed: the address of a scheduler, or local"
            ) from fault

    def map(self, function: Callable[[Job], bool], jobs: Sequence[Job]) -> Iterator[tuple[Job, bool]]:
        """See :class:`Engine`."""
        from distributed import KilledWorker, as_completed

        # pure=False: the key of a job must not be that of an equal job of another sweep.
        waiting = {self._client.submit(function, job, pure=False): job for job in jobs}
        died = 0
        try:
            for future in as_completed(waiting):
                try:
                    yield waiting[future], future.result()
                except KilledWorker:
                    died += 1
        finally:
            self._client.cancel(list(waiting))
        if died:
            raise WorkerDiedError(f"{died} jobs took their workers down")

    def close(self) -> None:
        """Leave the cluster, and end it if it is ours."""
        self._client.close()
        if self._local is not None:
            self._local.close()


def make_engine(jobs: int | None, dask: str | None) -> Serial | Processes | Cluster:
    """The engine that was asked for: by default, processes on all cores.

    Raises
    ------
    ValueError
        If there is no such cluster.
    """
    if dask is not None:
        return Cluster(dask)
    if jobs is None:
        from joblib import cpu_count

        jobs = cpu_count()
    return Serial() if jobs == 1 else Processes(jobs)
