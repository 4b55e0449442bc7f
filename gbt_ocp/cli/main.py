"""Command line ``gbt-ocp``: one function a subcommand.

Progress and faults go to standard error, results to standard output. Exit codes: 0 done, 1 a fault of the program,
2 the input is wrong, 3 the run finished but broke a stated limit, 4 interrupted.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import sys
import tempfile
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

# The matrices are small (20 to 60 rows): handing them to several threads costs many times what it saves. The BLAS
# libraries read these when numpy is imported, which the next imports do. What the user has set stays.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MKL_NUM_THREADS", "1")

from gbt_ocp.cli.arguments import WRONG_INPUT, completion, parser
from gbt_ocp.experiments.build.trackers import TRACKERS
from gbt_ocp.experiments.config import catalogue
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.guidance import GUIDANCE_LAWS
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.config.schema import SOLVERS, Configuration, schema
from gbt_ocp.simulation import run_folder

if TYPE_CHECKING:
    from gbt_ocp.experiments.result import Result

DONE, PROGRAM_FAULT, LIMIT_BROKEN, INTERRUPTED = 0, 1, 3, 4

MOST_RIVALS = 100
"""Runs for one folder at the same time that each find a place beside it."""

VIOLATION_TOLERANCE = 1.0e-9
"""Relative thrust violation that still counts as round-off."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv
        Arguments without the program's name; ``None`` for those of the process.

    Returns
    -------
    int
        Exit code.
    """
    try:
        arguments = parser().parse_args(argv)
    except SystemExit as leave:
        return leave.code if isinstance(leave.code, int) else DONE
    try:
        code = _SUBCOMMANDS[arguments.subcommand](arguments)
        sys.stdout.flush()
    except ConfigurationError as error:
        print("\n".join(error.faults), file=sys.stderr)
        return WRONG_INPUT
    except BrokenPipeError:
        # The reader (`gbt-ocp schema | head`) has seen enough; the interpreter must not flush into its pipe again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except KeyboardInterrupt:
        print("interrupted: nothing was written", file=sys.stderr)
        return INTERRUPTED
    except Exception:
        traceback.print_exc()
        return PROGRAM_FAULT
    return code


def _run(arguments: argparse.Namespace) -> int:
    configuration = load_config(arguments.config, overrides=arguments.set, seed=arguments.seed)
    out: Path | None = arguments.out
    _refuse_unwritable(out)

    # CasADi and SciPy take a second to import, which faults, `schema` and `list` need not wait for.
    from gbt_ocp.experiments.run import run

    result = run(configuration, progress=not arguments.quiet)
    asked = out or _new_folder(configuration)
    out, drawn = _save_somewhere(result, asked, figures=not arguments.no_figures)
    _print_summary(result.summary)
    print(f"\n{out}")
    kept = _limits_kept(result.summary["violation_max"], result.summary["retries"]["clipped"])
    if arguments.out is not None and out != asked:
        return WRONG_INPUT
    if not drawn:
        return PROGRAM_FAULT
    return DONE if kept else LIMIT_BROKEN


def _refuse_unwritable(out: Path | None) -> None:
    """Find out before anything runs that a folder cannot be written; ``None`` is one in ``runs/``."""
    if out is not None and out.exists() and not (out.is_dir() and not any(out.iterdir())):
        raise ConfigurationError([f"--out: found {out}, which is not an empty folder; allowed: a new or empty folder"])
    above = next(one for one in (out or Path("runs")).absolute().parents if one.exists())
    if not (above.is_dir() and os.access(above, os.W_OK)):
        raise ConfigurationError(
            [f"--out: found {out or 'runs'}, which cannot be written below {above}; allowed: a writable folder"]
        )


def _save_somewhere(result: Result, out: Path, *, figures: bool) -> tuple[Path, bool]:
    """Write the run folder where it was asked for, or else where it can be; its place, and whether with its figures.

    A run may have taken long: a folder that another run has filled meanwhile, a full or a read-only disk must not
    cost its results.
    """
    try:
        return out, _save(result, out, figures=figures)
    except OSError as fault:
        taken = isinstance(fault, FileExistsError)
        elsewhere = Path() if taken else Path(tempfile.mkdtemp(prefix="gbt-ocp-")) / out.name
        try:
            if taken:
                elsewhere, drawn = _save_beside(result, out, figures=figures)
            else:
                drawn = _save(result, elsewhere, figures=False)
        except OSError:
            raise ConfigurationError(
                [f"--out: found {out}, which cannot be written ({fault}); allowed: a writable folder"]
            ) from fault
        print(f"--out: {out} cannot be written ({fault}); the results are in {elsewhere}", file=sys.stderr)
        return elsewhere, drawn


def _save_beside(result: Result, out: Path, *, figures: bool) -> tuple[Path, bool]:
    """Write the run folder under the first name beside ``out`` that nobody else takes meanwhile."""
    for _ in range(MOST_RIVALS):
        beside = _beside(out)
        with suppress(FileExistsError):
            return beside, _save(result, beside, figures=figures)
    raise FileExistsError(f"{beside}: other runs take every name")


def _save(result: Result, out: Path, *, figures: bool) -> bool:
    """Write the run folder, if need be without its figures; whether that was not needed."""
    try:
        result.save(out, figures=figures)
    except OSError:
        raise
    except Exception as fault:
        if not figures:
            raise
        # A run may have taken long: a fault in drawing must not cost its results.
        result.save(out, figures=False)
        print(f"figures: not drawn ({type(fault).__name__}: {fault}); the results are kept", file=sys.stderr)
        return False
    return True


def _limits_kept(violation: float | None, clipped: int) -> bool:
    """Whether the thrust kept its limits by plan; says so on standard error if not."""
    if clipped:
        print(f"the thrust limits were kept only by clipping, in {clipped} steps", file=sys.stderr)
        return False
    if violation is None:
        print("the thrust limits count as broken: the thrust is not a finite number", file=sys.stderr)
        return False
    if violation > VIOLATION_TOLERANCE:
        print(f"the thrust limits were broken by {violation:.3g} of the limit", file=sys.stderr)
        return False
    return True


def _new_folder(configuration: Configuration) -> Path:
    formulation = configuration.planner.formulation
    return _free(f"{configuration.name}-{configuration.preset}-{formulation}-seed{configuration.seed}")


def _free(name: str) -> Path:
    """A folder in ``runs/`` that does not exist yet."""
    folder = Path("runs") / name
    return _beside(folder) if folder.exists() else folder


def _beside(folder: Path) -> Path:
    """The first of ``NAME-2``, ``NAME-3``, ... that is not there."""
    return next(one for k in itertools.count(2) if not (one := folder.with_name(f"{folder.name}-{k}")).exists())


def _compare(arguments: argparse.Namespace) -> int:
    from gbt_ocp.studies.limits.compare import ComparisonInterruptedError, compare

    chosen = {name: getattr(arguments, name) for name in ("formulations", "solvers")}
    try:
        done = compare(
            arguments.config,
            **{name: names for name, names in chosen.items() if names is not None},
            runs=arguments.runs,
            problems=arguments.problems,
            full=arguments.full,
            overrides=arguments.set,
            out=arguments.out,
            jobs=arguments.jobs,
            progress=not arguments.quiet,
        )
    except ComparisonInterruptedError as interrupt:
        print(f"interrupted: {interrupt}", file=sys.stderr)
        return INTERRUPTED
    print("\n".join(done.verdict))
    print(f"\n{done.folder / 'report.md'}")
    return DONE


def _sweep(arguments: argparse.Namespace) -> int:
    from gbt_ocp.experiments.sweep.carry_out import SweepInterrupted, sweep
    from gbt_ocp.experiments.sweep.plan import read_axis, read_entries

    if arguments.config is None and arguments.resume is None:
        raise ConfigurationError(["CONFIG: found nothing; allowed: a configuration, or --resume DIR"])
    if arguments.config is None and (arguments.runs or arguments.grid or arguments.list or arguments.set):
        raise ConfigurationError(["CONFIG: found nothing; allowed: a configuration beside --runs, --grid, ..."])
    if arguments.config is not None and arguments.runs is None:
        raise ConfigurationError(["--runs: found nothing; allowed: a whole number >= 1"])
    grid: dict[str, list[Any]] = {}
    for key, values in map(read_axis, arguments.grid):
        if key in grid:
            raise ConfigurationError([f"--grid: found {key} twice; allowed: every key once"])
        grid[key] = values
    try:
        done = sweep(
            arguments.config,
            runs=arguments.runs,
            seed_from=arguments.seed_from,
            grid=grid,
            entries=None if arguments.list is None else read_entries(arguments.list),
            overrides=arguments.set,
            jobs=arguments.jobs,
            dask=arguments.dask,
            out=arguments.out,
            resume=arguments.resume,
            histories=not arguments.no_histories,
            progress=not arguments.quiet,
        )
    except SweepInterrupted as interrupt:
        print(f"interrupted: {interrupt}; go on with: gbt-ocp sweep --resume {interrupt.folder}", file=sys.stderr)
        return INTERRUPTED
    print(done.folder / "runs.csv")
    if done.failed:
        first = done.failed[0]
        print(
            f"{len(done.failed)} of {len(done.rows)} runs failed; run {first['run']}: {first['error']}", file=sys.stderr
        )
        return PROGRAM_FAULT
    # None where no thrust was applied: a method may place the vehicle.
    worst = max((row["violation_max"] for row in done.rows if row["violation_max"] is not None), default=0.0)
    clipped = sum(row.get("retries.clipped") or 0 for row in done.rows)
    return DONE if _limits_kept(worst, clipped) else LIMIT_BROKEN


def _reproduce(arguments: argparse.Namespace) -> int:
    from gbt_ocp.studies.paper.reproduce import StudyInterruptedError, reproduce

    try:
        folder, reports = reproduce(
            arguments.study,
            runs=arguments.runs,
            seed_from=arguments.seed_from,
            jobs=arguments.jobs,
            dask=arguments.dask,
            out=arguments.out,
            resume=arguments.resume,
            tune=arguments.tune,
            progress=not arguments.quiet,
        )
    except StudyInterruptedError as interrupt:
        again = f"gbt-ocp reproduce {arguments.study} --runs {arguments.runs} --resume {interrupt.folder}"
        print(f"interrupted: {interrupt}; go on with: {again}", file=sys.stderr)
        return INTERRUPTED
    for name, report in reports.items():
        print(report.markdown())
        print(folder / name)
    return DONE


def _codegen(arguments: argparse.Namespace) -> int:
    configuration = load_config(arguments.config, overrides=arguments.set)

    from gbt_ocp.experiments.build.loop import build_problem, build_vehicle
    from gbt_ocp.ocp import Planner
    from gbt_ocp.ocp.codegen.library import CompilerError
    from gbt_ocp.ocp.export.folder import free_folder, write_c
    from gbt_ocp.ocp.export.ipopt_source import write_ipopt_folder
    from gbt_ocp.ocp.export.verification import verify_folder
    from gbt_ocp.ocp.solvers.base import options_for

    section, solver = configuration.planner, arguments.solver
    problem = build_problem(configuration, build_vehicle(configuration))
    # Options under no solver's name are those of the solver that the configuration names.
    named = "compiled" if section.solver == "auto" else section.solver
    if arguments.verify and solver != "compiled":
        raise ConfigurationError(["--verify: found --solver ipopt; allowed: --solver compiled"])
    try:
        free_folder(arguments.out)
        options = options_for(solver, section.solver_options, common=named == solver)
        if solver == "compiled":
            write_c(Planner(problem, solver, options), arguments.out)
        else:
            write_ipopt_folder(problem, options, arguments.out)
    except (FileExistsError, CompilerError) as fault:
        raise ConfigurationError([f"--out: {fault}"]) from fault
    except OSError as fault:
        raise ConfigurationError(
            [f"--out: found {arguments.out}, which cannot be written ({fault}); allowed: a writable folder"]
        ) from fault
    except ValueError as fault:
        raise ConfigurationError([f"{arguments.config}: planner: {fault}"]) from fault
    print(arguments.out)
    if not arguments.verify:
        return DONE
    found = verify_folder(arguments.out)
    for line in found.faults:
        print(line, file=sys.stderr)
    print(f"{found.vectors} recorded steps, largest difference {found.difference:.3g}, {len(found.faults)} faults")
    return LIMIT_BROKEN if found.faults else DONE


_SHOWN = {
    "error_settled": "m",
    "error_mean": "m",
    "error_final": "m",
    "distance_median": "m",
    "violation_max": "of the limit",
    "solver": "",
    "solver_success_rate": "",
    "solver_iterations_mean": "",
    "solver_time_median_ms": "ms",
    "tracker_time_median_ms": "ms",
    "steps": "",
    "wall_s": "s",
}
"""The keys of the summary that the terminal shows, with their units; summary.json has all of them."""


def _print_summary(summary: Mapping[str, Any]) -> None:
    for key, unit in _SHOWN.items():
        value = summary.get(key)
        if value is not None:
            text = f"{value:.4g}" if isinstance(value, float) else str(value)
            print(f"{key:<24}{text:>10} {unit}".rstrip())


def _animate(arguments: argparse.Namespace) -> int:
    from gbt_ocp.reporting.animation import write_animation

    return _write_from(arguments, write_animation, "animation.html")


def _report(arguments: argparse.Namespace) -> int:
    from gbt_ocp.reporting.run_report import write_report

    return _write_from(arguments, write_report, "report.html")


def _write_from(arguments: argparse.Namespace, write: Callable[[Path, Path], Path], name: str) -> int:
    """Write a file about a run folder, if need be of this name inside it."""
    folder: Path = arguments.run_dir
    missing = [part for part in run_folder.PARTS if not (folder / part).is_file()]
    if missing:
        raise ConfigurationError(
            [f"RUN_DIR: found {folder}, without {', '.join(missing)}; allowed: a folder that gbt-ocp run wrote"]
        )
    try:
        print(write(folder, arguments.out or folder / name))
    except ValueError as fault:
        where = "--out" if str(fault).startswith("found") else "RUN_DIR"
        raise ConfigurationError([f"{where}: {fault}"]) from fault
    except OSError as fault:
        raise ConfigurationError([f"--out: {fault}; allowed: a file that can be written"]) from fault
    return DONE


def _new(arguments: argparse.Namespace) -> int:
    from gbt_ocp.experiments.starting_point import write_problem

    print(f"{write_problem(arguments.file)}\nrun it: gbt-ocp run {arguments.file}")
    return DONE


def _completion(arguments: argparse.Namespace) -> int:
    print(completion(arguments.shell))
    return DONE


def _replay(arguments: argparse.Namespace) -> int:
    from tqdm import tqdm

    from gbt_ocp.experiments.replay import replay
    from gbt_ocp.reporting.replay import score_table

    out: Path | None = arguments.out
    _refuse_unwritable(out)
    with tqdm(disable=arguments.quiet, file=sys.stderr, unit="bearing") as bar:

        def after(name: str, done: int, total: int) -> None:
            if done == 1:
                bar.reset(total)
                bar.set_description(name)
            bar.update()

        found = replay(
            arguments.log,
            arguments.config,
            trackers=arguments.tracker,
            bearing_from=arguments.bearing_from,
            latency=arguments.latency,
            overrides=arguments.set,
            progress=after,
        )
    out = out or _free(f"replay-{arguments.log.stem}")
    try:
        found.save(out, figures=not arguments.no_figures)
    except OSError as fault:
        raise ConfigurationError(
            [f"--out: found {out}, which cannot be written ({fault}); allowed: a writable folder"]
        ) from fault
    print(score_table(found.summary).markdown())
    print(f"\n{out}")
    return DONE


def _schema(arguments: argparse.Namespace) -> int:
    print(json.dumps(schema(), indent=2, ensure_ascii=False))
    return DONE


def _list(arguments: argparse.Namespace) -> int:
    sections: dict[str, Mapping[str, str]] = {
        "problems": {name: catalogue.load_problem(name).description for name in catalogue.problem_names()},
        "configurations": {name: catalogue.config_description(name) for name in catalogue.config_names()},
        "trackers": {name: kind.says for name, kind in TRACKERS.items()},
        "guidance laws": GUIDANCE_LAWS,
        "solvers": SOLVERS,
    }
    for number, (title, entries) in enumerate(sections.items()):
        print(f"{'' if number == 0 else chr(10)}{title}")
        for name, description in entries.items():
            print(f"  {name:<18}{description}")
    return DONE


_SUBCOMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {
    "run": _run,
    "compare": _compare,
    "sweep": _sweep,
    "reproduce": _reproduce,
    "codegen": _codegen,
    "animate": _animate,
    "report": _report,
    "new": _new,
    "replay": _replay,
    "completion": _completion,
    "schema": _schema,
    "list": _list,
}
