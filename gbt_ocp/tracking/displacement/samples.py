"""What a tracker of noisy bearings keeps: bearings, each by itself or in bins, and measurements of other kinds."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.tracking.bins import BearingBins, BinnedBearings
from gbt_ocp.tracking.decomposed import SingleNumbers
from gbt_ocp.tracking.window import Window
from gbt_ocp.typing import Array


class SampleStore:
    """The measurements of the window.

    Parameters
    ----------
    capacity
        Bearings kept where there are no bins.
    bins
        Bins, if bearings are averaged.
    follows
        Whether another tracker fills the bins.

    Attributes
    ----------
    others
        Measurements that are no bearings, oldest first, no older than the oldest bearing.
    """

    def __init__(self, capacity: int, bins: BearingBins | None, follows: bool) -> None:
        self.bins = bins
        self._follows = follows
        self._window = Window(capacity)
        self.others = SingleNumbers(None if bins is None else bins.width)

    def checked(self, time: float, bearing: ArrayLike, own: ArrayLike) -> tuple[Array, Array]:
        """Bearing and own position ``(d,)`` of a sample that :meth:`append` takes; raises as it does."""
        store = self._window if self.bins is None else self.bins
        return store.checked(time, bearing, own)

    def append(
        self,
        time: float,
        bearing: Array,
        own: Array,
        *,
        weight: float,
        expected: Array | None,
        suspect: bool,
        platform: str = "",
    ) -> None:
        """Add a bearing, as :meth:`~gbt_ocp.tracking.bins.BearingBins.append`."""
        if self.bins is None:
            self._window.append(time, bearing, own, weight=weight, same_time=True)
        else:
            self.bins.append(
                time, bearing, own, expected=expected, suspect=suspect, weight=weight, same_time=True, platform=platform
            )
        self._forget_others()

    def _forget_others(self) -> None:
        oldest = self._window.times[0] if self.bins is None else self.bins.begins
        self.others.forget_before(oldest)

    @property
    def latest(self) -> float | None:
        """Time of the latest measurement in seconds."""
        bearing = self._window.latest[0] if len(self._window) else None
        times = [self.others.latest, bearing if self.bins is None else self.bins.latest]
        return max([time for time in times if time is not None], default=None)

    def clear(self) -> None:
        """Forget all; bins that another tracker fills are left to it."""
        if self.bins is None:
            self._window = Window(self._window.capacity)
        elif not self._follows:
            self.bins.clear()
        self.others.clear()

    def keep_latest(self, count: int, bins: int) -> None:
        """Forget all but the latest bearings, so many of them or so many bins."""
        if self.bins is None:
            kept, old = Window(self._window.capacity), self._window
            samples = zip(old.times, old.bearings, old.own_positions, old.weights, strict=True)
            for time, bearing, own, weight in list(samples)[-count:]:
                kept.append(time, bearing, own, weight=weight, same_time=True)
            self._window = kept
        elif not self._follows:
            self.bins.forget_before(self.bins.means().times[-min(len(self.bins), bins)])
        self._forget_others()

    def bearings(self) -> BinnedBearings:
        """The bearings; not of none."""
        if self.bins is not None:
            return self.bins.means()
        window = self._window
        return BinnedBearings(window.times, window.bearings, window.own_positions, window.weights)

    def everything(self, bearings: BinnedBearings) -> BinnedBearings:
        """The bearings, and behind them times and places of the others, which have no direction."""
        if not len(self.others):
            return bearings
        count, d = len(self.others), bearings.bearings.shape[1]
        return BinnedBearings(
            np.concatenate([bearings.times, [one.time for one in self.others]]),
            np.concatenate([bearings.bearings, np.tile(np.eye(d)[0], (count, 1))]),
            np.concatenate([bearings.own_positions, [one.position for one in self.others]]),
            np.concatenate([bearings.counts, np.ones(count)]),
            np.concatenate([bearings.platforms, np.zeros(count, dtype=np.intp)]),
        )
