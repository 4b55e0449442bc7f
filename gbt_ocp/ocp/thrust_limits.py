"""Limits of the inputs and of their rates, and what inputs and their changes cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np

from gbt_ocp.models.sizes import positive, vector
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.models.vehicles import DrivenVehicle, Vehicle
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class ThrustLimit:
    """``τ_min <= τ <= τ_max`` on every input of the vehicle (``eq29c``); τ_min is -τ_max where it is not given.

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

    name: ClassVar[str] = "thrust"

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
        """τ_min ``(m,)`` in the same units: minus ones, unless the limits differ by sign."""
        lower = ThrustRange.of(self.vehicle).lower
        return lower.copy() if self.units == "newton" else lower / self.vehicle.thrust_max

    @property
    def backoff(self) -> Array:
        """``(1 - γ)`` of the limit, of the smaller one where they differ by sign."""
        return (1.0 - self.gamma) * np.minimum(self.upper, -self.lower)

    @property
    def scale(self) -> Array:
        """Violations are reported in units of the limit."""
        return self.upper

    def value(self, point: FlatPoint) -> Any:
        """Thrust, over its limit or in newtons."""
        return self.of_inputs(self.vehicle.inputs(*point))

    def of_inputs(self, inputs: Any) -> Any:
        """The same of inputs that are known."""
        return inputs if self.units == "newton" else inputs / ca.DM(self.vehicle.thrust_max)


class _BothSenses:
    """Bounds on as many numbers as the vehicle has inputs, of one size in both senses."""

    vehicle: DrivenVehicle
    reach: float = 1.0

    @property
    def upper(self) -> Array:
        """The bounds ``(m,)``."""
        return np.full(len(self.vehicle.thrust_max), self.reach)

    @property
    def lower(self) -> Array:
        """Minus as much ``(m,)``, whatever the range of the inputs."""
        return -self.upper

    @property
    def backoff(self) -> Array:
        """None ``(m,)``."""
        return np.zeros_like(self.upper)

    @property
    def scale(self) -> Array:
        """Ones ``(m,)``."""
        return np.ones_like(self.upper)


@dataclass(frozen=True)
class ThrustEffort(_BothSenses):
    """The effort ``Σ(τ_i/τ_max,i)²``, as a penalty that is never zero.

    ``problem.subject_to_penalty(ThrustEffort(vehicle), weight=4 w, width=2, nodes=n)`` takes
    ``w ∫ (Σ(τ_i/τ_max,i)² + m) dt`` off the objective: with that half width the smoothed penalties of ``x <= 1`` and of
    ``-x <= 1`` add up to ``(x² + 1)/4`` for all ``|x| <= 1``.

    Parameters
    ----------
    vehicle
        Whose inputs are weighed.
    """

    name: ClassVar[str] = "effort"
    WIDTH: ClassVar[float] = 2.0

    vehicle: Vehicle

    def value(self, point: FlatPoint) -> Any:
        """Thrust over its limit."""
        return self.of_inputs(self.vehicle.inputs(*point))

    def of_inputs(self, inputs: Any) -> Any:
        """The same of inputs that are known."""
        return inputs / ca.DM(self.vehicle.thrust_max)


