"""``gbt-ocp compare``, ``sweep`` and ``reproduce``: many runs, which go on where they were interrupted."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import shtab

from gbt_ocp.cli.arguments import add_config, add_out, add_quiet, add_set, completed, count, names, seed
from gbt_ocp.cli.exit_codes import DONE, INTERRUPTED, LIMIT_BROKEN, PROGRAM_FAULT
from gbt_ocp.cli.output import remark, show
from gbt_ocp.cli.run import limits_kept
from gbt_ocp.cli.subcommand import Subcommand
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.studies.paper import STUDIES

COMPARED = "penalty, continuation, elastic, mixed, hard, exchange, soft, shooting"
"""Treatments that ``compare`` knows; repeated here because importing them would load CasADi for ``--help``."""


def _add_engine(parser: argparse.ArgumentParser) -> None:
    """Add who carries out the runs, and where they are kept."""
    who = parser.add_mutually_exclusive_group()
    who.add_argument("--jobs", metavar="J", type=count, help="processes (default: one a core)")
    who.add_argument("--dask", metavar="ADDRESS", help="scheduler of a dask.distributed cluster, or local")
    where = parser.add_mutually_exclusive_group()
    add_out(where, "a new or empty folder (default: a new one in runs/)")
    action = where.add_argument("--resume", metavar="DIR", type=Path, help="go on with what was begun in this folder")
    completed(action, shtab.DIRECTORY)
    add_quiet(parser)


def _add_compare(parser: argparse.ArgumentParser) -> None:
    add_config(parser, nargs="+")
    parser.add_argument("--formulations", metavar="NAME,NAME", type=names, help=f"of {COMPARED}; by default all")
    parser.add_argument("--solvers", metavar="NAME,NAME", type=names, help="ipopt, compiled (default: both)")
    parser.add_argument("--runs", metavar="N", type=count, default=10, help="seeds in closed loop (default: 10)")
    parser.add_argument(
        "--problems", metavar="N", type=count, default=200, help="recorded problems of each CONFIG (default: 200)"
    )
    parser.add_argument("--full", action="store_true", help="slow pairs get all problems and seeds too (hours)")
    add_set(parser)
    add_out(parser, "a new or empty folder, or one to go on with")
    parser.add_argument("--jobs", metavar="J", type=count, help="processes (default: one a core)")
    add_quiet(parser)


def _compare(arguments: argparse.Namespace) -> int:
    from gbt_ocp.studies.limits.compare import ComparisonInterruptedError, compare

    chosen = {name: getattr(arguments, name) for name in ("formulations", "solvers")}
    try:
        done = compare(
            arguments.config,
            **{name: value for name, value in chosen.items() if value is not None},
            runs=arguments.runs,
            problems=arguments.problems,
            full=arguments.full,
            overrides=arguments.set,
            out=arguments.out,
            jobs=arguments.jobs,
            progress=not arguments.quiet,
        )
    except ComparisonInterruptedError as interrupt:
        remark(f"interrupted: {interrupt}")
        return INTERRUPTED
    show("\n".join(done.verdict))
    show(f"\n{done.folder / 'report.md'}")
    return DONE


def _add_sweep(parser: argparse.ArgumentParser) -> None:
    add_config(parser, nargs="?")
    parser.add_argument("--runs", metavar="N", type=count, help="seeds of every variant")
    parser.add_argument("--seed-from", metavar="S", type=seed, default=0, help="the first seed (default: 0)")
    parser.add_argument(
        "--grid",
        metavar="KEY.PATH=V1,V2",
        nargs="+",
        action="extend",
        default=[],
        help="values of a key; all combinations are run",
    )
    parser.add_argument("--list", metavar="FILE", type=Path, help="a YAML list of variants, mappings of keys")
    add_set(parser, "replace keys in all runs")
    parser.add_argument("--no-histories", action="store_true", help="keep summaries only, no history.npz")
    _add_engine(parser)


def _sweep(arguments: argparse.Namespace) -> int:
    from gbt_ocp.experiments.sweep.carry_out import SweepInterrupted, sweep
    from gbt_ocp.experiments.sweep.sweep_plan import read_axis, read_entries

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
        remark(f"interrupted: {interrupt}; go on with: gbt-ocp sweep --resume {interrupt.folder}")
        return INTERRUPTED
    show(done.folder / "runs.csv")
    if done.failed:
        first = done.failed[0]
        remark(f"{len(done.failed)} of {len(done.rows)} runs failed; run {first['run']}: {first['error']}")
        return PROGRAM_FAULT
    # None where no thrust was applied: a method may place the vehicle.
    worst = max((row["violation_max"] for row in done.rows if row["violation_max"] is not None), default=0.0)
    clipped = sum(row.get("retries.clipped") or 0 for row in done.rows)
    return DONE if limits_kept(worst, clipped) else LIMIT_BROKEN


def _add_reproduce(parser: argparse.ArgumentParser) -> None:
    studies = [*STUDIES, "all"]
    parser.add_argument("study", metavar="STUDY", choices=studies, help=", ".join(studies))
    parser.add_argument("--runs", metavar="N", type=count, default=50, help="runs of every variant (default: 50)")
    parser.add_argument("--seed-from", metavar="S", type=seed, default=0, help="the first seed (default: 0)")
    parser.add_argument("--tune", action="store_true", help="search for the parameters of the methods again")
    _add_engine(parser)


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
        remark(f"interrupted: {interrupt}; go on with: {again}")
        return INTERRUPTED
    for name, report in reports.items():
        show(report.markdown())
        show(folder / name)
    return DONE


COMPARE = Subcommand(
    "compare",
    "compare treatments of the same limits on the same problems",
    ("gbt-ocp compare case2 case5 --runs 10", "gbt-ocp compare sea2d sea3d --solvers compiled"),
    _add_compare,
    _compare,
)

SWEEP = Subcommand(
    "sweep",
    "run an experiment with many seeds and with any keys varied",
    (
        "gbt-ocp sweep case2 --runs 50 --grid planner.pieces=5,10 planner.formulation=hard,penalty",
        "gbt-ocp sweep --resume runs/sweep",
    ),
    _add_sweep,
    _sweep,
)

REPRODUCE = Subcommand(
    "reproduce",
    "make a table or a figure of the paper again",
    ("gbt-ocp reproduce table2 --runs 50", "gbt-ocp reproduce all --runs 10 --out runs/paper"),
    _add_reproduce,
    _reproduce,
)
