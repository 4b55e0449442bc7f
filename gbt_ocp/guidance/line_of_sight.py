"""What the reactive laws read off a forecast: range, direction and speed of the estimated target."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class LineOfSight:
    """Where the target is believed to be, seen from the vehicle.

    Attributes
    ----------
    range
        r̂ in metres.
    direction
        λ, unit vector ``(d,)``: the bearing where there is one, else from the vehicle to the estimate.
    target_velocity
        v̂_T ``(d,)`` in m/s, from the first two positions of the forecast.
    """

    range: float
    direction: Array
    target_velocity: Array

    @classmethod
    def of(cls, position: Array, forecast: Forecast, period: float, bearing: Array | None = None) -> LineOfSight:
        """The line of sight from a position ``(d,)``; an estimate at the vehicle itself is put ahead along x."""
        line = forecast.mean[0] - position
        distance = float(np.linalg.norm(line))
        direction = bearing
        if direction is None:
            direction = line / distance if distance > 0.0 else np.eye(len(line))[0]
        return cls(distance, direction, (forecast.mean[1] - forecast.mean[0]) / period)
