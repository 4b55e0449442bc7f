"""Compiles C sources into a shared library, once: the result is kept in the user's cache under its content."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path

FLAGS = ("-std=c99", "-O3", "-fno-math-errno", "-ffp-contract=off", "-fPIC", "-shared")
"""``-ffp-contract=off``: the same numbers with and without fused instructions. ``-fno-math-errno``: square roots
become one instruction."""


class CompilerError(RuntimeError):
    """There is no C compiler, or it refused the source."""


def kernel_files() -> dict[str, str]:
    """The hand-written C files of the solver, by name."""
    folder = files("gbt_ocp.ocp") / "kernel"
    return {
        entry.name: entry.read_text(encoding="utf-8")
        for entry in sorted(folder.iterdir(), key=lambda entry: entry.name)
        if entry.name.endswith((".c", ".h"))
    }


def find_compiler() -> str | None:
    """The C compiler: what the environment names as ``CC``, else cc, gcc or clang; ``None`` if none is there."""
    named = os.environ.get("CC")
    for name in [named] if named else ["cc", "gcc", "clang"]:
        path = shutil.which(name)
        if path is not None:
            return path
    return None


def cache_folder() -> Path:
    """Where compiled solvers are kept: ``GBT_OCP_CACHE``, else gbt_ocp in ``XDG_CACHE_HOME`` or ``~/.cache``."""
    own = os.environ.get("GBT_OCP_CACHE")
    if own:
        return Path(own)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gbt_ocp"


@cache
def _version(compiler: str) -> str:
    shown = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=False)
    return shown.stdout + shown.stderr


def build_library(sources: Mapping[str, str]) -> Path:
    """Compile these files (name to content) into a shared library, or find it compiled already.

    Several processes may ask for the same library at once: each compiles under a name of its own, and the last one's
    rename wins over equal files.

    Raises
    ------
    CompilerError
        If there is no compiler or it fails; the message ends with what it said.
    """
    compiler = find_compiler()
    if compiler is None:
        raise CompilerError("no C compiler found (CC, cc, gcc, clang)")
    content = "\0".join([compiler, _version(compiler), *FLAGS, *(f"{name}\0{text}" for name, text in sources.items())])
    target = cache_folder() / f"{hashlib.sha256(content.encode()).hexdigest()[:32]}.so"
    if target.is_file():
        return target
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent, prefix="build-") as folder:
            _compile(compiler, sources, Path(folder))
            os.replace(Path(folder) / "library.so", target)
    except OSError as fault:
        raise CompilerError(
            f"{target.parent}: cannot be written ({fault}); set GBT_OCP_CACHE to a folder that can"
        ) from fault
    return target


def _compile(compiler: str, sources: Mapping[str, str], folder: Path) -> None:
    for name, text in sources.items():
        (folder / name).write_text(text, encoding="utf-8")
    units = sorted(name for name in sources if name.endswith(".c"))
    command = [compiler, *FLAGS, "-o", "library.so", *units, "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise CompilerError(f"{' '.join(command)} failed: {done.stderr.strip()[-2000:]}")