@dataclass(frozen=True)
class ThrustChange(_BothSenses):
    """What it costs to change the thrust, ``Σ(τ̇_i/τ_max,i)²`` in 1/s², as a penalty that is never zero.

    ``problem.subject_to_penalty(change, weight=change.weight(w), width=change.width, nodes=n)`` takes
    ``w ∫ Σ(τ̇_i/τ_max,i)² dt`` and a constant off the objective, as :class:`ThrustEffort` does of τ, with bounds that
    are so far apart that the parabola holds wherever thrust changes by at most ``reach`` of its limit a second.

    The thrust of a flat trajectory of degree 2 jumps from piece to piece, and τ̇ is that step over the length of a
    piece; what thrust changes within pieces does not count. Where thrust is continuous τ̇ follows from z, ż, z̈ and z⃛.
    Inputs of a trajectory by integration change from piece to piece where they are held, and
    within them where they are linear; the first change is that from the inputs that act when the plan begins.

    Parameters
    ----------
    vehicle
        Whose inputs are weighed.
    reach
        In 1/s.
    """

    name: ClassVar[str] = "effort_rate"

    vehicle: DrivenVehicle
    reach: float = 10.0

    def __post_init__(self) -> None:
        positive("reach", self.reach)

    @property
    def width(self) -> float:
        """ϖ of the penalty."""
        return 2.0 * self.reach

    def weight(self, effort: float) -> float:
        """w_p of the penalty for w."""
        return 4.0 * self.reach * effort

    def of_motion(self, z: Any, dz: Any, ddz: Any, dddz: Any) -> Any:
        """τ̇ over the limits of the inputs ``(m,)``, a CasADi expression of z and its derivatives ``(n,)``."""
        vehicle: Any = self.vehicle
        along = [ca.SX.sym(name, z.numel()) for name in ("z", "dz", "ddz")]
        thrust = ca.SX(ca.vertcat(vehicle.inputs(*along)))
        rate = ca.jtimes(thrust, ca.vertcat(*along), ca.vertcat(dz, ddz, dddz))
        return ca.substitute(rate, ca.vertcat(*along), ca.vertcat(z, dz, ddz)) / ca.DM(vehicle.thrust_max)

    def value(self, point: FlatPoint) -> Any:
        """Not to be had from a point: z⃛ counts.

        Raises
        ------
        ValueError
            Always; see :meth:`of_motion`, :meth:`of_jump` and :meth:`of_change`.
        """
        raise ValueError("planner.effort_rate: found a point of z, ż, z̈; allowed: one with z⃛ or what was before too")

    def of_jump(self, z: Any, dz: Any, ddz: Any, before: Any, period: float) -> Any:
        """The same of the acceleration z̈ after another one ``(n,)``, over a piece."""
        vehicle: Any = self.vehicle
        step = ca.vertcat(vehicle.inputs(z, dz, ddz)) - ca.vertcat(vehicle.inputs(z, dz, before))
        return self.of_change(step, period)

    def of_change(self, change: Any, period: float) -> Any:
        """The same of a change of the inputs over a piece ``(m,)``."""
        return change / ca.DM(self.vehicle.thrust_max) / period


@dataclass(frozen=True)
class InputRateLimit(_BothSenses):
    """``|τ̇| <= rate`` on every input, for trajectories by integration.

    Inputs that are linear over a piece go on from where they were; inputs that are held step by no more than ``rate T``
    from one piece to the next. The first piece goes on from the inputs that act when the plan begins.

    Parameters
    ----------
    vehicle
        Whose inputs are limited.
    rate
        Their largest rates ``(m,)`` in their units a second; violations are reported in units of them.

    Raises
    ------
    ValueError
        If there are not as many rates as inputs, or one is not above 0.
    """

    name: ClassVar[str] = "input_rate"

    vehicle: DrivenVehicle
    rate: tuple[float, ...]

    def __post_init__(self) -> None:
        vector("rate", self.rate, len(self.vehicle.thrust_max), above_zero=True)

    def value(self, point: FlatPoint) -> Any:
        """Not to be had from a point: a rate belongs to two of them.

        Raises
        ------
        ValueError
            Always; see :meth:`of_change`.
        """
        raise ValueError("limits.input_rate: found planner.form: flat; allowed: shooting")

    def of_change(self, change: Any, period: float) -> Any:
        """The rates over their limits, of a change of the inputs over a piece ``(m,)``."""
        return change / ca.DM(self.rate) / period


OfInputs = ThrustLimit | ThrustEffort
"""What is bounded of the inputs at one time."""

OfChanges = InputRateLimit | ThrustChange
"""What is bounded of how the inputs change over a piece, for trajectories by integration."""
