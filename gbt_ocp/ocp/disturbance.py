"""What a vehicle needs of thrust beyond its model, from how it moves: the disturbance observer of a follower."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from gbt_ocp.models.evaluated import Evaluated
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.typing import Array

TIME = 0.3
"""Time constant of the estimate in s."""

LONGEST_BETWEEN = 0.5
"""Longest time in s between two samples from which an acceleration is taken."""

MOST_SHARE = 0.5
"""Share of the thrust limits within which the estimate is kept."""


class DisturbanceObserver:
    """Estimates the thrust that acts without moving the model: errors of mass, drag and thrust, and forces.

    Over the time between two samples the model needs the thrust ``Ψ_τ(z, ż, z̈)`` at their middle, with z̈ from the
    difference of the rates. What acted beyond that, in the axes of the inputs, is low-passed with :data:`TIME`; a
    follower adds it to its thrust. That is integral action with nothing to wind up: of thrust that was cut at its
    limits, only what acted counts. Thrusters that lag by L though the model does not say so are a disturbance too, with
    a damping of ``½ sqrt(TIME / L)``. The generated C has the same (``gbt_disturbance``).

    Parameters
    ----------
    vehicle
        The model.

    References
    ----------
    Ohnishi, Shibata and Murakami, Motion control for advanced mechatronics (1996).
    """

    def __init__(self, vehicle: Vehicle) -> None:
        n = vehicle.flat_dimension
        point = [ca.SX.sym(name, n) for name in ("z", "dz", "ddz")]
        self._inputs = Evaluated("inputs", point, [vehicle.inputs(*point)])
        self._range = ThrustRange.of(vehicle)
        self._dimension = vehicle.position_dimension
        self._before: tuple[Array, Array] | None = None
        self.estimate = np.zeros(len(vehicle.thrust_max))

    def observe(self, z: Array, dz: Array, acted: Array, passed: float) -> Array:
        """The estimate ``(m,)`` after a sample, and take note of it.

        Parameters
        ----------
        z, dz
            The measured flat output and its rate now ``(n,)``, through the water.
        acted
            Mean thrust since the last sample ``(m,)``.
        passed
            Seconds since then.
        """
        before, self._before = self._before, (z.copy(), dz.copy())
        if before is None or not 0.0 < passed <= LONGEST_BETWEEN:
            return self.estimate
        middle = z.copy()  # of the angles: no vehicle cares so exactly where it is
        for axis in range(self._dimension, len(z)):
            middle[axis] -= 0.5 * math.remainder(z[axis] - before[0][axis], 2.0 * math.pi)
        needed = self._inputs(middle, 0.5 * (before[1] + dz), (dz - before[1]) / passed)
        excess = acted - needed
        if np.all(np.isfinite(excess)):
            moved = self.estimate + (1.0 - math.exp(-passed / TIME)) * (excess - self.estimate)
            self.estimate = self._range.clip(moved, MOST_SHARE)
        return self.estimate

    def forget(self) -> None:
        """The next sample follows on none."""
        self._before = None
