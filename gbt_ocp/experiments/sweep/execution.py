"""One run of a sweep, as a worker carries it out, and what a failed run leaves."""

from __future__ import annotations

import json
import traceback
from pathlib import Path

import numpy as np

from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.experiments.sweep.plan import PlannedRun
from gbt_ocp.files import whole_folder
from gbt_ocp.simulation import run_folder

FAILURE = "failure.json"
"""Stands in the folder of a failed run in place of its summary."""

ARRAYS = "arrays.npz"
"""Single arrays of a history."""


def execute(run: PlannedRun, folder: Path, histories: bool = True, arrays: tuple[str, ...] = ()) -> bool:
    """Carry out a run and write its folder; whether it succeeded.

    A run that raises leaves a folder with ``failure.json`` and ends no other run. The temporary folder is there from
    the beginning: one whose process is gone says that the process died during the run.

    Parameters
    ----------
    run
        What to run.
    folder
        Where the folders of all runs lie.
    histories
        Whether to keep ``history.npz``.
    arrays
        Attributes of the history to keep in ``arrays.npz``.
    """
    # In here, so that a worker unpickles this function before it pays for CasADi.
    from gbt_ocp.experiments.run import run as run_experiment

    configuration, own = run.configuration, folder / run.identifier
    try:
        with whole_folder(own) as temporary:
            try:
                result = run_experiment(configuration)
            except Exception as fault:
                _write_failure(temporary, configuration, f"{type(fault).__name__}: {fault}", traceback.format_exc())
                return False
            result.write(temporary, history=histories, figures=False)
            if arrays:
                np.savez(temporary / ARRAYS, **{name: getattr(result.history, name) for name in arrays})
    except FileExistsError:
        # A worker of a sweep that was killed has finished this run meanwhile, and runs repeat: its folder is as good.
        if not (own / run_folder.CONFIGURATION).is_file():
            raise
        return not (own / FAILURE).is_file()
    return True


def record_lost(run: PlannedRun, folder: Path) -> None:
    """Record a run that took its process down with it."""
    with whole_folder(folder / run.identifier) as temporary:
        error = "the process died during the run (killed, out of memory, or a crash)"
        _write_failure(temporary, run.configuration, error, "")


def _write_failure(folder: Path, configuration: Configuration, error: str, details: str) -> None:
    (folder / run_folder.CONFIGURATION).write_text(configuration.to_yaml(), encoding="utf-8")
    text = json.dumps({"error": " ".join(error.split()), "traceback": details}, indent=2, ensure_ascii=False)
    (folder / FAILURE).write_text(text + "\n", encoding="utf-8")
