"""The program ``gbt-ocp``: the command line, and Ctrl-C while it is loaded and after it is done.

Loading takes a second, in which an interrupt would end in a traceback of whatever was being imported. Until the command
line answers for itself, it is answered here.
"""

from __future__ import annotations

import os
import signal
import warnings

INTERRUPTED = 4
"""Exit code; :mod:`gbt_ocp.cli.main` has it too, and is not loaded yet when it is needed."""


def main() -> int:
    """Run the command line of this process.

    Returns
    -------
    int
        Exit code, see :mod:`gbt_ocp.cli.main`.
    """
    warnings.formatwarning = _warning
    # What a shell starts in the background ignores Ctrl-C, and is left to do so.
    heard = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if heard:
        signal.signal(signal.SIGINT, _leave)
    from gbt_ocp.cli.main import main as command_line

    try:
        if heard:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        code = command_line()
        if heard:  # it is done: what comes is clearing up
            signal.signal(signal.SIGINT, signal.SIG_IGN)
    except KeyboardInterrupt:  # before it answered, or after
        return _said()
    return code


def _warning(
    message: Warning | str, category: type[Warning], filename: str, lineno: int, line: str | None = None
) -> str:
    """A warning as a user reads it, without the line of the program that gave it."""
    return f"warning: {message}\n"


def _leave(number: int, frame: object) -> None:
    # At once: an exception would be raised, and perhaps swallowed, in the middle of some module's import.
    os._exit(_said())


def _said() -> int:
    os.write(2, b"interrupted: nothing was written\n")
    return INTERRUPTED
