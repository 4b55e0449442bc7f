"""Target motions: the six cases of the paper, abrupt manoeuvres, and recorded tracks.

A target is anything with a ``dimension`` and a ``position(times)`` in metres. The tracker sees its bearings only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.sizes import positive
from gbt_ocp.typing import Array


class Target(Protocol):
    """A moving point."""

    @property
    def dimension(self) -> int:
        """d, the dimension of the space."""

    def position(self, times: ArrayLike) -> Array:
        """P_T(t) in metres: ``(..., d)`` at the times ``(...)`` in seconds."""


@dataclass(frozen=True)
class MotionTarget:
    """A target whose coordinates are given functions of time."""

    coordinates: tuple[Callable[[Array], Array], ...]

    @property
    def dimension(self) -> int:
        """The dimension d of the space."""
        return len(self.coordinates)

    def position(self, times: ArrayLike) -> Array:
        """P_T(t) ``(..., d)``."""
        shape = np.shape(times)
        t = np.atleast_1d(np.asarray(times, dtype=float))  # NumPy rounds powers of single numbers in another way
        found = np.stack([coordinate(t) + 0.0 * t for coordinate in self.coordinates], axis=-1)
        return found.reshape(*shape, self.dimension)


def _line(t: Array) -> Array:
    return t - 1.0


def _eight_denominator(t: Array) -> Array:
    # Squared as printed; a lemniscate has the plain sum in both denominators.
    return np.asarray((1.0 + np.sin(np.pi / 8.0 * t) ** 2) ** 2)


def _eight_x(t: Array) -> Array:
    return np.asarray(3.0 * np.cos(np.pi / 8.0 * t) / _eight_denominator(t))


def _eight_y(t: Array) -> Array:
    return np.asarray(1.5 * np.sin(np.pi / 4.0 * t) / _eight_denominator(t))


@dataclass(frozen=True)
class OrbitAngle:
    """ψ_T(t) of cases 3 and 6: ``ψ̇ = 0.3 + 0.2 sin(0.4 t)``, with abrupt manoeuvres on top.

    Parameters
    ----------
    turn_rate_step
        Δψ̇ in rad/s: at every multiple of ``every_s`` the turn rate jumps by this much, up at the first, back at the
        second, and so on, so that the speed stays within the vehicle's.
    every_s
        Time between jumps in seconds.

    Raises
    ------
    ValueError
        If the time is not above 0.
    """

    turn_rate_step: float = 0.0
    every_s: float = 10.0

    def __post_init__(self) -> None:
        positive("every_s", self.every_s)

    def __call__(self, t: Array) -> Array:
        """ψ_T in radians, integrated in closed form."""
        cycle = np.floor_divide(t, 2.0 * self.every_s)
        raised = cycle * self.every_s + np.clip(t - (2.0 * cycle + 1.0) * self.every_s, 0.0, self.every_s)
        return np.asarray(0.3 * t + 0.5 * (1.0 - np.cos(0.4 * t)) + self.turn_rate_step * raised)


def case_target(number: int, *, turn_rate_step: float = 0.0, every_s: float = 10.0) -> MotionTarget:
    """The target of one of the paper's six cases (section 5.2).

    Parameters
    ----------
    number
        1 to 3 in the plane, 4 to 6 in space: constant velocity, figure eight, circle with varying speed.
    turn_rate_step, every_s
        Abrupt manoeuvres of cases 3 and 6 (section 5.6, scenario 5); see :class:`OrbitAngle`.

    Raises
    ------
    ValueError
        For another number, or for manoeuvres of a case that has no turn rate.
    """
    if number not in range(1, 7):
        raise ValueError(f"the cases are 1 to 6, found {number}")
    if turn_rate_step and number not in (3, 6):
        raise ValueError(f"abrupt manoeuvres are defined for cases 3 and 6, found case {number}")
    angle = OrbitAngle(turn_rate_step, every_s)
    plane: tuple[Callable[[Array], Array], ...] = {
        1: (_line, _line),
        2: (_eight_x, _eight_y),
        0: (lambda t: 4.0 * np.cos(angle(t)), lambda t: 4.0 * np.sin(angle(t))),
    }[number % 3]
    height: dict[int, Callable[[Array], Array]] = {
        4: lambda t: 0.1 * t,
        5: lambda t: np.asarray(3.0 * np.sin(np.pi / 8.0 * t)),
        6: lambda t: np.asarray(5.0 * np.sin(0.2 * t) ** 2),
    }
    return MotionTarget(plane if number <= 3 else (*plane, height[number]))


class TrackTarget:
    """A recorded track, interpolated by a cubic spline.

    Parameters
    ----------
    times
        Recorded times ``(K,)`` in seconds, strictly increasing.
    positions
        Recorded positions ``(K, d)`` in metres.
    length_scale, time_scale
        Factors on length and time: a boat that outruns the vehicle is brought to its size. Bearings do not change
        under a common scaling of length.
    start
        Where the first point used is put ``(d,)`` in metres; ``None`` keeps the scaled coordinates.
    start_time
        Recorded time in seconds after the first sample at which the run starts.

    Raises
    ------
    ValueError
        If there are fewer than four samples, times do not increase, numbers are not finite, or a scale is not above 0.
    """

    def __init__(
        self,
        times: ArrayLike,
        positions: ArrayLike,
        *,
        length_scale: float = 1.0,
        time_scale: float = 1.0,
        start: ArrayLike | None = None,
        start_time: float = 0.0,
    ) -> None:
        positive("length_scale", length_scale)
        positive("time_scale", time_scale)
        t = np.asarray(times, dtype=float)
        p = np.asarray(positions, dtype=float)
        if len(t) < 4 or p.shape[:1] != t.shape:
            raise ValueError(f"a track needs at least 4 samples of time and position, found {t.shape} and {p.shape}")
        if not (np.all(np.isfinite(t)) and np.all(np.isfinite(p)) and np.all(np.diff(t) > 0.0)):
            raise ValueError("a track needs finite numbers and strictly increasing times")
        if not 0.0 <= start_time < t[-1] - t[0]:
            raise ValueError(
                f"start_time must lie within the {t[-1] - t[0]:.6g} s of the track, found {start_time:.6g}"
            )
        from scipy.interpolate import CubicSpline  # takes a second to import, which other targets do not need

        self._spline = CubicSpline((t - t[0] - start_time) * time_scale, p * length_scale, extrapolate=False)
        self._shift = np.zeros(p.shape[1])
        if start is not None:
            self._shift = np.asarray(start, dtype=float) - self._spline(0.0)
        self.duration = float((t[-1] - t[0] - start_time) * time_scale)
        self.dimension = int(p.shape[1])

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        dimension: int,
        *,
        length_scale: float = 1.0,
        time_scale: float = 1.0,
        start: ArrayLike | None = None,
        start_time: float = 0.0,
    ) -> TrackTarget:
        """Read a track with the columns ``t,x,y[,z]`` (s, m) and a header line.

        Raises
        ------
        ValueError
            If columns are missing, cells are not numbers, or a row has not as many as the header; the message names
            the file.
        OSError
            If the file cannot be read.
        """
        columns = ["t", "x", "y", "z"][: dimension + 1]
        with Path(path).open(encoding="utf-8") as file:
            header = [name.strip() for name in file.readline().split(",")]
            if not set(columns) <= set(header):
                raise ValueError(f"{path}: columns {', '.join(header)}; needed are {', '.join(columns)}")
            rows = {number: line for number, line in enumerate(file, start=2) if line.partition("#")[0].strip()}
            if not rows:
                raise ValueError(f"{path}: no rows below the header")
            for number, line in rows.items():
                count = line.partition("#")[0].count(",") + 1
                if count != len(header):  # its cells may be those of other columns
                    raise ValueError(f"{path}: line {number}: found {count} cells; allowed: {len(header)}")
            try:
                table = np.loadtxt(
                    list(rows.values()), delimiter=",", usecols=[header.index(name) for name in columns], ndmin=2
                )
            except ValueError as fault:
                raise ValueError(f"{path}: {fault}") from fault
        try:
            return cls(
                table[:, 0],
                table[:, 1:],
                length_scale=length_scale,
                time_scale=time_scale,
                start=start,
                start_time=start_time,
            )
        except ValueError as fault:
            raise ValueError(f"{path}: {fault}") from fault

    def position(self, times: ArrayLike) -> Array:
        """P_T(t) ``(..., d)``.

        Raises
        ------
        ValueError
            Outside the recorded time.
        """
        position = self._spline(np.asarray(times, dtype=float))
        if not np.all(np.isfinite(position)):
            raise ValueError(
                f"the track lasts from 0 to {self.duration:.6g} s, "
                f"asked for {np.min(times):.6g} to {np.max(times):.6g} s"
            )
        return np.asarray(position + self._shift)
