"""Compiles C sources into a shared library, once, and loads it; the libraries are kept in the user's cache."""

from __future__ import annotations

import ctypes
import os
import platform
import shlex
import shutil
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path

from gbt_ocp.ocp.codegen.cache import CacheError, LibraryCache
from gbt_ocp.ocp.codegen.commands import CommandError, run_command

FLAGS = ("-std=c99", "-O3", "-fno-math-errno", "-ffp-contract=off", "-fPIC", "-shared")
"""``-ffp-contract=off``: the same numbers with and without fused instructions. ``-fno-math-errno``: square roots
become one instruction."""

VERSION_S = 10.0
"""Seconds that a compiler may take to say its version; a fraction of one is usual."""

COMPILE_S = 300.0
"""Seconds that it may take to compile a problem; 2 to 20 are usual."""

LOAD_S = 60.0
"""Seconds that a new library may take to be loaded by a process of its own."""

OUTPUT = "library.so"
"""What a compiler writes, before it has its name in the cache."""


FLAT_FILES = ("gbt_pieces", "gbt_flat_guess", "gbt_riccati", "gbt_braking", "gbt_follow")
"""Beginnings of the names of those files of the kernel that are for flat trajectories alone."""

SHOOTING_FILES = ("gbt_shoot",)
"""The same for trajectories by integration."""


class CompilerError(RuntimeError):
    """There is no C compiler that works, or no place for what it makes; the message begins with what was found."""


def kernel_files(*, shooting: bool = False) -> dict[str, str]:
    """The hand-written C files of the solver, by name: those for flat trajectories, or for trajectories by integration.

    Both have all files but those of the other form.
    """
    texts, other = c_texts("gbt_ocp.ocp", "kernel"), FLAT_FILES if shooting else SHOOTING_FILES
    return {name: text for name, text in texts.items() if not name.startswith(other)}


@cache
def c_texts(package: str, folder: str) -> dict[str, str]:
    """The C files in a folder of a package by name, which are read once and not to be changed."""
    return {
        entry.name: entry.read_text(encoding="utf-8")
        for entry in sorted((files(package) / folder).iterdir(), key=lambda entry: entry.name)
        if entry.name.endswith((".c", ".h"))
    }


def find_compiler() -> list[str] | None:
    """The command that compiles C: what the environment names as ``CC``, else cc, gcc or clang.

    ``CC`` is read as a shell and ``make`` read it: a program and its arguments, ``ccache gcc`` or ``gcc -m64``.

    Returns
    -------
    The words of the command, the first of them an absolute path: ``[*find_compiler(), "-c", "x.c"]`` is a command, and
    ``f"CC={shlex.join(find_compiler())}"`` an argument of make. ``None`` if there is no such program; another one is
    not taken in the place of what ``CC`` names.
    """
    named = os.environ.get("CC", "").strip()
    try:
        choices = [shlex.split(named)] if named else [["cc"], ["gcc"], ["clang"]]
    except ValueError:  # a quotation that does not end
        return None
    for program, *arguments in choices:
        path = shutil.which(program)
        if path is not None:
            return [os.path.abspath(path), *arguments]
    return None


def cache_folder() -> Path:
    """Where compiled solvers are kept: ``GBT_OCP_CACHE``, else gbt_ocp in ``XDG_CACHE_HOME`` or ``~/.cache``.

    Raises
    ------
    CompilerError
        If neither is set and there is no home.
    """
    own = os.environ.get("GBT_OCP_CACHE")
    if own:
        return Path(own).absolute()
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache").absolute() / "gbt_ocp"
    except RuntimeError as fault:
        raise CompilerError(f"GBT_OCP_CACHE: found nothing, and no home ({fault}); allowed: a folder") from fault


