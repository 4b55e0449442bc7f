"""Builds a generated folder, runs its recorded steps, and makes it fail: what a user would find out later."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gbt_ocp.ocp.codegen.commands import CommandError
from gbt_ocp.ocp.codegen.library import CompilerError
from gbt_ocp.ocp.export.building import built, number_after, required_tools, run_example

NOT_FINITE = 3
"""Exit code of ``example --fail``: the planner's status for an input that is not a number."""

PILOT_PROGRAM = "pilot_example"
"""The program that replays a closed loop of a pilot, in folders that have one."""


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
    replayed
        What the replay of a pilot said in its last line; ``None`` in a folder without one.
    """

    difference: float
    vectors: int
    faults: tuple[str, ...]
    replayed: str | None = None


def verify_folder(folder: str | Path, *, flags: str = "-O2 -Werror") -> Verification:
    """Build a copy of a generated folder, run its steps twice, compare with what Python recorded, and force a failure.

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
    required_tools()
    faults = []
    try:
        with built(Path(folder), flags) as build:
            compared, failed = run_example(build), run_example(build, "--fail")
            pilot = run_example(build, program=PILOT_PROGRAM) if (build / PILOT_PROGRAM).is_file() else None
    except (CompilerError, CommandError) as fault:
        return Verification(np.inf, 0, (str(fault),))
    for name, done in (("example", compared), (PILOT_PROGRAM, pilot)):
        if done is not None and done.returncode != 0:
            faults.append(f"{name}: exit code {done.returncode}: {(done.stdout + done.stderr)[-2000:]}")
    if failed.returncode != NOT_FINITE:
        faults.append(f"example --fail: found exit code {failed.returncode}; allowed: {NOT_FINITE}")
    difference = number_after("difference", compared.stdout)
    if difference is None:
        return Verification(np.inf, 0, (*faults, "example printed no result"))
    replayed = None if pilot is None else "".join(pilot.stdout.splitlines()[-1:])
    return Verification(difference, int(compared.stdout.splitlines()[-1].split()[0]), tuple(faults), replayed)
