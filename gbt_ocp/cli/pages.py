"""``gbt-ocp animate`` and ``gbt-ocp report``: a run folder as a film or a page."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import shtab

from gbt_ocp.cli.arguments import completed
from gbt_ocp.cli.exit_codes import DONE
from gbt_ocp.cli.output import show
from gbt_ocp.cli.subcommand import Subcommand
from gbt_ocp.experiments.config.faults import ConfigurationError


def _add_animate(parser: argparse.ArgumentParser) -> None:
    _add_arguments(parser, "a file that ends in .html, .gif or .mp4 (default: animation.html in the run folder)")


def _add_report(parser: argparse.ArgumentParser) -> None:
    _add_arguments(parser, "the page (default: report.html in the run folder)")


def _add_arguments(parser: argparse.ArgumentParser, file: str) -> None:
    says = "a run folder, as gbt-ocp run writes it"
    completed(parser.add_argument("run_dir", metavar="RUN_DIR", type=Path, help=says), shtab.DIRECTORY)
    completed(parser.add_argument("--out", metavar="FILE", type=Path, help=file), shtab.FILE)


def _animate(arguments: argparse.Namespace) -> int:
    from gbt_ocp.reporting.animation import write_animation

    return _write_from(arguments, write_animation, "animation.html")


def _report(arguments: argparse.Namespace) -> int:
    from gbt_ocp.reporting.run_report import write_report

    return _write_from(arguments, write_report, "report.html")


def _write_from(arguments: argparse.Namespace, write: Callable[[Path, Path], Path], name: str) -> int:
    """Write a file about a run folder; where no name is given, under this name inside it."""
    from gbt_ocp.simulation import run_folder

    folder: Path = arguments.run_dir
    missing = [part for part in run_folder.PARTS if not (folder / part).is_file()]
    if missing:
        raise ConfigurationError(
            [f"RUN_DIR: found {folder}, without {', '.join(missing)}; allowed: a folder that gbt-ocp run wrote"]
        )
    try:
        show(write(folder, arguments.out or folder / name))
    except ValueError as fault:
        where = "--out" if str(fault).startswith("found") else "RUN_DIR"
        raise ConfigurationError([f"{where}: {fault}"]) from fault
    except OSError as fault:
        raise ConfigurationError([f"--out: {fault}; allowed: a file that can be written"]) from fault
    return DONE


ANIMATE = Subcommand(
    "animate",
    "show a run folder as a page to play with, a GIF or an MP4",
    (
        "gbt-ocp animate runs/case2-default-penalty-seed0",
        "gbt-ocp animate runs/case2-default-penalty-seed0 --out case2.gif",
    ),
    _add_animate,
    _animate,
)

REPORT = Subcommand(
    "report",
    "write one page about a run: summary, figures, solver ledger, configuration",
    ("gbt-ocp report runs/case2-default-penalty-seed0 --out case2.html",),
    _add_report,
    _report,
)
