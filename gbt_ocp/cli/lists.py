"""``gbt-ocp list``, ``schema`` and ``new``: what there is, what a file may hold, and a problem to start from."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path

from gbt_ocp.cli.exit_codes import DONE
from gbt_ocp.cli.output import show
from gbt_ocp.cli.subcommand import Subcommand
from gbt_ocp.experiments.build.tracker_kinds import TRACKERS
from gbt_ocp.experiments.config import catalogue
from gbt_ocp.experiments.config.guidance import GUIDANCE_LAWS
from gbt_ocp.experiments.config.json_schema import json_schema
from gbt_ocp.experiments.config.planner import SOLVER_CHOICES
from gbt_ocp.experiments.config.vehicle import DRIVEN_BY_NAME, KNOWN_BY_NAME


def _add_nothing(parser: argparse.ArgumentParser) -> None:
    pass


def _add_what(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "what",
        nargs="?",
        metavar="WHAT",
        choices=("problems", "configurations", "trackers", "guidance laws", "vehicles", "solvers"),
        help="one of the lists alone: problems, configurations, trackers, 'guidance laws', vehicles or solvers",
    )


def _list(arguments: argparse.Namespace) -> int:
    sections: dict[str, Mapping[str, str]] = {
        "problems": {name: catalogue.load_problem(name).description for name in catalogue.problem_names()},
        "configurations": {name: catalogue.config_description(name) for name in catalogue.config_names()},
        "trackers": {name: kind.says for name, kind in TRACKERS.items()},
        "guidance laws": GUIDANCE_LAWS,
        "vehicles": {**KNOWN_BY_NAME, **DRIVEN_BY_NAME},
        "solvers": SOLVER_CHOICES,
    }
    if arguments.what is not None:
        sections = {arguments.what: sections[arguments.what]}
    for number, (title, entries) in enumerate(sections.items()):
        show(f"{'' if number == 0 else chr(10)}{title}")
        for name, description in entries.items():
            show(f"  {name:<18}{description}")
    return DONE


def _schema(arguments: argparse.Namespace) -> int:
    # JSON has escapes of its own for the Greek letters, where standard output has none
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    show(json.dumps(json_schema(), indent=2, ensure_ascii=not encoding.lower().startswith("utf")))
    return DONE


def _add_file(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE.py", type=Path, help="a new Python file")


def _new(arguments: argparse.Namespace) -> int:
    from gbt_ocp.experiments.starting_point import write_problem

    show(f"{write_problem(arguments.file)}\nrun it: gbt-ocp run {arguments.file}")
    return DONE


LIST = Subcommand(
    "list",
    "list problems, configurations, trackers, guidance laws, vehicles and solvers",
    ("gbt-ocp list", "gbt-ocp list vehicles"),
    _add_what,
    _list,
)

SCHEMA = Subcommand(
    "schema",
    "print the JSON schema of the YAML, for editors",
    ("gbt-ocp schema > gbt-ocp.schema.json",),
    _add_nothing,
    _schema,
)

NEW = Subcommand(
    "new",
    "write a commented problem of your own to start from",
    ("gbt-ocp new my_problem.py", "gbt-ocp run my_problem.py"),
    _add_file,
    _new,
)
