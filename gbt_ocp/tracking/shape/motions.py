"""The shape of a motion as a Gaussian process: turn rate and log speed, with the position integrated from them.

A boat, a vehicle or an animal keeps its speed better than its course, and its course better than its position. The
process is therefore put on turn rate w(t), on the change c(t) of log speed and, in space, on the change g(t) of the
climb angle. Time runs relative to *now*; with u the direction to the target and ρ the logarithm of its range,

    p(t) = exp(ρ) u - ∫_t^0 v dτ,   v = exp(s + c) [cos h, sin h]   (in space times cos γ, with sin γ as third),
    h(t) = h_0 - ∫_t^0 w dτ,   γ(t) = γ_0 + g(t),   c(0) = g(0) = 0.

Everything is in whitened coordinates z, in which the prior is N(0, I) whatever the hyperparameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.models.bearings import rotate_bearing, tangent_basis
from gbt_ocp.tracking.shape.course import Course, Part, way
from gbt_ocp.tracking.shape.processes import SLOWER, Operators, ShapePrior, applied, interpolation, operators
from gbt_ocp.typing import Array

Indices = NDArray[np.intp]

AHEAD = 4
"""Spans of the past that are computed ahead of now; see :attr:`MotionShape.longest_ahead`."""

FLAT_ANGLE = np.pi / np.sqrt(3.0)
"""Standard deviation in radians of an angle of which nothing is known."""


@dataclass(frozen=True)
class Motions:
    """B motions, each under its own point of the grid.

    Attributes
    ----------
    theta
        Number of the point ``(B,)``.
    direction
        u ``(B, d)``, unit vectors from the origin (the own position now) to the target now.
    heading
        h_0 ``(B,)`` in radians.
    white
        z ``(B, n)``; zero in the coordinates of direction and heading, whose prior is flat and centred on them.
    """

    theta: Indices
    direction: Array
    heading: Array
    white: Array

    def __len__(self) -> int:
        return len(self.theta)

    def __getitem__(self, which: Indices | NDArray[np.bool_]) -> Motions:
        return Motions(self.theta[which], self.direction[which], self.heading[which], self.white[which])

    @staticmethod
    def joined(parts: Sequence[Motions]) -> Motions:
        """All motions of the parts, in order."""
        return Motions(
            np.concatenate([part.theta for part in parts]),
            np.concatenate([part.direction for part in parts]),
            np.concatenate([part.heading for part in parts]),
            np.concatenate([part.white for part in parts]),
        )


class MotionShape:
    """The prior in whitened coordinates, and the motions that belong to them.

    The order of the coordinates is: log range, direction (d-1), log speed, heading, in space climb angle; then the
    knots of turn rate, of log speed and in space of climb angle, from now into the past.

    Parameters
    ----------
    dimension
        d, 2 or 3.
    prior
        What is known.
    span
        Time into the past that the knots reach, in seconds.
    knot
        Time between knots of the turn rate in seconds.
    steps
        Nodes of the integration per knot.
    reach
        How far ahead motions are computed at least, in seconds; ``None`` for :data:`AHEAD` spans.
    """

    def __init__(
        self,
        dimension: int,
        prior: ShapePrior,
        *,
        span: float,
        knot: float,
        steps: int = 2,
        reach: float | None = None,
    ) -> None:
        if dimension not in (2, 3):
            raise ValueError(f"dimension: found {dimension}; allowed: 2, 3")
        if not (knot > 0.0 and span > knot):
            raise ValueError(f"knot: found {knot}; allowed: a number > 0 and < {span}, the span")
        self.dimension = dimension
        self.prior = prior
        self.grid = prior.grid()
        self._span = span
        self._knot = knot
        self._steps = steps
        self._reach = reach
        heads = dimension + (2 if dimension == 2 else 3)
        self.speed_at, self.heading_at, self.climb_at = dimension, dimension + 1, dimension + 2
        slow = int(np.ceil(span / (SLOWER * knot)))
        fast = SLOWER * slow + 1
        self._slow_knots = slow
        self._most_blocks = AHEAD * slow if reach is None else max(1, int(np.ceil(reach / (SLOWER * knot) - 1e-9)))
        self._knots = np.asarray(-knot * np.arange(fast), dtype=float)
        self._turn = slice(heads, heads + fast)
        self._speed = slice(heads + fast, heads + fast + slow)
        self._climb = slice(heads + fast + slow, heads + fast + 2 * slow)
        self.size = heads + fast + slow * (dimension - 1)
        """n, number of whitened coordinates."""
        self._past = operators(prior, knot, steps, slow, 0)
        self._ahead: dict[int, Operators] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        # all that it holds follows from these, and is large
        again = partial(MotionShape, span=self._span, knot=self._knot, steps=self._steps, reach=self._reach)
        return again, (self.dimension, self.prior)

    @property
    def longest_ahead(self) -> float:
        """How far ahead of now motions are computed, in seconds, so that the cost is bounded by the span."""
        return self._most_blocks * SLOWER * self._knot

    @property
    def knots(self) -> tuple[float, float, int, int]:
        """Knot and span in seconds, slow knots of the past, and those that are computed ahead at most."""
        return self._knot, self._span, self._slow_knots, self._most_blocks

    @property
    def past_nodes(self) -> Array:
        """Times of the nodes of the past, from 0 downwards ``(G,)`` in seconds."""
        return self._past.nodes

    def at(self, times: Array) -> Array:
        """Weights ``(K, G)`` of :attr:`past_nodes` at the times ``(K,)`` in seconds."""
        return interpolation(self._past.nodes, times)

    def way(self, times: Array) -> Array:
        """Weights ``(K, G)`` of the velocities at :attr:`past_nodes` in the way from now to the times ``(K,)``."""
        return way(self.at(times), float(self.past_nodes[1]))

    def log_range(self, motions: Motions) -> Array:
        """ρ ``(B,)``, logarithm of metres."""
        return np.asarray(np.log(self.prior.range.median) + self.prior.range.log_std * motions.white[:, 0])

    def speed(self, motions: Motions) -> Array:
        """Speed now ``(B,)`` in m/s."""
        z = motions.white[:, self.speed_at]
        return np.asarray(self.prior.speed.median * np.exp(self.prior.speed.log_std * z))

    # ---- making motions ---------------------------------------------------------------------------------------------

    def begin(self, theta: Indices, ranges: Array, direction: Array, velocity: Array) -> Motions:
        """Straight motions at a range ``(B,)`` in a direction ``(B, d)`` with a velocity ``(B, d)`` in m/s."""
        white = np.zeros((len(theta), self.size))
        p = self.prior
        speed = np.maximum(np.linalg.norm(velocity, axis=1), 1e-3 * p.speed.median)
        white[:, 0] = np.log(ranges / p.range.median) / p.range.log_std
        # a start far out in the tail of the prior does not help
        white[:, self.speed_at] = np.clip(np.log(speed / p.speed.median) / p.speed.log_std, -2.0, 2.0)
        if self.dimension == 3:
            climb = np.arctan2(velocity[:, 2], np.linalg.norm(velocity[:, :2], axis=1))
            white[:, self.climb_at] = np.clip(climb / p.climb_std, -2.0, 2.0)
        return Motions(theta, direction, np.arctan2(velocity[:, 1], velocity[:, 0]), white)

    def moved(self, motions: Motions, step: Array) -> Motions:
        """Motions after a step ``(B, n)`` in the whitened coordinates."""
        d = self.dimension
        white = motions.white + step
        direction = rotate_bearing(motions.direction, FLAT_ANGLE * white[:, 1:d])
        heading = motions.heading + FLAT_ANGLE * white[:, self.heading_at]
        white[:, 1:d] = 0.0
        white[:, self.heading_at] = 0.0
        return Motions(motions.theta, direction, heading, white)

    def advanced(self, motions: Motions, step: float, own: Array) -> Motions:
        """The same motions seen from a later now: a start for the next estimate.

        Parameters
        ----------
        motions
            B motions.
        step
            Time that has passed in seconds, > 0.
        own
            The own position then, relative to that before ``(d,)`` in metres.
        """
        p, white = self.prior, np.zeros_like(motions.white)
        times, nodes = self.ahead(motions, step)
        place = (interpolation(times, np.array([step])) @ nodes.positions)[:, 0] - own
        if step > times[-1]:  # straight on; the processes keep the values that they have reached
            place += (step - times[-1]) * nodes.velocity[:, -1]
        ranges = np.maximum(np.linalg.norm(place, axis=1), 1e-6)
        white[:, 0] = np.log(ranges / p.range.median) / p.range.log_std
        fast = np.asarray(step + self._knots)
        slow = fast[::SLOWER]
        white[:, self._turn] = self._whitened("rate", motions.theta, self._values(motions, fast, "rate"))
        speed = self._values(motions, slow, "speed")
        white[:, self.speed_at] = motions.white[:, self.speed_at] + speed[:, 0] / p.speed.log_std
        white[:, self._speed] = self._whitened("speed", motions.theta, speed[:, 1:] - speed[:, :1])
        if self.dimension == 3:
            climb = self._values(motions, slow, "climb")
            white[:, self.climb_at] = motions.white[:, self.climb_at] + climb[:, 0] / p.climb_std
            white[:, self._climb] = self._whitened("climb", motions.theta, climb[:, 1:] - climb[:, :1])
        heading = motions.heading + self._values(motions, fast[:1], "turn")[:, 0]
        return Motions(motions.theta, place / ranges[:, None], heading, white)

    def transferred(self, motion: Motions, theta: Indices) -> Motions:
        """One motion under each of the points ``(B,)`` of the grid."""
        same = motion[np.zeros(len(theta), dtype=np.intp)]
        white = same.white.copy()
        slow = self._knots[::SLOWER]
        white[:, self._turn] = self._whitened("rate", theta, self._values(same, self._knots, "rate"))
        white[:, self._speed] = self._whitened("speed", theta, self._values(same, slow, "speed")[:, 1:])
        if self.dimension == 3:
            white[:, self._climb] = self._whitened("climb", theta, self._values(same, slow, "climb")[:, 1:])
        return replace(same, theta=theta, white=white)

    # ---- where they lead --------------------------------------------------------------------------------------------

    def past(self, motions: Motions, count: int | None = None) -> Course:
        """Motions at :attr:`past_nodes`, or at the first ``count`` of them."""
        there = self._past
        if count is not None:
            there = Operators(there.nodes[:count], *(rows[:, :count] for rows in there[1:]))
        return self._course(motions, there, motions.white)

    def ahead(self, motions: Motions, horizon: float, white: Array | None = None) -> tuple[Array, Course]:
        """Motions at nodes from now to at least ``horizon`` seconds ahead, or as far as :attr:`longest_ahead`.

        Parameters
        ----------
        motions
            B motions.
        horizon
            In seconds.
        white
            Coordinates of the future ``(B, m)``; zero, their mean, by default.

        Returns
        -------
        Times ``(G,)`` and the motions there; the slopes have further columns, for the coordinates of the future.
        """
        there = self._operators_ahead(horizon)
        beyond = np.zeros((len(motions), self.coordinates_ahead(horizon))) if white is None else white
        return there.nodes, self._course(motions, there, np.concatenate([motions.white, beyond], axis=1))

    def coordinates_ahead(self, horizon: float) -> int:
        """m, number of the whitened coordinates of the future in :meth:`ahead`."""
        return self._blocks_ahead(horizon) * (SLOWER + self.dimension - 1)

    def _blocks_ahead(self, horizon: float) -> int:
        wanted = np.ceil(horizon / (SLOWER * self._knot) - 1e-9)
        return int(np.clip(wanted, 1, self._most_blocks))

    def _operators_ahead(self, horizon: float) -> Operators:
        blocks = self._blocks_ahead(horizon)
        if blocks not in self._ahead:
            self._ahead[blocks] = operators(self.prior, self._knot, self._steps, self._slow_knots, blocks)
        return self._ahead[blocks]

    def _blocks(self, width: int) -> list[Indices] | list[slice]:
        """Coordinates of the three processes among ``width``, those of the future behind those of the past."""
        if width == self.size:
            return [self._turn, self._speed, self._climb]  # slices: several times faster than indices
        blocks = (width - self.size) // (SLOWER + self.dimension - 1)
        found, after = [], self.size
        for past, future in ((self._turn, SLOWER * blocks), (self._speed, blocks), (self._climb, blocks)):
            found.append(np.concatenate([np.arange(past.start, past.stop), np.arange(after, after + future)]))
            after += future
        return found

    def _course(self, motions: Motions, there: Operators, white: Array) -> Course:
        d, p, theta = self.dimension, self.prior, motions.theta
        turn, speed = there.turn[theta], there.speed[theta]
        blocks = self._blocks(white.shape[1])
        heading = motions.heading[:, None] + applied(turn, white[:, blocks[0]])
        pace = p.speed.median * np.exp(
            p.speed.log_std * white[:, self.speed_at, None] + applied(speed, white[:, blocks[1]])
        )
        velocity = np.stack([pace * np.cos(heading), pace * np.sin(heading)], axis=-1)
        climbs = []
        if d == 3:
            climb = there.climb[theta]
            angle = p.climb_std * white[:, self.climb_at, None] + applied(climb, white[:, blocks[2]])
            cosine, sine = np.cos(angle), np.sin(angle)
            raised = np.concatenate([-sine[..., None] * velocity, (pace * cosine)[..., None]], axis=-1)
            velocity = np.concatenate([cosine[..., None] * velocity, (pace * sine)[..., None]], axis=-1)
            climbs.append(Part(raised, self.climb_at, p.climb_std, climb, blocks[2]))
        across = np.zeros_like(velocity)
        across[..., 0], across[..., 1] = -velocity[..., 1], velocity[..., 0]
        parts = [
            Part(across, self.heading_at, FLAT_ANGLE, turn, blocks[0]),
            Part(velocity, self.speed_at, p.speed.log_std, speed, blocks[1]),
            *climbs,
        ]
        ranges = np.exp(self.log_range(motions))[:, None]
        place = ranges * motions.direction
        sideways = FLAT_ANGLE * (ranges[..., None] * tangent_basis(motions.direction))
        slopes = np.concatenate([p.range.log_std * place[..., None], sideways], axis=-1)
        return Course(velocity, parts, place, slopes, float(there.nodes[1] - there.nodes[0]), white.shape[1])

    def _values(self, motions: Motions, times: Array, process: Literal["turn", "rate", "speed", "climb"]) -> Array:
        """A process at times ``(K,)``, its mean where they lie ahead: ``(B, K)``."""
        block = {"turn": self._turn, "rate": self._turn, "speed": self._speed, "climb": self._climb}[process]
        z = motions.white[:, block]
        found = np.empty((len(motions), len(times)))
        behind = times <= 0.0
        past = applied(getattr(self._past, process)[motions.theta], z)
        found[:, behind] = past @ interpolation(self._past.nodes, times[behind]).T
        if not np.all(behind):
            there = self._operators_ahead(float(np.max(times)))
            future = applied(getattr(there, process)[motions.theta][:, :, : z.shape[1]], z)
            found[:, ~behind] = future @ interpolation(there.nodes, times[~behind]).T
        return found

    def _whitened(self, process: Literal["rate", "speed", "climb"], theta: Indices, values: Array) -> Array:
        """Coordinates ``(B, m)`` of the values of a process at the knots."""
        return applied(self._inverses[process][theta], values)

    @cached_property
    def _inverses(self) -> dict[str, Array]:
        slow = SLOWER * self._steps
        return {
            "rate": np.asarray(np.linalg.inv(self._past.rate[:, :: self._steps])),
            "speed": np.asarray(np.linalg.inv(self._past.speed[:, slow::slow])),
            "climb": np.asarray(np.linalg.inv(self._past.climb[:, slow::slow])),
        }
