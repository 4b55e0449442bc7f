"""Thrusters that lag: what to ask of them so that they give a thrust soon."""

from __future__ import annotations

import math

import numpy as np

from gbt_ocp.models.sizes import not_negative
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.typing import Array

QUICKER = 0.1
"""Share of the lag within which a thrust is to act: less asks for more noise, and for limits more often.

A moment that comes later than the Munk moment grows (13 a second, see :mod:`gbt_ocp.ocp.follower`) does not hold it: a
lag of 0.3 s has to become one of 0.03 s."""


class LaggingThrusters:
    """The inverse of thrusters of first order, ``τ̇ = (asked - τ) / lag``, within the limits.

    The thrust that acts is known by integration from what was asked. More than the wanted thrust is asked, so that it
    acts after a share :data:`QUICKER` of the lag, or at the next sample if that is later. The generated C has the same
    (``gbt_thrusters_ask``).

    Parameters
    ----------
    vehicle
        Its limits.
    lag
        Time constant in s; with 0, what is wanted is asked.

    Raises
    ------
    ValueError
        If the lag is negative or not finite.
    """

    def __init__(self, vehicle: Vehicle, lag: float) -> None:
        self._lag = not_negative("lag", lag)
        self._range = ThrustRange.of(vehicle)
        self._acting = np.zeros(len(vehicle.thrust_max))
        self._asked = np.zeros(len(vehicle.thrust_max))

    def acted(self, passed: float) -> Array:
        """Mean thrust ``(m,)`` over so many seconds since the last call of :meth:`ask`."""
        if self._lag == 0.0 or passed <= 0.0:
            return self._asked
        share = -math.expm1(-passed / self._lag) * self._lag / passed
        return np.asarray(self._asked + share * (self._acting - self._asked))

    def ask(self, wanted: Array, passed: float, hold: float) -> Array:
        """What to ask ``(m,)`` until the next sample for a thrust ``(m,)``.

        Parameters
        ----------
        wanted
            Within the limits.
        passed
            Seconds since the last call; the first one finds thrusters at rest.
        hold
            Seconds until the next sample.
        """
        if self._lag == 0.0:
            self._asked = wanted
            return wanted
        self._acting = self._asked + (self._acting - self._asked) * math.exp(-passed / self._lag)
        within = 1.0 - math.exp(-max(hold / self._lag, QUICKER))
        self._asked = self._range.clip(self._acting + (wanted - self._acting) / within)
        return self._asked
