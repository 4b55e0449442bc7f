"""A sweep from its plan to its table: resumed where it stopped, carried out by an engine, collected."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing, nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from gbt_ocp.experiments.config.faults import ConfigurationError, shown
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.experiments.sweep.checks import check_run
from gbt_ocp.experiments.sweep.engines import Cluster, Engine, make_engine
from gbt_ocp.experiments.sweep.execution import ARRAYS_FILE, execute, record_lost
from gbt_ocp.experiments.sweep.sweep_plan import Overrides, PlannedRun, SweepPlan, plan_sweep
from gbt_ocp.experiments.sweep.table import Row, row_of, write_table
from gbt_ocp.experiments.sweep.task_folder import TaskFolder, at_work_in, free_name
from gbt_ocp.files import read_arrays, whole_file, whole_folder
from gbt_ocp.simulation import run_folder
from gbt_ocp.typing import Array

PLAN = "sweep.json"
RUNS = "runs"
DISTRIBUTION = "distribution"


@dataclass(frozen=True)
class Sweep:
    """A finished sweep.

    Attributes
    ----------
    folder
        Holds ``sweep.json`` (the plan), ``runs.csv``, ``runs.parquet`` where pyarrow is installed,
        ``distribution.png`` and ``.pdf``, and ``runs/``.
    plan
        What was run.
    rows
        The table: one mapping a run, in the order of the runs (see :func:`gbt_ocp.experiments.sweep.table.row_of`).
    """

    folder: Path
    plan: SweepPlan
    rows: list[Row]

    @property
    def failed(self) -> list[Row]:
        """Rows of the runs that failed."""
        return [row for row in self.rows if row["status"] == "failed"]

    def run_folder(self, row: Row) -> Path:
        """Folder of the run of a row."""
        return self.folder / RUNS / f"{row['run']:06d}"

    def matching(self, **overrides: Any) -> list[Row]:
        """Rows of the runs that succeeded and have these values in their columns."""
        return [
            row
            for row in self.rows
            if row["status"] == "done" and all(row[key] == value for key, value in overrides.items())
        ]

    def arrays(self, rows: Sequence[Row], name: str) -> Array:
        """One array of the history of each row, stacked: ``(runs, K, ...)``.

        Raises
        ------
        FileNotFoundError
            If the runs did not keep it.
        ValueError
            If a file is damaged.
        """
        found = []
        for row in rows:
            path = self.run_folder(row) / (ARRAYS_FILE if name in self.plan.arrays else run_folder.HISTORY)
            found.append(read_arrays(path, [name], "arrays of a run")[name])
        return np.array(found)


class SweepInterrupted(KeyboardInterrupt):
    """The sweep was interrupted; what was finished is in its folder.

    Attributes
    ----------
    folder
        Of the sweep.
    finished, planned
        Numbers of runs.
    """

    def __init__(self, folder: Path, finished: int, planned: int) -> None:
        self.folder, self.finished, self.planned = folder, finished, planned
        super().__init__(f"{finished} of {planned} runs are finished and kept in {folder}")


def sweep(
    configuration: Configuration | str | Path | Mapping[str, Any] | None = None,
    *,
    runs: int | None = None,
    seed_from: int = 0,
    grid: Mapping[str, Sequence[Any]] | None = None,
    entries: Iterable[Overrides] | None = None,
    overrides: Sequence[str] = (),
    jobs: int | None = None,
    dask: str | None = None,
    out: str | os.PathLike[str] | None = None,
    resume: str | os.PathLike[str] | None = None,
    histories: bool = True,
    progress: bool = False,
) -> Sweep:
    """Run an experiment with many seeds and with any keys varied.

    Parameters
    ----------
    configuration
        What :func:`gbt_ocp.run` takes. May be left out with ``resume``: the folder knows what was planned.
    runs, seed_from, grid, entries, overrides, histories
        See :func:`gbt_ocp.experiments.sweep.sweep_plan.plan_sweep`.
    jobs
        Processes; by default one a core. 1 runs in this process.
    dask
        Address of a dask.distributed scheduler, or ``local``; instead of ``jobs``.
    out
        A new or empty folder; by default a new one in ``runs/``.
    resume
        Folder of this sweep, begun before: what is finished is not run again. Instead of ``out``.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    ConfigurationError
        If the input is wrong, or ``resume`` is the folder of another sweep; one line a fault.
    SweepInterrupted
        If Ctrl-C was pressed.
    """
    plan = None
    if configuration is not None:
        if runs is None:
            raise ConfigurationError(["runs: found nothing; allowed: a whole number >= 1"])
        plan = plan_sweep(
            configuration,
            runs=runs,
            seed_from=seed_from,
            grid=grid,
            entries=entries,
            overrides=overrides,
            histories=histories,
        )
    elif resume is None:
        raise ConfigurationError(["configuration: found nothing; allowed: a configuration, or a folder to resume"])
    if jobs is not None and dask is not None:
        raise ConfigurationError(["found both jobs and dask; allowed: one of them"])
    with engine_for(jobs, dask) as engine:
        if resume is not None:
            folder = Path(resume)
            plan = resumed_plan(folder, plan)
        else:
            assert plan is not None
            default = Path("runs") / f"sweep-{plan.variants[0].configuration.name}"
            folder = Path(out) if out is not None else free_name(default)
            begin(folder, plan)
        done = carry_out(plan, folder, engine, progress=progress)
    draw(done)
    return done


def draw(done: Sweep) -> None:
    """Write ``distribution.png`` and ``distribution.pdf`` of a finished sweep, where its runs have what they show."""
    # which take half a second to load
    from gbt_ocp.reporting.style import DPI
    from gbt_ocp.reporting.sweep_figure import distribution

    variants: dict[str, list[Row]] = {}
    for row in done.rows:
        replaced = {key: row[key] for key in done.plan.varied if row[key] is not None}
        name = ", ".join(f"{key.rpartition('.')[2]}: {value}" for key, value in replaced.items()) or "all runs"
        variants.setdefault(name, []).append(row)
    figure = distribution(variants)
    if figure is not None:
        for ending in ("png", "pdf"):
            with whole_file(done.folder / f"{DISTRIBUTION}.{ending}") as temporary:
                figure.savefig(temporary, format=ending, dpi=DPI)


def begin(folder: Path, plan: SweepPlan) -> None:
    """Make the folder of a sweep, with its plan.

    Raises
    ------
    ConfigurationError
        If the folder is not new or empty, or cannot be written.
    """
    try:
        with whole_folder(folder) as temporary:
            (temporary / PLAN).write_text(plan.to_json(), encoding="utf-8")
            (temporary / RUNS).mkdir()
    except FileExistsError:
        raise ConfigurationError(
            [f"--out: found {folder}, which is not an empty folder; allowed: a new or empty folder (or --resume)"]
        ) from None
    except OSError as fault:
        raise ConfigurationError(
            [f"--out: found {folder}, which cannot be written ({fault}); allowed: a writable folder"]
        ) from fault


def resumed_plan(folder: Path, plan: SweepPlan | None) -> SweepPlan:
    """The plan of a sweep folder, which must be ``plan`` if that is given.

    Raises
    ------
    ConfigurationError
        If the folder holds no sweep, or another one.
    """
    try:
        text = (folder / PLAN).read_text(encoding="utf-8")
        found = SweepPlan.from_json(text)
    except (OSError, ValueError) as fault:
        line = str(fault).partition("\n")[0]
        line = line if isinstance(fault, OSError) else f"{PLAN}: {line}"  # the others do not name it
        raise ConfigurationError(
            [f"--resume: found {folder}, which holds no sweep ({line}); allowed: the folder of a sweep"]
        ) from None
    if plan is not None and plan.to_json() != found.to_json():
        raise ConfigurationError(
            [f"--resume: found {folder}, the folder of another sweep ({_difference(found, plan)}); allowed: this one's"]
        )
    return found


def _difference(found: SweepPlan, plan: SweepPlan) -> str:
    """The first thing in which two plans differ, in words."""
    if found.seeds != plan.seeds:
        there, here = (f"{len(one.seeds)} from {one.seeds[0]}" for one in (found, plan))
        return f"seeds: {there} there, {here} here"
    if (found.histories, found.arrays) != (plan.histories, plan.arrays):
        return "other histories are kept there"
    if len(found.variants) != len(plan.variants):
        return f"{len(found.variants)} variants there, {len(plan.variants)} here"
    pairs = enumerate(zip(found.variants, plan.variants, strict=True))
    number, (its, ours) = next((number, pair) for number, pair in pairs if pair[0] != pair[1])
    if its.overrides != ours.overrides:
        return f"variant {number}: {shown(its.overrides)} there, {shown(ours.overrides)} here"
    first, second = its.configuration.to_mapping(), ours.configuration.to_mapping()
    keys = [key for key in {**first, **second} if first.get(key) != second.get(key)]
    return f"variant {number} differs in {', '.join(keys)}"


def engine_for(jobs: int | None, dask: str | None) -> Any:
    """Context that yields the engine asked for, and leaves a cluster at its end.

    Raises
    ------
    ConfigurationError
        If there is no such cluster.
    """
    try:
        engine = make_engine(jobs, dask)
    except ValueError as fault:
        raise ConfigurationError([f"--dask: {fault}"]) from fault
    return closing(engine) if isinstance(engine, Cluster) else nullcontext(engine)


def carry_out(plan: SweepPlan, folder: Path, engine: Engine, *, progress: bool = False, title: str = "sweep") -> Sweep:
    """Run what is not finished yet, and write the table.

    Raises
    ------
    SweepInterrupted
        If Ctrl-C was pressed; the table holds what is finished.
    ConfigurationError
        If another process is at work in the folder, it cannot be read or written, or the workers of a cluster do not
        see it.
    """
    own = Path(os.path.abspath(folder)) / RUNS  # a worker may run elsewhere
    runs = list(plan.runs())
    tasks = TaskFolder[PlannedRun](
        place=lambda run: own / run.identifier,
        check=partial(check_run, plan=plan, folder=own),
        work=partial(execute, folder=own, histories=plan.histories, arrays=plan.arrays),
        lost=partial(record_lost, folder=own),
    )
    try:
        with at_work_in(folder, f"--resume {folder}"):
            _carry_out(tasks, runs, engine, progress, title)
            return collect(plan, folder)
    except KeyboardInterrupt:
        with suppress(ValueError, OSError):  # a damaged run that was not found yet, a full disk
            collect(plan, folder)
        finished = sum((own / run.identifier).is_dir() for run in runs)
        raise SweepInterrupted(folder, finished, len(plan)) from None


def _carry_out(
    tasks: TaskFolder[PlannedRun], runs: Sequence[PlannedRun], engine: Engine, progress: bool, title: str
) -> None:
    pending = tasks.pending(runs)
    with tqdm(
        total=len(runs), initial=len(runs) - len(pending), disable=not progress, file=sys.stderr, unit="run", desc=title
    ) as bar:
        failures = 0
        # closed at once when it is interrupted: its workers have the same folder
        with closing(tasks.carried_out(pending, engine)) as finished:
            for _, succeeded in finished:
                failures += not succeeded
                if failures:
                    bar.set_postfix_str(f"{failures} failed", refresh=False)
                bar.update()


def collect(plan: SweepPlan, folder: Path) -> Sweep:
    """Read the folders of the runs that are finished, and write the table."""
    own, varied = folder / RUNS, plan.varied
    rows = [row_of(run, own, varied) for run in plan.runs() if (own / run.identifier).is_dir()]
    write_table(folder, rows)
    return Sweep(folder, plan, rows)
