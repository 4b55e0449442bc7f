"""What earlier estimates knew of position and velocity, as a prior for the bearings of the window."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from gbt_ocp.tracking.shape.fit import Known
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class _Kept:
    """What is known, and the time in seconds of the estimate that it is of."""

    now: float
    known: Known


class TrackMemory:
    """Keeps the posterior of each estimate until the window begins after it.

    The posterior at the time at which the window now begins rests on the bearings that have left the window, and on
    none of those in it. Its error comes back every window, and it is no exact Gaussian: so its deviations are
    multiplied by a factor.

    Parameters
    ----------
    factor
        On the deviations; infinity keeps nothing.
    span
        Age in seconds beyond which a posterior is of no use.
    """

    def __init__(self, factor: float, span: float) -> None:
        self._factor = factor
        self._span = span
        self._kept: deque[_Kept] = deque()

    def keep(self, now: float, times: Array, positions: Array, covariance: Array) -> None:
        """Keep a posterior.

        Parameters
        ----------
        now
            Time of the estimate in seconds.
        times, positions
            Two times ``(2,)`` in seconds and the mean positions then ``(2, d)`` in metres.
        covariance
            Their joint covariance ``(2d, 2d)`` in m².
        """
        self._kept.append(_Kept(now, Known(times, positions, precision_root(covariance) / self._factor)))

    def clear(self) -> None:
        """Forget all of them."""
        self._kept.clear()

    def recall(self, begins: float, now: float) -> Known | None:
        """The latest posterior from before the window begins (s), unless it is too old now (s)."""
        while len(self._kept) > 1 and self._kept[1].now <= begins + 1e-9:
            self._kept.popleft()
        if not self._kept or self._kept[0].now > begins + 1e-9 or self._kept[0].known.times[-1] < now - self._span:
            return None
        return self._kept[0].known


def precision_root(covariance: Array) -> Array:
    """A matrix A ``(n, n)`` with ``AᵀA`` the inverse of a covariance."""
    values, axes = np.linalg.eigh(covariance)
    return np.asarray((axes / np.sqrt(values)).T)
