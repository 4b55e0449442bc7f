"""A desired bearing that asks for a steady speed of the vehicle instead of a steady turn of the line of sight.

Noisy bearings tell the range by how far the vehicle moves across the line of sight, and drag takes power with the cube
of its speed. A turn by the clock asks for more speed where the target crosses one way than where it crosses the other,
and for more the farther away it is: at the same mean speed it takes more energy, and tells no more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.guidance.pacing import PacedBearing, horizontal_radius
from gbt_ocp.models.bearings import DesiredBearing, inner
from gbt_ocp.models.sizes import positive
from gbt_ocp.typing import Array

LEAST_ACROSS = 0.3
"""Part of the speed that goes across the line of sight, however fast the target is that is kept up with."""

NEAREST_LINE = 1e-9
"""Distance in metres below which a line of sight turns no faster."""

WITHIN = 1e-9
"""Part of a piece nearer than which to its ends a reversal counts as at an end: times are rounded."""


@dataclass(frozen=True)
class SweptBearing:
    """λ*(t) as a vehicle sees it that keeps its distance and moves at a speed of its own, whatever the target does.

    What of the target's velocity goes along the line of sight, or along the axis of the circle, the vehicle goes along
    with; the rest of its speed goes across the line of sight, forth and back.

    Parameters
    ----------
    turn
        Circle, sense and reversals; its rate and phase count until the first :meth:`sweeping_from`.
    speed
        Of the vehicle through the water, in m/s.
    times, angles
        Where the bearing is on the circle ``(p+1,)``, in s and rad; as :meth:`sweeping_from` left them.

    Raises
    ------
    ValueError
        If the speed is not above 0.
    """

    turn: DesiredBearing
    speed: float
    times: Array = field(default_factory=lambda: np.empty(0))
    angles: Array = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        positive("speed", self.speed)

    def __call__(self, times: ArrayLike) -> Array:
        """Desired bearings ``(..., d)`` at the times ``(...)`` in seconds; before and after the last sweep its ends."""
        if len(self.times) == 0:
            return self.turn(times)
        return self.turn.direction(np.interp(np.asarray(times, dtype=float), self.times, self.angles))

    def reversing_from(self, time: float, line: ArrayLike, velocity: ArrayLike) -> SweptBearing:
        """As :meth:`DesiredBearing.reversing_from <gbt_ocp.models.bearings.DesiredBearing.reversing_from>`."""
        return replace(self, turn=self.turn.reversing_from(time, line, velocity))

    def sweeping_from(self, time: float, line: ArrayLike, target: ArrayLike, period: float) -> SweptBearing:
        """The bearing from a time on, for where the target is believed to go.

        A reversal that falls within a period is at the nearer end of it: a plan that is told bearings at the ends alone
        would cut the corner. Legs that are shorter than a period are averaged over it.

        Parameters
        ----------
        time
            In seconds.
        line
            From the vehicle to the target, ``(d,)`` in metres.
        target
            Expected positions of the target ``(p+1, d)`` in metres, a period apart, the first of them now.
        period
            In seconds.
        """
        knots = np.asarray(time + period * np.arange(len(np.asarray(target))), dtype=float)
        forth = np.diff(self.turn.turned(knots)) / period
        if self.turn.reverse >= period:
            forth = np.where(np.abs(forth) < 1.0 - WITHIN, np.copysign(1.0, forth), forth)
        forth *= math.copysign(1.0, self.turn.rate)
        radius = max(horizontal_radius(self.turn.dimension, math.sqrt(inner(line, line))), NEAREST_LINE)
        reach, angle = self.speed * period, self.turn.angle(line)
        angles = [angle]
        for sense, moved in zip(forth, np.diff(target, axis=0), strict=True):
            along = self.turn.in_plane(moved)
            across = math.cos(angle) * along[1] - math.sin(angle) * along[0]
            left = reach**2 - (inner(moved, moved) - across**2)
            angle += float(sense * math.sqrt(max(left, (LEAST_ACROSS * reach) ** 2)) + across) / radius
            angles.append(angle)
        return replace(self, times=knots, angles=np.array(angles))


DesiredTurn = DesiredBearing | PacedBearing | SweptBearing
"""What asks for bearings: a turn by the clock, one that is slowed down, or one at a speed of the vehicle."""
