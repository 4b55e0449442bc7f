"""``gbt-ocp check``: the parts of an experiment, evaluated without a run."""

from __future__ import annotations

import argparse

from gbt_ocp.cli.arguments import add_config, add_set
from gbt_ocp.cli.exit_codes import DONE
from gbt_ocp.cli.output import show
from gbt_ocp.cli.subcommand import Subcommand
from gbt_ocp.experiments.config.loading import load_config


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    add_config(parser)
    add_set(parser)


def _carry_out(arguments: argparse.Namespace) -> int:
    configuration = load_config(arguments.config, overrides=arguments.set)

    from gbt_ocp.experiments.check_problem import check_problem

    findings = check_problem(configuration)
    for finding in findings:
        show(f"{finding.topic:<12}{'doubtful: ' * finding.doubtful}{finding.text}")
    doubtful = sum(finding.doubtful for finding in findings)
    show(f"\nno fault found{f', {doubtful} doubtful' if doubtful else ''}")
    return DONE


CHECK = Subcommand(
    "check",
    "evaluate target, vehicle, objective and limits of a problem once, without a run",
    ("gbt-ocp check my_problem.py", "gbt-ocp check case2 --set planner.formulation=hard"),
    _add_arguments,
    _carry_out,
)
