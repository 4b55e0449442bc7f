"""Motion that does not look at the bearings: the three modes that the paper compares its planner with (section 5.3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.sizes import positive
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array


class Static:
    """No thrust: ``τ = 0``."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._thrust = np.zeros_like(vehicle.thrust_max)

    def decide(self, time: float, flat: Array, forecast: Forecast) -> Array:
        """Zero thrust."""
        return self._thrust


class ConstantForce:
    """Constant body thrust.

    Parameters
    ----------
    vehicle
        Whose limits the thrust is clipped to.
    force
        τ ``(m,)`` in N and N m; the paper's is 500 N on each axis and no moment.

    Raises
    ------
    ValueError
        If the force does not have one finite number for each input of the vehicle.
    """

    def __init__(self, vehicle: Vehicle, force: ArrayLike) -> None:
        limits, given = ThrustRange.of(vehicle), np.asarray(force, dtype=float)
        if given.shape != limits.upper.shape or not np.all(np.isfinite(given)):
            raise ValueError(f"guidance.force: found {given.tolist()}; allowed: {limits.upper.size} finite numbers")
        self._thrust: Array = limits.clip(given)

    def decide(self, time: float, flat: Array, forecast: Forecast) -> Array:
        """The constant thrust."""
        return self._thrust


class RandomThrust:
    """Thrust drawn uniformly within the limits and held for a time.

    Parameters
    ----------
    vehicle
        Whose limits bound the draws.
    hold
        Seconds between draws.
    rng
        Source of the draws.

    Raises
    ------
    ValueError
        If the time is not above 0.
    """

    def __init__(self, vehicle: Vehicle, hold: float, rng: np.random.Generator) -> None:
        self._range = ThrustRange.of(vehicle)
        self._hold = positive("hold", hold)
        self._rng = rng
        self._draw = -1
        self._thrust = np.zeros_like(self._range.upper)

    def decide(self, time: float, flat: Array, forecast: Forecast) -> Array:
        """The thrust of the interval that ``time`` lies in."""
        draw = int(np.floor(time / self._hold + 1e-9))
        while self._draw < draw:
            self._thrust = self._rng.uniform(self._range.lower, self._range.upper)
            self._draw += 1
        return self._thrust
