"""The range of a vehicle's inputs, whose limits may differ by sign."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbt_ocp.typing import Array


@dataclass(frozen=True)
class ThrustRange:
    """``τ_min <= τ <= τ_max`` on every input.

    Attributes
    ----------
    lower, upper
        τ_min ``(m,)``, all below 0 (or 0, for an input of one sense), and τ_max ``(m,)``, all above it, in the units of
        the inputs.
    """

    lower: Array
    upper: Array

    @classmethod
    def of(cls, vehicle: Any) -> ThrustRange:
        """The range of a vehicle: its ``thrust_max``, and its ``thrust_min`` or, where it has none, minus that."""
        upper = np.asarray(vehicle.thrust_max, dtype=float)
        lower = getattr(vehicle, "thrust_min", None)
        return cls(-upper if lower is None else np.asarray(lower, dtype=float), upper)

    @cached_property
    def _one_sided(self) -> NDArray[np.bool_] | None:
        """Inputs that have no lower side ``(m,)``, if there are any."""
        found = self.lower == 0.0
        return found if found.any() else None

    def clip(self, thrust: ArrayLike, share: float = 1.0) -> Array:
        """The thrust ``(..., m)`` within a share of the range."""
        return np.asarray(np.clip(np.asarray(thrust, dtype=float), share * self.lower, share * self.upper))

    def used(self, thrust: ArrayLike) -> Array:
        """The thrust ``(..., m)`` over the limit on its side, at least 0: above 1 where the limit is exceeded.

        Below a limit of 0 it counts in units of the other limit, from 1 on.
        """
        given = np.asarray(thrust, dtype=float)
        one_sided = self._one_sided
        if one_sided is None:
            return np.asarray(np.maximum(given / self.upper, given / self.lower))
        below = np.where(one_sided, 1.0 - given / self.upper, given / np.where(one_sided, -1.0, self.lower))
        return np.asarray(np.maximum(given / self.upper, np.where(one_sided & (given >= 0.0), 0.0, below)))
