"""Laws by which targets move, for particles: N states at once, drawn from the law, without approximation.

A state begins with the position; its other components belong to the law. Times in s, lengths in m, angles in rad.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gbt_ocp.typing import Array


class MotionLaw(Protocol):
    """A law of motion."""

    def begun(self, positions: Array, towards: Array, rng: np.random.Generator) -> Array:
        """States ``(N, m)`` at the positions ``(N, d)``; ``towards`` are unit vectors to the vehicle ``(N, d)``."""

    def moved(self, states: Array, duration: float, rng: np.random.Generator) -> Array:
        """States ``(N, m)`` a duration in seconds later."""

    def kept(self, dimension: int) -> tuple[int, ...]:
        """Columns that must not be blurred when particles are drawn again."""


@dataclass(frozen=True)
class SteadyLaw:
    """Constant velocity, but for white noise of the acceleration.

    Attributes
    ----------
    speed, speed_std
        Mean and standard deviation of the speed at the start, in m/s; speeds below 0 are drawn again.
    course_std
        Standard deviation of the course from that towards the vehicle in rad; infinite for courses of any direction.
        In space velocities of any direction are drawn.
    density
        Spectral density of the acceleration in m²/s³.
    """

    speed: float
    speed_std: float
    course_std: float = np.inf
    density: float = 0.0

    def begun(self, positions: Array, towards: Array, rng: np.random.Generator) -> Array:
        """See :class:`MotionLaw`."""
        count, dimension = positions.shape
        speeds = np.abs(self.speed + self.speed_std * rng.standard_normal(count))
        lines = rng.standard_normal((count, dimension))
        if np.isfinite(self.course_std) and dimension == 2:
            courses = np.arctan2(towards[:, 1], towards[:, 0]) + self.course_std * rng.standard_normal(count)
            lines = np.stack([np.cos(courses), np.sin(courses)], axis=-1)
        lines /= np.linalg.norm(lines, axis=1, keepdims=True)
        return np.hstack([positions, speeds[:, None] * lines])

    def moved(self, states: Array, duration: float, rng: np.random.Generator) -> Array:
        """See :class:`MotionLaw`."""
        dimension = states.shape[1] // 2
        found = states.copy()
        found[:, :dimension] += duration * states[:, dimension:]
        if self.density > 0.0 and duration > 0.0:
            # the integral of white noise and its own integral, which go together
            first, second = rng.standard_normal((2, len(states), dimension))
            change = np.sqrt(self.density * duration) * first
            found[:, dimension:] += change
            found[:, :dimension] += 0.5 * duration * change
            found[:, :dimension] += np.sqrt(self.density * duration**3 / 12.0) * second
        return found

    def kept(self, dimension: int) -> tuple[int, ...]:
        """See :class:`MotionLaw`."""
        return ()


@dataclass(frozen=True)
class HeldTurnLaw:
    """A speed that keeps its course rate for a while: see :class:`~gbt_ocp.models.turning.TurningTarget`.

    A state is position, heading, logarithm of the speed, turn rate, time left until the next draw, and the vertical
    speed in space.

    Attributes
    ----------
    speed, speed_log_std
        Median of the speed in m/s, and the standard deviation of its logarithm at the start.
    turn_rate
        Half width of the uniform distribution of turn rates, or their standard deviation if ``normal``, in rad/s.
    hold
        Least and largest time for which a turn rate is held, in s. It is uniform between them.
    normal
        Whether turn rates are normal.
    speed_change, speed_time
        Standard deviation of the change of the logarithm of the speed, and its correlation time in s.
    climb
        Half width of the uniform distribution of vertical speeds, in m/s.
    """

    speed: float
    speed_log_std: float
    turn_rate: float
    hold: tuple[float, float]
    normal: bool = False
    speed_change: float = 0.0
    speed_time: float = 40.0
    climb: float = 0.1

    def begun(self, positions: Array, towards: Array, rng: np.random.Generator) -> Array:
        """See :class:`MotionLaw`."""
        count, dimension = positions.shape
        headings = rng.uniform(-np.pi, np.pi, count)
        spread = np.hypot(self.speed_log_std, self.speed_change)
        speeds = np.log(self.speed) + spread * rng.standard_normal(count)
        columns = [headings, speeds, self._rates(count, rng), rng.uniform(*self.hold, count)]
        if dimension == 3:
            columns.append(rng.uniform(-self.climb, self.climb, count))
        return np.column_stack([positions, *columns])

    def _rates(self, count: int, rng: np.random.Generator) -> Array:
        if self.normal:
            return self.turn_rate * rng.standard_normal(count)
        return rng.uniform(-self.turn_rate, self.turn_rate, count)

    def moved(self, states: Array, duration: float, rng: np.random.Generator) -> Array:
        """See :class:`MotionLaw`. A long duration is cut into steps, in each of which a rate is drawn at most once."""
        steps = max(1, int(np.ceil(duration / (0.2 * self.hold[0]) - 1e-9)))
        for _ in range(steps):
            states = self._step(states, duration / steps, rng)
        return states

    def _step(self, states: Array, duration: float, rng: np.random.Generator) -> Array:
        space = states.shape[1] == 8
        at = 3 if space else 2
        found = states.copy()
        found[:, at + 3] -= duration
        over = np.flatnonzero(found[:, at + 3] <= 0.0)
        before = duration + np.minimum(found[:, at + 3], 0.0)  # with the old rate
        turned, risen = states[:, at + 2] * before, np.zeros(len(states))
        if space:
            risen = states[:, at + 4] * before
        if len(over):
            found[over, at + 2] = self._rates(len(over), rng)
            if space:
                found[over, at + 4] = rng.uniform(-self.climb, self.climb, len(over))
            rest = duration - before[over]
            turned[over] += found[over, at + 2] * rest
            if space:
                risen[over] += found[over, at + 4] * rest
            found[over, at + 3] += rng.uniform(*self.hold, len(over))
        found[:, at] += turned
        if self.speed_change > 0.0:
            keep = np.exp(-duration / self.speed_time)
            middle = np.log(self.speed)
            found[:, at + 1] = middle + keep * (found[:, at + 1] - middle)
            found[:, at + 1] += self.speed_change * np.sqrt(1.0 - keep**2) * rng.standard_normal(len(states))
        # the chord of an arc, with the means of heading and speed
        heading = states[:, at] + 0.5 * turned
        way = duration * np.exp(0.5 * (states[:, at + 1] + found[:, at + 1])) * np.sinc(turned / (2.0 * np.pi))
        found[:, 0] += way * np.cos(heading)
        found[:, 1] += way * np.sin(heading)
        if space:
            found[:, 2] += risen
        return found

    def kept(self, dimension: int) -> tuple[int, ...]:
        """See :class:`MotionLaw`."""
        return (dimension + 3,)
