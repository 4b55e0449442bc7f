"""What ``gbt-ocp`` can be told: one parser a subcommand, each with examples that the tests parse."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import shtab

from gbt_ocp.experiments.config import catalogue
from gbt_ocp.studies.paper import STUDIES

WRONG_INPUT = 2
"""Exit code for arguments that cannot be read."""

COMPARED = "penalty, continuation, elastic, hard, exchange, soft, shooting"
"""Treatments that ``compare`` knows; written down here because asking for them would load CasADi for ``--help``."""

SHELLS = ("bash", "zsh", "fish")

EXAMPLES = {
    "run": (
        "gbt-ocp run case2",
        "gbt-ocp run case5 --set planner.formulation=hard planner.pieces=10 --seed 3",
        "gbt-ocp run mine.yaml --out runs/mine --no-figures",
    ),
    "compare": ("gbt-ocp compare case2 case5 --runs 10", "gbt-ocp compare case2 --formulations hard --problems 50"),
    "sweep": (
        "gbt-ocp sweep case2 --runs 50 --grid planner.pieces=5,10 planner.formulation=hard,penalty",
        "gbt-ocp sweep --resume runs/sweep",
    ),
    "reproduce": ("gbt-ocp reproduce table2 --runs 50", "gbt-ocp reproduce all --runs 10 --out runs/paper"),
    "codegen": ("gbt-ocp codegen case2 --out planner_c --set planner.formulation=hard --verify",),
    "animate": (
        "gbt-ocp animate runs/case2-default-penalty-seed0",
        "gbt-ocp animate runs/case2-default-penalty-seed0 --out case2.gif",
    ),
    "report": ("gbt-ocp report runs/case2-default-penalty-seed0 --out case2.html",),
    "replay": (
        "gbt-ocp replay log.csv --bearing-from north",
        "gbt-ocp replay log.csv --bearing-from x --tracker motion_gp,ekf,imm_ekf --out runs/log",
        "gbt-ocp replay log.csv --bearing-from north --where contact=1",
        "gbt-ocp replay log.csv --config mine.yaml --latency 0.5 --set tracker.range.median_m=200",
    ),
    "new": ("gbt-ocp new my_problem.py", "gbt-ocp run my_problem.py"),
    "completion": (
        "gbt-ocp completion bash > ~/.local/share/bash-completion/completions/gbt-ocp",
        'gbt-ocp completion zsh > "${fpath[1]}/_gbt-ocp"',
        "gbt-ocp completion fish > ~/.config/fish/completions/gbt-ocp.fish",
    ),
    "schema": ("gbt-ocp schema > gbt-ocp.schema.json",),
    "list": ("gbt-ocp list",),
}
"""Command lines that ``--help`` shows below each subcommand."""

# Files of a shell, and the names of the shipped configurations before them.
_CONFIG = {"bash": "_gbt_ocp_config", "zsh": "_gbt_ocp_config", "fish": "(_gbt_ocp_config)"}


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
    commands = top.add_subparsers(title="subcommands", dest="subcommand", required=True, metavar="SUBCOMMAND")

    def command(name: str, says: str) -> argparse.ArgumentParser:
        lines = "\n".join(f"  {line}" for line in EXAMPLES[name])
        made = commands.add_parser(
            name,
            help=says,
            description=f"{says[0].upper()}{says[1:]}.",
            epilog=f"examples:\n{lines}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        assert isinstance(made, argparse.ArgumentParser)
        return made

    run = command("run", "run one experiment and write its run folder")
    _add_config(run)
    _add_out(run, "run folder (default: a new one in runs/)")
    _add_set(run, "replace single keys")
    run.add_argument("--seed", metavar="N", type=_seed, help="replace the seed")
    run.add_argument("--no-figures", action="store_true", help="write no figures")
    _add_quiet(run)

    _add_comparison(command("compare", "compare treatments of the thrust limits on the same problems"))
    _add_sweep(command("sweep", "run an experiment with many seeds and with any keys varied"))

    reproduce = command("reproduce", "make a table or a figure of the paper anew")
    reproduce.add_argument("study", metavar="STUDY", choices=[*STUDIES, "all"], help=", ".join([*STUDIES, "all"]))
    reproduce.add_argument("--runs", metavar="N", type=_count, default=50, help="runs of every variant (default: 50)")
    reproduce.add_argument("--seed-from", metavar="S", type=_seed, default=0, help="the first seed (default: 0)")
    reproduce.add_argument("--tune", action="store_true", help="search for the parameters of the methods anew")
    _add_engine(reproduce)

    codegen = command("codegen", "write the planner of an experiment as C that stands alone")
    _add_config(codegen)
    _add_out(codegen, "a new or empty folder", required=True)
    _add_set(codegen, "replace single keys")
    codegen.add_argument("--solver", choices=("compiled", "ipopt"), default="compiled", help="what solves it in C")
    codegen.add_argument("--verify", action="store_true", help="build it, run its recorded steps, make it fail")

    animate = command("animate", "show a run folder as a page to play with, a GIF or an MP4")
    _add_run_dir(animate)
    _add_file(animate, "a file that ends in .html, .gif or .mp4 (default: animation.html in the run folder)")

    report = command("report", "write one page about a run: summary, figures, solver ledger, configuration")
    _add_run_dir(report)
    _add_file(report, "the page (default: report.html in the run folder)")

    _add_replay(command("replay", "track a target from a log of own positions and bearings"))

    new = command("new", "write a commented problem of your own to start from")
    new.add_argument("file", metavar="FILE.py", type=Path, help="a new Python file")

    completion = command("completion", "print the completion of gbt-ocp for a shell")
    completion.add_argument("shell", choices=SHELLS, help="the shell")

    command("schema", "print the JSON schema of the YAML, for editors")
    command("list", "list problems, configurations, trackers, guidance laws and solvers")
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


def _add_config(parser: argparse.ArgumentParser, nargs: str | None = None) -> None:
    says = "a shipped configuration (see gbt-ocp list), a YAML file, or a problem's Python file"
    _completed(parser.add_argument("config", metavar="CONFIG", nargs=nargs, help=says), _CONFIG)


def _add_run_dir(parser: argparse.ArgumentParser) -> None:
    says = "a run folder, as gbt-ocp run writes it"
    _completed(parser.add_argument("run_dir", metavar="RUN_DIR", type=Path, help=says), shtab.DIRECTORY)


def _add_out(parser: argparse._ActionsContainer, says: str, *, required: bool = False) -> None:
    action = parser.add_argument("--out", metavar="DIR", type=Path, required=required, help=says)
    _completed(action, shtab.DIRECTORY)


def _add_file(parser: argparse.ArgumentParser, says: str) -> None:
    _completed(parser.add_argument("--out", metavar="FILE", type=Path, help=says), shtab.FILE)


def _add_set(parser: argparse.ArgumentParser, says: str) -> None:
    parser.add_argument("--set", metavar="KEY.PATH=VALUE", nargs="+", action="extend", default=[], help=says)


def _add_quiet(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--quiet", action="store_true", help="show no progress")


def _completed(action: argparse.Action, how: Mapping[str, Any]) -> None:
    action.complete = how  # type: ignore[attr-defined]  # where shtab looks for it


def _add_comparison(compare: argparse.ArgumentParser) -> None:
    _add_config(compare, nargs="+")
    compare.add_argument("--formulations", metavar="NAME,NAME", type=_names, help=f"of {COMPARED}; by default all")
    compare.add_argument("--solvers", metavar="NAME,NAME", type=_names, help="ipopt, compiled (default: both)")
    compare.add_argument("--runs", metavar="N", type=_count, default=10, help="seeds in closed loop (default: 10)")
    compare.add_argument(
        "--problems", metavar="N", type=_count, default=200, help="recorded problems of each CONFIG (default: 200)"
    )
    compare.add_argument("--full", action="store_true", help="slow pairs get all problems and seeds too (hours)")
    _add_set(compare, "replace single keys")
    _add_out(compare, "a new or empty folder, or one to go on with")
    compare.add_argument("--jobs", metavar="J", type=_count, help="processes (default: one a core)")
    _add_quiet(compare)


def _add_replay(replay: argparse.ArgumentParser) -> None:
    log = replay.add_argument("log", metavar="LOG.csv", type=Path, help="columns t, own_x, own_y, bearing_deg ...")
    _completed(log, shtab.FILE)
    config = replay.add_argument("--config", metavar="CONFIG", default="replay", help="configuration (default: replay)")
    _completed(config, _CONFIG)
    replay.add_argument("--tracker", metavar="NAME,NAME", type=_names, default=[], help="trackers side by side, or all")
    replay.add_argument(
        "--bearing-from", choices=("x", "north"), help="x: counter-clockwise from +x; north: clockwise from +y"
    )
    replay.add_argument(
        "--where",
        metavar="COLUMN=VALUE",
        type=_where,
        action="append",
        default=[],
        help="read only the rows of one contact; may be given again for another column",
    )
    replay.add_argument("--latency", metavar="S", type=float, help="age in s of a bearing at its time stamp")
    _add_out(replay, "a new or empty folder (default: a new one in runs/)")
    _add_set(replay, "replace single keys")
    replay.add_argument("--no-figures", action="store_true", help="write no figures")
    _add_quiet(replay)


def _add_sweep(sweep: argparse.ArgumentParser) -> None:
    _add_config(sweep, nargs="?")
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
    _add_set(sweep, "replace keys in all runs")
    sweep.add_argument("--no-histories", action="store_true", help="keep summaries only, no history.npz")
    _add_engine(sweep)


def _add_engine(parser: argparse.ArgumentParser) -> None:
    """Add who carries out the runs, and where they are kept."""
    who = parser.add_mutually_exclusive_group()
    who.add_argument("--jobs", metavar="J", type=_count, help="processes (default: one a core)")
    who.add_argument("--dask", metavar="ADDRESS", help="scheduler of a dask.distributed cluster, or local")
    where = parser.add_mutually_exclusive_group()
    _add_out(where, "a new or empty folder (default: a new one in runs/)")
    action = where.add_argument("--resume", metavar="DIR", type=Path, help="take up what was begun in this folder")
    _completed(action, shtab.DIRECTORY)
    _add_quiet(parser)


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"found {text!r}; allowed: a whole number >= 1")
    return int(text)


def _seed(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"found {text!r}; allowed: a whole number >= 0")
    return int(text)


def _where(text: str) -> tuple[str, str]:
    column, equals, value = text.partition("=")
    if not equals or not column.strip():
        raise argparse.ArgumentTypeError(f"found {text!r}; allowed: COLUMN=VALUE")
    return column.strip(), value.strip()


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",")]
