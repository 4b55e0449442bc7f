"""Solvers of the trajectory problem behind one protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.typing import Array


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
        self,
        start: Array,
        objectives: Sequence[Array],
        guess: Array,
        *,
        cold: bool,
        tightening: float,
        limits: Sequence[Array] = (),
    ) -> Solution:
        """Solve from a guess u ``(p, n)``.

        Parameters
        ----------
        start
            Derivatives of the flat output at the start, as many as are continuous ``(k+1, n)``.
        objectives
            Parameters of each objective, one endpoint a column ``(size, p)``.
        guess
            u ``(p, freedoms)``.
        cold
            Whether the guess is a mere start and not the shifted solution of the step before.
        tightening
            Moves every bound inwards, in units of the limits.
        limits
            Parameters of each constraint, one knot a column ``(size, p+1)``; needed where any has some.
        """


@runtime_checkable
class ChecksLimits(Protocol):
    """A solver that brings its own, faster check of the true limits of a trajectory."""

    def check(self, trajectory: FlatTrajectory, limits: Sequence[Array] = ()) -> Array:
        """Largest violation of each piece ``(p,)``; see :class:`gbt_ocp.ocp.check.LimitCheck`."""


SOLVERS = {
    "compiled": "interior point in C99, generated for the problem; needs a C compiler once",
    "ipopt": "interior point with exact derivatives from CasADi, the reference",
}
"""Names and one-line descriptions of the solvers that a configuration can name besides ``auto``."""


def options_for(solver: str, options: Mapping[str, Any], *, common: bool = True) -> dict[str, Any]:
    """Those options that are for one solver.

    A mapping under the name of a solver is for that solver only; options under no such name are for whichever solver
    is taken, and win.

    Parameters
    ----------
    solver
        A name of :data:`SOLVERS`.
    options
        As a configuration has them, ``{"compiled": {"deadline": 150}, "tolerance": 1e-3}``.
    common
        Whether those under no solver's name are taken.

    Raises
    ------
    ValueError
        If there is something else than a mapping under the name of a solver.
    """
    for name in SOLVERS:
        if not isinstance(options.get(name, {}), Mapping):
            raise ValueError(f"solver_options.{name}: found {options[name]!r}; allowed: a mapping of option names")
    free = {name: value for name, value in options.items() if common and name not in SOLVERS}
    return {**options.get(solver, {}), **free}
