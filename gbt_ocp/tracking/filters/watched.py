"""A filter that notices when it has lost its track."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.bearings import log_map, tangent_basis
from gbt_ocp.tracking.priors import PositionPrior
from gbt_ocp.tracking.protocol import Forecast, Tracker
from gbt_ocp.tracking.window import checked_sample
from gbt_ocp.typing import Array

WATCHED_BEARINGS = 60
"""Latest bearings that the test looks at."""

LOST_TRACK = 4.0
"""Mean squared standardised innovation of them above which the track counts as lost."""


class WatchedFilter:
    """A filter that is made again where its bearings were not foreseen.

    Parameters
    ----------
    make
        Makes the filter from what is known of the position.
    position
        What is known at the first bearing.
    deviation
        σ of a bearing in radians.

    Attributes
    ----------
    restarts
        How often the track was lost and begun again.
    """

    def __init__(self, make: Callable[[PositionPrior], Tracker], position: PositionPrior, deviation: float) -> None:
        self._make = make
        self._position = position
        self._deviation = deviation
        self._filter = make(position)
        self._squares: deque[float] = deque(maxlen=WATCHED_BEARINGS)
        self._latest: float | None = None
        self.restarts = 0

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing ``(d,)`` measured at ``own_position`` ``(d,)``; see :class:`Tracker`."""
        b, own = checked_sample(time, bearing, own_position, self._latest)
        if self._latest is not None:
            self._squares.append(self._unforeseen(float(time), b, own))
        if len(self._squares) == WATCHED_BEARINGS and np.mean(self._squares) > LOST_TRACK:
            self.restarts += 1
            self._squares.clear()
            self._filter = self._make(self._position.elsewhere(own))
        self._filter.update(time, b, own)
        self._latest = float(time)

    def _unforeseen(self, time: float, bearing: Array, own: Array) -> float:
        """Squared standardised innovation of a bearing, a component."""
        mean, covariance = (values[0] for values in self._filter.predict(np.array([time])))
        line = mean - own
        distance = float(np.linalg.norm(line))
        if not (distance > 0.0 and np.all(np.isfinite(covariance))):
            return 0.0
        unit = line / distance
        basis = tangent_basis(unit)
        spread = basis.T @ covariance @ basis / distance**2 + self._deviation**2 * np.eye(len(own) - 1)
        angle = log_map(unit, bearing, basis)
        return float(angle @ np.linalg.solve(spread, angle)) / (len(own) - 1)

    def predict(self, times: ArrayLike) -> Forecast:
        """Posterior of the target's position at the times ``(K,)`` in seconds."""
        return self._filter.predict(np.atleast_1d(np.asarray(times, dtype=float)))
