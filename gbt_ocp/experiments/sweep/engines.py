"""Where tasks are carried out: in this process, in processes of this machine, or on a cluster (dask.distributed).

An engine maps a function over jobs and yields each job with its result, in the order in which they finish.

No worker imports from the folder that the command was given in: Python puts that folder first on the path of a process
that it starts with ``-m`` or ``-c``, as process pools do, and a ``numpy.py`` there would be executed.
``PYTHONSAFEPATH`` leaves it out.
"""

from __future__ import annotations

import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from contextlib import contextmanager
from typing import Any, Protocol, TypeVar

from tqdm import tqdm

Job = TypeVar("Job")

SAFE_PATH = {"PYTHONSAFEPATH": "1"}
"""Environment of workers: the current folder is not on their path while they are started."""

ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "NUMBA", "NUMEXPR")} | {
    "VECLIB_MAXIMUM_THREADS": "1"
}
"""Environment of workers: there are as many of them as cores."""

IDLE_S = 300.0
"""Time after which workers without work end. Until then another sweep of the same process takes them over."""


class WorkerDiedError(RuntimeError):
    """A worker process died; jobs that were not yielded are not done."""


class NoWorkersError(WorkerDiedError):
    """No worker process can be started at all; no job is done."""


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
    """Processes of this machine, from loky (the pool of joblib); BLAS and OpenMP get one thread in each.

    Parameters
    ----------
    count
        Number of processes.
    """

    def __init__(self, count: int) -> None:
        self._count = count

    def map(self, function: Callable[[Job], bool], jobs: Sequence[Job]) -> Iterator[tuple[Job, bool]]:
        """See :class:`Engine`."""
        with _quiet():
            from joblib.externals.loky import BrokenProcessPool, get_reusable_executor

        home = os.getpid()
        executor = None
        try:
            try:
                with _starting():
                    executor = get_reusable_executor(
                        self._count, timeout=IDLE_S, initializer=_prepare, env=SAFE_PATH | ONE_THREAD
                    )
                    # One job a task: a job takes seconds, and the jobs of a batch would be lost together.
                    waiting = {executor.submit(_carried_out, function, job, home): job for job in jobs}
            except (ImportError, OSError) as fault:  # no semaphores: shared memory is missing, full or read-only
                raise NoWorkersError(_short(fault)) from fault
            for future in as_completed(waiting):
                yield waiting[future], future.result()
        except BrokenProcessPool as fault:
            raise WorkerDiedError(_short(fault)) from fault
        except BaseException:  # also of the caller, who wants no more results
            if executor is not None:
                executor.shutdown(kill_workers=True)
            raise


@contextmanager
def _quiet() -> Iterator[None]:
    """Joblib warns when it is imported where there are no semaphores; :class:`Processes` answers that in one line."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


@contextmanager
def _starting() -> Iterator[None]:
    """Workers that are started in this block never receive Ctrl-C: their parent answers it, and ends them.

    Ctrl-C goes to all processes of a terminal. A worker that is being loaded would answer with a traceback.
    """
    from joblib.externals.loky.backend import resource_tracker

    _start_tracker()
    with _environment(SAFE_PATH):
        resource_tracker.ensure_running()  # before the signals are blocked: it unblocks them, like the other one
    if os.name != "posix" or threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_tracker() -> None:
    """Start the process with which Python clears up semaphores: with a safe path, as workers are.

    Raises
    ------
    OSError
        If there are no semaphores.
    """
    from multiprocessing import get_context

    with _environment(SAFE_PATH):
        get_context("spawn").Lock()


@contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _prepare() -> None:
    """Prepare a worker, also one that is started later in place of another."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Progress bars share a lock between processes, a semaphore that an interrupted worker would leave behind.
    tqdm.set_lock(threading.RLock())


def _carried_out(function: Callable[[Any], bool], job: Any, home: int) -> bool:
    if os.name == "posix" and os.getppid() != home:  # the parent was killed; its resumption does this job
        os._exit(1)
    return function(job)


def _short(fault: BaseException) -> str:
    return str(fault).partition("\n")[0].partition(". ")[0]


class Cluster:
    """Workers of a dask.distributed scheduler; they must see the folder of the tasks under the same path.

    Parameters
    ----------
    address
        Of the scheduler, or ``local`` for a cluster of this machine's cores.

    Raises
    ------
    ValueError
        If dask is not installed or no scheduler answers at the address.
    """

    def __init__(self, address: str) -> None:
        try:
            import dask
            from distributed import Client, LocalCluster
        except ImportError as fault:
            raise ValueError(
                f"found {address}, but dask is not installed; allowed: pip install gbt_ocp[dask]"
            ) from fault
        self._local: Any = None
        if address == "local":
            _start_tracker()
            # beside the variables that dask sets itself, such as one thread for BLAS
            path = "distributed.nanny.pre-spawn-environ"
            with dask.config.set({f"{path}.{name}": value for name, value in SAFE_PATH.items()}):
                self._local = LocalCluster(threads_per_worker=1, dashboard_address=None)
        try:
            self._client: Any = Client(self._local or address, timeout="10s")
        except (OSError, ValueError) as fault:
            raise ValueError(
                f"found {address}, where no scheduler answers ({fault}); allowed: the address of a scheduler, or local"
            ) from fault

    def map(self, function: Callable[[Job], bool], jobs: Sequence[Job]) -> Iterator[tuple[Job, bool]]:
        """See :class:`Engine`."""
        from distributed import KilledWorker
        from distributed import as_completed as completed

        # pure=False: the key of a job must not be that of an equal job of another sweep.
        waiting = {self._client.submit(function, job, pure=False): job for job in jobs}
        died = 0
        try:
            for future in completed(waiting):
                try:
                    yield waiting[future], future.result()
                except KilledWorker:
                    died += 1
        finally:
            self._client.cancel(list(waiting))
        if died:
            raise WorkerDiedError(f"{died} jobs took their workers down")

    def close(self) -> None:
        """Leave the cluster, and end it if it was started here."""
        self._client.close()
        if self._local is not None:
            self._local.close()


def make_engine(jobs: int | None, dask: str | None = None) -> Serial | Processes | Cluster:
    """The engine that was asked for: by default, processes on all cores.

    Raises
    ------
    ValueError
        If there is no such cluster.
    """
    if dask is not None:
        return Cluster(dask)
    if jobs is None:
        with _quiet():
            from joblib.externals.loky import cpu_count

        jobs = cpu_count()
    return Serial() if jobs == 1 else Processes(jobs)
