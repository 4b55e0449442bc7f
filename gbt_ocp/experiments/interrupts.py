"""Ctrl-C during a run ends it between two steps."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def interrupted_between_steps() -> Iterator[Callable[[], None]]:
    """Yield a function that raises ``KeyboardInterrupt`` if Ctrl-C was pressed since; a second one is not waited for.

    CasADi swallows an interrupt that arrives while IPOPT runs: the step fails, is answered by a fallback, and the run
    goes on. A process that ignores Ctrl-C (a worker, or what a shell starts in the background) goes on ignoring it.
    """
    pressed = False

    def remember(number: int, frame: object) -> None:
        nonlocal pressed
        if pressed:
            raise KeyboardInterrupt
        pressed = True

    def check() -> None:
        if pressed:
            raise KeyboardInterrupt

    main = threading.current_thread() is threading.main_thread()  # which alone receives signals
    if not main or signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        yield check
        return
    before = signal.signal(signal.SIGINT, remember)
    try:
        yield check
    finally:
        signal.signal(signal.SIGINT, before)
    check()  # pressed after the last step: the runs that would follow must not go on
