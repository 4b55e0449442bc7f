"""What a trajectory problem consists of: what the transcription, the solvers and the planner read of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Self

from gbt_ocp.models.sizes import at_least, positive
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.ocp.terms import Constraint, JointObjective, Objective, is_believed


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
class ProblemData:
    """Vehicle, horizon, objectives and limits of a trajectory problem.

    See :class:`gbt_ocp.ocp.problem.TrajectoryProblem` for the parameters.
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
        at_least("pieces", self.pieces, 1)
        at_least("degree", self.degree, 2)
        if self.continuity is not None and at_least("continuity", self.continuity, 1) >= self.degree:
            raise ValueError(f"continuity: found {self.continuity}; allowed: at most degree - 1 = {self.degree - 1}")
        positive("period", self.period)

    @property
    def joined(self) -> int:
        """How many derivatives of the flat output, itself included, a piece takes over from the one before it."""
        return joined_derivatives(self.degree, self.continuity)

    @property
    def freedoms(self) -> int:
        """Unknowns of a piece: its derivatives from :attr:`joined` to L, each of the size of the flat output."""
        return (self.degree + 1 - self.joined) * self.vehicle.flat_dimension

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
        soft = (not is_believed(limit.constraint) for limit in self.penalties)
        return (*(True for _ in self.hard), *soft)

    @property
    def relaxed(self) -> Self | None:
        """The same problem with hard limits on what is only believed as penalties; ``None`` if there are none.

        A forecast may jump so that no plan keeps a distance from it. This problem still has a plan: the one that gets
        nearest to keeping it. Its :attr:`constraints` are those of the problem in the order of
        :attr:`relaxed_order`.
        """
        believed = [limit for limit in self.hard if is_believed(limit.constraint)]
        if not believed:
            return None
        kept = tuple(limit for limit in self.hard if not is_believed(limit.constraint))
        softened = tuple(PenaltyLimit(limit.constraint, limit.nodes, 100.0, 0.01) for limit in believed)
        return replace(self, hard=kept, penalties=(*self.penalties, *softened))

    def limited_to(self, keep: Callable[[Constraint], bool]) -> Self:
        """The same problem with those of its limits whose constraints are to be kept, hard and penalised."""
        return replace(
            self,
            hard=tuple(limit for limit in self.hard if keep(limit.constraint)),
            penalties=tuple(limit for limit in self.penalties if keep(limit.constraint)),
        )

    @property
    def certain(self) -> Self:
        """The same problem without the limits on what is only believed."""
        return self.limited_to(lambda constraint: not is_believed(constraint))

    @property
    def relaxed_order(self) -> tuple[int, ...]:
        """Where each constraint of :attr:`relaxed` stands among :attr:`constraints`."""
        moving = [is_believed(limit.constraint) for limit in self.hard]
        kept = [number for number, moves in enumerate(moving) if not moves]
        softened = [number for number, moves in enumerate(moving) if moves]
        soft = [len(self.hard) + number for number in range(len(self.penalties))]
        return (*kept, *soft, *softened)
