"""The parser of the command line, made from the subcommands, and its completion in a shell."""

from __future__ import annotations

import argparse
from typing import Any, NoReturn

import shtab

from gbt_ocp import __version__
from gbt_ocp.cli.benchmark import BENCHMARK
from gbt_ocp.cli.check import CHECK
from gbt_ocp.cli.codegen import CODEGEN
from gbt_ocp.cli.exit_codes import WRONG_INPUT
from gbt_ocp.cli.lists import LIST, NEW, SCHEMA
from gbt_ocp.cli.output import show
from gbt_ocp.cli.pages import ANIMATE, REPORT
from gbt_ocp.cli.replay import REPLAY
from gbt_ocp.cli.run import RUN
from gbt_ocp.cli.studies import COMPARE, REPRODUCE, SWEEP
from gbt_ocp.cli.subcommand import Subcommand
from gbt_ocp.experiments.config import catalogue

SHELLS = ("bash", "zsh", "fish")


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.exit(WRONG_INPUT, f"{self.prog}: {message}; see {self.prog} --help\n")


def parser() -> argparse.ArgumentParser:
    """The parser of all subcommands; ``subcommand`` of what it returns is the name of the one given."""
    top = _Parser(
        prog="gbt-ocp",
        description="Trajectory optimisation for bearing-only target tracking.",
        epilog="examples:\n  gbt-ocp run case2\n  gbt-ocp list\n  gbt-ocp run --help",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("-v", "--version", action="version", version=f"gbt-ocp {__version__}")
    commands = top.add_subparsers(title="subcommands", dest="subcommand", required=True, metavar="SUBCOMMAND")
    for subcommand in SUBCOMMANDS.values():
        examples = "\n".join(f"  {line}" for line in subcommand.examples)
        made = commands.add_parser(
            subcommand.name,
            help=subcommand.purpose,
            description=f"{subcommand.purpose[0].upper()}{subcommand.purpose[1:]}.",
            epilog=f"examples:\n{examples}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        subcommand.add_arguments(made)
    return top


def completion(shell: str) -> str:
    """Completion script of a shell: subcommands, options, choices, shipped configurations, files and folders."""
    names = " ".join(catalogue.config_names())
    files: Any = {
        "bash": "_gbt_ocp_config() {\n"
        f'  compgen -W "{names}" -- "$1"\n'
        '  compgen -d -- "$1"\n  compgen -f -X \'!*.yaml\' -- "$1"\n  compgen -f -X \'!*.py\' -- "$1"\n}',
        "zsh": "_gbt_ocp_config() {\n"
        f"  _alternative 'configs:configuration:({names})' 'files:file:_files -g \"*.(yaml|py)\"'\n}}",
        "fish": f"function _gbt_ocp_config\n  printf '%s\\n' {names}\n  __fish_complete_path (commandline -ct)\nend",
    }
    return str(shtab.complete(parser(), shell=shell, preamble=files))


def _add_shell(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=SHELLS, help="the shell")


def _print_completion(arguments: argparse.Namespace) -> int:
    show(completion(arguments.shell))
    return 0


COMPLETION = Subcommand(
    "completion",
    "print the completion of gbt-ocp for a shell",
    (
        "gbt-ocp completion bash > ~/.local/share/bash-completion/completions/gbt-ocp",
        'gbt-ocp completion zsh > "${fpath[1]}/_gbt-ocp"',
        "gbt-ocp completion fish > ~/.config/fish/completions/gbt-ocp.fish",
    ),
    _add_shell,
    _print_completion,
)

SUBCOMMANDS = {
    subcommand.name: subcommand
    for subcommand in (
        RUN, COMPARE, SWEEP, REPRODUCE, BENCHMARK, CODEGEN, ANIMATE, REPORT, REPLAY,
        NEW, CHECK, COMPLETION, SCHEMA, LIST,
    )
}  # fmt: skip
"""All subcommands by their names, in the order of ``--help``. To add one: a :class:`Subcommand`, and its name here."""
