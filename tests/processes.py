"""Command lines as processes of their own: forked from the tests', so that nothing is loaded anew, or started."""

import os
import signal
import subprocess
import sys
import time
import traceback
from pathlib import Path

from gbt_ocp.cli import program

PROGRAM = [sys.executable, "-c", "from gbt_ocp.cli.program import main; raise SystemExit(main())"]
"""What the installed ``gbt-ocp`` does."""


class Process:
    """A process whose standard error goes to a file."""

    def __init__(self, pid: int, errors: Path) -> None:
        self.pid, self._errors, self.code = pid, errors, None

    def send(self, number: int) -> None:
        if not self.over():
            os.kill(self.pid, number)

    def over(self) -> bool:
        if self.code is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self.code = os.waitstatus_to_exitcode(status)
        return self.code is not None

    def wait(self, patience: float = 600.0) -> int:
        deadline = time.monotonic() + patience
        while not self.over():
            assert time.monotonic() < deadline, f"still running: {self.told}"
            time.sleep(0.005)
        return self.code

    @property
    def told(self) -> str:
        return self._errors.read_text(encoding="utf-8", errors="replace")


def forked(arguments: list[str], errors: Path) -> Process:
    """A process that carries out a command line with all that is loaded here, patches included."""
    sys.stdout.flush()
    sys.stderr.flush()
    held = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # not heard before it can be answered
    pid = os.fork()
    if pid == 0:
        code = 1
        try:
            # what a shell starts in the background ignores Ctrl-C, and so would this
            signal.signal(signal.SIGINT, signal.default_int_handler)
            for number, path in ((1, Path(os.devnull)), (2, errors)):
                os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644), number)
            sys.stdout, sys.stderr = os.fdopen(1, "w", closefd=False), os.fdopen(2, "w", 1, closefd=False)
            sys.argv = ["gbt-ocp", *arguments]
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
            code = program.main()
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    signal.pthread_sigmask(signal.SIG_SETMASK, held)
    return Process(pid, errors)


def started(arguments: list[str], errors: Path) -> Process:
    """A process as a shell starts it, with everything to load; it leads a group of its own."""
    path = os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    with errors.open("wb") as stream:
        process = subprocess.Popen(
            [*PROGRAM, *arguments], stdout=subprocess.DEVNULL, stderr=stream, env={**os.environ, "PYTHONPATH": path},
            process_group=0, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )  # fmt: skip
    process.returncode = 0  # waited for here, not by subprocess
    return Process(process.pid, errors)
