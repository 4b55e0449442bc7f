"""Solvers of the trajectory problem behind one protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from numpy.typing import ArrayLike

from gbt_ocp.ocp.shot import ShotTrajectory
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.typing import Array

OUT_OF_ITERATIONS = ("iteration limit", "Maximum_Iterations_Exceeded")
"""Status of a solution that is an iterate like others when the iterations were spent, and can be judged."""

NO_PLAN = "no plan"
"""In the place of a fallback, where the input is so large that no plan is finite."""

GIVEN_UP = "given up"
"""Status where the thrust limits are kept and others had to give."""


@dataclass(frozen=True)
class Solution:
    """What a solver returns.

    Attributes
    ----------
    variables
        u ``(p, n)``, the scaled L-th derivatives of the pieces; may be anything where ``solved`` is false.
    solved
        Whether the solver met its tolerance and the solution keeps the thrust limits at the nodes.
    status
        ``solved``, or the solver's own word for what happened.
    iterations
        Iterations in all.
    """

    variables: Array
    solved: bool
    status: str
    iterations: int


@dataclass(frozen=True)
class PlannerStep:
    """One step of a planner, with all its attempts.

    Attributes
    ----------
    top
        What is free in the pieces ``(p, freedoms)``.
    status
        ``solved`` or ``given up``, or the word for what happened to the first attempt.
    fallback
        ``""`` for the first attempt's plan, ``shifted``, ``cold``, ``unfinished`` or ``braking``.
    iterations
        Of all attempts.
    tightened
        How often limits were tightened.
    piece_violation
        Worst violation of the judged limits in each piece, on the fine grid and in their units, at least 0 ``(p,)``.
    given_up
        Worst violation of each constraint that had to give, 0 of the others, in its unit.
    broken_at_start
        How far each constraint is broken where the plan begins and no plan can change it, in its unit.
    objective
        Without penalty; ``None`` where it has to be computed.
    """

    top: Array
    status: str
    fallback: str
    iterations: int
    tightened: int
    piece_violation: Array
    given_up: Array
    broken_at_start: Array
    objective: float | None = None


@runtime_checkable
class PlansSteps(Protocol):
    """What takes a planner's step: a solver that brings its own, or the ladder around one that does not."""

    def plan(
        self,
        start: Array,
        objectives: Sequence[Array],
        limits: Sequence[Array],
        previous: FlatTrajectory | ShotTrajectory | None,
        data: Mapping[str, Any],
    ) -> PlannerStep:
        """Plan from a start.

        Parameters
        ----------
        start, objectives, limits
            As of :meth:`Solver.solve`.
        previous
            The trajectory of the previous plan, if there is one; it began a piece before the start.
        data
            What the parameters were made of.
        """


@runtime_checkable
class ReadsMoments(Protocol):
    """What takes a planner's step from the moments of a forecast, where it can, without the parameters."""

    def reads(self, data: Mapping[str, Any]) -> bool:
        """Whether the next :meth:`PlansSteps.plan` needs nothing but this data, which is sound.

        It keeps what it read until then; the objectives and limits that it is given are not looked at.
        """


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
        tightening: ArrayLike = 0.0,
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
            Moves bounds inwards in the first piece, which is executed, in units of the limits: one number a constraint,
            or one for all.
        limits
            Parameters of each constraint, one knot a column ``(size, p+1)``; needed where any has some.
        """


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


def options_beside(named: str, solver: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """:func:`options_for` a solver where options stand beside the name of one, as in a configuration.

    Options under no solver's name are for the solver that is named; ``auto`` stands for ``compiled``.
    """
    return options_for(solver, options, common=solver == ("compiled" if named == "auto" else named))
