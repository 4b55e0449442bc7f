"""Flat trajectories: piecewise polynomials of the flat output (``eq31``, ``eq32``).

A trajectory of degree L has p pieces of one period T. The paper's is L-1 times continuously differentiable, so each
piece adds one vector of freedom: its L-th derivative, or what is the same in other coordinates, its endpoint. With
L = 2 the start (z_0, ż_0) and the endpoints fix everything:
``a_i = 2 (z_i - z_{i-1} - T ż_{i-1}) / T²``, ``ż_i = ż_{i-1} + a_i T``.
Where fewer derivatives are continuous, all those above them are free in every piece.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import accumulate, repeat
from math import factorial
from operator import mul
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.typing import Array


class FlatPoint(NamedTuple):
    """The flat output and its first two derivatives at one time, symbolic or numeric, each ``(n,)``."""

    z: Any
    dz: Any
    ddz: Any


def propagate(derivatives: Sequence[Any], free: Sequence[Any], time: float) -> list[Any]:
    """Taylor step of a piece: its derivatives 0 … L after ``time`` seconds, the L-th of which is constant.

    Works on numbers and on CasADi expressions alike.

    Parameters
    ----------
    derivatives
        Those at the beginning of the piece that it takes over from the one before.
    free
        Those of higher order, up to the L-th.
    time
        Seconds.
    """
    terms = [*derivatives, *free]
    out = []
    for order in range(len(terms)):
        value = terms[order]
        for later in range(order + 1, len(terms)):
            value = value + terms[later] * (time ** (later - order) / factorial(later - order))
        out.append(value)
    return out


def _propagated(terms: list[list[float]], shares: Sequence[float]) -> list[list[float]]:
    """:func:`propagate` of numbers, of which there are so few that arrays of them take several times as long."""
    out = []
    for order, value in enumerate(terms):
        for share, later in zip(shares, terms[order + 1 :], strict=False):
            value = [here + more * share for here, more in zip(value, later, strict=True)]
        out.append(value)
    return out


@lru_cache(maxsize=64)
def _taylor(degree: int, time: float) -> tuple[float, ...]:
    """``time^k / k!`` for k = 1 … L."""
    return tuple(time**power / factorial(power) for power in range(1, degree + 1))


@lru_cache(maxsize=16)
def _inverse_factorials(degree: int) -> Array:
    """1/k! for k = 0 … L ``(L+1, 1)``."""
    return np.array([[1.0 / factorial(order)] for order in range(degree + 1)])


@lru_cache(maxsize=64)
def _grid(period: float, degree: int, points: int) -> tuple[tuple[Array, Array], ...]:
    """For z, ż and z̈: powers of the times of an even grid ``(points, L+1-k)``, and what multiplies coefficients."""
    powers = np.linspace(0.0, period, points)[:, None] ** np.arange(degree + 1)
    found = []
    for order in range(3):
        # d/ds of s^k lowers the power and multiplies by it
        scale = np.array([[factorial(k) / factorial(k - order)] for k in range(order, degree + 1)])
        found.append((powers[:, : degree + 1 - order], scale))
    return tuple(found)


SETTLING_GAINS = ((1.0,), (1.0, 3 / 2), (1.0, 2.0, 11 / 6), (1.0, 5 / 2, 35 / 12, 25 / 12))
"""Gains that bring chains of one to four integrators to rest in as many steps of one second: all poles at zero."""


def settling(inherited: Array, first: int, aim: ArrayLike, period: float) -> Array:
    """The lowest free derivative of a piece ``(n,)`` that settles those from ``first`` on.

    Where it is chosen so in every piece, derivative ``first`` becomes ``aim`` and those above it zero in as many pieces
    as there are inherited ones of them.

    Parameters
    ----------
    inherited
        Derivatives at the beginning of the piece ``(k+1, n)``.
    first
        At most k+1, which is the lowest free one.
    aim
        ``(n,)``.
    period
        T in s.
    """
    chain = np.array(inherited[first:], dtype=float)
    if not len(chain):
        return np.asarray(aim, dtype=float)
    chain[0] -= aim
    lowest = np.zeros(chain.shape[1])
    # in the order of the kernel: the last bits of a guess decide between equal plans
    for below, (gain, link) in enumerate(zip(SETTLING_GAINS[len(chain) - 1], chain, strict=True)):
        lowest -= gain * link / float(period) ** (len(chain) - below)
    return lowest


def led_back(off: Array, top: Array, period: float) -> Array:
    """What is free in the pieces of a plan ``(p, freedoms)``, changed so that they lead back to it.

    Parameters
    ----------
    off
        By how much the derivatives at the start are off the plan ``(k+1, n)``.
    top
        What is free in its pieces ``(p, freedoms)``.
    period
        T in s.
    """
    changed, n = top.copy(), off.shape[1]
    for piece in changed:
        back = np.zeros_like(piece)
        back[:n] = settling(off, 0, np.zeros(n), period)
        piece += back
        off = FlatTrajectory(period, off, back[None]).knots[1]
    return changed


def flat_point(derivatives: list[Any]) -> FlatPoint:
    """The first three entries of a list of derivatives."""
    return FlatPoint(derivatives[0], derivatives[1], derivatives[2])


@dataclass(frozen=True)
class FlatTrajectory:
    """A piecewise polynomial z(t) on [0, p T].

    Parameters
    ----------
    period
        T in seconds, the length of a piece.
    start
        Derivatives of the flat output at t = 0 that are continuous, itself among them: 0 … k, ``(k+1, n)``.
    top
        Derivatives k+1 … L at the beginning of each piece, one after the other ``(p, (L-k) n)``; where all but the
        L-th are continuous, that one ``(p, n)``.
    """

    period: float
    start: Array
    top: Array

    @classmethod
    def from_endpoints(cls, period: float, start: ArrayLike, endpoints: ArrayLike) -> FlatTrajectory:
        """The trajectory through the endpoints ``z̄`` ``(p, n)`` (``eq32``), from the start ``(L, n)``, with k = L-1."""
        start = np.asarray(start, dtype=float)
        degree = len(start)
        derivatives = list(start)
        top = []
        for endpoint in np.asarray(endpoints, dtype=float):
            coasted = propagate(derivatives, [np.zeros_like(endpoint)], period)
            top.append((endpoint - coasted[0]) * factorial(degree) / period**degree)
            derivatives = propagate(derivatives, [top[-1]], period)[:degree]
        return cls(period, start, np.array(top))

    @cached_property
    def degree(self) -> int:
        """L, the degree of the polynomials."""
        return len(self.start) + int(self.top.shape[1]) // int(self.start.shape[1]) - 1

    @property
    def _free(self) -> Array:
        """The same as ``top``, one derivative a row ``(p, L-k, n)``."""
        size = self.start.shape[1]
        return self.top.reshape(len(self.top), self.top.shape[1] // size, size)

    @property
    def pieces(self) -> int:
        """p, the number of pieces."""
        return len(self.top)

    @property
    def duration(self) -> float:
        """Length in seconds, p T."""
        return self.pieces * self.period

    @cached_property
    def knots(self) -> Array:
        """Derivatives 0 … k, the continuous ones, at the piece boundaries ``(p+1, k+1, n)``."""
        joined, shares = len(self.start), _taylor(self.degree, self.period)
        knots = [self.start.tolist()]
        for free in self._free.tolist():
            knots.append(_propagated([*knots[-1], *free], shares)[:joined])
        return np.array(knots)

    @property
    def endpoints(self) -> Array:
        """z̄: the flat output at the end of each piece ``(p, n)``."""
        return np.asarray(self.knots[1:, 0])

    @cached_property
    def coefficients(self) -> Array:
        """c_i of ``eq31``: coefficients of 1, s, …, s^L of each piece ``(p, L+1, n)``."""
        knots = self.start[None] if len(self.top) == 1 else self.knots[:-1]
        return np.concatenate([knots, self._free], axis=1) * _inverse_factorials(self.degree)

    def sample(self, points: int) -> FlatPoint:
        """z, ż, z̈ on an even grid of ``points`` times a piece, both ends included; each ``(p, points, n)``.

        The ends of neighbouring pieces are both there, since what is not continuous jumps between them.
        """
        coefficients = self.coefficients
        grid = _grid(self.period, self.degree, points)
        return FlatPoint(*(powers @ (coefficients[:, k:] * scale) for k, (powers, scale) in enumerate(grid)))

    def __call__(self, times: ArrayLike, order: int = 0) -> Array:
        """The flat output, or its derivative of that order, at times in [0, p T]: ``(..., n)``.

        At a boundary the later piece counts; beyond both ends the first and last piece are continued.
        """
        t = np.asarray(times, dtype=float)
        # A time that was meant to be a boundary must not fall into the earlier piece by rounding.
        piece = np.clip(np.floor(t / self.period + 1e-9).astype(int), 0, self.pieces - 1)
        s = t - piece * self.period
        value = np.zeros((*t.shape, self.start.shape[1]))
        for power in range(order, self.degree + 1):
            scale = factorial(power) / factorial(power - order)
            value += self.coefficients[piece, power] * (scale * s ** (power - order))[..., None]
        return value

    def point(self, time: float) -> FlatPoint:
        """z, ż, z̈ at one time, each ``(n,)``: what three calls of the trajectory give, in a tenth of their time."""
        return FlatPoint(*self._values(time))

    def step(self, since: float, until: float) -> tuple[list[float], list[float]]:
        """How far z and ż go between two times, n numbers each, in a sixth of the time of two points."""
        piece, last = self._piece(since), self._piece(until)
        if piece != last:
            z, dz, _ = (self._values(until) - self._values(since)).tolist()
            return z, dz
        begin, end = since - piece * self.period, until - piece * self.period
        shares = [(end**k - begin**k) / factorial(k) for k in range(1, self.degree + 1)]
        slopes = self._slopes_of(piece)
        # the products end with the shorter of the two
        return [sum(map(mul, one, shares)) for one in slopes], [sum(map(mul, one[1:], shares)) for one in slopes]

    def _values(self, time: float) -> Array:
        """z, ż, z̈ at one time ``(3, n)``."""
        piece, powers = self._powers(time)
        values: Array = np.dot(powers, self._derivatives(piece))
        return values

    def _powers(self, time: float) -> tuple[int, list[float]]:
        """The piece of a time, and the powers 1, s, …, s^L of the time s since that piece began."""
        piece = self._piece(time)
        return piece, list(accumulate(repeat(time - piece * self.period, self.degree), mul, initial=1.0))

    def _piece(self, time: float) -> int:
        """The number of the piece of a time: the later one at a boundary, the first or last one beyond the ends."""
        return min(max(int((time / self.period + 1e-9) // 1.0), 0), len(self.top) - 1)

    def _slopes_of(self, piece: int) -> list[tuple[float, ...]]:
        """Derivatives 1 … L of each flat output where a piece begins, kept."""
        slopes = self._slopes.get(piece)
        if slopes is None:
            begin = self.start if piece == 0 else self.knots[piece]
            slopes = list(zip(*begin[1:].tolist(), *self._free[piece].tolist(), strict=True))
            self._slopes[piece] = slopes
        return slopes

    @cached_property
    def _slopes(self) -> dict[int, list[tuple[float, ...]]]:
        """What :meth:`_slopes_of` gave, piece by piece."""
        return {}

    def _derivatives(self, piece: int) -> Array:
        """What :meth:`_derivatives_of` gives, kept."""
        derived = self._derived.get(piece)
        if derived is None:
            derived = self._derived[piece] = self._derivatives_of(piece)
        return derived

    @cached_property
    def _derived(self) -> dict[int, Array]:
        """What :meth:`_derivatives_of` gave, piece by piece: a plan is followed in its first piece, most often."""
        return {}

    def _derivatives_of(self, piece: int) -> Array:
        """Coefficients of z, ż and z̈ in a piece ``(3, L+1, n)``."""
        begin = self.start if piece == 0 else self.knots[piece]
        derivatives = np.concatenate([begin, self._free[piece]])
        found = np.zeros((3, *derivatives.shape))
        for order in range(3):
            for power in range(len(derivatives) - order):
                found[order, power] = derivatives[power + order] / factorial(power)
        return found

    def segment(self, begin: float, duration: float) -> FlatTrajectory:
        """The part of one piece from ``begin`` on, as a trajectory of one piece that lasts ``duration`` seconds.

        Raises
        ------
        ValueError
            If it reaches beyond the piece in which it begins.
        """
        piece = min(int(begin / self.period + 1e-9), self.pieces - 1)
        inside = max(begin - piece * self.period, 0.0)
        if inside + duration > self.period * (1.0 + 1e-9):
            raise ValueError(
                f"duration: found {duration}; allowed: at most {self.period - inside}, the rest of a piece"
            )
        begin_of_piece = self.start if piece == 0 else self.knots[piece]
        terms = [*begin_of_piece.tolist(), *self._free[piece].tolist()]
        joined = len(self.start)
        derivatives = np.array(_propagated(terms, _taylor(self.degree, inside)))
        return FlatTrajectory(duration, derivatives[:joined], derivatives[joined:].reshape(1, -1))

    def after(self, begin: float, duration: float) -> Array:
        """The continuous derivatives ``(k+1, n)`` so many seconds after ``begin``, in whatever piece that is."""
        if (begin / self.period + 1e-9) % 1.0 * self.period + duration <= self.period * (1.0 + 1e-9):
            return np.asarray(self.segment(begin, duration).knots[1])
        return np.array([self(begin + duration, order) for order in range(len(self.start))])

    def moving(self, velocity: ArrayLike) -> FlatTrajectory:
        """The same motion as a frame sees it that moves with ``-velocity`` ``(d,)`` in m/s: z gains ``velocity t``."""
        start = self.start.copy()
        start[1, : np.size(velocity)] += np.asarray(velocity, dtype=float)
        return FlatTrajectory(self.period, start, self.top)

    def shifted(self) -> FlatTrajectory:
        """The rest of the trajectory after its first piece, the last piece coasting: what is free there is zero."""
        return FlatTrajectory(self.period, self.knots[1], np.vstack([self.top[1:], np.zeros_like(self.top[:1])]))
