"""What the command line prints: results on standard output, remarks on standard error."""

from __future__ import annotations

import os
import sys
from contextlib import suppress


class OutputError(Exception):
    """Standard output cannot take what is printed; the message says why."""


def open_standard_streams() -> None:
    """Open the standard streams that the caller closed, so that no file of a run gets their place.

    A solver in C that prints to descriptor 1 would otherwise write into whichever file was opened first.
    """
    for descriptor in (0, 1, 2):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number, which is this one
    if sys.stderr is None:
        sys.stderr = os.fdopen(2, "w", encoding="utf-8")


def show(text: object = "") -> None:
    """Print a result; signs that standard output has not are escaped.

    Raises
    ------
    OutputError
        If standard output is closed or cannot be written.
    BrokenPipeError
        If its reader has left.
    """
    stream = sys.stdout
    if stream is None:
        raise OutputError("standard output: found it closed; allowed: a terminal, a pipe or a file")
    encoding = stream.encoding or "utf-8"
    try:
        print(str(text).encode(encoding, "backslashreplace").decode(encoding), file=stream, flush=True)
    except BrokenPipeError:
        raise
    except OSError as fault:
        leave_standard_output()
        reason = fault.strerror or fault
        raise OutputError(
            f"standard output: found a file that cannot be written ({reason}); allowed: another"
        ) from None


def remark(text: str) -> None:
    """Print a remark or a fault on standard error, if that can be written."""
    with suppress(OSError):
        print(text, file=sys.stderr, flush=True)


def leave_standard_output() -> None:
    """Write nothing more: the interpreter must not try again at its end what has failed."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
