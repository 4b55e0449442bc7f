"""Where results are written: what is refused before anything runs, and where a finished result goes in need."""

from __future__ import annotations

import itertools
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from gbt_ocp.cli.output import remark
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.yaml_dialect import shortened
from gbt_ocp.files import try_folder

MOST_RIVALS = 100
"""Runs for one folder at the same time that each find a place beside it."""


class Saved(Protocol):
    """A result that can be saved in a new or empty folder."""

    def save(self, folder: Path, figures: bool) -> object:
        """Write the folder, with or without figures."""
        ...


def free_folder(name: str) -> Path:
    """A folder in ``runs/`` that does not exist yet: ``NAME``, or ``NAME-2``, ``NAME-3``, ..."""
    folder = Path("runs") / name
    with suppress(OSError):  # a name that no folder can have is refused by whoever writes it
        return beside(folder) if folder.exists() else folder
    return folder


def beside(folder: Path) -> Path:
    """The first of ``NAME-2``, ``NAME-3``, ... that does not exist."""
    return next(one for k in itertools.count(2) if not (one := folder.with_name(f"{folder.name}-{k}")).exists())


def refuse_unwritable(out: Path) -> None:
    """Find out before anything runs whether a folder can be written.

    Raises
    ------
    ConfigurationError
        If it is not new or empty, or cannot be written.
    """
    try:
        try_folder(out)
    except FileExistsError:
        what = (
            "a symbolic link that leads to no folder"
            if out.is_symlink() and not out.exists()
            else "not an empty folder"
        )
        raise ConfigurationError(
            [f"--out: found {_named(out)}, which is {what}; allowed: a new or empty folder"]
        ) from None
    except (OSError, ValueError) as fault:
        raise _unwritable(out, fault) from fault


def save_somewhere(result: Saved, out: Path, *, figures: bool) -> tuple[Path, bool]:
    """Save a result in ``out``, or else where it can be; return the folder, and whether it has its figures.

    A run may have taken long. A folder that another run has filled meanwhile, a full disk or one that has become
    read-only must not cost its results: they go beside the folder in the first case, else to a new folder of the
    system's temporary directory.

    Raises
    ------
    ConfigurationError
        If it can be saved nowhere.
    """
    try:
        return out, save(result, out, figures=figures)
    except OSError as fault:
        reason = fault
    where: Path | None = None
    drawn = False
    if isinstance(reason, FileExistsError):
        with suppress(OSError):
            where, drawn = _save_beside(result, out, figures=figures)
    if where is None:
        try:
            where = Path(tempfile.mkdtemp(prefix="gbt-ocp-"))
            drawn = save(result, where, figures=False)
        except OSError as fault:
            raise _unwritable(out, reason) from fault
    remark(f"--out: {_named(out)} cannot be written ({_reason(reason)}); the results are in {where}")
    return where, drawn


def _save_beside(result: Saved, out: Path, *, figures: bool) -> tuple[Path, bool]:
    for _ in range(MOST_RIVALS):
        other = beside(out)
        with suppress(FileExistsError):
            return other, save(result, other, figures=figures)
    raise FileExistsError(f"{out}: other runs take every name beside it")


def save(result: Saved, out: Path, *, figures: bool) -> bool:
    """Save a result, without its figures if they cannot be drawn; return ``False`` in that case."""
    try:
        result.save(out, figures=figures)
    except OSError:
        raise
    except Exception as fault:
        if not figures:
            raise
        # A run may have taken long: a fault in drawing must not cost its results.
        result.save(out, figures=False)
        remark(f"figures: not drawn ({type(fault).__name__}: {fault}); the results are kept")
        return False
    return True


def _unwritable(out: Path, fault: Exception) -> ConfigurationError:
    return ConfigurationError(
        [f"--out: found {_named(out)}, which cannot be written ({_reason(fault)}); allowed: a writable folder"]
    )


def _reason(fault: Exception) -> str:
    """The message of the system without its number and the path, which the line has already."""
    return getattr(fault, "strerror", None) or str(fault)


def _named(out: Path) -> str:
    return shortened(str(out))
