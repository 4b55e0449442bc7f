"""A target that turns at random, like a boat whose skipper is not known."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.sizes import not_negative, positive
from gbt_ocp.typing import Array

TURNING_STEP = 0.05
"""Step in seconds at which the course of a :class:`TurningTarget` is integrated."""

MOST_TURNS = 1_000_000
"""Largest number of turns that are drawn for a :class:`TurningTarget`."""

SPEED_TIME = 40.0
"""Correlation time in seconds of a :class:`TurningTarget`'s speed, where it varies."""


class TurningTarget:
    """A boat that turns: the turn rate is drawn again every so often, and held.

    Turn rates are uniform within ``±turn_rate_max``, each held for a time uniform in ``hold``; the first heading is
    uniform. In space the vertical speed is drawn and held in the same way. The speed over ground is constant, or
    log-normal about ``speed`` with an exponential correlation over :data:`SPEED_TIME`.

    Parameters
    ----------
    dimension
        d.
    rng
        Source of the draws; a longer duration continues the same motion.
    duration
        Time in seconds up to which the motion is defined.
    start
        P_T(0) ``(d,)`` in metres.
    speed
        Horizontal speed in m/s; its median, where it varies.
    turn_rate_max
        In rad/s.
    hold
        Least and largest time in seconds between two draws.
    climb_rate_max
        Largest vertical speed in m/s, in space.
    speed_std
        Standard deviation of the logarithm of the speed.

    Raises
    ------
    ValueError
        If a number is out of range.
    """

    def __init__(
        self,
        dimension: int,
        rng: np.random.Generator,
        *,
        duration: float,
        start: ArrayLike,
        speed: float = 1.0,
        turn_rate_max: float = 0.05,
        hold: tuple[float, float] = (20.0, 40.0),
        climb_rate_max: float = 0.1,
        speed_std: float = 0.0,
    ) -> None:
        from scipy.interpolate import make_interp_spline  # takes a second to import, which other targets do not need

        if dimension not in (2, 3):
            raise ValueError(f"dimension must be 2 or 3, found {dimension}")
        if not 0.0 < hold[0] <= hold[1]:
            raise ValueError(f"hold must be two increasing positive times, found {hold}")
        positive("duration", duration)
        positive("speed", speed)
        not_negative("turn_rate_max", turn_rate_max)
        not_negative("climb_rate_max", climb_rate_max)
        not_negative("speed_std", speed_std)
        longest = min(MOST_TURNS * 0.5 * (hold[0] + hold[1]), 5 * MOST_TURNS * TURNING_STEP)
        if duration > longest:
            raise ValueError(
                f"target: found a motion of {duration:.6g} s; allowed: at most {longest:.6g} s, {MOST_TURNS} turns of "
                f"hold_s or {5 * MOST_TURNS} steps of {TURNING_STEP} s"
            )
        self.dimension = dimension
        self.duration = float(duration)
        turns, speeds = rng.spawn(2)
        count = int(np.ceil(duration / TURNING_STEP)) + 2
        t = TURNING_STEP * np.arange(count)
        heading, begins, rates, climbs = turns.uniform(-np.pi, np.pi), [0.0], [], []
        while begins[-1] <= t[-1]:
            rates.append(turns.uniform(-turn_rate_max, turn_rate_max))
            climbs.append(turns.uniform(-climb_rate_max, climb_rate_max))
            begins.append(begins[-1] + turns.uniform(*hold))
        # between two steps the course is straight: with 0.05 rad/s that is wrong by less than a micrometre a step
        heading += np.interp(t, begins, np.concatenate([[0.0], np.cumsum(np.diff(begins) * rates)]))
        log_speed = np.full(count, np.log(speed))
        if speed_std > 0.0:
            from scipy.signal import lfilter

            keep = np.exp(-TURNING_STEP / SPEED_TIME)
            draws = speed_std * speeds.standard_normal(count)
            draws[1:] *= np.sqrt(1.0 - keep**2)
            log_speed += lfilter([1.0], [1.0, -keep], draws)
        velocity = np.exp(log_speed)[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
        moved = np.vstack([np.zeros(2), np.cumsum(0.5 * TURNING_STEP * (velocity[1:] + velocity[:-1]), axis=0)])
        if dimension == 3:
            climbed = np.concatenate([[0.0], np.cumsum(np.diff(begins) * climbs)])
            moved = np.column_stack([moved, np.interp(t, begins, climbed)])
        self._path = make_interp_spline(t, np.asarray(start, dtype=float) + moved, k=1)

    def position(self, times: ArrayLike) -> Array:
        """P_T(t) ``(..., d)``.

        Raises
        ------
        ValueError
            Outside the time for which the motion is defined.
        """
        t = np.asarray(times, dtype=float)
        if np.any(t < 0.0) or np.any(t > self.duration + 1e-9):
            raise ValueError(
                f"the motion lasts from 0 to {self.duration:.6g} s, asked for {np.min(t)} to {np.max(t)} s"
            )
        return np.asarray(self._path(t))
