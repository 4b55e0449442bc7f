"""Bearings: unit vectors to a target, their tangent planes, and how well a set of them pins a position down.

Source: equations ``eq4``, ``eq5``, ``eq20`` and ``op_bearings`` of the paper. Arrays are time first: ``(K, d)``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.sizes import vector
from gbt_ocp.typing import Array


def unit_bearing(target: ArrayLike, own: ArrayLike) -> Array:
    """Unit vector λ from the vehicle to the target (``eq4``).

    Parameters
    ----------
    target, own
        Positions ``(..., d)`` in metres; they broadcast against each other.

    Returns
    -------
    Bearings ``(..., d)``, each of length one.

    Raises
    ------
    ValueError
        If a target coincides with the vehicle: the bearing is then undefined.
    """
    line = np.asarray(target, dtype=float) - np.asarray(own, dtype=float)
    # Scaling by the largest component first keeps the norm from overflowing or vanishing at extreme ranges.
    largest = np.max(np.abs(line), axis=-1, keepdims=True)
    if np.any(largest == 0.0):
        raise ValueError("the bearing is undefined where the target coincides with the vehicle")
    line = line / largest
    return np.asarray(line / np.linalg.norm(line, axis=-1, keepdims=True))


def tangent_basis(bearing: ArrayLike) -> Array:
    """Orthonormal basis λ̄ of the tangent plane at each bearing (``eq5``).

    In 2D it is the bearing turned by +90°. In 3D it is the image of (e_x, e_y) under the smallest rotation that takes
    e_z to the bearing: smooth everywhere but at -e_z, where every choice of basis on the sphere must break once.

    Parameters
    ----------
    bearing
        Unit vectors ``(..., d)`` with d = 2 or 3.

    Returns
    -------
    Bases ``(..., d, d-1)``; ``basis.T @ bearing == 0`` and ``basis.T @ basis == I``.

    Raises
    ------
    ValueError
        If d is neither 2 nor 3.
    """
    b = np.asarray(bearing, dtype=float)
    if b.shape[-1] == 2:
        return np.stack([-b[..., 1], b[..., 0]], axis=-1)[..., None]
    if b.shape[-1] != 3:
        raise ValueError(f"bearings must have 2 or 3 components, found {b.shape[-1]}")
    x, y, z = b[..., 0], b[..., 1], b[..., 2]
    # 1 + z loses its digits near -e_z; for a unit vector (x² + y²)/(1 - z) is the same number without cancellation.
    one_plus_z = np.where(z < 0.0, (x * x + y * y) / (1.0 - np.minimum(z, 0.0)), 1.0 + z)
    pole = one_plus_z == 0.0
    scale = 1.0 / np.where(pole, 1.0, one_plus_z)
    cross = -x * y * scale
    first = np.stack([1.0 - x * x * scale, cross, -x], axis=-1)
    second = np.stack([cross, np.where(pole, -1.0, 1.0 - y * y * scale), -y], axis=-1)
    return np.stack([first, second], axis=-1)


def inner(first: ArrayLike, second: ArrayLike) -> float:
    """Inner product of two vectors ``(d,)``, summed from the first component on and without fused products.

    So it is to the last bit that of the generated C. Where two plans are about equally good the last bit decides, and a
    matrix product of numpy differs in it from processor to processor.
    """
    total = 0.0
    for a, b in zip(np.asarray(first, dtype=float).tolist(), np.asarray(second, dtype=float).tolist(), strict=True):
        total += a * b
    return total


def rotate_bearing(bearing: ArrayLike, angle: ArrayLike) -> Array:
    """Turn a bearing by a rotation given in its tangent plane: how noise and outliers act on a bearing.

    Parameters
    ----------
    bearing
        Unit vectors ``(..., d)``.
    angle
        Rotation ``(..., d-1)`` in radians along the columns of :func:`tangent_basis`; its length is the angle between
        the bearing before and after.

    Returns
    -------
    Unit vectors ``(..., d)``.
    """
    b = np.asarray(bearing, dtype=float)
    a = np.asarray(angle, dtype=float)
    size = np.linalg.norm(a, axis=-1, keepdims=True)
    # sin(size)/size without a division by zero
    step = np.einsum("...ij,...j->...i", tangent_basis(b), a) * np.sinc(size / np.pi)
    turned = np.cos(size) * b + step
    return np.asarray(turned / np.linalg.norm(turned, axis=-1, keepdims=True))


def log_map(expected: ArrayLike, measured: ArrayLike, basis: ArrayLike | None = None) -> Array:
    """The angle from an expected to a measured bearing: the logarithm map of the circle or the sphere.

    It is the inverse of :func:`rotate_bearing`: turning the expected bearing by it gives the measured one. Its length
    is the angle between the two, from 0 to π. The ratio of an angle to its sine is 1 where the sine is zero. Opposite
    bearings have an angle of π in every direction; the first axis of the basis is taken.

    Parameters
    ----------
    expected, measured
        Unit vectors ``(..., d)`` with d = 2 or 3; their leading axes broadcast against each other.
    basis
        The tangent bases ``(..., d, d-1)`` of the expected bearings, for a caller that has them; by default those of
        :func:`tangent_basis`.

    Returns
    -------
    Angles ``(..., d-1)`` in radians along the columns of the basis; not a number where a bearing is not.
    """
    e, m = np.asarray(expected, dtype=float), np.asarray(measured, dtype=float)
    axes = tangent_basis(e) if basis is None else np.asarray(basis, dtype=float)
    across = np.einsum("...ij,...i->...j", axes, m)
    cosine = np.einsum("...i,...i->...", e, m)
    if across.shape[-1] == 1:
        return np.asarray(np.arctan2(across, cosine[..., None]))
    sine = np.hypot(across[..., 0], across[..., 1])
    parallel = sine == 0.0
    angle = np.arctan2(sine, cosine)
    turned = across * np.where(parallel, 1.0, angle / np.where(parallel, 1.0, sine))[..., None]
    turned[..., 0] = np.where(parallel & (cosine < 0.0), np.pi, turned[..., 0])
    return np.asarray(turned)


def cumulative_bearing_matrix(bearings: ArrayLike) -> Array:
    """P = Σ (I - λ λᵀ) over the bearings ``(K, d)`` of a window (``eq20``); returns ``(d, d)``."""
    b = np.atleast_2d(np.asarray(bearings, dtype=float))
    return np.asarray(len(b) * np.eye(b.shape[1]) - b.T @ b)


def condition_number(matrix: ArrayLike) -> float:
    """Ratio of the largest to the smallest eigenvalue of a symmetric positive semidefinite matrix ``(d, d)``.

    Returns infinity where the matrix is singular to working precision, as it is for a single bearing in 2D.
    """
    return float(condition_numbers(matrix))


def condition_numbers(matrices: ArrayLike) -> Array:
    """:func:`condition_number` of many matrices ``(..., d, d)``, one number ``(...)`` for each."""
    values = np.linalg.eigvalsh(np.asarray(matrices, dtype=float))
    least, largest = values[..., 0], values[..., -1]
    singular = least <= largest * values.shape[-1] * np.finfo(float).eps
    return np.asarray(np.where(singular, np.inf, largest / np.where(singular, 1.0, least)))


@dataclass(frozen=True)
class DesiredBearing:
    """The optimal desired bearing λ*(t), a point that runs around a circle (``op_bearings``).

    Parameters
    ----------
    dimension
        d = 2 (circle in the plane) or 3 (circle of radius √6/3 lifted to √3/3 along ``axis``).
    rate
        ω in rad/s; the paper's is 2π/(T m).
    axis
        λ_0 of the paper, the preset direction in 3D ``(3,)``; normalised here. Ignored in 2D.
    phase
        Angle on the circle at t = 0 in radians; zero in the paper.
    reverse
        Seconds after which the turn changes its sense, again and again; infinity, the paper's, for never. A steady
        circle does not tell the target's speed from its range, and a reversal does.
    leg_start
        A time in seconds at which the turn begins to go in the sense of ``rate``, for ``reverse`` seconds.

    Raises
    ------
    ValueError
        If the dimension is neither 2 nor 3, the axis is zero, ``reverse`` is not above 0, or another number is not
        finite.
    """

    dimension: int
    rate: float
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    phase: float = 0.0
    reverse: float = math.inf
    leg_start: float = 0.0

    def __post_init__(self) -> None:
        if self.dimension not in (2, 3):
            raise ValueError(f"dimension must be 2 or 3, found {self.dimension}")
        vector("rate, phase and leg_start", (self.rate, self.phase, self.leg_start), 3)
        if not self.reverse > 0.0:
            raise ValueError(f"reverse: found {self.reverse}; allowed: a number above 0")
        if self.dimension == 3 and not np.any(vector("axis", self.axis, 3)):
            raise ValueError(f"axis must not be zero, found {self.axis}")

    def __call__(self, times: ArrayLike) -> Array:
        """Desired bearings ``(..., d)`` at the times ``(...)`` in seconds."""
        return self.direction(self.phase + self.rate * self.turned(times))

    def direction(self, angle: ArrayLike) -> Array:
        """Bearings ``(..., d)`` at angles ``(...)`` on the circle, in radians; to the last bit those of the C."""
        angle = np.asarray(angle, dtype=float)
        # numpy's sine is not the C library's on every processor
        circle = np.array([(math.cos(one), math.sin(one)) for one in angle.ravel().tolist()]).reshape(*angle.shape, 2)
        if self.dimension == 2:
            return circle
        axis, basis = self._axis_and_basis
        level = circle[..., :1] * basis[:, 0] + circle[..., 1:] * basis[:, 1]
        return np.asarray(math.sqrt(3.0) / 3.0 * axis + math.sqrt(6.0) / 3.0 * level)

    @cached_property
    def _axis_and_basis(self) -> tuple[Array, Array]:
        """The axis in space, normalised, and the basis of the plane across it; every piece of a plan asks for them."""
        axis = np.asarray(self.axis, dtype=float) / np.linalg.norm(self.axis)
        return axis, tangent_basis(axis)

    def turned(self, times: ArrayLike) -> Array:
        """Seconds of turning at the times ``(...)`` in seconds: those forth, from zero, less those back.

        Without reversals that is the time itself.
        """
        t = np.asarray(times, dtype=float)
        if math.isinf(self.reverse):
            return t
        into = np.mod(t - self.leg_start, 2.0 * self.reverse)
        return np.minimum(into, 2.0 * self.reverse - into)

    def beginning_at(self, time: float, bearing: ArrayLike) -> DesiredBearing:
        """The same turn, shifted so that at ``time`` (s) it is as near as it gets to a bearing ``(d,)``."""
        return replace(self, phase=float(self.angle(bearing) - self.rate * self.turned(time)))

    def reversing_from(self, time: float, line: ArrayLike, velocity: ArrayLike) -> DesiredBearing:
        """The same turn with a leg that begins at ``time`` (s), in the sense in which the line of sight turns already.

        Parameters
        ----------
        time
            In seconds.
        line
            From the vehicle to the target, ``(d,)`` in metres.
        velocity
            Of its end relative to its beginning, ``(d,)`` in m/s.
        """
        if math.isinf(self.reverse):
            return self
        across, along = self.in_plane(velocity), self.in_plane(line)
        agrees = self.rate * (along[0] * across[1] - along[1] * across[0]) >= 0.0
        begins = replace(self, leg_start=time if agrees else time - self.reverse)
        return begins.beginning_at(time, line)

    def in_plane(self, direction: ArrayLike) -> Array:
        """Components ``(2,)`` of a direction ``(d,)`` in the plane of the circle."""
        b = np.asarray(direction, dtype=float)
        if self.dimension == 3:
            b = np.array([inner(column, b) for column in self._axis_and_basis[1].T])
        return b

    def angle(self, bearing: ArrayLike) -> float:
        """On the circle, in radians, of the point nearest to a bearing ``(d,)``."""
        x, y = self.in_plane(bearing).tolist()
        return math.atan2(y, x)
