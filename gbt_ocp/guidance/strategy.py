"""What an observer strategy offers until the next step: a plan to follow, a thrust to hold, or a place to be put."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array


class Placement(NamedTuple):
    """The vehicle is put somewhere, without regard to its dynamics.

    Attributes
    ----------
    position
        Where it is, at rest, at the next step ``(d,)`` in metres.
    """

    position: Array


class Guidance(Protocol):
    """Decides how the vehicle moves over the next period."""

    def decide(self, time: float, flat: Array, forecast: Forecast) -> Plan | ShootingPlan | Placement | Array:
        """A plan from ``time`` on, or the inputs ``(m,)`` to hold over the period.

        Parameters
        ----------
        time
            t_k in seconds.
        flat
            Derivatives 0 … L-1 of the flat output now ``(L, n)``.
        forecast
            Posterior at t_k, t_{k+1}, …, t_{k+n}.
        """


@runtime_checkable
class BearingGuidance(Guidance, Protocol):
    """A strategy that steers by the bearing itself, not only by the estimate."""

    def see(self, bearing: Array | None) -> None:
        """Take in the bearing ``(d,)`` measured now, before the decision; ``None`` where it was missed."""
