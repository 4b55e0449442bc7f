"""Bearings gathered in bins of a second or two: what a tracker of noisy bearings works on.

A long window of a fast sensor holds hundreds of bearings that say little more than one mean a second. Bins are aligned
to multiples of their width, so samples may come at any times, be missed, or stop for a while: an empty bin is not kept.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbt_ocp.bearings import tangent_basis
from gbt_ocp.tracking.window import checked_sample

Array = NDArray[np.float64]


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
        Bearings in each mean ``(N,)``.
    """

    times: Array
    bearings: Array
    own_positions: Array
    counts: Array

    def __len__(self) -> int:
        return len(self.times)


@dataclass
class _Mean:
    """Running sums of time, direction and own position."""

    count: int = 0
    sums: Array | float = 0.0

    def add(self, sample: Array) -> None:
        self.count += 1
        self.sums = self.sums + sample

    def row(self, origin: Array) -> Array:
        return np.asarray(origin + self.sums / self.count)


@dataclass
class _Bin:
    """One bin: the samples that fit what was expected, those that do not, and the scatter about a straight line."""

    index: int
    origin: Array
    fitting: _Mean = field(default_factory=_Mean)
    suspect: _Mean = field(default_factory=_Mean)
    lags: list[float] = field(default_factory=list)
    offsets: list[Array] = field(default_factory=list)

    def row(self) -> tuple[Array, int]:
        """Mean sample and its count; suspects count as soon as they are the majority."""
        if self.suspect.count > self.fitting.count:
            total = self.fitting.sums + self.suspect.sums
            count = self.fitting.count + self.suspect.count
            return np.asarray(self.origin + total / count), count
        return self.fitting.row(self.origin), self.fitting.count

    def scatter(self) -> tuple[float, int]:
        """Squared residuals of the fitting bearings about a straight line in time, and their degrees of freedom."""
        if len(self.lags) < 3:
            return 0.0, 0
        t = np.array(self.lags) - np.mean(self.lags)
        a = np.array(self.offsets)
        a = a - a.mean(axis=0)
        left = a - np.outer(t, (t @ a) / (t @ t))
        return float(np.sum(left**2)), (len(t) - 2) * a.shape[1]


class BearingBins:
    """Keeps the bins of the latest ``window`` seconds.

    Samples marked as suspect (a gate's word) stay out of their bin's mean for as long as they are its minority: a
    stray echo is left out, a manoeuvre that nobody expected is not.

    Parameters
    ----------
    width
        Width of a bin in seconds.
    window
        Bins whose mean time is older than this, counted back from the latest sample, are dropped; in seconds.

    Raises
    ------
    ValueError
        If the width is not positive or the window is shorter than two bins.
    """

    def __init__(self, width: float, window: float) -> None:
        if not width > 0.0:
            raise ValueError(f"width: found {width}; allowed: a number > 0")
        if not window >= 2.0 * width:
            raise ValueError(f"window: found {window}; allowed: at least two bins of {width} s")
        self.width = float(width)
        self.window = float(window)
        self._bins: deque[_Bin] = deque()
        self._latest: float | None = None

    def __len__(self) -> int:
        return len(self._bins)

    @property
    def latest(self) -> float | None:
        """Time of the latest sample in seconds, or ``None``."""
        return self._latest

    @property
    def samples(self) -> int:
        """Bearings in all bins, suspects included."""
        return sum(one.fitting.count + one.suspect.count for one in self._bins)

    def append(self, time: float, bearing: ArrayLike, own_position: ArrayLike, *, suspect: bool = False) -> None:
        """Add a bearing ``(d,)`` taken from ``own_position`` ``(d,)`` at ``time`` in seconds.

        Raises
        ------
        ValueError
            If a number is not finite, the bearing is no unit vector, or time does not increase.
        """
        b, own = checked_sample(time, bearing, own_position, self._latest)
        t = float(time)
        index = int(np.floor(t / self.width))
        sample = np.concatenate([[t], b, own])
        if not self._bins or self._bins[-1].index != index:
            self._bins.append(_Bin(index, sample))
        one = self._bins[-1]
        (one.suspect if suspect else one.fitting).add(sample - one.origin)
        if not suspect:
            one.lags.append(t)
            one.offsets.append(b @ tangent_basis(one.origin[1 : 1 + len(b)]))
        self._latest = t
        self.forget_before(t - self.window)

    def forget_before(self, time: float) -> None:
        """Drop bins whose mean time is before ``time`` in seconds, but for the newest."""
        while len(self._bins) > 1 and self._bins[0].row()[0][0] < time:
            self._bins.popleft()

    def clear(self) -> None:
        """Forget all bins; times still have to increase."""
        self._bins.clear()

    def means(self) -> BinnedBearings:
        """The bins; not of none."""
        rows, counts = zip(*(one.row() for one in self._bins), strict=True)
        table = np.array(rows)
        d = (table.shape[1] - 1) // 2
        directions = table[:, 1 : 1 + d]
        # Opposite bearings in one bin have no mean direction: the vehicle ran over the target. The first one stands.
        length = np.linalg.norm(directions, axis=1, keepdims=True)
        first = np.array([one.origin[1 : 1 + d] for one in self._bins])
        directions = np.where(length > 1e-3, directions, first)
        directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        return BinnedBearings(table[:, 0], directions, table[:, 1 + d :], np.array(counts, dtype=float))

    def scatter(self) -> tuple[float, int]:
        """White noise of single bearings: variance in rad², and its degrees of freedom.

        Pooled over the bins from the residuals about a straight line in each, so that neither the motion nor a slowly
        varying error enters. The variance is NaN without degrees of freedom.
        """
        squares, freedom = (sum(parts) for parts in zip(*(one.scatter() for one in self._bins), strict=True))
        return (squares / freedom if freedom else float("nan")), int(freedom)
