"""Path constraints: bounds on functions of the flat output that must hold all along a trajectory.

A constraint says what is bounded, not how: :meth:`TrajectoryProblem.subject_to` imposes it exactly at nodes, and
:meth:`TrajectoryProblem.subject_to_penalty` turns it into the integral penalty of the paper.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol, runtime_checkable

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.vehicles import Vehicle

Array = NDArray[np.float64]


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

    It can be generated as C together with the whole step of the planner.
    """

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """Parameters at one time: name to matrix shape."""

    def at_knot(self, mean: Any, covariance: Any) -> Mapping[str, Any]:
        """CasADi expressions of the parameters, from μ ``(d,)`` and Σ ``(d, d)``."""


Constraint = PathConstraint | MovingConstraint
"""Whatever a problem can be subject to."""


@dataclass(frozen=True)
class ThrustLimit:
    """``|τ| <= τ_max`` on every input of the vehicle (``eq29c``).

    Parameters
    ----------
    vehicle
        Whose inputs are limited.
    gamma
        γ in (0, 1]: the solver is held to γ τ_max (``eq35``).
    units
        ``normalised``: the thrust over its limit; ``newton``: as the paper prints it, which makes the kink of the
        penalty so narrow that Newton's method stalls on it.

    Raises
    ------
    ValueError
        If γ lies outside (0, 1] or the units are unknown.
    """

    vehicle: Vehicle
    gamma: float = 1.0
    units: Literal["normalised", "newton"] = "normalised"

    def __post_init__(self) -> None:
        if not 0.0 < self.gamma <= 1.0:
            raise ValueError(f"gamma must lie in (0, 1], found {self.gamma}")
        if self.units not in ("normalised", "newton"):
            raise ValueError(f"units must be 'normalised' or 'newton', found {self.units!r}")

    @property
    def upper(self) -> Array:
        """The limits ``(m,)``: ones, or newtons."""
        limit = self.vehicle.thrust_max
        return limit.copy() if self.units == "newton" else np.ones_like(limit)

    @property
    def lower(self) -> Array:
        """Minus the limits ``(m,)``."""
        return -self.upper

    @property
    def backoff(self) -> Array:
        """``(1 - γ)`` of the limit."""
        return (1.0 - self.gamma) * self.upper

    @property
    def scale(self) -> Array:
        """Violations are reported in units of the limit."""
        return self.upper

    def value(self, point: FlatPoint) -> Any:
        """Thrust, over its limit or in newtons."""
        thrust = self.vehicle.inputs(*point)
        return thrust if self.units == "newton" else thrust / ca.DM(self.vehicle.thrust_max)
