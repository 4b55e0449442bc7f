"""Bearings gathered in bins of a second or two: what a tracker of noisy bearings works on.

A long window of a fast sensor holds hundreds of bearings that say little more than one mean a second. Bins are aligned
to multiples of their width, so samples may come at any times, be missed, or stop for a while: an empty bin is not kept.
Bearings of different vehicles have no mean: each vehicle has bins of its own.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbt_ocp.models.bearings import log_map
from gbt_ocp.tracking.window import checked_sample
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class BinnedBearings:
    """Means of N bins, oldest first.

    Attributes
    ----------
    times
        Mean times ``(N,)`` in seconds.
    bearings
        Mean directions ``(N, d)``, unit vectors.
    own_positions
        Mean own positions ``(N, d)`` in metres.
    counts
        Bearings in each mean ``(N,)``, each as often as it is worth.
    platforms
        A number for each vehicle that measured ``(N,)``, 0 for the own one; by default all are its own.
    """

    times: Array
    bearings: Array
    own_positions: Array
    counts: Array
    platforms: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))

    def __post_init__(self) -> None:
        if len(self.platforms) != len(self.times):
            object.__setattr__(self, "platforms", np.zeros(len(self.times), dtype=np.intp))

    def __len__(self) -> int:
        return len(self.times)

    @property
    def own(self) -> BinnedBearings:
        """Those of the own vehicle; all of them if there are none."""
        mine = self.platforms == 0
        if mine.all() or not mine.any():
            return self
        return BinnedBearings(*(values[mine] for values in vars(self).values()))


ENOUGH = 3
"""Bearings in a bin from which their median tells the strays among them; fewer are judged by a gate's word."""


@dataclass(frozen=True)
class _Bin:
    """The samples of one bin: rows ``[t, λ, o]``, their offsets from what was expected, and a gate's word on each.

    It is not written to, so that copies of a tracker share it.
    """

    index: int
    stray: float
    platform: int = 0
    rows: tuple[Array, ...] = ()
    offsets: tuple[Array, ...] = ()
    suspects: tuple[bool, ...] = ()
    weights: tuple[float, ...] = ()

    def with_sample(self, row: Array, offset: Array, suspect: bool, weight: float) -> _Bin:
        """The bin with one sample more."""
        return replace(
            self,
            rows=(*self.rows, row),
            offsets=(*self.offsets, offset),
            suspects=(*self.suspects, suspect),
            weights=(*self.weights, weight),
        )

    # of a bin that takes in no more samples they are asked for again and again

    @cached_property
    def kept(self) -> NDArray[np.bool_]:
        """Which samples count: those near the median, or of few those that are not suspected by a majority."""
        if len(self.rows) >= ENOUGH and np.isfinite(self.stray):
            offsets = np.array(self.offsets)
            away = np.linalg.norm(offsets - np.median(offsets, axis=0), axis=1) * np.sqrt(self.weights)
            # no bearing lies halfway between two halves that disagree
            kept: NDArray[np.bool_] = away <= max(self.stray, float(np.median(away)))
        else:
            suspects = np.array(self.suspects)
            kept = ~suspects if 2 * np.sum(suspects) <= len(suspects) else np.ones_like(suspects)
        return kept if np.any(kept) else np.ones(len(self.rows), dtype=bool)

    @cached_property
    def mean(self) -> tuple[Array, float]:
        """Mean row and its count, each bearing by its weight."""
        weights = np.array(self.weights)[self.kept]
        total = float(np.sum(weights))
        return np.asarray((weights[:, None] * np.array(self.rows)[self.kept]).sum(axis=0) / total), total

    @cached_property
    def scatter(self) -> tuple[float, int]:
        """Squared residuals of the bearings about a straight line in time, and their degrees of freedom."""
        kept = self.kept
        if np.sum(kept) < 3:
            return 0.0, 0
        weights = np.array(self.weights)[kept]
        t = np.array([row[0] for row in self.rows])[kept]
        t = t - (weights * t).sum() / weights.sum()
        a = np.array(self.offsets)[kept]
        a = a - (weights[:, None] * a).sum(axis=0) / weights.sum()
        spread = (weights * t) @ t
        if not spread > 0.0:  # several sensors at one time
            return float(np.sum(weights[:, None] * a**2)), (len(t) - 1) * a.shape[1]
        left = a - np.outer(t, ((weights * t) @ a) / spread)
        return float(np.sum(weights[:, None] * left**2)), (len(t) - 2) * a.shape[1]


