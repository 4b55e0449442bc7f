"""How a task is carried out, in this process or in a worker, and what its file must hold."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from time import process_time

from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.experiments.interrupts import interrupted_between_steps
from gbt_ocp.experiments.sweep.engines import Serial
from gbt_ocp.experiments.sweep.task_folder import TaskFolder
from gbt_ocp.files import whole_file
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.studies.limits.comparison_tables import Row, write_rows
from gbt_ocp.studies.limits.formulations import COMPILED, IPOPT
from gbt_ocp.studies.limits.problems import Check, Problems, draw, joined, record
from gbt_ocp.studies.limits.row_checks import check_problems, check_rows
from gbt_ocp.studies.limits.runs import run_treated
from gbt_ocp.studies.limits.sensitivity import solve_varied
from gbt_ocp.studies.limits.solves import best_chunk, solve_chunk
from gbt_ocp.studies.limits.tasks import ComparisonPlan, Task
from gbt_ocp.studies.limits.treatments import Pair, treated

PARTS, PROBLEMS, COSTS = "parts", "problems", "costs.txt"

RECORDED_UNDER = ("hard", "elastic")
"""Runs are recorded under hard limits and under the penalty in turn, so that warm starts favour neither."""


@dataclass(frozen=True)
class CarryOut:
    """Carries out tasks of a plan in a folder.

    Attributes
    ----------
    plan, folder
        Whose tasks, and where their files go.
    """

    plan: ComparisonPlan
    folder: Path

    def __call__(self, task: Task) -> bool:
        """Carry out one task."""
        began = process_time()
        with whole_file(part_file(self.folder, task)) as temporary:
            temporary.touch()  # names the task if the process dies
            with interrupted_between_steps() as check:
                result = self._result(task, check)
            if isinstance(result, Problems):
                result.save(temporary)
            else:
                write_rows(temporary, result)
            # One short line at the end of the file: processes that write at once do not mix them up. Before the part
            # has its name: a process that is killed between the two leaves no part without its costs.
            with (self.folder / COSTS).open("a", encoding="utf-8") as stream:
                stream.write(f"{task.name} {process_time() - began:.3f}\n")
        return True

    def _result(self, task: Task, check: Check) -> Problems | list[Row]:
        configuration = self.plan.configurations[task.case]
        if task.kind == "record":
            under = treated(configuration, RECORDED_UNDER[task.argument % len(RECORDED_UNDER)])
            return record(under.model_copy(update={"seed": task.argument}), self.plan.recorded_a_run, check)
        if task.kind == "loop":
            assert task.pair is not None
            return [run_treated(configuration.model_copy(update={"seed": task.argument}), task.pair, check)]
        problems = load_problems(problems_file(self.folder, configuration.name))
        if task.kind == "best":
            return best_chunk(configuration, problems, task.argument, _searchers(), check)
        if task.kind == "sweep":
            return solve_varied(configuration, problems, task.argument, check)
        assert task.pair is not None
        mode, numbers = task.argument
        return solve_chunk(configuration, problems, numbers, task.pair, mode, check=check)


def part_file(folder: Path, task: Task) -> Path:
    """The file that a task leaves."""
    return folder / PARTS / task.name


def problems_file(folder: Path, case: str) -> Path:
    """Where the problems of an experiment are kept."""
    return folder / PROBLEMS / f"{case}.npz"


def check_part(task: Task, plan: ComparisonPlan, folder: Path) -> None:
    """Check the file of a task.

    Raises
    ------
    ValueError
        If it is not what the task leaves.
    """
    path, configuration = part_file(folder, task), plan.configurations[task.case]
    if task.kind == "record":
        check_problems(Problems.load(path), configuration, [task.argument], 0)
    else:
        check_rows(path, task, plan, load_problems(problems_file(folder, configuration.name)))


def gather_problems(plan: ComparisonPlan, folder: Path) -> list[int]:
    """Put the recorded problems of each experiment and its random ones into one file; returns how many each has."""

    def place(configuration: Configuration) -> Path:
        return problems_file(folder, configuration.name)

    def check(configuration: Configuration) -> None:
        check_problems(Problems.load(place(configuration)), configuration, range(plan.runs), plan.random)

    def work(configuration: Configuration) -> bool:
        parts = [folder / PARTS / f"record-{configuration.name}-{run}.npz" for run in range(plan.runs)]
        with whole_file(place(configuration)) as temporary:
            joined([*map(Problems.load, parts), draw(configuration, plan.random)]).save(temporary)
        return True

    files = TaskFolder(place, check, work, lost=lambda _: None)  # no worker takes part, so none is lost
    for _ in files.carried_out(files.pending(plan.configurations), Serial()):
        pass
    return [len(load_problems(place(configuration))) for configuration in plan.configurations]


def load_problems(path: Path) -> Problems:
    """Problems of a file, kept from the last call."""
    state = path.stat()
    return _loaded(path, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=2)
def _loaded(path: Path, changed: int, size: int) -> Problems:
    return Problems.load(path)


def _searchers() -> list[Pair]:
    """Who looks for the best known solutions: the fast solver where there is one."""
    return [Pair(name, COMPILED if find_compiler() else IPOPT) for name in ("hard", "elastic")]


def costs(folder: Path) -> dict[str, float]:
    """Processor time in s of the tasks that were carried out, by name."""
    path = folder / COSTS
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines() if path.exists() else []
    found = {}
    for name, _, seconds in (line.rpartition(" ") for line in lines):
        with suppress(ValueError):  # a damaged line: the costs of that task are not known
            found[name] = float(seconds)
    return found
