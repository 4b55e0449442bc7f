"""A subcommand of ``gbt-ocp``: its name, its help, its arguments, and the function that carries it out."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Subcommand:
    """A subcommand.

    Attributes
    ----------
    name
        On the command line.
    purpose
        What it does, in one sentence without a capital and a full stop.
    examples
        Command lines that ``--help`` shows; the tests parse them.
    add_arguments
        Adds its arguments to its parser.
    carry_out
        Does it and returns an exit code (:mod:`gbt_ocp.cli.exit_codes`). Imports of what takes long to load stand in
        it: CasADi and SciPy take a second, which ``--help`` and a fault of the input need not wait for.
    """

    name: str
    purpose: str
    examples: tuple[str, ...]
    add_arguments: Callable[[argparse.ArgumentParser], None]
    carry_out: Callable[[argparse.Namespace], int]
