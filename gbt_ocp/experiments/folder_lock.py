"""One process at a time in a folder that can be taken up again; the system releases it with the process, also a killed
one.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gbt_ocp.experiments.faults import ConfigurationError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Hold a folder that exists, so that no other process works in it.

    The folder itself is locked, so nothing lies in it that was not there. Where a system cannot lock folders (Windows,
    some network drives) nothing is held; there, what a slower process has done too is not taken.

    Raises
    ------
    ConfigurationError
        If another process holds it.
    """
    if fcntl is None:
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)  # not inherited: workers do not hold it beyond the end of this process
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ConfigurationError(
                [f"{folder}: found another process at work in it; allowed: one at a time (wait for its end)"]
            ) from None
        except OSError:  # no locks on this drive
            pass
        yield
    finally:
        os.close(descriptor)
