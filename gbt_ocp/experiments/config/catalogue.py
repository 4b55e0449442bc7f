"""Finds the shipped problems and configurations by name, in a checkout and in an installed wheel."""

from __future__ import annotations

import hashlib
import importlib.util
import sys
import traceback
from functools import lru_cache
from pathlib import Path

from gbt_ocp.experiments.config.tracking_problem import TrackingProblem
from gbt_ocp.experiments.config.yaml_dialect import shortened

_PACKAGE = Path(__file__).resolve().parents[2]


SCHEMA_LINE = "# yaml-language-server: $schema="
"""Beginning of the first line of a configuration, which names the schema to an editor."""


class ProblemError(ValueError):
    """A problem that cannot be found or loaded; the message says what was found and what is allowed."""


def _shipped(kind: str, package: Path) -> Path:
    # The wheel carries the folders inside the package (pyproject.toml, force-include); a checkout has them beside it.
    inside = package / f"_{kind}"
    return inside if inside.is_dir() else package.parent / kind


def problems_folder(package: Path = _PACKAGE) -> Path:
    """Folder of the shipped problem modules."""
    return _shipped("problems", package)


def configs_folder(package: Path = _PACKAGE) -> Path:
    """Folder of the shipped configurations."""
    return _shipped("configs", package)


def problem_names() -> list[str]:
    """Names of the shipped problems, sorted."""
    return sorted(path.stem for path in problems_folder().glob("*.py") if not path.name.startswith("_"))


def config_names() -> list[str]:
    """Names of the shipped configurations, sorted."""
    return sorted(path.stem for path in configs_folder().glob("*.yaml"))


def config_path(name: str) -> Path | None:
    """File of a shipped configuration, ``None`` if no configuration has that name."""
    return configs_folder() / f"{name}.yaml" if name in config_names() else None


def config_description(name: str) -> str:
    """First comment line of a shipped configuration after the one that names the schema to editors."""
    lines = (configs_folder() / f"{name}.yaml").read_text(encoding="utf-8").splitlines()
    return next(line.removeprefix("#").strip() for line in lines if not line.startswith(SCHEMA_LINE))


def resolved(text: str | Path, folder: Path | None = None) -> Path | None:
    """Absolute path of a text, ``None`` if no file can have that name: too long, a NUL, no such user.

    Parameters
    ----------
    text
        A path as the user wrote it.
    folder
        Where a relative one is looked up first; then in the current folder.
    """
    try:
        given = Path(text).expanduser()
        beside = given if folder is None else folder / given
        return (beside if beside.exists() else given).resolve()
    except (OSError, ValueError, RuntimeError):
        return None


def problem_path(problem: str) -> Path:
    """File of a problem given by its shipped name or by a path that ends in ``.py``.

    Raises
    ------
    ProblemError
        If there is no such file.
    """
    names = problem_names()
    if problem in names:
        return problems_folder() / f"{problem}.py"
    path = resolved(problem) if problem.endswith(".py") else None
    if path is not None and path.is_file():
        return path
    raise ProblemError(
        f"found {shortened(repr(problem))}; allowed: {', '.join(names)}, or a path to an existing .py file"
    )


def load_problem(problem: str) -> TrackingProblem:
    """Load a problem given by its shipped name or by a path that ends in ``.py``.

    The module is executed once, and again only after its file has changed.

    Raises
    ------
    ProblemError
        If there is no such file, it does not run, or it exports no :class:`TrackingProblem` named ``problem``.
    """
    path = problem_path(problem)
    return _execute(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=64)
def _execute(path: Path, modified: int) -> TrackingProblem:
    # Two files of one name must not share a module, and dataclasses of the module look themselves up in sys.modules.
    name = f"gbt_ocp_problem_{path.stem}_{hashlib.sha1(str(path).encode()).hexdigest()[:8]}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ProblemError(f"found {path}; allowed: a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        # Compiled from the text and not through the loader: its cache has a resolution of a second.
        exec(compile(path.read_bytes(), str(path), "exec"), module.__dict__)
    except Exception as fault:
        del sys.modules[name]
        raise ProblemError(
            f"found {path}, which does not run: line {_line(fault, path)}: {type(fault).__name__}: {fault}; "
            "allowed: a module that imports without error"
        ) from fault
    found = getattr(module, "problem", None)
    if not isinstance(found, TrackingProblem):
        what = "nothing" if found is None else f"a {type(found).__name__}"
        raise ProblemError(f"found {what} named `problem` in {path}; allowed: a gbt_ocp TrackingProblem")
    return found


def _line(fault: Exception, path: Path) -> int | None:
    if isinstance(fault, SyntaxError):
        return fault.lineno
    lines = [frame.lineno for frame in traceback.extract_tb(fault.__traceback__) if frame.filename == str(path)]
    return lines[-1] if lines else None
