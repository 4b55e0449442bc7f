"""The data window D_{c:k}: the latest bearings as pseudo-linear measurements (``eq9``, ``eq10``)."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.bearings import cumulative_bearing_matrix, tangent_basis
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class Measurements:
    """Linear measurements ``y = hᵀ P_T(t)`` of the target's position, one a row.

    A bearing gives d-1 rows; a known position gives d rows with their own variance.

    Attributes
    ----------
    times
        ``(R,)`` in seconds.
    directions
        h ``(R, d)``, unit vectors: the rows of G.
    values
        y ``(R,)`` in metres.
    variances
        Variance of each row beyond the nugget ``(R,)`` in m²; zero for a bearing.
    """

    times: Array
    directions: Array
    values: Array
    variances: Array

    def relative_to(self, centre: Array) -> Array:
        """y of the position relative to ``centre`` ``(d,)``: ``(R,)``."""
        return np.asarray(self.values - self.directions @ centre)


def checked_sample(
    time: float,
    bearing: ArrayLike,
    own_position: ArrayLike,
    latest: float | None,
    same_time: bool = False,
    since: float = -np.inf,
) -> tuple[Array, Array]:
    """Bearing and own position ``(d,)`` as new arrays.

    ``latest`` is the time of the sample before, in seconds, ``since`` that of the latest measurement of any kind.

    Raises
    ------
    ValueError
        If a number is not finite, the bearing is no unit vector, or time does not increase; with ``same_time`` (another
        sensor's sample), if it decreases; or if it is before ``since``.
    """
    b, own = np.array(bearing, dtype=float), np.array(own_position, dtype=float)
    if b.shape != own.shape or b.shape not in ((2,), (3,)):
        raise ValueError(f"bearing and own position must both be 2 or 3 numbers, found {b.shape} and {own.shape}")
    # a few numbers: one by one they are checked in a fifth of the time
    direction = b.tolist()
    if not all(map(math.isfinite, (time, *direction, *own.tolist()))):
        raise ValueError("time, bearing and own position must be finite")
    length = math.hypot(*direction)
    if abs(length - 1.0) > 1e-6:
        raise ValueError(f"a bearing must have length 1, found {length:.6g}")
    if latest is not None and (time < latest or (time == latest and not same_time)):
        raise ValueError(f"time must increase, found {time} after {latest}")
    if time < since:
        raise ValueError(f"time: found {time} after {since}; allowed: times that do not decrease")
    return b, own


class Window:
    """Keeps the latest ``min(N_c, k+1)`` samples.

    Parameters
    ----------
    capacity
        N_c >= 2.
    """

    def __init__(self, capacity: int) -> None:
        if capacity < 2:
            raise ValueError(f"the window needs a capacity of at least 2, found {capacity}")
        self.capacity = capacity
        self._samples: deque[tuple[float, Array, Array]] = deque(maxlen=capacity)
        self._weights: deque[float] = deque(maxlen=capacity)

    def __len__(self) -> int:
        return len(self._samples)

    def checked(
        self, time: float, bearing: ArrayLike, own_position: ArrayLike, *, same_time: bool = False
    ) -> tuple[Array, Array]:
        """Bearing and own position ``(d,)`` of a sample that :meth:`append` takes; raises as it does."""
        return checked_sample(time, bearing, own_position, self._samples[-1][0] if self._samples else None, same_time)

    def append(
        self,
        time: float,
        bearing: ArrayLike,
        own_position: ArrayLike,
        *,
        weight: float = 1.0,
        same_time: bool = False,
    ) -> None:
        """Add a sample; the oldest one leaves when the window is full.

        Parameters
        ----------
        time, bearing, own_position
            The sample.
        weight
            Number of ordinary bearings that it is worth.
        same_time
            Whether it may have the time of the one before.

        Raises
        ------
        ValueError
            If a number is not finite, the bearing is no unit vector, or time does not increase.
        """
        self.keep(time, *self.checked(time, bearing, own_position, same_time=same_time), weight=weight)

    def keep(self, time: float, bearing: Array, own_position: Array, *, weight: float = 1.0) -> None:
        """The same of a sample that :meth:`checked` has given, which is not copied."""
        self._samples.append((float(time), bearing, own_position))
        self._weights.append(weight)

    def leave_out_latest(self) -> None:
        """Forget the latest sample; not of an empty window."""
        self._samples.pop()

    @property
    def latest(self) -> tuple[float, Array, Array]:
        """Time in seconds, bearing and own position ``(d,)`` of the latest sample; not of an empty window."""
        return self._samples[-1]

    @property
    def times(self) -> Array:
        """Sample times ``(N,)`` in seconds."""
        return np.array([sample[0] for sample in self._samples])

    @property
    def bearings(self) -> Array:
        """λ ``(N, d)``."""
        return np.array([sample[1] for sample in self._samples])

    @property
    def own_positions(self) -> Array:
        """P_A ``(N, d)``."""
        return np.array([sample[2] for sample in self._samples])

    @property
    def weights(self) -> Array:
        """Number of ordinary bearings that each sample is worth ``(N,)``."""
        return np.array(self._weights)

    def measurements(self) -> Measurements:
        """The pseudo-linear measurements ``λ̄ᵀ P_A = λ̄ᵀ P_T``, d-1 rows a sample; not of an empty window."""
        basis = tangent_basis(self.bearings)
        directions = np.swapaxes(basis, -1, -2)
        values = np.einsum("kji,ki->kj", directions, self.own_positions)
        rows = directions.shape[1]
        return Measurements(
            np.repeat(self.times, rows),
            directions.reshape(-1, directions.shape[2]),
            values.ravel(),
            np.zeros(values.size),
        )

    def bearing_matrix(self) -> Array:
        """P_{c:k} ``(d, d)`` (``eq20``)."""
        return cumulative_bearing_matrix(self.bearings)
