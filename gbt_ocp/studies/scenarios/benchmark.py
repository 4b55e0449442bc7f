"""The benchmark: every contestant over every run of every scenario, one file each, and a report of them all."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from tqdm import tqdm

from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.sweep.engines import make_engine
from gbt_ocp.experiments.sweep.task_folder import TaskFolder, at_work_in, free_name
from gbt_ocp.files import whole_file, whole_folder
from gbt_ocp.studies.scenarios.at_sea import SEA, log_scenarios
from gbt_ocp.studies.scenarios.bearing_angle import NING
from gbt_ocp.studies.scenarios.benchmark_report import Row, summarised, write_benchmark
from gbt_ocp.studies.scenarios.contestants import CONTESTANTS
from gbt_ocp.studies.scenarios.naval import NAVAL
from gbt_ocp.studies.scenarios.scenario import PublicScenario
from gbt_ocp.studies.scenarios.trial import trial

TRIALS, PLANNED = "trials", "benchmark_plan.json"

QUICK = 0.1
"""Share of the runs with ``quick``; each scenario keeps one at least."""

PUBLIC = {one.name: one for one in (*NING, *NAVAL, *SEA)}
"""The scenarios that come with the package, by name."""


@dataclass(frozen=True)
class Trial:
    """One run of a contestant in a scenario."""

    scenario: str
    contestant: str
    run: int

    @property
    def name(self) -> str:
        """Of its file."""
        return f"{self.scenario}-{self.contestant}-{self.run:03d}.json"


@dataclass(frozen=True)
class BenchmarkPlan:
    """What is measured: runs by scenario, names of contestants, and the folder of logs."""

    runs: dict[str, int]
    contestants: tuple[str, ...]
    logs: str | None = None

    def to_json(self) -> str:
        """The plan as it stands in the folder."""
        return json.dumps(self.__dict__, indent=1) + "\n"

    @property
    def trials(self) -> list[Trial]:
        """All runs; those of a scenario and a run follow each other."""
        return [
            Trial(name, one, run)
            for name, count in self.runs.items()
            for run in range(count)
            for one in self.contestants
        ]


@dataclass(frozen=True)
class Benchmark:
    """A finished benchmark.

    Attributes
    ----------
    folder
        Holds ``report.md``, ``benchmark.csv``, ``benchmark.json`` and ``trials/``.
    rows
        The table: one mapping a scenario and contestant.
    notes
        What was left out, and why.
    """

    folder: Path
    rows: list[Row]
    notes: list[str]


class BenchmarkInterruptedError(KeyboardInterrupt):
    """The benchmark was interrupted; what was finished is kept."""


def known_scenarios(logs: str | None) -> dict[str, PublicScenario]:
    """The scenarios of the package, and those of a folder of logs.

    Raises
    ------
    ConfigurationError
        If the folder has no logs with the truth.
    """
    found = {} if logs is None else {one.name: one for one in log_scenarios(Path(logs))}
    return {**PUBLIC, **found}


def benchmark(
    scenarios: Sequence[str] | None = None,
    trackers: Sequence[str] | None = None,
    *,
    runs: int | None = None,
    quick: bool = False,
    logs: str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str] | None = None,
    resume: str | os.PathLike[str] | None = None,
    jobs: int | None = None,
    progress: bool = False,
) -> Benchmark:
    """Let trackers follow the targets of public scenarios from the same bearings.

    Parameters
    ----------
    scenarios
        Names of :data:`PUBLIC`, or of logs (``log_NAME``); by default all.
    trackers
        Names of :data:`~gbt_ocp.studies.scenarios.contestants.CONTESTANTS`; by default all whose packages are there.
    runs
        Runs of each scenario, instead of its own number; a log has one run.
    quick
        A tenth of the runs.
    logs
        Folder of CSV files with recorded bearings and the truth.
    out
        A new or empty folder, or that of the same benchmark, which goes on; by default a new one in ``runs/``.
    resume
        Folder of a benchmark begun before, which is finished as it was planned. Instead of all above.
    jobs
        Processes, by default one a core. Processor time is measured within each.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    ConfigurationError
        If a name, a number or a folder is wrong; one line a fault.
    BenchmarkInterruptedError
        If Ctrl-C was pressed.
    """
    if resume is not None:
        folder = Path(resume)
        plan = _planned_before(folder)
    else:
        plan = _plan(scenarios, trackers, runs, quick, None if logs is None else os.path.abspath(logs))
        folder = Path(out) if out is not None else free_name(Path("runs") / "benchmark")
        _begin(folder, plan)
    known = known_scenarios(plan.logs)
    with at_work_in(folder, f"--resume {folder}"):
        trials = plan.trials
        try:
            _carry_out(trials, folder, plan.logs, jobs, progress)
        except KeyboardInterrupt:
            done = sum((folder / TRIALS / one.name).is_file() for one in trials)
            raise BenchmarkInterruptedError(f"{done} of {len(trials)} runs are finished and kept in {folder}") from None
        found = [(one, read_trial(folder / TRIALS / one.name)) for one in trials]
        rows = summarised([(one.scenario, one.contestant, numbers) for one, numbers in found])
        notes = _notes(plan)
        write_benchmark(folder, [known[name] for name in plan.runs], plan.runs, rows, notes, _command(plan))
    return Benchmark(folder, rows, notes)


def _plan(
    scenarios: Sequence[str] | None, trackers: Sequence[str] | None, runs: int | None, quick: bool, logs: str | None
) -> BenchmarkPlan:
    known = known_scenarios(logs)
    faults = [
        f"--scenarios: found {name}; allowed: {', '.join(known)}" for name in scenarios or () if name not in known
    ]
    faults += [
        f"--trackers: found {name}; allowed: {', '.join(CONTESTANTS)}"
        for name in trackers or ()
        if name not in CONTESTANTS
    ]
    faults += [
        f"--trackers: found {name}, whose package {CONTESTANTS[name].package} is not installed; allowed: "
        "pip install gbt_ocp[bench], or others"
        for name in trackers or ()
        if name in CONTESTANTS and not CONTESTANTS[name].installed
    ]
    if runs is not None and runs < 1:
        faults.append(f"--runs: found {runs}; allowed: a whole number >= 1")
    if faults:
        raise ConfigurationError(faults)
    share = QUICK if quick else 1.0
    counts = {}
    for name in dict.fromkeys(scenarios or known):
        full = 1 if name.startswith("log_") else runs or known[name].runs
        counts[name] = max(1, round(share * full))
    chosen = dict.fromkeys(trackers or [name for name, one in CONTESTANTS.items() if one.installed])
    return BenchmarkPlan(counts, tuple(chosen), logs)


def _notes(plan: BenchmarkPlan) -> list[str]:
    notes = [
        f"{name} did not take part: {one.package} is not installed (pip install gbt_ocp[bench])"
        for name, one in CONTESTANTS.items()
        if name not in plan.contestants and not one.installed
    ]
    if plan.logs is None:
        notes.append("no recorded logs: --logs DIR names a folder of them")
    return notes


def _command(plan: BenchmarkPlan) -> str:
    counts = {name: count for name, count in plan.runs.items() if not name.startswith("log_")}
    words = ["gbt-ocp benchmark", "--scenarios", ",".join(plan.runs), "--trackers", ",".join(plan.contestants)]
    if len(set(counts.values())) == 1:
        words += ["--runs", str(next(iter(counts.values())))]
    elif all(count == PUBLIC[name].runs for name, count in counts.items()):
        pass
    else:
        words.append("--quick")
    return " ".join([*words, *(["--logs", plan.logs] if plan.logs else [])])


def _begin(folder: Path, plan: BenchmarkPlan) -> None:
    if (folder / PLANNED).is_file() and _planned_before(folder) == plan:
        return  # the same benchmark, which goes on
    try:
        with whole_folder(folder) as temporary:
            (temporary / PLANNED).write_text(plan.to_json(), encoding="utf-8")
            (temporary / TRIALS).mkdir()
    except FileExistsError:
        raise ConfigurationError(
            [
                f"--out: found {folder}, which is not an empty folder; allowed: a new or empty folder, or that "
                "of the same benchmark"
            ]
        ) from None
    except OSError as fault:
        raise ConfigurationError(
            [f"--out: found {folder}, which cannot be written ({fault}); allowed: a writable folder"]
        ) from fault


def _planned_before(folder: Path) -> BenchmarkPlan:
    try:
        found = json.loads((folder / PLANNED).read_text(encoding="utf-8"))
        return BenchmarkPlan(dict(found["runs"]), tuple(found["contestants"]), found["logs"])
    except (OSError, ValueError, KeyError, TypeError) as fault:
        line = str(fault).partition("\n")[0]
        raise ConfigurationError(
            [f"--resume: found {folder}, which holds no benchmark ({line}); allowed: the folder of a benchmark"]
        ) from None


def read_trial(path: Path) -> dict[str, Any] | None:
    """The numbers of a run; ``None`` where the contestant did not take part.

    Raises
    ------
    ValueError
        If the file is damaged.
    """
    found = json.loads(path.read_text(encoding="utf-8"))
    if found is not None and not {"lost", "seconds", "fault"} <= set(found):
        raise ValueError(f"{path}: found no numbers of a run")
    return None if found is None else dict(found)


def carried_out(one: Trial, folder: Path, logs: str | None) -> bool:
    """Do one run and write its file; for a worker."""
    numbers = trial(known_scenarios(logs)[one.scenario], CONTESTANTS[one.contestant], one.run)
    with whole_file(folder / TRIALS / one.name) as temporary:
        temporary.write_text(json.dumps(numbers) + "\n", encoding="utf-8")
    return numbers is None or not numbers["fault"]


def _lost(one: Trial, folder: Path) -> None:
    numbers = {"lost": True, "seconds": None, "measurements": 0, "fault": "the process died, twice"}
    with whole_file(folder / TRIALS / one.name) as temporary:
        temporary.write_text(json.dumps(numbers) + "\n", encoding="utf-8")


def _carry_out(trials: list[Trial], folder: Path, logs: str | None, jobs: int | None, progress: bool) -> None:
    own = Path(os.path.abspath(folder))  # a worker may run elsewhere
    tasks = TaskFolder[Trial](
        place=lambda one: own / TRIALS / one.name,
        check=lambda one: read_trial(own / TRIALS / one.name),
        work=partial(carried_out, folder=own, logs=logs),
        lost=partial(_lost, folder=own),
    )
    pending = tasks.pending(trials)
    with (
        tqdm(
            total=len(trials),
            initial=len(trials) - len(pending),
            disable=not progress,
            file=sys.stderr,
            unit="run",
            desc="benchmark",
        ) as bar,
        closing(tasks.carried_out(pending, make_engine(jobs if len(pending) > 1 else 1))) as finished,
    ):
        for one, _ in finished:
            bar.set_postfix_str(Path(one.name).stem, refresh=False)
            bar.update()
