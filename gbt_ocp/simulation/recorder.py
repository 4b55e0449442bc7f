"""The arrays of a history while it is recorded, a row a step."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.simulation.columns import RAGGED, UNKNOWN, Column, columns
from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.step import Step

_SINGLE: dict[type, tuple[int, ...]] = {float: (), int: (), bool: (), np.float64: (), np.bool_: ()}
"""Numbers that are no arrays, and their shape."""

_NONE = (-1,)
"""The shape of no row."""


class Recorder:
    """Records a run; its memory is that of the history, which takes the arrays over without a copy.

    Parameters
    ----------
    kind
        The class of history.
    steps
        Steps of the run, K.
    """

    def __init__(self, kind: type[History], steps: int) -> None:
        self._kind = kind
        self._columns = columns(kind)
        self._steps = steps
        self._count = 0
        self._arrays: dict[str, NDArray[Any]] = {}
        self._fit = [_NONE] * len(self._columns)

    def add(self, step: Step) -> None:
        """Record a step.

        Raises
        ------
        ValueError
            If a row has another shape than the column declares or than the rows before.
        """
        for number, one in enumerate(self._columns):
            found = one.read(step)
            # most rows are as those before them, of which nothing need be looked at
            if self._fit[number] == (found.shape if type(found) is np.ndarray else _SINGLE.get(type(found))):
                self._arrays[one.name][self._count] = found
            else:
                self._place(number, one, found)
        self._count += 1

    def _place(self, number: int, one: Column, found: Any) -> None:
        """Record what has been read of a step, whatever it is."""
        row: NDArray[Any] = np.asarray(found, dtype=one.kind)
        array = self._room(one, row)
        if array.shape[1:] != row.shape:
            array[self._count] = UNKNOWN[one.kind]
        place: tuple[int | slice, ...] = (self._count, *(slice(length) for length in row.shape))
        array[place] = row
        self._fit[number] = _NONE if one.kind is str else array.shape[1:]

    def history(self) -> History:
        """The steps recorded so far."""
        finish = {one.name: one.finish for one in self._columns}
        return self._kind(**{name: finish[name](array[: self._count]) for name, array in self._arrays.items()})

    def _room(self, one: Column, row: NDArray[Any]) -> NDArray[Any]:
        """An array with room for the row: more pieces or longer words than before need a larger one."""
        array = self._arrays.get(one.name)
        before = row.shape if array is None else array.shape[1:]
        if array is not None and before == row.shape and row.itemsize <= array.itemsize:
            return array
        fits = len(row.shape) == len(before) == len(one.rows) and all(
            axis in RAGGED or length == known for axis, length, known in zip(one.rows, row.shape, before, strict=True)
        )
        if not fits:
            allowed = before if array is not None else f"{len(one.rows)} axes"
            raise ValueError(
                f"history: {one.name}: found a row of shape {row.shape} at step {self._count}; allowed: {allowed}"
            )
        shape = tuple(map(max, row.shape, before))
        if array is not None and shape == before and row.itemsize <= array.itemsize:
            return array
        larger = np.empty((self._steps, *shape), row.dtype if array is None else np.result_type(row, array))
        if array is not None:
            larger[: self._count] = UNKNOWN[one.kind]
            larger[(slice(self._count), *map(slice, before))] = array[: self._count]
        self._arrays[one.name] = larger
        return larger
