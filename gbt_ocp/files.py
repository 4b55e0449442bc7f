"""Files and folders that are there whole or not at all, one process at a time in a folder, and damaged archives."""

from __future__ import annotations

import os
import secrets
import shutil
import socket
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


def read_arrays(
    path: str | os.PathLike[str], names: Iterable[str], kind: str, *, optional: Iterable[str] = ()
) -> dict[str, NDArray[Any]]:
    """Arrays of an ``.npz`` by name; what stands beside them is passed over.

    Parameters
    ----------
    path
        The file.
    names
        Of the arrays.
    kind
        What the file should be, for the line that says that it is none.
    optional
        Names of arrays that the file may lack.

    Raises
    ------
    ValueError
        If the file is no ``.npz``, is damaged, or an array is missing; the line names the file.
    OSError
        If it cannot be opened.
    """
    wanted = list(names)
    # Opened here: given a path, np.load leaves a damaged file open.
    with Path(path).open("rb") as stream:
        try:
            with np.load(stream, allow_pickle=False) as archive:
                missing = [name for name in wanted if name not in archive.files]
                if missing:
                    raise ValueError(f"missing arrays: {', '.join(missing)}")
                found = [*wanted, *(name for name in optional if name in archive.files)]
                return {name: archive[name] for name in found}
        except Exception as fault:
            # Bytes that are not what was written make zipfile, zlib and numpy raise almost anything: RuntimeError
            # (encrypted), NotImplementedError (another compression), MemoryError (a shape of billions), OSError (a
            # place before the beginning).
            reason = " ".join(str(fault).split()) or type(fault).__name__
            raise ValueError(f"{os.fspath(path)}: not {kind}: {reason}") from None


PARTIAL = ".partial-"
"""Marks a temporary folder: ``.NAME.partial-HOST-PID-TOKEN`` beside the final NAME."""


@contextmanager
def whole_folder(target: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary folder that becomes ``target`` when the block ends without an exception.

    Parameters
    ----------
    target
        The final name. Missing parents are made. It may exist only as an empty folder.

    Yields
    ------
    The temporary folder, in the same parent as ``target``; files written into it appear under ``target`` at the end.

    Raises
    ------
    FileExistsError
        If ``target`` is a file or a folder with something in it, before the block or (another process was faster)
        after it. Nothing is overwritten and nothing is left behind.
    """
    final = Path(os.path.abspath(target))  # not resolve(): a symbolic link stays the user's choice of place
    _refuse_occupied(final)
    final.parent.mkdir(parents=True, exist_ok=True)
    remove_abandoned(final)
    temporary = temporary_beside(final)
    temporary.mkdir()
    try:
        yield temporary
        _refuse_occupied(final)
        try:
            with suppress(FileNotFoundError):
                final.rmdir()  # a rename onto an empty folder is refused by Windows
            os.rename(temporary, final)
        except OSError:
            _refuse_occupied(final)  # another process finished first: say so
            raise
    except BaseException:  # KeyboardInterrupt as well: nothing half-written stays
        shutil.rmtree(temporary, ignore_errors=True)
        raise


def temporary_beside(final: Path) -> Path:
    """A name beside ``final`` that says which process made it (see :data:`PARTIAL`)."""
    return final.parent / f".{final.name}{PARTIAL}{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(4)}"


def remove_abandoned(target: Path) -> list[Path]:
    """Remove temporary folders that killed processes left beside ``target``, and return their paths.

    Only folders meant for the same ``target``, made on this machine by a process that no longer lives, are touched:
    a sweep's other workers may be writing at this moment.
    """
    if os.name != "posix":  # os.kill(pid, 0) asks on POSIX, and kills on Windows
        return []
    prefix = f".{target.name}{PARTIAL}{socket.gethostname()}-"
    removed = []
    for entry in list(target.parent.iterdir()):
        pid, _, token = entry.name.removeprefix(prefix).partition("-")
        if entry.name.startswith(prefix) and token and pid.isdigit() and not _alive(int(pid)):
            shutil.rmtree(entry, ignore_errors=True)
            removed.append(entry)
    return removed


def _refuse_occupied(final: Path) -> None:
    if final.is_dir():
        if any(final.iterdir()):
            raise FileExistsError(f"{final}: the folder exists and is not empty; give another name or remove it")
    elif final.exists() or final.is_symlink():
        raise FileExistsError(f"{final}: a file of this name exists; give another name or remove it")


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):  # another user's process lives; an absurd number is not ours to judge
        return True
    return True


class FolderBusyError(RuntimeError):
    """Another process is at work in a folder."""


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Hold a folder that exists, so that no other process works in it.

    The folder itself is locked, so nothing lies in it that was not there. Where a system cannot lock folders (Windows,
    some network drives) nothing is held; there, what a slower process has done too is not taken.

    Raises
    ------
    FolderBusyError
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
            raise FolderBusyError(
                f"{folder}: found another process at work in it; allowed: one at a time (wait for its end)"
            ) from None
        except OSError:  # no locks on this drive
            pass
        yield
    finally:
        os.close(descriptor)


@contextmanager
def whole_file(target: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary name beside ``target``, with its ending, that replaces it when the block ends well."""
    final = Path(target)
    final.parent.mkdir(parents=True, exist_ok=True)
    temporary = final.parent / f".{final.stem}.partial-{secrets.token_hex(4)}{final.suffix}"
    try:
        yield temporary
        os.replace(temporary, final)
    finally:
        temporary.unlink(missing_ok=True)


def packaged_text(package: str, *path: str) -> str:
    """Text of a file that travels with a package, ``packaged_text("gbt_ocp.reporting", "page", "report.html")``."""
    return files(package).joinpath(*path).read_text(encoding="utf-8")
