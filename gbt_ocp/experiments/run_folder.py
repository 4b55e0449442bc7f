"""A run folder is written whole or not at all, and its JSON is strict.

The folder is filled under a temporary name in the same parent and renamed at the end: a rename within one file system
is atomic, so whoever sees the final name sees the whole folder, also after a kill or a full disk.
"""

from __future__ import annotations

import json
import math
import os
import secrets
import shutil
import socket
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import yaml

CONFIGURATION = "config.yaml"
HISTORY = "history.npz"
SUMMARY = "summary.json"
FIGURES = "figures"
PARTS = (CONFIGURATION, HISTORY, SUMMARY)
"""The files without which a folder is no run folder."""

NUMBERS = frozenset(
    (
        "error_mean", "error_settled", "error_final", "error_rms", "error_median", "error_settled_max", "settling_s",
        "distance_min", "distance_median", "violation_max", "objective_mean", "solver_success_rate",
        "solver_iterations_mean", "solver_time_median_ms", "solver_time_max_ms", "tracker_time_median_ms", "steps",
        "wall_s", "seed",
    )
)  # fmt: skip
COUNTS = frozenset(("fallbacks", "retries"))
LISTS = frozenset(("warnings", "thrust_max"))
"""What keys of the summary hold that somebody computes with."""

# The fast one is a part of most builds of PyYAML; a sweep reads as many files as it has runs.
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

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


def strict(value: Any) -> Any:
    """Copy of nested mappings, sequences and numbers fit for strict JSON: NaN and infinity become None."""
    if isinstance(value, Mapping):
        return {str(key): strict(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [strict(entry) for entry in value]
    if hasattr(value, "tolist"):  # numpy scalars and arrays
        return strict(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def write_summary(folder: Path, summary: Mapping[str, Any]) -> None:
    """Write ``summary.json``; NaN and infinity are written as null.

    Raises
    ------
    TypeError
        If a value is neither a number, a text, a boolean, None nor a nest of these.
    """
    text = json.dumps(strict(summary), indent=2, ensure_ascii=False, allow_nan=False)
    (folder / SUMMARY).write_text(text + "\n", encoding="utf-8")


def read_summary(folder: Path) -> dict[str, Any]:
    """Read ``summary.json`` of a run folder.

    Raises
    ------
    FileNotFoundError
        If the folder has no summary.
    ValueError
        If the file is not a JSON object, or a number of it is none.
    """
    path = folder / SUMMARY
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:  # what is no UTF-8 is a ValueError too
        raise ValueError(f"{path}: not valid JSON: {error}") from None
    if not isinstance(summary, dict):
        raise ValueError(f"{path}: found {type(summary).__name__}; allowed: a JSON object")
    # A key that is not there may be one that an older version did not write.
    for key, value in summary.items():
        if key in NUMBERS and value is not None and not _is_number(value):
            raise ValueError(f"{path}: {key}: found {value!r:.60}; allowed: a number or null")
        if key in COUNTS and not (isinstance(value, dict) and all(map(_is_number, value.values()))):
            raise ValueError(f"{path}: {key}: found {value!r:.60}; allowed: a mapping to numbers")
        if key == "versions" and not isinstance(value, dict):
            raise ValueError(f"{path}: {key}: found {value!r:.60}; allowed: a mapping")
        if key in LISTS and value is not None and not isinstance(value, list):
            raise ValueError(f"{path}: {key}: found {value!r:.60}; allowed: a list")
    return summary


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def read_configuration(folder: Path) -> tuple[str, dict[str, Any]]:
    """Text and mapping of ``config.yaml`` of a run folder; its keys are not checked.

    Raises
    ------
    FileNotFoundError
        If the folder has none.
    ValueError
        If the file is not a mapping in YAML.
    """
    path = folder / CONFIGURATION
    try:
        text = path.read_text(encoding="utf-8")
        mapping = yaml.load(text, _LOADER)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ValueError(f"{path}: not valid YAML: {' '.join(str(error).split())}") from None
    if not isinstance(mapping, dict):
        raise ValueError(f"{path}: found {type(mapping).__name__}; allowed: a mapping, as gbt-ocp run wrote it")
    return text, mapping


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
