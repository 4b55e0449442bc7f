"""Plans within the thrust by a few projections, without any solver: to slow down, or to mend a first piece."""

from __future__ import annotations

from math import factorial

import casadi as ca
import numpy as np

from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.models.vehicles import acceleration
from gbt_ocp.ocp.problem_data import ProblemData
from gbt_ocp.ocp.trajectory import FlatPoint, FlatTrajectory, flat_point, led_back, propagate, settling
from gbt_ocp.typing import Array

BRAKING_POINTS = 11
"""Points of a piece at which its thrust is held within the limits, both ends included."""

ROUNDS = 20
"""Rounds of projections over these points, at most."""

PROGRESS = 1.0e-4
"""By which a round has to be better, in units of the limits: rounding must not decide what follows."""

INSIDE = 0.995
"""Share of the limits that a projection leads to: between the points thrust may bulge a little."""


MENDABLE = 0.1
"""Excess, in units of the limits, up to which a piece is mended: beyond, little of its plan would be left."""


class BrakingPlanner:
    """Slows down as hard as the thrust allows, piece by piece; other limits are not looked at.

    A piece starts from the acceleration that stops within it, or within as many pieces as derivatives are inherited
    (:func:`~gbt_ocp.ocp.trajectory.settling`). Wherever the thrust of that exceeds its limits, the
    acceleration is moved by what the excess of thrust accelerates, point by point along the piece and again until no
    point exceeds any more: cyclic projections onto sets that are nearly convex, since thrust is affine in the
    acceleration. Where that does not end within :data:`ROUNDS`, drifting (thrust zero at the beginning) is the second
    start, and the piece that breaks the limits less is taken, of two that keep them the one that ends slower. The
    generated C has the same algorithm (``gbt_braking.c``).

    Parameters
    ----------
    problem
        Whose vehicle and pieces.
    """

    def __init__(self, problem: ProblemData) -> None:
        self._problem = problem
        self._range = ThrustRange.of(problem.vehicle)
        vehicle, size = problem.vehicle, problem.vehicle.flat_dimension
        z, dz, ddz = (ca.SX.sym(name, size) for name in ("z", "dz", "ddz"))
        thrust = ca.SX.sym("thrust", len(vehicle.thrust_max))
        self._inputs = ca.Function("inputs", [z, dz, ddz], [vehicle.inputs(z, dz, ddz)])
        self._acceleration = ca.Function("acceleration", [z, dz, thrust], [acceleration(vehicle, z, dz, thrust)])

    def __call__(self, start: Array) -> FlatTrajectory:
        """A braking trajectory from the start ``(k+1, n)``."""
        problem = self._problem
        top: list[Array] = []
        knot = np.asarray(start, dtype=float)
        for _ in range(problem.pieces):
            top.append(self._piece(knot))
            knot = FlatTrajectory(problem.period, knot, top[-1][None]).knots[1]
        return FlatTrajectory(problem.period, np.asarray(start, dtype=float), np.array(top))

    def mended(self, start: Array, top: Array) -> Array | None:
        """A plan whose first piece keeps within the thrust, the rest led back to itself; ``None`` if there is none.

        Nor is there one where the piece exceeds the thrust by more than :data:`MENDABLE`.

        Parameters
        ----------
        start
            Derivatives of the flat output at the start ``(k+1, n)``.
        top
            What is free in the pieces ``(p, freedoms)``.
        """
        period, changed, knot = self._problem.period, top.copy(), np.asarray(start, dtype=float)
        if not self._worst(knot, top[0]) <= MENDABLE:
            return None
        changed[0], broken = self._projected(knot, top[0])
        if broken > 0.0:
            return None
        change = FlatTrajectory(period, np.zeros_like(start), (changed[0] - top[0])[None])
        changed[1:] = led_back(change.knots[1], top[1:], period)
        return changed

    def _piece(self, knot: Array) -> Array:
        """What is free in the piece after a knot ``(freedoms,)``; derivatives above the lowest brake nothing: zero."""
        problem, n = self._problem, knot.shape[1]
        best, best_key = np.zeros(problem.freedoms), (np.inf, np.inf)
        drift = np.asarray(self._acceleration(knot[0], knot[1], np.zeros(len(problem.vehicle.thrust_max)))).ravel()
        for first, aim in ((1, np.zeros(n)), (2, np.where(np.isfinite(drift), drift, 0.0))):
            lowest = settling(knot, first, aim, problem.period)
            candidate, broken = self._projected(knot, np.concatenate([lowest, np.zeros(problem.freedoms - n)]))
            end = FlatTrajectory(problem.period, knot, candidate[None]).knots[1, 1]
            key = (broken, float(np.sum((end / problem.vehicle.acceleration_scale) ** 2)))
            if key < best_key:
                best, best_key = candidate, key
            if broken <= 0.0:
                break
        return best

    def _projected(self, knot: Array, free: Array) -> tuple[Array, float]:
        """The best of a few rounds from what is free in a piece, and how far its thrust exceeds the limits."""
        best, least, share = free, np.inf, 1.0
        for _ in range(ROUNDS):
            excess = self._worst(knot, free)
            if excess <= 0.0 or excess < least - PROGRESS:
                best, least = free.copy(), excess
            else:
                share *= 0.5
            if not excess > 0.0:
                break
            for k in self._points:
                if self._excess(knot, free, k) > 0.0:
                    free = free + share * self._move(knot, free, k)
        return best, least

    @property
    def _points(self) -> range:
        """Numbers of the points at which the lowest free derivative moves the thrust."""
        return range(0 if self._problem.joined == 2 else 1, BRAKING_POINTS)

    def _point(self, knot: Array, free: Array, k: int) -> FlatPoint:
        time = self._problem.period * k / (BRAKING_POINTS - 1)
        return flat_point(propagate(list(knot), list(free.reshape(-1, knot.shape[1])), time))

    def _worst(self, knot: Array, free: Array) -> float:
        """The largest excess of all points."""
        return max(self._excess(knot, free, k) for k in self._points)

    def _excess(self, knot: Array, free: Array, k: int) -> float:
        """How far the thrust exceeds its limits at a point, at least 0; infinite where it is not a number."""
        thrust = np.asarray(self._inputs(*self._point(knot, free, k))).ravel()
        excess = float(np.max(self._range.used(thrust))) - 1.0
        return np.inf if np.isnan(excess) else max(excess, 0.0)

    def _move(self, knot: Array, free: Array, k: int) -> Array:
        """What brings the thrust at a point within its limits."""
        problem, n, above = self._problem, knot.shape[1], self._problem.joined - 2
        point = self._point(knot, free, k)
        within = self._range.clip(np.asarray(self._inputs(*point)).ravel(), INSIDE)
        power = (problem.period * k / (BRAKING_POINTS - 1)) ** above / factorial(above)
        move = np.zeros(len(free))
        move[:n] = (np.asarray(self._acceleration(point.z, point.dz, within)).ravel() - point.ddz) / power
        return move if np.all(np.isfinite(move)) else np.zeros(len(free))
