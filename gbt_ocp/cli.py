"""Command line ``gbt-ocp``: one function a subcommand.

Progress and faults go to standard error, results to standard output. Exit codes: 0 done, 1 a fault of the program,
2 the input is wrong, 3 the run finished but broke a stated limit, 4 interrupted.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import traceback
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

# The matrices are small (20 to 60 rows): handing them to several threads costs many times what it saves. The BLAS
# libraries read these when numpy is imported, which the next imports do. What the user has set stays.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MKL_NUM_THREADS", "1")

from gbt_ocp.experiments import catalogue
from gbt_ocp.experiments.configuration import SOLVERS, Configuration, schema
from gbt_ocp.experiments.faults import ConfigurationError
from gbt_ocp.experiments.guidance_sections import GUIDANCE_LAWS
from gbt_ocp.experiments.loading import load_config
from gbt_ocp.experiments.studies import STUDIES
from gbt_ocp.experiments.tracker_sections import TRACKERS

if TYPE_CHECKING:
    from gbt_ocp.experiments.result import Result

DONE, PROGRAM_FAULT, WRONG_INPUT, LIMIT_BROKEN, INTERRUPTED = 0, 1, 2, 3, 4

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
        arguments = _parser().parse_args(argv)
    except SystemExit as leave:
        return leave.code if isinstance(leave.code, int) else DONE
    try:
        code: int = arguments.subcommand(arguments)
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


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.exit(WRONG_INPUT, f"{self.prog}: {message}; see {self.prog} --help\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="gbt-ocp", description="Trajectory optimisation for bearing-only target tracking.")
    commands = parser.add_subparsers(title="subcommands", required=True, metavar="SUBCOMMAND")

    run = commands.add_parser("run", help="run one experiment and write its run folder")
    run.add_argument("config", metavar="CONFIG", help="a shipped configuration (see gbt-ocp list) or a YAML file")
    run.add_argument("--out", metavar="DIR", type=Path, help="run folder (default: a new one in runs/)")
    run.add_argument(
        "--set", metavar="KEY.PATH=VALUE", nargs="+", action="extend", default=[], help="replace single keys"
    )
    run.add_argument("--seed", metavar="N", type=_seed, help="replace the seed")
    run.add_argument("--no-figures", action="store_true", help="write no figures")
    run.add_argument("--quiet", action="store_true", help="show no progress")
    run.set_defaults(subcommand=_run)

    codegen = commands.add_parser("codegen", help="write the planner of an experiment as C that stands alone")
    codegen.add_argument("config", metavar="CONFIG", help="a shipped configuration or a YAML file")
    codegen.add_argument("--out", metavar="DIR", type=Path, required=True, help="a new or empty folder")
    codegen.add_argument(
        "--set", metavar="KEY.PATH=VALUE", nargs="+", action="extend", default=[], help="replace single keys"
    )
    codegen.add_argument("--solver", choices=("compiled", "ipopt"), default="compiled", help="what solves it in C")
    codegen.add_argument("--verify", action="store_true", help="build it, run its recorded steps, make it fail")
    codegen.set_defaults(subcommand=_codegen)

    sweep = commands.add_parser("sweep", help="run an experiment with many seeds and with any keys varied")
    sweep.add_argument("config", metavar="CONFIG", nargs="?", help="a shipped configuration or a YAML file")
    sweep.add_argument("--runs", metavar="N", type=_count, help="seeds of every variant")
    sweep.add_argument("--seed-from", metavar="S", type=_seed, default=0, help="the first seed (default: 0)")
    sweep.add_argument(
        "--grid",
        metavar="KEY.PATH=V1,V2",
        nargs="+",
        action="extend",
        default=[],
        help="values of a key; all combinations are run",
    )
    sweep.add_argument("--list", metavar="FILE", type=Path, help="a YAML list of variants, mappings of keys")
    sweep.add_argument(
        "--set", metavar="KEY.PATH=VALUE", nargs="+", action="extend", default=[], help="replace keys in all runs"
    )
    sweep.add_argument("--no-histories", action="store_true", help="keep summaries only, no history.npz")
    _add_engine(sweep)
    sweep.set_defaults(subcommand=_sweep)

    reproduce = commands.add_parser("reproduce", help="make a table or a figure of the paper anew")
    reproduce.add_argument("study", metavar="STUDY", choices=[*STUDIES, "all"], help=", ".join([*STUDIES, "all"]))
    reproduce.add_argument("--runs", metavar="N", type=_count, default=50, help="runs of every variant (default: 50)")
    reproduce.add_argument("--seed-from", metavar="S", type=_seed, default=0, help="the first seed (default: 0)")
    reproduce.add_argument("--tune", action="store_true", help="search for the parameters of the methods anew")
    _add_engine(reproduce)
    reproduce.set_defaults(subcommand=_reproduce)

    compare = commands.add_parser("compare", help="compare treatments of the thrust limits on the same problems")
    compare.add_argument("config", metavar="CONFIG", nargs="+", help="shipped configurations or YAML files")
    compare.add_argument("--formulations", metavar="NAME,NAME", type=_names, help="by default all (see the report)")
    compare.add_argument("--solvers", metavar="NAME,NAME", type=_names, help="ipopt, compiled (default: both)")
    compare.add_argument("--runs", metavar="N", type=_count, default=10, help="seeds in closed loop (default: 10)")
    compare.add_argument(
        "--problems", metavar="N", type=_count, default=200, help="recorded problems of each CONFIG (default: 200)"
    )
    compare.add_argument(
        "--set", metavar="KEY.PATH=VALUE", nargs="+", action="extend", default=[], help="replace single keys"
    )
    compare.add_argument("--out", metavar="DIR", type=Path, help="a new or empty folder, or one to go on with")
    compare.add_argument("--jobs", metavar="J", type=_count, help="processes (default: one a core)")
    compare.add_argument("--quiet", action="store_true", help="show no progress")
    compare.set_defaults(subcommand=_compare)

    commands.add_parser("schema", help="print the JSON schema of the YAML, for editors").set_defaults(
        subcommand=_schema
    )
    commands.add_parser("list", help="list problems, configurations, trackers, guidance laws and solvers").set_defaults(
        subcommand=_list
    )
    return parser


def _add_engine(parser: argparse.ArgumentParser) -> None:
    """Add who carries out the runs, and where they are kept."""
    who = parser.add_mutually_exclusive_group()
    who.add_argument("--jobs", metavar="J", type=_count, help="processes (default: one a core)")
    who.add_argument("--dask", metavar="ADDRESS", help="scheduler of a dask.distributed cluster, or local")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--out", metavar="DIR", type=Path, help="a new or empty folder (default: a new one in runs/)")
    where.add_argument("--resume", metavar="DIR", type=Path, help="take up what was begun in this folder")
    parser.add_argument("--quiet", action="store_true", help="show no progress")


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"found {text!r}; allowed: a whole number >= 1")
    return int(text)


def _seed(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"found {text!r}; allowed: a whole number >= 0")
    return int(text)


def _run(arguments: argparse.Namespace) -> int:
    configuration = load_config(arguments.config, overrides=arguments.set, seed=arguments.seed)
    out: Path | None = arguments.out
    if out is not None and out.exists() and not (out.is_dir() and not any(out.iterdir())):
        raise ConfigurationError([f"--out: found {out}, which is not an empty folder; allowed: a new or empty folder"])

    # CasADi and SciPy take a second to import, which faults, `schema` and `list` need not wait for.
    from gbt_ocp.experiments.run import run

    result = run(configuration, progress=not arguments.quiet)
    out = out or _new_folder(configuration)
    try:
        drawn = _save(result, out, figures=not arguments.no_figures)
    except OSError as fault:
        raise ConfigurationError(
            [f"--out: found {out}, which cannot be written ({fault}); allowed: a writable folder"]
        ) from fault
    _print_summary(result.summary)
    print(f"\n{out}")
    kept = _limits_kept(result.summary["violation_max"])
    if not drawn:
        return PROGRAM_FAULT
    return DONE if kept else LIMIT_BROKEN


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


def _limits_kept(violation: float | None) -> bool:
    """Whether the thrust kept its limits; says so on standard error if not."""
    if violation is None:
        print("the thrust limits count as broken: the thrust is not a finite number", file=sys.stderr)
        return False
    if violation > VIOLATION_TOLERANCE:
        print(f"the thrust limits were broken by {violation:.3g} of the limit", file=sys.stderr)
        return False
    return True


def _new_folder(configuration: Configuration) -> Path:
    formulation = configuration.planner.formulation
    base = f"{configuration.name}-{configuration.preset}-{formulation}-seed{configuration.seed}"
    folder, count = Path("runs") / base, 1
    while folder.exists():
        count += 1
        folder = Path("runs") / f"{base}-{count}"
    return folder


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",")]


def _compare(arguments: argparse.Namespace) -> int:
    from gbt_ocp.experiments.comparison.compare import ComparisonInterruptedError, compare

    chosen = {name: getattr(arguments, name) for name in ("formulations", "solvers")}
    try:
        done = compare(
            arguments.config,
            **{name: names for name, names in chosen.items() if names is not None},
            runs=arguments.runs,
            problems=arguments.problems,
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
    from gbt_ocp.experiments.sweep.plan import read_axis, read_entries
    from gbt_ocp.experiments.sweep.sweeping import SweepInterrupted, sweep

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
    return DONE if _limits_kept(worst) else LIMIT_BROKEN


def _reproduce(arguments: argparse.Namespace) -> int:
    from gbt_ocp.experiments.studies.reproducing import reproduce
    from gbt_ocp.experiments.sweep.sweeping import SweepInterrupted

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
    except SweepInterrupted as interrupt:
        again = f"gbt-ocp reproduce {arguments.study} --runs {arguments.runs} --resume {interrupt.folder.parents[1]}"
        print(f"interrupted: {interrupt}; go on with: {again}", file=sys.stderr)
        return INTERRUPTED
    for name, report in reports.items():
        print(report.markdown())
        print(folder / name)
    return DONE


def _codegen(arguments: argparse.Namespace) -> int:
    configuration = load_config(arguments.config, overrides=arguments.set)

    from gbt_ocp.experiments.build import build_problem, build_vehicle
    from gbt_ocp.ocp.codegen.building import CompilerError
    from gbt_ocp.ocp.codegen.folder import write_folder
    from gbt_ocp.ocp.codegen.ipopt_source import write_ipopt_folder
    from gbt_ocp.ocp.codegen.verification import verify_folder

    section, solver = configuration.planner, arguments.solver
    problem = build_problem(configuration, build_vehicle(configuration))
    # Options are those of the solver that the configuration names.
    named = "compiled" if section.solver == "auto" else section.solver
    options = section.solver_options if named == solver else {}
    if arguments.verify and solver != "compiled":
        raise ConfigurationError(["--verify: found --solver ipopt; allowed: --solver compiled"])
    try:
        write = write_folder if solver == "compiled" else write_ipopt_folder
        write(problem, options, arguments.out)
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


def _schema(arguments: argparse.Namespace) -> int:
    print(json.dumps(schema(), indent=2, ensure_ascii=False))
    return DONE


def _list(arguments: argparse.Namespace) -> int:
    sections: dict[str, Mapping[str, str]] = {
        "problems": {name: catalogue.load_problem(name).description for name in catalogue.problem_names()},
        "configurations": {name: catalogue.config_description(name) for name in catalogue.config_names()},
        "trackers": TRACKERS,
        "guidance laws": GUIDANCE_LAWS,
        "solvers": SOLVERS,
    }
    for number, (title, entries) in enumerate(sections.items()):
        print(f"{'' if number == 0 else chr(10)}{title}")
        for name, description in entries.items():
            print(f"  {name:<16}{description}")
    return DONE


if __name__ == "__main__":
    raise SystemExit(main())
