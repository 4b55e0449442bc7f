"""The history of a run folder, if there is something in it to draw."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from gbt_ocp.simulation import run_folder
from gbt_ocp.simulation.columns import columns
from gbt_ocp.simulation.history import History


def drawable_history(folder: Path) -> History:
    """Read ``history.npz`` of a run folder to draw it; infinite numbers have no place in a figure and become NaN.

    Raises
    ------
    FileNotFoundError
        If the folder has none.
    ValueError
        If it is damaged, or vehicle or target have no finite position in it; the line names the file.
    """
    path = folder / run_folder.HISTORY
    history = History.load_npz(path)
    for name in ("vehicle_pose", "target"):
        if not np.isfinite(getattr(history, name)).all(axis=1).any():
            raise ValueError(f"{path}: {name}: found no step with finite numbers; allowed: at least one")
    arrays = {one.name: getattr(history, one.name) for one in columns(History)}
    numbers = {name: array for name, array in arrays.items() if array.dtype.kind == "f"}
    return replace(history, **{name: np.where(np.isinf(array), np.nan, array) for name, array in numbers.items()})
