"""What a problem is made of: objectives, to be maximised, and constraints, to be kept.

A term says what numbers it needs at one time (``shapes``; ``{}`` for none), how it is computed there from CasADi
symbols (``value``), and how those numbers come out of the data of a solve (``bind``). Nothing here knows where a
forecast comes from. :mod:`gbt_ocp.ocp.term_checks` evaluates each term once when it is added to a problem.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.typing import Array


class Moments(Protocol):
    """Mean and covariance of a predicted position at the endpoints t_{k+1}, t_{k+2} and so on."""

    @property
    def mean(self) -> Array:
        """μ ``(>=p, d)`` in metres."""

    @property
    def covariance(self) -> Array:
        """Σ ``(>=p, d, d)`` in m²."""


class Objective(Protocol):
    """A term of the objective: summed over the endpoints and maximised."""

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """Parameters of one endpoint: name to matrix shape; ``{}`` where none are needed."""

    def value(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """The term at one endpoint, a CasADi scalar."""

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Numbers for the parameters, ``(p, *shape)`` each, from the data given to a solve."""


@runtime_checkable
class JointObjective(Protocol):
    """A term of the objective that couples the endpoints, maximised like a sum over them.

    Only IPOPT takes it: the compiled solver's factorisation rests on sums over endpoints. Where the coupling is by a
    few sums, :class:`AccumulatedObjective` says so, and every solver takes it.
    """

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """Parameters of one endpoint: name to matrix shape."""

    def total(self, points: Sequence[FlatPoint], parameters: Sequence[Mapping[str, Any]]) -> Any:
        """The term of all endpoints together, a CasADi scalar."""

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Numbers for the parameters, ``(p, *shape)`` each, from the data given to a solve."""


@runtime_checkable
class AccumulatedObjective(Protocol):
    """A term of the objective that is a function of a few sums over the endpoints, maximised.

    Such is the determinant of an information matrix: its entries are sums of what single bearings say. The compiled
    solver carries the sums through its recursion as further states, at a cost linear in the endpoints.
    """

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """Parameters of one endpoint: name to matrix shape; ``{}`` where none are needed."""

    def accumulated(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """What one endpoint adds to the sums ``(m,)``, a CasADi column.

        The compiled solver takes those that depend on the flat output and its rate alone.
        """

    def of_sums(self, sums: Any) -> Any:
        """The term, a CasADi scalar of the sums ``(m,)`` and of nothing else."""

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Numbers for the parameters, ``(p, *shape)`` each, from the data given to a solve."""


AnyObjective = Objective | JointObjective | AccumulatedObjective
"""Whatever a problem can maximise."""


@runtime_checkable
class FromMoments(Protocol):
    """An objective whose parameters follow from mean, covariance and desired bearing alone.

    It can be generated as C together with the step of the planner.
    """

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """Parameters of one endpoint: name to matrix shape."""

    def from_moments(self, mean: Any, root: Any, desired: Any) -> Mapping[str, Any]:
        """CasADi expressions of the parameters at one endpoint.

        Parameters
        ----------
        mean
            μ ``(d,)``.
        root
            Symmetric square root of Σ ``(d, d)``.
        desired
            Desired bearing λ* ``(d,)``.
        """


def at_endpoint(objective: Objective | AccumulatedObjective, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
    """The term at one endpoint, or what that adds to the sums ``(m,)``."""
    if isinstance(objective, AccumulatedObjective):
        return objective.accumulated(point, parameters)
    return objective.value(point, parameters)


class MissingDataError(ValueError):
    """A term needs something that a solve was not given."""


def needed(data: Mapping[str, Any], name: str, reader: object) -> Any:
    """The entry ``name`` of the data of a solve, or a clear error.

    Raises
    ------
    MissingDataError
        If the entry is missing.
    """
    if data.get(name) is None:
        given = sorted(key for key, value in data.items() if value is not None)
        raise MissingDataError(f"{type(reader).__name__} needs '{name}'; given: {', '.join(given) or 'nothing'}")
    return data[name]


class PathConstraint(Protocol):
    """``lower <= value(z, ż, z̈) <= upper`` at every time."""

    @property
    def lower(self) -> Array:
        """True lower bounds ``(m,)``; ``-inf`` where there is none."""

    @property
    def upper(self) -> Array:
        """True upper bounds ``(m,)``; ``inf`` where there is none."""

    @property
    def backoff(self) -> Array:
        """How far inside the true bounds the solver is kept ``(m,)``, against what happens between nodes."""

    @property
    def scale(self) -> Array:
        """Unit in which a violation is reported ``(m,)``."""

    def value(self, point: FlatPoint) -> Any:
        """The bounded quantities ``(m,)``, a CasADi expression."""


@runtime_checkable
class MovingConstraint(Protocol):
    """A path constraint that depends on numbers that change along the trajectory and from solve to solve.

    Bounds, back-off and scale are those of :class:`PathConstraint`. The numbers are given at the knots, the boundaries
    of the pieces, and are linear in time between them.
    """

    @property
    def lower(self) -> Array:
        """See :class:`PathConstraint`."""

    @property
    def upper(self) -> Array:
        """See :class:`PathConstraint`."""

    @property
    def backoff(self) -> Array:
        """See :class:`PathConstraint`."""

    @property
    def scale(self) -> Array:
        """See :class:`PathConstraint`."""

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """Parameters at one time: name to matrix shape."""

    def value(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """The bounded quantities ``(m,)``, a CasADi expression."""

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Numbers for the parameters at the knots, ``(p+1, *shape)`` each, from the data given to a solve."""


@runtime_checkable
class LimitFromMoments(Protocol):
    """A moving constraint whose numbers at a knot follow from mean and covariance of the target's position then.

    It can be generated as C together with the step of the planner.
    """

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """Parameters at one time: name to matrix shape."""

    def at_knot(self, mean: Any, covariance: Any, present: Any) -> Mapping[str, Any]:
        """CasADi expressions of the parameters.

        Parameters
        ----------
        mean, covariance
            μ ``(d,)`` and Σ ``(d, d)`` at the knot.
        present
            Σ ``(d, d)`` at the beginning of the plan.
        """


@runtime_checkable
class LimitFromMotion(Protocol):
    """Like :class:`LimitFromMoments`, where the position at the knot before counts as well."""

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """Parameters at one time: name to matrix shape."""

    def at_knot_after(self, mean: Any, covariance: Any, present: Any, before: Any, later: Any) -> Mapping[str, Any]:
        """CasADi expressions of the parameters.

        Parameters
        ----------
        mean, covariance, present
            See :meth:`LimitFromMoments.at_knot`.
        before
            μ ``(d,)`` at the knot before; at the beginning of the plan that of the present.
        later
            0 at the beginning of the plan, 1 after it.
        """


Constraint = PathConstraint | MovingConstraint
"""Whatever a problem can be subject to."""


def is_believed(constraint: Constraint) -> bool:
    """Whether numbers that change from solve to solve enter a constraint, such as those of a forecast.

    A constraint whose numbers are certain says ``believed = False``.
    """
    moving = isinstance(constraint, MovingConstraint) and bool(constraint.shapes)
    return moving and bool(getattr(constraint, "believed", True))