class BearingBins:
    """Keeps the bins of the latest ``window`` seconds.

    Stray bearings are left out of their bin's mean without a manoeuvre being rejected: of three or more bearings those
    further than ``stray`` from the median of the bin, wherever that lies; of fewer, those that a gate suspects, unless
    they are the majority.

    Parameters
    ----------
    width
        Width of a bin in seconds.
    window
        Bins older than this, counted back from the latest sample, are dropped; in seconds.
    stray
        Angle in radians from the median of its bin beyond which a bearing is left out.

    Raises
    ------
    ValueError
        If the width is not positive or the window is shorter than two bins.
    """

    def __init__(self, width: float, window: float, stray: float = np.inf) -> None:
        if not width > 0.0:
            raise ValueError(f"width: found {width}; allowed: a number > 0")
        if not window >= 2.0 * width:
            raise ValueError(f"window: found {window}; allowed: at least two bins of {width} s")
        self.width = float(width)
        self.window = float(window)
        self.stray = float(stray)
        self._bins: deque[_Bin] = deque()
        self._latest: float | None = None
        self._platforms: dict[str, int] = {"": 0}

    def __len__(self) -> int:
        return len(self._bins)

    @property
    def begins(self) -> float:
        """Time at which the oldest bin begins, in seconds; not of none."""
        return self._bins[0].index * self.width

    @property
    def latest(self) -> float | None:
        """Time of the latest sample in seconds, or ``None``."""
        return self._latest

    @property
    def samples(self) -> int:
        """Bearings in all bins, strays included."""
        return sum(len(one.rows) for one in self._bins)

    @property
    def strays(self) -> int:
        """Bearings that are left out."""
        return sum(int(np.sum(~one.kept)) for one in self._bins)

    @property
    def first(self) -> tuple[float, Array]:
        """Time in seconds and own position ``(d,)`` of the oldest sample of the newest bin; not of none."""
        row = self._bins[-1].rows[0]
        return float(row[0]), row[1 + (len(row) - 1) // 2 :]

    def is_filled_by(self, time: float) -> bool:
        """Whether a sample at a time in seconds is no longer of the newest bin, which is full then; not of none."""
        return self._latest is not None and bool(self._bins and not self.are_together(time, self._latest))

    def are_together(self, time: float, other: float) -> bool:
        """Whether two times in seconds are of one bin."""
        return bool(np.floor(time / self.width) == np.floor(other / self.width))

    def checked(
        self,
        time: float,
        bearing: ArrayLike,
        own_position: ArrayLike,
        *,
        same_time: bool = False,
        since: float = -np.inf,
    ) -> tuple[Array, Array]:
        """Bearing and own position ``(d,)`` of a sample that :meth:`append` takes; raises as it does.

        And if the time in seconds is before ``since``, that of the latest measurement of any kind.
        """
        return checked_sample(time, bearing, own_position, self._latest, same_time, since)

    def append(
        self,
        time: float,
        bearing: ArrayLike,
        own_position: ArrayLike,
        *,
        expected: Array | None = None,
        suspect: bool = False,
        weight: float = 1.0,
        same_time: bool = False,
        platform: str = "",
    ) -> None:
        """Add a bearing ``(d,)`` taken from ``own_position`` ``(d,)`` at ``time`` in seconds.

        Parameters
        ----------
        time, bearing, own_position
            The sample.
        expected
            Direction in which the target is expected ``(d,)``: strays are told by their offset from it, so that the
            own motion within a bin makes none; by default the first bearing of the bin.
        suspect
            Whether a gate suspects the bearing.
        weight
            Number of ordinary bearings that it is worth: the ratio of their variance to its own.
        same_time
            Whether it may have the time of the one before, as another sensor's.
        platform
            Name of the vehicle that measured it; empty for the own one.

        Raises
        ------
        ValueError
            If a number is not finite, the bearing is no unit vector, or time does not increase.
        """
        b, own = self.checked(time, bearing, own_position, same_time=same_time)
        t = float(time)
        place = self._bin(int(np.floor(t / self.width)), platform)
        one = self._bins[place]
        if expected is None:
            expected = one.rows[0][1 : 1 + len(b)] if one.rows else b
        sample = np.concatenate([[t], b, own])
        self._bins[place] = one.with_sample(sample, log_map(expected, b), suspect, weight)
        self._latest = t
        self.forget_before(t - self.window)

    def _bin(self, index: int, platform: str) -> int:
        """Place of the bin of so many widths of a vehicle, which is among the newest or becomes the last."""
        number = self._platforms.setdefault(platform, len(self._platforms))
        for place in range(len(self._bins) - 1, -1, -1):
            if self._bins[place].index != index:
                break
            if self._bins[place].platform == number:
                return place
        self._bins.append(_Bin(index, self.stray, number))
        return len(self._bins) - 1

    def forget_before(self, time: float) -> None:
        """Drop bins that ended before ``time`` in seconds, but for the newest."""
        while len(self._bins) > 1 and (self._bins[0].index + 1) * self.width <= time:
            self._bins.popleft()

    def clear(self) -> None:
        """Forget all bins; times still have to increase."""
        self._bins.clear()

    def means(self) -> BinnedBearings:
        """The bins; not of none."""
        rows, counts = zip(*(one.mean for one in self._bins), strict=True)
        table = np.array(rows)
        d = (table.shape[1] - 1) // 2
        directions = table[:, 1 : 1 + d]
        # Opposite bearings in one bin have no mean direction: the vehicle ran over the target. The first one stands.
        length = np.linalg.norm(directions, axis=1, keepdims=True)
        first = np.array([one.rows[0][1 : 1 + d] for one in self._bins])
        directions = np.where(length > 1e-3, directions, first)
        directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        platforms = np.array([one.platform for one in self._bins], dtype=np.intp)
        return BinnedBearings(table[:, 0], directions, table[:, 1 + d :], np.array(counts, dtype=float), platforms)

    def scatter(self) -> tuple[float, int]:
        """White noise of single bearings: variance in rad², and its degrees of freedom.

        Pooled over the bins from the residuals about a straight line in each, so that neither the motion nor a slowly
        varying error enters. The variance is NaN without degrees of freedom.
        """
        squares, freedom = (sum(parts) for parts in zip(*(one.scatter for one in self._bins), strict=True))
        return (squares / freedom if freedom else float("nan")), int(freedom)
