"""Flat trajectories: piecewise polynomials of the flat output (``eq31``, ``eq32``).

A trajectory of degree L has p pieces of one period T. It is L-1 times continuously differentiable, so each piece adds
one vector of freedom: its L-th derivative, or what is the same in other coordinates, its endpoint. With L = 2 the
start (z_0, ż_0) and the endpoints fix everything:
``a_i = 2 (z_i - z_{i-1} - T ż_{i-1}) / T²``, ``ż_i = ż_{i-1} + a_i T``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import factorial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class FlatPoint(NamedTuple):
    """The flat output and its first two derivatives at one time, symbolic or numeric, each ``(n,)``."""

    z: Any
    dz: Any
    ddz: Any


def propagate(derivatives: list[Any], top: Any, time: float) -> list[Any]:
    """Taylor step of a piece: derivatives 0 … L-1 after ``time`` seconds under a constant L-th derivative ``top``.

    Works on numbers and on CasADi expressions alike; returns L+1 entries, the last being ``top`` itself.
    """
    terms = [*derivatives, top]
    out = []
    for order in range(len(terms)):
        value = terms[order]
        for later in range(order + 1, len(terms)):
            value = value + terms[later] * (time ** (later - order) / factorial(later - order))
        out.append(value)
    return out


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
        Derivatives 0 … L-1 of the flat output at t = 0, ``(L, n)``.
    top
        L-th derivative of each piece ``(p, n)``.
    """

    period: float
    start: Array
    top: Array

    @classmethod
    def from_endpoints(cls, period: float, start: ArrayLike, endpoints: ArrayLike) -> FlatTrajectory:
        """The trajectory through the endpoints ``z̄`` ``(p, n)`` (``eq32``), from the start ``(L, n)``."""
        start = np.asarray(start, dtype=float)
        degree = len(start)
        derivatives = list(start)
        top = []
        for endpoint in np.asarray(endpoints, dtype=float):
            coasted = propagate(derivatives, np.zeros_like(endpoint), period)
            top.append((endpoint - coasted[0]) * factorial(degree) / period**degree)
            derivatives = propagate(derivatives, top[-1], period)[:degree]
        return cls(period, start, np.array(top))

    @property
    def degree(self) -> int:
        """L, the degree of the polynomials."""
        return len(self.start)

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
        """Derivatives 0 … L-1 at the piece boundaries ``(p+1, L, n)``."""
        knots = [self.start]
        for top in self.top:
            knots.append(np.array(propagate(list(knots[-1]), top, self.period)[: self.degree]))
        return np.array(knots)

    @property
    def endpoints(self) -> Array:
        """z̄: the flat output at the end of each piece ``(p, n)``."""
        return np.asarray(self.knots[1:, 0])

    @property
    def coefficients(self) -> Array:
        """c_i of ``eq31``: coefficients of 1, s, …, s^L of each piece ``(p, L+1, n)``."""
        scale: Array = np.array([1.0 / factorial(order) for order in range(self.degree + 1)])
        return np.concatenate([self.knots[:-1], self.top[:, None]], axis=1) * scale[None, :, None]

    def sample(self, points: int) -> FlatPoint:
        """z, ż, z̈ on an even grid of ``points`` times a piece, both ends included; each ``(p, points, n)``.

        The ends of neighbouring pieces are both there, since the L-th derivative jumps between them.
        """
        powers = np.linspace(0.0, self.period, points)[:, None] ** np.arange(self.degree + 1)
        coefficients = self.coefficients
        values = []
        for order in range(3):
            # d/ds of s^k lowers the power and multiplies by it
            scale = np.array([factorial(k) / factorial(k - order) for k in range(order, self.degree + 1)])
            values.append(powers[:, : self.degree + 1 - order] @ (coefficients[:, order:] * scale[None, :, None]))
        return FlatPoint(*values)

    def __call__(self, times: ArrayLike, order: int = 0) -> Array:
        """The flat output, or its derivative of that order, at times in [0, p T]: ``(..., n)``.

        At a boundary the later piece counts; beyond both ends the first and last piece are continued.
        """
        t = np.asarray(times, dtype=float)
        # A time that was meant to be a boundary must not fall into the earlier piece by rounding.
        piece = np.clip(np.floor(t / self.period + 1e-9).astype(int), 0, self.pieces - 1)
        s = t - piece * self.period
        value = np.zeros((*t.shape, self.top.shape[1]))
        for power in range(order, self.degree + 1):
            scale = factorial(power) / factorial(power - order)
            value += self.coefficients[piece, power] * (scale * s ** (power - order))[..., None]
        return value

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
        derivatives = propagate(list(self.knots[piece]), self.top[piece], inside)[: self.degree]
        return FlatTrajectory(duration, np.array(derivatives), self.top[piece : piece + 1])

    def shifted(self) -> FlatTrajectory:
        """The rest of the trajectory after its first piece, with the last piece coasting (L-th derivative zero)."""
        return FlatTrajectory(self.period, self.knots[1], np.vstack([self.top[1:], np.zeros_like(self.top[:1])]))