def load_library(sources: Mapping[str, str]) -> ctypes.CDLL:
    """Compile these files or find them compiled, and load the library.

    A library of the cache that cannot be loaded, for it needs another C library, say, is compiled again.

    Raises
    ------
    CompilerError
        As :func:`build_library`, or if a library that has just been compiled cannot be loaded.
    """
    path = build_library(sources)
    try:
        return ctypes.CDLL(str(path))
    except OSError:
        path.unlink(missing_ok=True)
    path = build_library(sources)
    try:
        return ctypes.CDLL(str(path))
    except OSError as fault:
        raise CompilerError(f"{path}: found a library that cannot be loaded ({fault})") from fault


def build_library(sources: Mapping[str, str]) -> Path:
    """Compile these files (name to content) into a shared library, or find it compiled already.

    Several processes may ask for the same library at once: each compiles in a folder of its own.

    Raises
    ------
    CompilerError
        If there is no compiler, it fails, hangs or writes nothing that can be loaded, or the cache cannot be used.
    """
    compiler = find_compiler()
    if compiler is None:
        named = os.environ.get("CC", "").strip()
        missing = f"CC: found {named!r}, of which there is no program" if named else "found no program cc, gcc or clang"
        raise CompilerError(
            f"no C compiler: {missing}; allowed: the command of one in CC, or one called cc, gcc or clang"
        )
    folder = cache_folder()
    content = [*compiler, _version(tuple(compiler)), *_machine(), *FLAGS]
    content += [part for name, text in sources.items() for part in (name, text)]
    try:
        store = LibraryCache(folder)
        key = store.key(content)
        path = store.find(key)
        if path is not None:
            return path
        with store.workplace() as place:
            _compile(compiler, sources, place)
            return store.keep(key, place / OUTPUT)
    except CacheError as fault:
        raise CompilerError(str(fault)) from fault
    except OSError as fault:
        raise CompilerError(f"{folder}: cannot be written ({fault}); set GBT_OCP_CACHE to a folder that can") from fault


@cache
def _version(compiler: tuple[str, ...]) -> str:
    return _run(compiler, ["--version"], Path(os.sep), VERSION_S)[1]


@cache
def _machine() -> tuple[str, ...]:
    """What a library depends on beside its compiler: a cache may lie in a home that different machines share."""
    lines = []
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as text:
            lines = [line.partition(":")[2] for line in text if line.startswith(("flags", "Features"))][:1]
    except OSError:  # not Linux
        pass
    return platform.system(), platform.machine(), str(sys.maxsize), *platform.libc_ver(), *lines


def _compile(compiler: Sequence[str], sources: Mapping[str, str], folder: Path) -> None:
    for name, text in sources.items():
        (folder / name).write_text(text, encoding="utf-8")
    units = sorted(name for name in sources if name.endswith(".c"))
    returned, said = _run(compiler, [*FLAGS, "-o", OUTPUT, *units, "-lm"], folder, COMPILE_S)
    library = folder / OUTPUT
    if returned != 0:
        raise CompilerError(f"{shlex.join(compiler)} failed: {said.strip()[-2000:]}")
    if not library.is_file() or library.stat().st_size == 0:
        raise CompilerError(f"{shlex.join(compiler)}: found nothing written; allowed: a compiler that writes a library")
    # In a process of its own: an incomplete library can end the one that loads it.
    load = "import ctypes, sys; ctypes.CDLL(sys.argv[1])"
    returned, said = _run([sys.executable, "-I", "-S", "-c", load], [str(library)], folder, LOAD_S)
    if returned != 0:
        last = said.strip().splitlines()[-1:] or [f"exit code {returned}"]
        raise CompilerError(
            f"{shlex.join(compiler)}: found a library that cannot be loaded ({last[0]}); allowed: one for this machine"
        )


def _run(program: Sequence[str], arguments: Sequence[str], folder: Path, seconds: float) -> tuple[int, str]:
    """Exit code of a command, and what it said."""
    try:
        done = run_command([*program, *arguments], folder, seconds)
    except CommandError as fault:
        raise CompilerError(str(fault)) from fault
    return done.returncode, done.stdout + done.stderr
