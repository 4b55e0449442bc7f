"""Files and folders that appear complete or not at all, one process at a time in a folder, and damaged archives."""

from __future__ import annotations

import errno
import hashlib
import itertools
import os
import secrets
import shutil
import socket
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


UNPACKED, PACKED = 2**28, 200
"""Arrays of more bytes than the first that are so many times the size of their file are not read.

What a run leaves is at most three times the size of its file: its times and its clocks hardly shrink.
"""


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
        What the file should be, for the message.
    optional
        Names of arrays that the file may lack.

    Raises
    ------
    ValueError
        If the file is no ``.npz``, is damaged, an array is missing, or the arrays unpack to far more than the file;
        the line names the file.
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
                size = sum(archive.zip.getinfo(f"{name}.npy").file_size for name in found)
                allowed = max(UNPACKED, PACKED * os.fstat(stream.fileno()).st_size)
                if size > allowed:
                    raise ValueError(f"found {size:.3g} bytes of arrays; allowed: {allowed:.3g} in a file of its size")
                return {name: archive[name] for name in found}
        except Exception as fault:
            # Bytes that are not what was written make zipfile, zlib and numpy raise almost anything: RuntimeError
            # (encrypted), NotImplementedError (another compression), MemoryError (a shape of billions), OSError (a
            # place before the beginning).
            reason = " ".join(str(fault).split()) or type(fault).__name__
            raise ValueError(f"{os.fspath(path)}: not {kind}: {reason}") from None


PARTIAL = ".partial-"
"""Marks a temporary file or folder: ``.NAME.partial-HOST-PID-TOKEN`` beside the final NAME."""


