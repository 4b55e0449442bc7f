"""The trajectory problem: an immutable description, built up by verbs that name how a constraint is treated.

problem = TrajectoryProblem(vehicle, pieces=5, period=0.1)
problem = problem.maximize(BearingSimilarity(2))
problem = problem.subject_to_penalty(ThrustLimit(vehicle, gamma=0.98), weight=1000.0, width=0.01, nodes=20)
planner = problem.compile()
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from gbt_ocp.ocp.constraints import Constraint, MovingConstraint
from gbt_ocp.ocp.objectives import JointObjective, Objective
from gbt_ocp.vehicles import Vehicle

if TYPE_CHECKING:
    from gbt_ocp.ocp.planner import Planner


@dataclass(frozen=True)
class HardLimit:
    """A constraint imposed exactly at ``nodes`` intervals a piece (``nodes + 1`` points, both ends included)."""

    constraint: Constraint
    nodes: int


@dataclass(frozen=True)
class PenaltyLimit:
    """A constraint whose violation is integrated and weighed (``eq35``).

    ``weight`` is w_p, ``width`` ϖ (both in the constraint's own units), ``nodes`` n_c.
    """

    constraint: Constraint
    nodes: int
    weight: float
    width: float


def joined_derivatives(degree: int, continuity: int | None) -> int:
    """How many derivatives, the flat output itself included, pieces of a degree share; all but the last by default."""
    return degree if continuity is None else continuity + 1


@dataclass(frozen=True)
class TrajectoryProblem:
    """Maximise a sum over the endpoints of a flat trajectory, under path constraints (``eq33``, ``eq36``).

    Parameters
    ----------
    vehicle
        Gives the flatness map.
    pieces
        p, the number of pieces.
    period
        T in seconds, the length of a piece.
    degree
        L >= 2, the degree of the polynomials.
    continuity
        k, from 1 to L-1: how many derivatives are continuous from piece to piece. By default L-1, as in the paper,
        which leaves one vector of freedom a piece, its endpoint; with less, a piece has L-k of them, and its
        acceleration may turn with the vehicle where k = 1 < L-1.

    Raises
    ------
    ValueError
        If a size is out of range.
    """

    vehicle: Vehicle
    pieces: int
    period: float
    degree: int = 2
    continuity: int | None = None
    objectives: tuple[Objective | JointObjective, ...] = field(default=(), kw_only=True)
    hard: tuple[HardLimit, ...] = field(default=(), kw_only=True)
    penalties: tuple[PenaltyLimit, ...] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        for name, value, least in (("pieces", self.pieces, 1), ("degree", self.degree, 2)):
            if value < least:
                raise ValueError(f"{name} must be at least {least}, found {value}")
        if self.continuity is not None and not 1 <= self.continuity < self.degree:
            raise ValueError(f"continuity must be from 1 to degree - 1 = {self.degree - 1}, found {self.continuity}")
        if not self.period > 0.0:
            raise ValueError(f"period must be positive, found {self.period}")

    @property
    def joined(self) -> int:
        """How many derivatives of the flat output, itself included, a piece takes over from the one before it."""
        return joined_derivatives(self.degree, self.continuity)

    @property
    def freedoms(self) -> int:
        """Unknowns of a piece: its derivatives from :attr:`joined` to L, each of the size of the flat output."""
        return (self.degree + 1 - self.joined) * self.vehicle.flat_dimension

    def maximize(self, objective: Objective | JointObjective) -> TrajectoryProblem:
        """Add a term to the objective."""
        return replace(self, objectives=(*self.objectives, objective))

    def subject_to(self, constraint: Constraint, *, nodes: int = 4) -> TrajectoryProblem:
        """Impose a constraint exactly, at ``nodes`` intervals a piece."""
        if nodes < 1:
            raise ValueError(f"nodes must be at least 1, found {nodes}")
        return replace(self, hard=(*self.hard, HardLimit(constraint, nodes)))

    def subject_to_penalty(
        self, constraint: Constraint, *, weight: float = 1000.0, width: float = 0.01, nodes: int = 20
    ) -> TrajectoryProblem:
        """Penalise the violation of a constraint, integrated over ``nodes`` intervals a piece."""
        if nodes < 1:
            raise ValueError(f"nodes must be at least 1, found {nodes}")
        if not (weight > 0.0 and width > 0.0):
            raise ValueError(f"weight and width must be positive, found {weight} and {width}")
        return replace(self, penalties=(*self.penalties, PenaltyLimit(constraint, nodes, weight, width)))

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """Every constraint, however it is treated."""
        return (*(limit.constraint for limit in self.hard), *(soft.constraint for soft in self.penalties))

    @property
    def judged(self) -> tuple[bool, ...]:
        """For each constraint, whether a piece that breaks it is never executed.

        Not so a penalty on what is only believed: a forecast may jump so that no plan keeps a distance from it, and
        then the plan that does its best is better than none.
        """
        soft = (not isinstance(limit.constraint, MovingConstraint) for limit in self.penalties)
        return (*(True for _ in self.hard), *soft)

    @property
    def relaxed(self) -> TrajectoryProblem | None:
        """The same problem with hard limits on what is only believed as penalties; ``None`` if there are none.

        A forecast may jump so that no plan keeps a distance from it. This problem still has a plan: the one that gets
        nearest to keeping it. Its :attr:`constraints` are those of the problem in the order of
        :attr:`relaxed_order`.
        """
        believed = [limit for limit in self.hard if isinstance(limit.constraint, MovingConstraint)]
        if not believed:
            return None
        kept = tuple(limit for limit in self.hard if not isinstance(limit.constraint, MovingConstraint))
        softened = tuple(PenaltyLimit(limit.constraint, limit.nodes, 100.0, 0.01) for limit in believed)
        return replace(self, hard=kept, penalties=(*self.penalties, *softened))

    def limited_to(self, keep: Callable[[Constraint], bool]) -> TrajectoryProblem:
        """The same problem with those of its limits whose constraints are to be kept, hard and penalised."""
        return replace(
            self,
            hard=tuple(limit for limit in self.hard if keep(limit.constraint)),
            penalties=tuple(limit for limit in self.penalties if keep(limit.constraint)),
        )

    @property
    def certain(self) -> TrajectoryProblem:
        """The same problem without the limits on what is only believed."""
        return self.limited_to(lambda constraint: not isinstance(constraint, MovingConstraint))

    @property
    def relaxed_order(self) -> tuple[int, ...]:
        """Where each constraint of :attr:`relaxed` stands among :attr:`constraints`."""
        moving = [isinstance(limit.constraint, MovingConstraint) for limit in self.hard]
        kept = [number for number, moves in enumerate(moving) if not moves]
        softened = [number for number, moves in enumerate(moving) if moves]
        soft = [len(self.hard) + number for number in range(len(self.penalties))]
        return (*kept, *soft, *softened)

    def compile(self, solver: str = "auto", options: Mapping[str, Any] | None = None) -> Planner:
        """Build the solver once; everything that changes from step to step is a parameter of it.

        Parameters
        ----------
        solver
            ``ipopt``, or ``auto`` for the best one that is there.
        options
            Handed to the solver; those in a mapping under the name of a solver to that solver only.

        Raises
        ------
        ValueError
            If the problem has no objective or the solver is unknown.
        """
        from gbt_ocp.ocp.planner import Planner
        from gbt_ocp.ocp.solvers import make_solver

        if not self.objectives:
            raise ValueError("the problem has no objective; call maximize() first")
        relaxed = self.relaxed
        return Planner(
            self,
            make_solver(self, solver, options or {}),
            None if relaxed is None else make_solver(relaxed, solver, options or {}),
        )
