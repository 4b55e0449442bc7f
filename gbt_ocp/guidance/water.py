"""Plans in moving water: made in the frame that moves with the water, given back in the earth frame.

In a current that is the same everywhere over the horizon the vehicle obeys the same equations in that frame, so the
trajectory problem, its solvers and their C stay as they are: the velocity over ground loses v_c, and the forecast of
the target drifts backwards by v_c t. Limits on the speed are limits through the water. What stands still over ground,
a zone to keep out of, drifts: :class:`OverGround`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from gbt_ocp.guidance.current import Current
from gbt_ocp.guidance.planned import PlannedMotion
from gbt_ocp.guidance.startup import CrossFirst
from gbt_ocp.guidance.swept import DesiredTurn
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.ocp.terms import PathConstraint
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array


def through_water(flat: Array, current: Array) -> Array:
    """Derivatives of the flat output ``(L, n)`` over ground, as they are in a frame that moves with the water."""
    moved = np.array(flat, dtype=float)
    moved[1, : len(current)] -= current
    return moved


class InWater:
    """A planning strategy in moving water.

    Parameters
    ----------
    inner
        Plans as if the water stood still.
    current
        What is known of its velocity.
    forecast_period
        Seconds between the predicted positions of a forecast.
    """

    def __init__(self, inner: PlannedMotion | CrossFirst, current: Current, forecast_period: float) -> None:
        self.inner = inner
        self.current = current
        self._period = forecast_period
        self._planned_for = current.velocity

    @property
    def planned(self) -> PlannedMotion:
        """The part that plans."""
        return self.inner if isinstance(self.inner, PlannedMotion) else self.inner.planned

    @property
    def desired(self) -> DesiredTurn:
        """λ* of what plans."""
        return self.inner.desired

    def see(self, bearing: Array | None) -> None:
        """Take note of the bearing ``(d,)`` measured now."""
        self.inner.see(bearing)

    def decide(self, time: float, flat: Array, forecast: Forecast) -> Plan | ShootingPlan | Array:
        """See :meth:`gbt_ocp.guidance.strategy.Guidance.decide`: a plan over ground, made for the current."""
        velocity = self.current.velocity
        ahead = self._period * np.arange(len(forecast.mean))
        drifting = Forecast(forecast.mean - ahead[:, None] * velocity, forecast.covariance)
        decision = self.inner.decide(time, through_water(flat, velocity), drifting)
        if not isinstance(decision, Plan | ShootingPlan):
            return decision
        if decision.elapsed == 0.0:
            self._planned_for = velocity
        if isinstance(decision, ShootingPlan):
            over_ground = self._over_ground(decision.knots, self.planned.planner.problem.period)
            return replace(decision, knots=over_ground, current=self._planned_for)
        # a plan that is followed on stays the one of the current it was made for
        return replace(decision, trajectory=decision.trajectory.moving(self._planned_for), current=self._planned_for)

    def _over_ground(self, knots: Array, period: float) -> Array:
        """z and ż at the ends of the periods ``(p+1, 2, n)``, moved with the water for which they were planned."""
        moved, d = knots.copy(), len(self._planned_for)
        moved[:, 0, :d] += period * np.arange(len(knots))[:, None] * self._planned_for
        moved[:, 1, :d] += self._planned_for
        return moved


@dataclass(frozen=True)
class OverGround:
    """A limit that stands still over ground, for plans in the frame of the water.

    Parameters
    ----------
    inner
        The limit.
    current
        What is known of the velocity of the water.
    period
        T in seconds, the length of a piece.
    """

    believed: ClassVar[bool] = False

    inner: PathConstraint
    current: Current
    period: float

    @property
    def name(self) -> str:
        """That of the limit."""
        return str(getattr(self.inner, "name", type(self.inner).__name__))

    @property
    def lower(self) -> Array:
        """That of the limit."""
        return self.inner.lower

    @property
    def upper(self) -> Array:
        """That of the limit."""
        return self.inner.upper

    @property
    def backoff(self) -> Array:
        """That of the limit."""
        return self.inner.backoff

    @property
    def scale(self) -> Array:
        """That of the limit."""
        return self.inner.scale

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """How far the water has moved since the plan began, in metres."""
        return {"drift": (len(self.current.velocity), 1)}

    def value(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """That of the limit at the place over ground."""
        drift = parameters["drift"]
        d = drift.shape[0]
        place = ca.vertcat(point.z[:d] + drift, point.z[d:])
        return self.inner.value(FlatPoint(place, point.dz, point.ddz))

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """The drift at the knots ``(p+1, d, 1)``."""
        return {"drift": self.period * np.arange(pieces + 1)[:, None, None] * self.current.velocity[:, None]}
