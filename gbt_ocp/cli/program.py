"""The program ``gbt-ocp``: the command line, and Ctrl-C while it is loaded and after it is done.

Loading takes a second, in which an interrupt would end in a traceback from the module that was being imported. Until
the command line answers interrupts itself, they are answered here.
"""

from __future__ import annotations

import os
import signal
import warnings

from gbt_ocp.cli.exit_codes import INTERRUPTED
from gbt_ocp.cli.output import open_standard_streams


def main() -> int:
    """Run the command line of this process.

    Returns
    -------
    int
        Exit code, see :mod:`gbt_ocp.cli.exit_codes`.
    """
    # What a shell starts in the background ignores Ctrl-C, and goes on ignoring it.
    heard = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if heard:
        signal.signal(signal.SIGINT, _leave)
    open_standard_streams()
    warnings.formatwarning = _warning
    from gbt_ocp.cli.main import main as command_line

    try:
        if heard:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        code = command_line()
        if heard:  # the command is done, and what is left to do is clearing up
            signal.signal(signal.SIGINT, signal.SIG_IGN)
    except KeyboardInterrupt:  # before the command line answered interrupts, or after
        return _say_so()
    return code


def _warning(
    message: Warning | str, category: type[Warning], filename: str, lineno: int, line: str | None = None
) -> str:
    """A warning as a user reads it, without the line of the program that gave it."""
    return f"warning: {message}\n"


def _leave(number: int, frame: object) -> None:
    # At once: an exception would be raised, and perhaps swallowed, in the middle of some module's import.
    os._exit(_say_so())


def _say_so() -> int:
    os.write(2, b"interrupted: nothing was written\n")
    return INTERRUPTED
