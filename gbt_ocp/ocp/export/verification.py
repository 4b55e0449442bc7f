"""Builds a generated folder, runs its recorded steps, and makes it fail: what a user would find out later."""

from __future__ import annotations

import shlex
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gbt_ocp.ocp.codegen.library import CompilerError, find_compiler

NOT_FINITE = 3
"""Exit code of ``example --fail``: the planner's status for an input that is not a number."""


@dataclass(frozen=True)
class Verification:
    """What was found.

    Attributes
    ----------
    difference
        Largest difference in metres (radians) between an endpoint of a plan of the C code and of Python.
    vectors
        How many steps were compared.
    faults
        One line a fault; empty if all is well.
    """

    difference: float
    vectors: int
    faults: tuple[str, ...]


def verify_folder(folder: str | Path, *, flags: str = "-O2 -Werror") -> Verification:
    """Build a generated folder elsewhere, run its steps twice, compare with what Python recorded, and force a failure.

    Parameters
    ----------
    folder
        What :func:`gbt_ocp.ocp.export.folder.write_c` wrote. Nothing is left in it.
    flags
        ``CFLAGS`` of the build.

    Raises
    ------
    gbt_ocp.ocp.codegen.library.CompilerError
        If there is no C compiler or no ``make``.
    """
    source = Path(folder).resolve()
    compiler, make = find_compiler(), shutil.which("make")
    if compiler is None or make is None:
        raise CompilerError("verification needs a C compiler and make")
    with tempfile.TemporaryDirectory() as scratch:
        build = [make, "-C", str(source), f"OUT={scratch}", f"CC={shlex.join(compiler)}", f"CFLAGS={flags}"]
        built = subprocess.run(build, capture_output=True, text=True, check=False)
        if built.returncode != 0:
            return Verification(np.inf, 0, (f"{' '.join(build)}: {built.stderr.strip()[-2000:]}",))

        def example(*arguments: str) -> subprocess.CompletedProcess[str]:
            command = [str(Path(scratch) / "example"), *arguments]
            return subprocess.run(command, cwd=scratch, capture_output=True, text=True, check=False)

        faults = []
        compared = example()
        if compared.returncode != 0:
            faults.append(f"example: exit code {compared.returncode}: {(compared.stdout + compared.stderr)[-2000:]}")
        failed = example("--fail")
        if failed.returncode != NOT_FINITE:
            faults.append(f"example --fail: found exit code {failed.returncode}; allowed: {NOT_FINITE}")
        words = compared.stdout.splitlines()[-1].split() if compared.stdout else []
        if "difference" not in words:
            return Verification(np.inf, 0, (*faults, "example printed no result"))
        difference = float(words[words.index("difference") + 1].rstrip(","))
        return Verification(difference, int(words[0]), tuple(faults))
