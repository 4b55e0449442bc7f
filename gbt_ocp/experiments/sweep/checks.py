"""Whether the folder of a finished run is what its sweep's plan says; what is not is run again."""

from __future__ import annotations

from pathlib import Path

from gbt_ocp.experiments.sweep.execution import ARRAYS_FILE
from gbt_ocp.experiments.sweep.sweep_plan import PlannedRun, SweepPlan
from gbt_ocp.experiments.sweep.table import row_of
from gbt_ocp.files import read_arrays
from gbt_ocp.simulation import run_folder
from gbt_ocp.simulation.history import TEXT, History

NEEDED = frozenset(("error_mean", "error_settled", "violation_max", "retries", "seed"))
"""Keys that the summary of every run has, of whatever version; tables, studies and exit codes ask for them."""


def check_run(run: PlannedRun, plan: SweepPlan, folder: Path) -> None:
    """Read all that a finished run should have left.

    Raises
    ------
    ValueError, FileNotFoundError, IsADirectoryError, NotADirectoryError
        If something is missing or damaged, with the name of the file.
    """
    own = folder / run.identifier
    row = row_of(run, folder, plan.varied)
    path = own / run_folder.CONFIGURATION
    # A newer version may write out more defaults in a section than the one that ran it: only the run must be the same.
    if path.read_bytes() != run.configuration.to_yaml().encode():
        _, found = run_folder.read_configuration(own)
        absent = sorted(run.configuration.to_mapping().keys() - found.keys())
        if absent:
            raise ValueError(f"{path}: without {', '.join(absent)}")
        if found.get("seed") != run.seed:
            raise ValueError(f"{path}: seed: found {found.get('seed')!r}; allowed: {run.seed}")
    if row["status"] == "failed":
        return
    path = own / run_folder.SUMMARY
    summary = run_folder.read_summary(own)
    missing = sorted(NEEDED - summary.keys())
    if missing:
        raise ValueError(f"{path}: without {', '.join(missing)}")
    if summary["seed"] != run.seed:
        raise ValueError(f"{path}: seed: found {summary['seed']!r}; allowed: {run.seed}")
    if plan.histories:
        History.load_npz(own / run_folder.HISTORY)
    if plan.arrays:
        arrays = read_arrays(own / ARRAYS_FILE, plan.arrays, "arrays of a run")
        lengths = {name: array.shape[:1] for name, array in arrays.items()}
        if len(set(lengths.values())) > 1 or () in lengths.values():
            raise ValueError(f"{own / ARRAYS_FILE}: found arrays of different lengths: {lengths}")
        words = [name for name, array in arrays.items() if array.dtype.kind not in "fiub" and name not in TEXT]
        if words:
            raise ValueError(f"{own / ARRAYS_FILE}: found text in {', '.join(words)}; allowed: numbers")
