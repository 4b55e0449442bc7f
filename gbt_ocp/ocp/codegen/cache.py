"""The cache of compiled libraries: only what its user wrote, complete and unchanged, is loaded.

A library is code that the process executes. Its name says what it was made of and what it must contain:
``KEY-HASH.so`` with the hash of its bytes, so that one that is damaged, replaced or cut off is found before it is
loaded.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import stat
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from gbt_ocp.files import remove_temporaries, temporaries, temporary_beside

KEPT_DAYS = 60.0
"""Days without use after which a library is removed."""

MOST_KEPT = 500
"""Libraries that are kept; of more, those used last. A library has 0.1 to 0.5 MB."""

LONGEST_BUILD_DAYS = 1.0
"""Days after which a build of another machine counts as abandoned, whose processes cannot be asked for."""

OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH

DIGITS = 32
"""Hexadecimal digits of each hash in a name."""

NAME = re.compile(rf"[0-9a-f]{{{DIGITS}}}(-[0-9a-f]{{{DIGITS}}})?\.so")
"""Names of libraries, with and without the second hash; without it they are of an earlier version and only removed."""

EARLIER_BUILD = re.compile(r"build-[a-z0-9_]{8}")
"""Names of folders in which an earlier version compiled."""


class CacheError(RuntimeError):
    """A folder that must not be used as a cache; the message is one line."""


class LibraryCache:
    """Libraries of one user in a folder.

    Parameters
    ----------
    folder
        Is made, for the user alone, if it is missing.

    Raises
    ------
    CacheError
        If the folder belongs to another user, or others may write in it.
    OSError
        If it cannot be made.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        if _is_of_others(folder.stat()):
            raise CacheError(
                f"{folder}: found a cache of compiled code in which other users may write, or that belongs to one; "
                f"allowed: a folder of your own (chmod go-w), or another one named by GBT_OCP_CACHE"
            )

    @staticmethod
    def key(content: Sequence[str]) -> str:
        """The first part of the name of a library that is made of this content."""
        return hashlib.sha256("\0".join(content).encode()).hexdigest()[:DIGITS]

    def find(self, key: str) -> Path | None:
        """The library of a key, if there is one that can be trusted; others of that key are removed."""
        for path in sorted(self.folder.glob(f"{key}-*.so")):
            if self._is_sound(path):
                with suppress(OSError):
                    os.utime(path)  # it is in use
                return path
            _remove(path)
        return None

    @contextmanager
    def workplace(self) -> Iterator[Path]:
        """A folder to compile in, removed at the end; what killed processes left and what is old are removed first."""
        self.prune()
        place = temporary_beside(self.folder / "build")
        place.mkdir(mode=0o700)
        try:
            yield place
        finally:
            shutil.rmtree(place, ignore_errors=True)

    def keep(self, key: str, library: Path) -> Path:
        """Move a library into the cache, complete on the disk before it has its name; returns where it is."""
        library.chmod(0o700)
        _sync(library)
        target = self.folder / f"{key}-{_hash(library)}.so"
        if target.is_dir():
            _remove(target)
        os.replace(library, target)
        with suppress(OSError):  # not every file system syncs folders
            _sync(self.folder)
        return target

    def prune(self) -> None:
        """Remove libraries that were not used for long or are too many, and builds that ended halfway."""
        remove_temporaries(self.folder)
        now, entries = time.time(), list(self.folder.iterdir())
        for place in [*temporaries(self.folder), *(path for path in entries if EARLIER_BUILD.fullmatch(path.name))]:
            if _age(place, now) > LONGEST_BUILD_DAYS:
                _remove(place)
        libraries = [path for path in entries if NAME.fullmatch(path.name)]
        libraries.sort(key=lambda path: _age(path, now))
        for number, path in enumerate(libraries):
            if number >= MOST_KEPT or _age(path, now) > KEPT_DAYS:
                _remove(path)

    def _is_sound(self, path: Path) -> bool:
        """Whether a library is a file of the user's own with the content that its name says."""
        try:
            status = path.lstat()
            plain = stat.S_ISREG(status.st_mode) and not _is_of_others(status)
            return plain and path.stem.partition("-")[2] == _hash(path)
        except OSError:
            return False


def _is_of_others(status: os.stat_result) -> bool:
    """Whether a file or folder belongs to another user, or others may write in it."""
    if os.name != "posix":
        return False
    return status.st_uid != os.geteuid() or bool(status.st_mode & OTHERS_WRITE)


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:DIGITS]


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _age(path: Path, now: float) -> float:
    """Days since an entry was used; one that is gone meanwhile is new."""
    try:
        return (now - path.lstat().st_mtime) / 86400.0
    except OSError:
        return 0.0


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()
