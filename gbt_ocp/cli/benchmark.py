"""``gbt-ocp benchmark``: trackers over public scenarios."""

from __future__ import annotations

import argparse
from pathlib import Path

import shtab

from gbt_ocp.cli.arguments import add_out, add_quiet, completed, count, names
from gbt_ocp.cli.exit_codes import DONE, INTERRUPTED
from gbt_ocp.cli.output import remark, show
from gbt_ocp.cli.subcommand import Subcommand
from gbt_ocp.experiments.config.faults import ConfigurationError


def _add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scenarios", metavar="NAME,NAME", type=names, help="by default all; --list shows them")
    parser.add_argument("--trackers", metavar="NAME,NAME", type=names, help="by default all; --list shows them")
    parser.add_argument("--runs", metavar="N", type=count, help="runs of every scenario (default: its own number)")
    parser.add_argument("--quick", action="store_true", help="a tenth of the runs")
    logs = parser.add_argument(
        "--logs", metavar="DIR", type=Path, help="a folder of CSV files with recorded bearings and true positions"
    )
    completed(logs, shtab.DIRECTORY)
    parser.add_argument("--jobs", metavar="J", type=count, help="processes (default: one a core)")
    where = parser.add_mutually_exclusive_group()
    add_out(where, "a new or empty folder, or that of the same benchmark (default: a new one in runs/)")
    action = where.add_argument("--resume", metavar="DIR", type=Path, help="go on with what was begun in this folder")
    completed(action, shtab.DIRECTORY)
    parser.add_argument("--list", action="store_true", help="list scenarios and trackers, and run nothing")
    add_quiet(parser)


def _carry_out(arguments: argparse.Namespace) -> int:
    from gbt_ocp.studies.scenarios.benchmark import BenchmarkInterruptedError, benchmark, known_scenarios
    from gbt_ocp.studies.scenarios.benchmark_report import OVERVIEW, overview
    from gbt_ocp.studies.scenarios.contestants import CONTESTANTS

    if arguments.list:
        known = known_scenarios(None if arguments.logs is None else str(arguments.logs))
        for name, scenario in known.items():
            show(f"{name}: {scenario.title} ({scenario.source}); {scenario.runs} runs")
        for name, one in CONTESTANTS.items():
            show(f"{name}: {one.says}" + ("" if one.installed else " (not installed)"))
        return DONE
    given = [name for name in ("scenarios", "trackers", "runs", "quick", "logs") if getattr(arguments, name)]
    if arguments.resume is not None and given:
        raise ConfigurationError([f"--resume: found --{given[0]} beside it; allowed: the benchmark as it was planned"])
    try:
        done = benchmark(
            arguments.scenarios,
            arguments.trackers,
            runs=arguments.runs,
            quick=arguments.quick,
            logs=arguments.logs,
            out=arguments.out,
            resume=arguments.resume,
            jobs=arguments.jobs,
            progress=not arguments.quiet,
        )
    except BenchmarkInterruptedError as interrupt:
        remark(f"interrupted: {interrupt}; go on with --resume")
        return INTERRUPTED
    for note in done.notes:
        remark(note)
    show(f"{OVERVIEW}\n\n{overview(done.rows)}\n")
    show(done.folder / "report.md")
    return DONE


BENCHMARK = Subcommand(
    "benchmark",
    "compare trackers, also those of other packages, on public scenarios",
    ("gbt-ocp benchmark --quick", "gbt-ocp benchmark --scenarios sea2d,ristic_moderate --trackers ekf,stonesoup_ukf"),
    _add,
    _carry_out,
)
