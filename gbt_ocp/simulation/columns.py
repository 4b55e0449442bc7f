"""How a recorded array is declared: once, and the history, its file, its tables and its reference follow from it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from inspect import cleandoc
from typing import Any, TypeVar, dataclass_transform

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.simulation.step import Step

UNKNOWN: dict[type, Any] = {float: np.nan, int: 0, bool: False, str: ""}
"""What stands for an entry that is not there, by the kind of the array."""

AXES = {
    "t": "K", "axis": "d", "axis_": "d", "pose": "d+1", "body": "d+1", "input": "m", "ahead": "n+1", "piece": "p",
}  # fmt: skip
"""Known axes with their lengths: steps, coordinates, flat outputs, inputs, forecast times, pieces of the plan."""

SAME_LENGTH = {"body": "pose", "axis_": "axis"}
"""Axes that are as long as another one."""

RAGGED = ("piece",)
"""Axes along which rows may differ in length; the array has the length of the longest, the rest is unknown."""

NAMED = ("axis", "pose", "body", "input")
"""Axes whose entries have names: along them an array is spread over several columns of a table."""


def _as_it_is(rows: NDArray[Any]) -> NDArray[Any]:
    return rows


@dataclass(frozen=True)
class Column:
    """One recorded array.

    Attributes
    ----------
    axes
        Names of its axes, ``t`` first.
    read
        Reads its row from a step of the loop.
    units
        Its units; empty for text and for numbers without a unit.
    meaning
        Its line in the reference.
    kind
        ``float``, ``int``, ``bool`` or ``str``.
    table
        What a table shows of it: each column, or group of columns for the entries of a named axis, with the function
        that computes it from the array.
    clock
        Whether it is measured by a clock. All other arrays repeat bit by bit for the same seed.
    optional
        Whether a file may lack the array, as files do that are older than it. It is then read as unknown.
    name
        Its name in ``history.npz`` and as an attribute of the history.
    rows
        Names of the axes of what is read of a step; those of the array but ``t``, unless it is finished.
    finish
        Computes the array from what was read of all steps, one a row: for that at once takes less time than for each.
    """

    axes: tuple[str, ...]
    read: Callable[[Step], Any]
    units: str
    meaning: str
    kind: type
    table: Mapping[str, Callable[[Any], Any]]
    clock: bool
    optional: bool
    name: str = ""
    rows: tuple[str, ...] = ()
    finish: Callable[[NDArray[Any]], NDArray[Any]] = _as_it_is

    @property
    def shape(self) -> str:
        """Its shape in symbols, as in ``(K, d)``."""
        lengths = ", ".join(AXES.get(axis, axis) for axis in self.axes)
        return f"({lengths})" if len(self.axes) > 1 else f"({lengths},)"

    def canonical(self, array: Any) -> NDArray[Any]:
        """The array as it is kept: contiguous and of its kind, text at the least width."""
        if self.kind is str:
            return np.array(np.asarray(array).tolist(), dtype=np.str_)
        return np.ascontiguousarray(array, dtype=self.kind)


def column(
    axes: str,
    read: Callable[[Step], Any],
    units: str = "",
    *,
    meaning: str,
    kind: type = float,
    table: Mapping[str, Callable[[Any], Any]] | None = None,
    clock: bool = False,
    optional: bool = False,
    finished: tuple[str, Callable[[NDArray[Any]], NDArray[Any]]] | None = None,
) -> Any:
    """Declare an array of a :func:`recorded` class.

    Parameters
    ----------
    axes
        Names of its axes with spaces between them, as in ``"t axis"``.
    read, units, meaning, kind, clock, optional
        See :class:`Column`.
    table
        See :class:`Column`. By default a table shows the array itself under its own name, if it has one number a step
        or one for each entry of a named axis.
    finished
        Names of the axes of what ``read`` gives, with spaces between them, and what makes the array of all of that.
    """
    names = tuple(axes.split())
    if table is None:
        table = {"": lambda array: array} if len(names) == 1 or (len(names) == 2 and names[1] in NAMED) else {}
    rows, finish = (names[1:], _as_it_is) if finished is None else (tuple(finished[0].split()), finished[1])
    made = Column(names, read, units, meaning, kind, table, clock, optional, rows=rows, finish=finish)
    return field(metadata={"column": made})


Class = TypeVar("Class")


@dataclass_transform(field_specifiers=(column,), eq_default=False, frozen_default=True)
def recorded(cls: type[Class]) -> type[Class]:
    """Make a frozen dataclass of a class that declares its arrays by :func:`column`; its docstring lists them."""
    made = dataclass(frozen=True, eq=False)(cls)
    lines = ["Attributes", "----------"]
    for one in columns(made):
        lines += [one.name, f"    {one.meaning}, ``{one.shape}``" + f", {one.units}" * bool(one.units)]
    made.__doc__ = "\n".join([cleandoc(cls.__doc__ or ""), "", *lines, ""])
    return made


def columns(recorded: Any) -> tuple[Column, ...]:
    """The columns of a :func:`recorded` class, or of an object of one, in the order of its file."""
    return tuple(replace(one.metadata["column"], name=one.name) for one in fields(recorded))
