"""The bearing sensor: noise, missed detections and outliers on the true bearing (section 5.6 of the paper)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.models.sizes import not_negative, positive
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class BearingSensor:
    """Measures the bearing to the target once every period.

    Parameters
    ----------
    period
        T in seconds.
    noise
        Standard deviation in radians of the rotation in each direction of the tangent plane.
    missed_probability
        Probability in [0, 1) that a bearing is not measured.
    outlier
        Size in radians of a sporadic rotation in a random direction.
    outlier_every
        Time between outliers in seconds; the first comes after one such time.
    latency
        Time in seconds from a measurement to its arrival at the tracker.

    Raises
    ------
    ValueError
        If a number is out of range.
    """

    period: float
    noise: float = 0.0
    missed_probability: float = 0.0
    outlier: float = 0.0
    outlier_every: float = 10.0
    latency: float = 0.0

    def __post_init__(self) -> None:
        positive("period", self.period)
        positive("outlier_every", self.outlier_every)
        for name in ("noise", "missed_probability", "outlier", "latency"):
            not_negative(name, getattr(self, name))
        if self.missed_probability >= 1.0:
            raise ValueError(f"missed_probability: found {self.missed_probability}; allowed: a number in [0, 1)")

    def measure(self, step: int, target: ArrayLike, own: ArrayLike, rng: np.random.Generator) -> Array | None:
        """Bearing ``(d,)`` at the step, or ``None`` where it is missed or undefined (target at the vehicle).

        The generator is drawn from equally often whatever the settings, so that one seed gives the same noise, and the
        same misses, whether or not the other disturbances are switched on.
        """
        line = np.asarray(target, dtype=float) - np.asarray(own, dtype=float)
        noise = rng.standard_normal(len(line) - 1)
        direction = rng.standard_normal(len(line) - 1)
        missed = rng.random() < self.missed_probability
        if missed or not np.any(line):
            return None
        angle = self.noise * noise
        every = max(1, round(self.outlier_every / self.period))
        if self.outlier > 0.0 and step > 0 and step % every == 0:
            angle = angle + self.outlier * direction / np.linalg.norm(direction)
        bearing = unit_bearing(target, own)
        return rotate_bearing(bearing, angle) if np.any(angle) else bearing
