"""Builds a generated folder with make, in a copy, and runs its example there."""

from __future__ import annotations

import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gbt_ocp.ocp.codegen.commands import CommandError, run_command
from gbt_ocp.ocp.codegen.library import CompilerError, find_compiler

BUILD_S = 600.0
"""Seconds that a build may take; some ten are usual."""

RUN_S = 120.0
"""Seconds that the example may take for the recorded steps; less than one is usual."""


def required_tools() -> tuple[list[str], str]:
    """The C compiler and ``make``.

    Raises
    ------
    gbt_ocp.ocp.codegen.library.CompilerError
        If one of them is missing.
    """
    compiler, make = find_compiler(), shutil.which("make")
    if compiler is None or make is None:
        missing = "C compiler" if compiler is None else "make"
        raise CompilerError(f"found no {missing}; allowed: a machine with a C compiler (CC, cc, gcc, clang) and make")
    return compiler, make


@contextmanager
def built(folder: Path, flags: str) -> Iterator[Path]:
    """Copy a generated folder, build it there, and yield where the library and the example are.

    Nothing is left in the folder. make runs inside the copy and is given relative names only, since it cannot handle
    spaces in paths.

    Parameters
    ----------
    folder
        What :func:`gbt_ocp.ocp.export.folder.write_c` wrote.
    flags
        ``CFLAGS`` of the build.

    Raises
    ------
    gbt_ocp.ocp.codegen.library.CompilerError
        If there is no C compiler or no ``make``, or the build fails; the message ends with what it said.
    """
    compiler, make = required_tools()
    with tempfile.TemporaryDirectory() as scratch:
        copy = Path(scratch) / "planner"
        shutil.copytree(folder, copy)
        quoted = shlex.join(compiler).replace("$", "$$")  # for the shell, and for make, which expands $
        command = [make, f"CC={quoted}", f"CFLAGS={flags}", "OUT=build"]
        try:
            done = run_command(command, copy, BUILD_S)
        except CommandError as fault:
            raise CompilerError(str(fault)) from fault
        if done.returncode != 0 or not (copy / "build" / "example").is_file():
            said = (done.stderr or done.stdout).strip()[-2000:] or "it wrote nothing"
            raise CompilerError(f"{shlex.join(command)} failed: {said}")
        yield copy / "build"


def run_example(build: Path, *arguments: str, program: str = "example") -> subprocess.CompletedProcess[str]:
    """Run the example of a build, or another program beside it.

    Raises
    ------
    gbt_ocp.ocp.codegen.commands.CommandError
        If it cannot be started, or does not end.
    """
    return run_command([str(build / program), *arguments], build, RUN_S)


def number_after(word: str, text: str) -> float | None:
    """The number after a word in the last line of the example's output; ``None`` if there is none."""
    words = text.splitlines()[-1].split() if text.strip() else []
    try:
        return float(words[words.index(word) + 1].rstrip(","))
    except (ValueError, IndexError):
        return None
