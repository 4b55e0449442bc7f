"""Commands of other programs (a compiler, make, a generated example) with a bound on their time."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path


class CommandError(RuntimeError):
    """A command could not be started or did not end."""


def run_command(command: Sequence[str], folder: Path, seconds: float) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder and read what it writes; without input, and ended after so many seconds.

    Its children are ended with it: a compiler that hangs is often a child of make.

    Raises
    ------
    CommandError
        If it cannot be started, or takes longer.
    """
    # a make above this program would pass its own flags on
    own = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
    try:
        process = subprocess.Popen(
            command,
            cwd=folder,
            env=own,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            start_new_session=True,
        )
    except OSError as fault:
        raise CommandError(f"{command[0]}: cannot be started ({fault})") from fault
    with process:
        try:
            out, err = process.communicate(timeout=seconds)
        except BaseException as fault:
            _end(process)
            if isinstance(fault, subprocess.TimeoutExpired):
                raise CommandError(f"{' '.join(command)}: not done after {seconds:g} s") from fault
            raise
    return subprocess.CompletedProcess(list(command), process.returncode, out, err)


def _end(process: subprocess.Popen[str]) -> None:
    if os.name == "posix":
        os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
