"""Arguments that several subcommands share."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import shtab

# Files of a shell, and the names of the shipped configurations before them (see gbt_ocp.cli.parser.completion).
CONFIG = {"bash": "_gbt_ocp_config", "zsh": "_gbt_ocp_config", "fish": "(_gbt_ocp_config)"}


def add_config(parser: argparse.ArgumentParser, nargs: str | None = None) -> None:
    """Add ``CONFIG``."""
    says = "a shipped configuration (see gbt-ocp list), a YAML file, or a problem's Python file"
    completed(parser.add_argument("config", metavar="CONFIG", nargs=nargs, help=says), CONFIG)


def add_set(parser: argparse.ArgumentParser, says: str = "replace single keys") -> None:
    """Add ``--set``."""
    parser.add_argument("--set", metavar="KEY.PATH=VALUE", nargs="+", action="extend", default=[], help=says)


def add_out(parser: argparse._ActionsContainer, says: str, *, required: bool = False) -> None:
    """Add ``--out`` for a folder."""
    action = parser.add_argument("--out", metavar="DIR", type=Path, required=required, help=says)
    completed(action, shtab.DIRECTORY)


def add_quiet(parser: argparse.ArgumentParser) -> None:
    """Add ``--quiet``."""
    parser.add_argument("--quiet", action="store_true", help="show no progress")


def completed(action: argparse.Action, how: Mapping[str, Any]) -> None:
    """Have a shell complete an argument with files, folders or configurations."""
    action.complete = how  # type: ignore[attr-defined]  # where shtab looks for it


def count(text: str) -> int:
    """Type of an argument: a whole number from 1."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"found {text!r}; allowed: a whole number >= 1")
    return int(text)


def seed(text: str) -> int:
    """Type of an argument: a whole number from 0."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"found {text!r}; allowed: a whole number >= 0")
    return int(text)


def names(text: str) -> list[str]:
    """Type of an argument: names between commas."""
    return [name.strip() for name in text.split(",")]
