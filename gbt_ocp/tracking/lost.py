"""Whether a track is lost: its recent bearings were not foreseen."""

from __future__ import annotations

from collections import deque

import numpy as np

LOST_SQUARE = 6.0
"""Mean squared standardised innovation of the recent bins above which a track counts as lost."""

LOST_BINS = 12
"""Bins over which that mean is taken."""


class LostTrack:
    """The recent squared standardised innovations of a track."""

    def __init__(self) -> None:
        self._squares: deque[float] = deque(maxlen=LOST_BINS)

    def clear(self) -> None:
        """Begin with a new track."""
        self._squares.clear()

    def after(self, square: float) -> bool:
        """Note the squared standardised innovation of a bin, a component; whether the track is lost."""
        self._squares.append(square)
        return len(self._squares) == LOST_BINS and float(np.mean(self._squares)) > LOST_SQUARE