@contextmanager
def whole_folder(target: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary folder that becomes ``target`` when the block ends without an exception.

    Parameters
    ----------
    target
        The final name. Missing parents are made. It may exist only as an empty folder (or a symbolic link to one),
        which keeps its mode and its identity: the temporary folder is then made in it, and at the end each of its
        entries is renamed.

    Yields
    ------
    The temporary folder; files written into it appear under ``target`` at the end.

    Raises
    ------
    FileExistsError
        If ``target`` is a file, a symbolic link that leads to no folder, or a folder with something in it, before the
        block or (another process was faster) after it. Nothing is overwritten and nothing is left behind.
    """
    final = Path(os.path.abspath(target))  # not resolve(): a symbolic link stays the user's choice of place
    _refuse_occupied(final)
    if final.is_dir():
        remove_abandoned(final / final.name)
        temporary = temporary_beside(final / final.name)
    else:
        final.parent.mkdir(parents=True, exist_ok=True)
        remove_abandoned(final)
        temporary = temporary_beside(final)
    temporary.mkdir()
    try:
        yield temporary
        _refuse_occupied(final)
        if final.is_dir():
            _fill(final, temporary)
        else:
            _rename(temporary, final)
    except BaseException:  # KeyboardInterrupt as well: nothing half-written stays
        shutil.rmtree(temporary, ignore_errors=True)
        raise


def _rename(temporary: Path, final: Path) -> None:
    try:
        os.rename(temporary, final)
    except OSError:
        _refuse_occupied(final)  # another process finished first: say so
        raise


def _fill(final: Path, temporary: Path) -> None:
    """Move everything from a temporary folder into an empty one, alone and completely."""
    try:
        with alone_in(final):
            _refuse_occupied(final)
            moved = []
            try:
                for entry in sorted(temporary.iterdir()):
                    moved.append(final / entry.name)
                    os.rename(entry, moved[-1])
                temporary.rmdir()
            except BaseException:
                for path in moved:
                    if path.is_dir():
                        shutil.rmtree(path, ignore_errors=True)
                    else:
                        path.unlink(missing_ok=True)
                raise
    except FolderBusyError as fault:
        raise FileExistsError(str(fault)) from None


def try_folder(target: str | os.PathLike[str]) -> None:
    """Find out whether :func:`whole_folder` could make a folder: make it, with its parents, and remove them again.

    Raises
    ------
    FileExistsError
        If ``target`` is a file, a symbolic link that leads to no folder, or a folder with something in it.
    OSError
        If it cannot be made or written: no rights, no space, a name that is too long.
    """
    final = Path(os.path.abspath(target))
    _refuse_occupied(final)
    missing = list(itertools.takewhile(lambda path: not os.path.lexists(path), [final, *final.parents]))
    if not missing:
        missing = [temporary_beside(final / final.name)]
    made = []
    try:
        for path in reversed(missing):
            if not path.parent.is_dir():  # a file, or a symbolic link that leads nowhere
                raise NotADirectoryError(errno.ENOTDIR, "not a folder", str(path.parent))
            path.mkdir()
            made.append(path)
    finally:
        for path in reversed(made):
            with suppress(OSError):  # another process has put something in it
                path.rmdir()


LONGEST_NAME = 100
"""Bytes of a final name that a temporary name repeats; a file system allows some 255 for a name."""


def temporary_beside(final: Path) -> Path:
    """A name beside ``final`` that says which process made it (see :data:`PARTIAL`)."""
    return final.parent / f"{_mark(final.name)}{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(4)}"


def _mark(name: str) -> str:
    """How temporary names for a final name begin; a long name is shortened and told apart by its hash."""
    encoded = os.fsencode(name)
    if len(encoded) > LONGEST_NAME:
        start = encoded[: LONGEST_NAME - 9].decode("utf-8", "ignore")
        name = f"{start}~{hashlib.sha256(encoded).hexdigest()[:8]}"
    return f".{name}{PARTIAL}"


def temporaries(folder: Path, name: str | None = None) -> list[Path]:
    """Temporary files and folders in ``folder``: those meant for the final ``name``, or all."""
    start = "." if name is None else _mark(name)
    return [entry for entry in folder.iterdir() if entry.name.startswith(start) and PARTIAL in entry.name]


def remove_temporaries(folder: Path, name: str | None = None, *, abandoned: bool = True) -> list[Path]:
    """Remove temporary files and folders, and return their paths.

    Parameters
    ----------
    folder
        Where they lie.
    name
        Only those meant for this final name.
    abandoned
        Only those that a process of this machine left that no longer lives: the others may be in use at this moment.
    """
    found = [entry for entry in temporaries(folder, name) if not abandoned or _is_abandoned(entry)]
    for entry in found:
        if entry.is_dir():
            shutil.rmtree(entry, ignore_errors=True)
        else:
            entry.unlink(missing_ok=True)
    return found


def remove_abandoned(target: Path) -> list[Path]:
    """Remove what killed processes left beside ``target`` while they wrote it, and return the paths."""
    return remove_temporaries(target.parent, target.name)


def _is_abandoned(entry: Path) -> bool:
    if os.name != "posix":  # os.kill(pid, 0) asks on POSIX, and kills on Windows
        return False
    maker = entry.name.rpartition(PARTIAL)[2]
    host = f"{socket.gethostname()}-"
    pid, _, token = maker.removeprefix(host).partition("-")
    return maker.startswith(host) and bool(token) and pid.isdigit() and not _alive(int(pid))


def _refuse_occupied(final: Path) -> None:
    """Refuse a name that holds something, temporary folders of the same name aside."""
    if final.is_dir():
        if any(not entry.name.startswith(_mark(final.name)) for entry in final.iterdir()):
            raise FileExistsError(f"{final}: the folder exists and is not empty; give another name or remove it")
    elif os.path.lexists(final):
        what = "a symbolic link that leads to no folder" if final.is_symlink() else "a file of this name"
        raise FileExistsError(f"{final}: {what} exists; give another name or remove it")


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
    """Yield a temporary name beside ``target``, with its suffix; it replaces ``target`` when the block ends well."""
    final = Path(target)
    final.parent.mkdir(parents=True, exist_ok=True)
    beside = temporary_beside(final)
    temporary = beside.with_name(f"{beside.name}{final.suffix}")
    try:
        yield temporary
        os.replace(temporary, final)
    finally:
        temporary.unlink(missing_ok=True)


def packaged_text(package: str, *path: str) -> str:
    """Text of a file that travels with a package, ``packaged_text("gbt_ocp.reporting", "page", "report.html")``."""
    return files(package).joinpath(*path).read_text(encoding="utf-8")


def optional_module(name: str, extra: str, purpose: str) -> Any:
    """A module of a library that an optional extra of the package brings.

    Parameters
    ----------
    name
        Of the module.
    extra
        Of the package that has it.
    purpose
        What it is for; the message begins with it.

    Raises
    ------
    ValueError
        If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as fault:
        line = (
            f"{purpose}: found no library {name.partition('.')[0]} ({fault}); allowed: pip install 'gbt_ocp[{extra}]'"
        )
        raise ValueError(line) from fault
