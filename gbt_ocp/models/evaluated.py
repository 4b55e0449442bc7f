"""CasADi expressions as functions of numpy arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.typing import Array


class Evaluated:
    """Expressions of a few vectors, evaluated at one point or at many at once.

    Numbers go straight into the memory of the function: a call by CasADi's own types takes ten times as long for one
    point, since it makes a matrix of each argument and of each result.

    Parameters
    ----------
    name
        Of the function.
    symbols
        The vectors, SX symbols ``(n,)`` each.
    expressions
        What is evaluated, columns ``(m,)`` of these symbols.
    points
        Points of a call; ``None`` for one, whose arrays have no axis for it.
    """

    def __init__(
        self, name: str, symbols: Sequence[ca.SX], expressions: Sequence[Any], points: int | None = None
    ) -> None:
        function = ca.Function(name, [*symbols], [ca.densify(ca.SX(one)) for one in expressions])
        self._load(function, points)

    def _load(self, function: ca.Function, points: int | None) -> None:
        self._made_from = function, points
        mapped = function if points is None else function.map(points)
        lead = () if points is None else (points,)
        self._given = [np.zeros((*lead, function.numel_in(k))) for k in range(function.n_in())]
        self._found = [np.zeros((*lead, function.numel_out(k))) for k in range(function.n_out())]
        buffer: Any
        buffer, self._evaluate = mapped.buffer()
        self._kept = buffer  # what evaluates it does not hold it
        for k, array in enumerate(self._given):
            buffer.set_arg(k, memoryview(array))  # type: ignore[arg-type,unused-ignore]
        for k, array in enumerate(self._found):
            buffer.set_res(k, memoryview(array))  # type: ignore[arg-type,unused-ignore]

    def __reduce__(self) -> tuple[Any, ...]:
        # memory that a function writes to does not pickle, nor may it be replaced by a copy
        return _evaluated, self._made_from

    def all(self, *values: ArrayLike) -> list[Array]:
        """The value of each expression ``(m,)`` or ``(points, m)`` at the vectors ``(n,)`` or ``(points, n)``."""
        for array, value in zip(self._given, values, strict=True):
            array[:] = value
        self._evaluate()
        return [array.copy() for array in self._found]

    def __call__(self, *values: ArrayLike) -> Array:
        """That of the first."""
        return self.all(*values)[0]


def _evaluated(function: ca.Function, points: int | None) -> Evaluated:
    made = Evaluated.__new__(Evaluated)
    made._load(function, points)
    return made
