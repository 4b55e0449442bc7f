"""What an observer strategy offers: a plan to follow, or a thrust to hold, until the next step."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.ocp.plan import Plan
from gbt_ocp.tracking.protocol import Forecast

Array = NDArray[np.float64]


class Guidance(Protocol):
    """Decides how the vehicle moves over the next period."""

    def decide(self, time: float, flat: Array, forecast: Forecast) -> Plan | Array:
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
