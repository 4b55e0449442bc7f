"""Solvers of the trajectory problem behind one protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.ocp.problem import TrajectoryProblem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Solution:
    """What a solver returns.

    Attributes
    ----------
    variables
        u ``(p, n)``, the scaled L-th derivatives of the pieces; may be anything where ``solved`` is false.
    solved
        Whether the solver met its tolerance.
    status
        ``solved``, or the solver's own word for what happened.
    iterations
        Iterations in all.
    """

    variables: Array
    solved: bool
    status: str
    iterations: int


class Solver(Protocol):
    """Solves one instance of the problem it was built for."""

    @property
    def name(self) -> str:
        """How the solver is called in a configuration."""

    def solve(
        self, start: Array, objectives: Sequence[Array], guess: Array, *, cold: bool, tightening: float
    ) -> Solution:
        """Solve from a guess u ``(p, n)``.

        Parameters
        ----------
        start
            Derivatives 0 … L-1 of the flat output ``(L, n)``.
        objectives
            Parameters of each objective, one endpoint a column ``(size, p)``.
        guess
            u ``(p, n)``.
        cold
            Whether the guess is a mere start and not the shifted solution of the step before.
        tightening
            Moves every bound inwards, in units of the limits.
        """


SOLVERS = {"ipopt": "interior point with exact derivatives from CasADi, the reference"}
"""Names and one-line descriptions of the solvers that a configuration can name besides ``auto``."""


def make_solver(problem: TrajectoryProblem, name: str, options: Mapping[str, Any]) -> Solver:
    """Build the solver of that name; ``auto`` takes the best one there is.

    Raises
    ------
    ValueError
        If the name is unknown; the message lists the known ones.
    """
    from gbt_ocp.ocp.ipopt import IpoptSolver

    if name in ("auto", "ipopt"):
        return IpoptSolver(problem, options)
    raise ValueError(f"solver: found {name!r}; allowed: auto, {', '.join(SOLVERS)}")
