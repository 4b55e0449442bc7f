"""The information of the bearings in the window: the past part of an information objective."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.sizes import positive
from gbt_ocp.typing import Array


class PastBearings:
    """Keeps the bearings of a time span, each with the range that the target was believed at.

    Parameters
    ----------
    dimension
        d.
    span
        Age of the oldest bearing kept, in seconds.
    share
        What one bearing counts, in planned ones: the sampling period over the length of a piece.
    weight
        w(r) of a range in metres; see :class:`gbt_ocp.guidance.information.FisherInformation`.

    Raises
    ------
    ValueError
        If span or share are not above 0.
    """

    def __init__(self, dimension: int, span: float, share: float, weight: Callable[[float], float]) -> None:
        self._dimension = dimension
        self._span = positive("span", span)
        self._share = positive("share", share)
        self._weight = weight
        self._kept: deque[tuple[float, Array, float]] = deque()

    def add(self, time: float, bearing: ArrayLike, range_: float) -> None:
        """Take in a bearing ``(d,)`` measured at ``time`` (s) to a target believed at a range in metres."""
        self._kept.append((time, np.asarray(bearing, dtype=float), range_))
        while self._kept[0][0] < time - self._span - 1e-9:
            self._kept.popleft()

    @property
    def information(self) -> Array:
        """``Σ share w(r) (I - λ λᵀ)`` ``(d, d)``."""
        total = np.zeros((self._dimension, self._dimension))
        for _, bearing, range_ in self._kept:
            total += self._weight(range_) * (np.eye(self._dimension) - np.outer(bearing, bearing))
        return self._share * total
