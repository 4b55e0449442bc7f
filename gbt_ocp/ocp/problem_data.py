"""What a trajectory problem consists of: what the transcription, the solvers and the planner read of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from gbt_ocp.models.sizes import at_least, positive
from gbt_ocp.models.vehicles import DrivenVehicle, Vehicle
from gbt_ocp.ocp.integration_steps import stable_steps
from gbt_ocp.ocp.terms import AnyObjective, Constraint, is_believed
from gbt_ocp.ocp.thrust_limits import InputRateLimit, OfChanges, ThrustChange


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
class PosedProblem:
    """Vehicle, horizon, objectives and limits of a problem, whatever form its trajectory has."""

    vehicle: DrivenVehicle
    pieces: int
    period: float
    objectives: tuple[AnyObjective, ...] = field(default=(), kw_only=True)
    hard: tuple[HardLimit, ...] = field(default=(), kw_only=True)
    penalties: tuple[PenaltyLimit, ...] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        at_least("pieces", self.pieces, 1)
        positive("period", self.period)

    @property
    def freedoms(self) -> int:
        """Unknowns of a piece."""
        raise NotImplementedError

    @property
    def joined(self) -> int:
        """How many derivatives of the flat output, itself included, a start has."""
        raise NotImplementedError

    def check_changes(self, constraint: OfChanges) -> None:
        """Whether rates of the inputs can be bounded or weighed at all.

        Raises
        ------
        ValueError
            If not.
        """
        if isinstance(constraint, InputRateLimit):
            raise ValueError("limits.input_rate: found planner.form: flat; allowed: shooting")

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """Every constraint, however it is treated."""
        return (*(limit.constraint for limit in self.hard), *(soft.constraint for soft in self.penalties))

    @property
    def judged(self) -> tuple[bool, ...]:
        """For each constraint, whether a piece that breaks it is never executed.

        Not so a penalty on what is only believed: a forecast may jump so that no plan keeps a distance from it, and
        then the plan that does its best is better than none. Nor changes of the thrust, which are weighed, not limited.
        """
        free = (is_believed(limit.constraint) or isinstance(limit.constraint, ThrustChange) for limit in self.penalties)
        soft = (not one for one in free)
        return (*(True for _ in self.hard), *soft)


@dataclass(frozen=True)
class ProblemData(PosedProblem):
    """A problem of flat trajectories.

    See :class:`gbt_ocp.ocp.problem.TrajectoryProblem` for the parameters.
    """

    vehicle: Vehicle
    degree: int = 2
    continuity: int | None = None

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

    def check_changes(self, constraint: OfChanges) -> None:
        """Those of the thrust can be weighed where it jumps between pieces and nowhere else, or not at all."""
        super().check_changes(constraint)
        if self.joined < min(3, self.degree):
            raise ValueError(
                f"planner.effort_rate: found degree {self.degree} of which one derivative is continuous; allowed: "
                "planner.degree 2, planner.continuity 2 and more, or planner.form: shooting"
            )

    @property
    def remembers(self) -> bool:
        """Whether a piece knows the acceleration of the one before: where changes of the thrust count, which jumps."""
        return self.joined == 2 and any(isinstance(constraint, ThrustChange) for constraint in self.constraints)

    @property
    def freedoms(self) -> int:
        """Unknowns of a piece: its derivatives from :attr:`joined` to L, each of the size of the flat output."""
        return (self.degree + 1 - self.joined) * self.vehicle.flat_dimension


@dataclass(frozen=True)
class ShootingData(PosedProblem):
    """A problem of trajectories that follow from the inputs by integration.

    See :class:`gbt_ocp.ocp.shooting_problem.ShootingProblem` for the parameters.
    """

    thrust: Literal["held", "linear"] = "held"
    steps: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.thrust not in ("held", "linear"):
            raise ValueError(f"thrust: found {self.thrust!r}; allowed: held, linear")
        if self.steps is not None:
            at_least("steps", self.steps, 1)

    @cached_property
    def runge_kutta_steps(self) -> int:
        """M, classical Runge-Kutta steps over a period: those given, or :func:`~.integration_steps.stable_steps`."""
        if self.steps is not None:
            return self.steps
        return stable_steps(self.vehicle, self.period, self.constraints)

    @property
    def joined(self) -> int:
        """How many derivatives of the flat output a start has: z and its rate."""
        return 2

    def check_changes(self, constraint: OfChanges) -> None:
        """They can."""

    @property
    def remembers_inputs(self) -> bool:
        """Whether the inputs of a piece are part of the state after it: where their rates count."""
        return any(isinstance(constraint, OfChanges) for constraint in self.constraints)

    @property
    def freedoms(self) -> int:
        """Unknowns of a piece: its inputs, or those at both of its ends, or at its end where they go on."""
        return len(self.vehicle.thrust_max) * (1 if self.thrust == "held" or self.remembers_inputs else 2)
