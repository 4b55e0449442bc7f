"""A comparison from its plan to its report."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from tqdm import tqdm

from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.guidance import PlannerGuidanceSection
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.experiments.interrupts import interrupted_between_steps
from gbt_ocp.experiments.sweep.engines import make_engine
from gbt_ocp.experiments.sweep.task_folder import TaskFolder, at_work_in
from gbt_ocp.files import PARTIAL, whole_file
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.studies.limits import summaries
from gbt_ocp.studies.limits.comparison_tables import Row, read_rows, write_rows
from gbt_ocp.studies.limits.formulations import COMPARED_SOLVERS, COMPILED, FORMULATIONS
from gbt_ocp.studies.limits.parts import (
    PARTS,
    PROBLEMS,
    CarryOut,
    check_part,
    costs,
    gather_problems,
    part_file,
)
from gbt_ocp.studies.limits.tasks import ComparisonPlan, Task, measurements, recordings
from gbt_ocp.studies.limits.treatments import chosen_pairs, described, unfit
from gbt_ocp.studies.limits.verdict import verdict

PLAN, TABLES, VERDICT = "comparison.json", "tables", "verdict.txt"

_ALLOWED = "allowed: a new or empty folder, or one of the same comparison"

Source = Configuration | str | Path | Mapping[str, Any]


@dataclass(frozen=True)
class Comparison:
    """A finished comparison.

    Attributes
    ----------
    folder
        Holds ``report.md`` and ``report.html``, ``verdict.txt``, ``tables/*.csv``, ``figures/*.png``,
        ``problems/*.npz``, the plan (``comparison.json``) and the parts that it was made of.
    plan
        What was compared.
    tables
        The CSV tables by name, one mapping a row.
    verdict
        Sentences; each names its tables.
    """

    folder: Path
    plan: ComparisonPlan
    tables: dict[str, list[Row]]
    verdict: list[str]


class ComparisonInterruptedError(KeyboardInterrupt):
    """The comparison was interrupted; what was finished is kept, and the same call goes on with it."""


def compare(
    configurations: Source | Sequence[Source],
    *,
    formulations: Iterable[str] = tuple(FORMULATIONS),
    solvers: Iterable[str] = COMPARED_SOLVERS,
    runs: int = 10,
    problems: int = 200,
    full: bool = False,
    overrides: Iterable[str] = (),
    out: str | os.PathLike[str] | None = None,
    jobs: int | None = None,
    progress: bool = False,
) -> Comparison:
    """Compare treatments of the same limits, on the same problems and on the same seeds.

    The limits are those on thrust and those of the section ``limits``, which all are treated alike but for ``mixed``.

    Parameters
    ----------
    configurations
        One or several of what :func:`gbt_ocp.run` takes, with ``guidance.kind: planner`` and distinct names.
    formulations
        Names of :data:`~gbt_ocp.studies.limits.treatments.FORMULATIONS`; the first one that is there is what
        times and objectives are held against.
    solvers
        ``ipopt``, ``compiled`` or both; pairs that do not exist are named in the report.
    runs
        Runs that problems are recorded in, and seeds in closed loop (slow pairs get fewer).
    problems
        Recorded problems of each configuration, at least; a quarter as many are drawn at random beside them.
    full
        Give slow pairs all problems and all seeds too, which takes hours instead of minutes. A comparison without
        it is completed by a second call with it.
    overrides
        ``key.path=value`` strings for all configurations that are not loaded yet.
    out
        A new or empty folder, or that of the same comparison, which is then resumed where it stopped. By default
        ``runs/compare-NAMES``.
    jobs
        Processes, by default one a core. Processor time is measured within each, so it does not matter how many.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    ConfigurationError
        If something asked for is wrong; one line a fault.
    ComparisonInterruptedError
        If Ctrl-C was pressed.
    """
    plan = _planned(configurations, formulations, solvers, runs, problems, full, list(overrides))
    folder = _folder(plan, out)
    with at_work_in(folder, "give the same command again"):
        _begin(folder, plan)
        return _compared(plan, folder, jobs, progress)


def _compared(plan: ComparisonPlan, folder: Path, jobs: int | None, progress: bool) -> Comparison:
    with _progress(progress) as bar:
        first = recordings(plan)
        try:
            _carry_out(first, plan, folder, jobs, bar)
            with interrupted_between_steps() as check:  # drawing problems calls CasADi, which would swallow Ctrl-C
                sizes = gather_problems(plan, folder)
                check()
            tasks = measurements(plan, sizes)
            _carry_out(tasks, plan, folder, jobs, bar)
            return _summed_up(plan, folder, first, tasks)
        except KeyboardInterrupt as fault:
            kept = sum(not path.name.startswith(".") for path in (folder / PARTS).iterdir())
            raise ComparisonInterruptedError(
                f"{kept} of {bar.total} tasks are finished and kept in {folder}; the same command goes on with them"
            ) from fault


def _summed_up(plan: ComparisonPlan, folder: Path, first: list[Task], tasks: list[Task]) -> Comparison:
    from gbt_ocp.studies.limits.report import write_report  # matplotlib only when something is drawn

    tables = _tables(plan, folder, tasks)
    tables["costs"] = summaries.costs([*first, *tasks], costs(folder))
    for name, rows in tables.items():
        with whole_file(folder / TABLES / f"{name}.csv") as temporary:
            write_rows(temporary, rows)
    # read back, so that a report never says what the files do not
    tables = {name: read_rows(folder / TABLES / f"{name}.csv") for name in tables}
    sentences = verdict(tables, plan.pairs)
    with whole_file(folder / VERDICT) as temporary:
        temporary.write_text("\n".join(sentences) + "\n", encoding="utf-8")
    write_report(folder, tables)
    return Comparison(folder, plan, tables, sentences)


def _planned(
    sources: Source | Sequence[Source],
    formulations: Iterable[str],
    solvers: Iterable[str],
    runs: int,
    problems: int,
    full: bool,
    overrides: list[str],
) -> ComparisonPlan:
    several = sources if isinstance(sources, Sequence) and not isinstance(sources, str) else [sources]
    loaded = tuple(one if isinstance(one, Configuration) else load_config(one, overrides) for one in several)
    faults = [
        f"--{name}: found {value}; allowed: a whole number >= 1"
        for name, value in (("runs", runs), ("problems", problems))
        if value < 1
    ]
    if not loaded:
        faults.append("configurations: found none; allowed: at least one")
    names = [configuration.name for configuration in loaded]
    faults += [
        f"name: found {name!r} twice; allowed: distinct names"
        for name in sorted({n for n in names if names.count(n) > 1})
    ]
    faults += [
        f"{one.name}: guidance.kind: found {one.guidance.kind!r}; allowed: planner, whose limits are compared"
        for one in loaded
        if not isinstance(one.guidance, PlannerGuidanceSection)
    ]
    faults += [
        f"{one.name}: vehicles: found {len(one.vehicles)}; allowed: none here, plans of one vehicle are compared"
        for one in loaded
        if one.vehicles
    ]
    faults += [
        f"{one.name}: planner.form: found shooting; allowed: flat, whose plans the problems are recorded with (the "
        "treatment shooting is by integration)"
        for one in loaded
        if one.planner.form != "flat"
    ]
    if faults:
        raise ConfigurationError(faults)
    pairs = chosen_pairs(formulations, solvers)
    faults += [
        f"{one.name}: --formulations: found none that fits ({unfit(one, pairs[0])}); allowed: others"
        for one in loaded
        if isinstance(one.guidance, PlannerGuidanceSection) and all(unfit(one, pair) for pair in pairs)
    ]
    if any(pair.solver == COMPILED for pair in pairs) and find_compiler() is None:
        faults.append("--solvers: found compiled, but no C compiler; allowed: ipopt")
    if faults:
        raise ConfigurationError(faults)
    return ComparisonPlan(
        tuple(one.model_copy(update={"seed": 0}) for one in loaded), tuple(pairs), runs, problems, full
    )


def _folder(plan: ComparisonPlan, out: str | os.PathLike[str] | None) -> Path:
    names = "-".join(configuration.name for configuration in plan.configurations)
    folder = Path("runs") / f"compare-{names}" if out is None else Path(out)
    try:
        if folder.exists() and not folder.is_dir():
            found = f"{folder}, which is a file"
        elif folder.is_dir() and any(map(_is_final, folder.iterdir())) and not (folder / PLAN).is_file():
            found = f"{folder}, which is not an empty folder and has no {PLAN}"
        else:
            folder.mkdir(parents=True, exist_ok=True)
            return folder
    except OSError as fault:
        found = f"{folder}, which cannot be written ({fault})"
    raise ConfigurationError([f"--out: found {found}; {_ALLOWED}"])


def _is_final(path: Path) -> bool:
    """Whether it is more than what a process that was killed was writing."""
    return not (path.name.startswith(".") and PARTIAL in path.name)


def _begin(folder: Path, plan: ComparisonPlan) -> None:
    """Refuse the folder of another comparison, and make that of this one ready."""
    path = folder / PLAN
    if path.is_file():
        try:
            known = path.read_text(encoding="utf-8")
            json.loads(known)
        except ValueError as fault:
            raise ConfigurationError([f"--out: found {path}, which is damaged ({fault}); {_ALLOWED}"]) from None
        if known not in (plan.to_json(), replace(plan, full=False).to_json()):
            raise ConfigurationError([f"--out: found {folder}, which holds another comparison ({PLAN}); {_ALLOWED}"])
    with whole_file(path) as temporary:  # before anything else: it says what the folder is for
        temporary.write_text(plan.to_json(), encoding="utf-8")
    for inner in (folder / PARTS, folder / PROBLEMS):
        inner.mkdir(exist_ok=True)


def _progress(shown: bool) -> Any:
    # without a total until the problems are there: their number decides how many tasks there are
    return tqdm(disable=not shown, file=sys.stderr, unit="task", desc="compare", total=0)


def _carry_out(tasks: list[Task], plan: ComparisonPlan, folder: Path, jobs: int | None, bar: Any) -> None:
    def lost(task: Task) -> None:
        raise ConfigurationError(
            [
                f"{part_file(folder, task)}: the process died during this task, twice (killed, out of memory, or a "
                "crash); free memory or give --jobs 1, then give the same command again"
            ]
        )

    parts = TaskFolder(
        place=partial(part_file, folder),
        check=partial(check_part, plan=plan, folder=folder),
        work=CarryOut(plan, folder),
        lost=lost,
    )
    pending = parts.pending(tasks)
    bar.total += len(tasks)
    bar.update(len(tasks) - len(pending))
    with closing(parts.carried_out(pending, make_engine(jobs if len(pending) > 1 else 1))) as finished:
        for task, _ in finished:
            bar.set_postfix_str(Path(task.name).stem, refresh=False)
            bar.update()


def _tables(plan: ComparisonPlan, folder: Path, tasks: list[Task]) -> dict[str, list[Row]]:
    def rows(kind: str) -> list[Row]:
        found = [row for task in tasks if task.kind == kind for row in read_rows(folder / PARTS / task.name)]
        order = [configuration.name for configuration in plan.configurations]
        pairs = [(pair.formulation, pair.solver) for pair in plan.pairs]
        # the order of the plan, whatever order the tasks were carried out in
        return sorted(
            found,
            key=lambda row: (
                order.index(row["case"]),
                pairs.index((row["formulation"], row["solver"])) if "solver" in row else 0,
            ),
        )

    solves = summaries.with_gaps(rows("solve"), rows("best"))
    loops = rows("loop")
    return {
        "formulations": described(plan.pairs, plan.configurations),
        "open_loop": summaries.open_loop(solves),
        "paired": summaries.paired(solves, plan.pairs),
        "classes": summaries.classes(solves),
        "closed_loop": summaries.closed_loop(loops),
        "at_a_distance": summaries.at_a_distance(loops),
        "closed_loop_paired": summaries.closed_loop_paired(loops, plan.pairs),
        "settings": summaries.settings(rows("sweep")),
        "sensitivity": summaries.sensitivity(rows("sweep")),
        "solves": solves,
        "runs": loops,
        "best_known": rows("best"),
    }
