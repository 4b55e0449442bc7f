"""What every tracker offers: bearings in, a predicted position with its covariance out."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Forecast(NamedTuple):
    """Predicted positions at K times.

    Attributes
    ----------
    mean
        μ ``(K, d)`` in metres.
    covariance
        Σ ``(K, d, d)`` in m²; NaN from an estimator that has none.
    """

    mean: Array
    covariance: Array


class Tracker(Protocol):
    """Estimates where the target is and will be, from bearings alone."""

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in one bearing ``(d,)`` measured from ``own_position`` ``(d,)`` at ``time`` in seconds."""

    def predict(self, times: ArrayLike) -> Forecast:
        """Posterior of the target's position at the times ``(K,)`` in seconds."""
