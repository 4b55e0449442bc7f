"""The last resort: a plan that slows the vehicle down within its limits, without any solver."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import casadi as ca
import numpy as np

from gbt_ocp.models.vehicles import drift
from gbt_ocp.ocp.problem_data import ProblemData
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.ocp.transcription import input_scale
from gbt_ocp.typing import Array

SHARES = (0.0, *(0.5**k for k in range(10, -1, -1)))
"""How far from drifting to stopping: by halves, because a stop may take a thousand times the thrust there is."""

AT_REST = 1e-16
"""Sum of squares of speeds, over their scales, that counts as none."""

ROUNDS = 12
"""Rounds of the pattern search around the best of the family."""


class Check(Protocol):
    """Finds how far a trajectory breaks the limits; see :class:`gbt_ocp.ocp.check.LimitCheck`."""

    def __call__(self, trajectory: FlatTrajectory, limits: Sequence[Array] = ()) -> Array:
        """Largest violation of each piece ``(p,)``."""


class BrakingPlanner:
    """Slows down as hard as the limits allow, piece by piece.

    Each piece starts from a family of accelerations that runs from drifting (thrust zero at its beginning: always
    within thrust limits there) to stopping within the piece, and improves the best of them by a pattern search: fast
    turns couple the axes, and then no mixture of drifting and stopping may keep the limits. Better is what breaks the
    limits less on the fine grid, and among those that keep them what ends slower.

    Parameters
    ----------
    problem
        Whose limits and pieces.
    check
        Of all limits.
    certain
        Of those that come first, none of which may be given up for the others; it is asked without parameters.
    """

    def __init__(self, problem: ProblemData, check: Check, certain: Check | None = None) -> None:
        self._problem = problem
        self._check = check
        self._certain = certain
        size = problem.vehicle.flat_dimension
        z, dz = ca.SX.sym("z", size), ca.SX.sym("dz", size)
        self._drift = ca.Function("drift", [z, dz], [drift(problem.vehicle, z, dz)])

    def __call__(self, start: Array, limits: Sequence[Array] = ()) -> FlatTrajectory:
        """A braking trajectory from the start ``(k+1, n)``, for these parameters of the constraints at the knots."""
        problem = self._problem
        top: list[Array] = []
        for piece in range(problem.pieces):
            so_far = FlatTrajectory(problem.period, start, np.array(top).reshape(-1, problem.freedoms))
            top.append(self._piece(so_far.knots[-1], [values[:, piece:] for values in limits]))
        return FlatTrajectory(problem.period, start, np.array(top))

    def _piece(self, knot: Array, limits: Sequence[Array]) -> Array:
        problem, n = self._problem, knot.shape[1]
        drift = np.asarray(self._drift(knot[0], knot[1])).ravel()
        stop = -knot[1] / problem.period
        if problem.joined > 2:
            # The acceleration is inherited: aim the one at the end of the piece instead.
            lag = problem.period ** (problem.joined - 2)
            drift, stop = (drift - knot[2]) / lag, (stop - knot[2]) / lag
        drift = np.where(np.isfinite(drift), drift, 0.0)
        best, best_key = drift, (np.inf, np.inf, np.inf)

        def whole(candidate: Array) -> Array:
            """With the derivatives of higher order, which brake nothing: zero."""
            return np.concatenate([candidate, np.zeros(problem.freedoms - n)])

        def improve(candidate: Array) -> bool:
            nonlocal best, best_key
            trial = FlatTrajectory(problem.period, knot, whole(candidate)[None])
            broken = max(float(self._check(trial, limits)[0]), 0.0)
            first = 0.0 if self._certain is None else max(float(self._certain(trial)[0]), 0.0)
            key = (first, broken, float(np.sum((trial.knots[1, 1] / problem.vehicle.acceleration_scale) ** 2)))
            if not key < best_key:
                return False
            best, best_key = candidate, key
            return True

        improve(stop)
        if best_key[:2] == (0.0, 0.0) and best_key[2] < AT_REST:  # nothing ends slower
            return whole(best)
        for share in SHARES:
            # Yaw brakes by its own share: a fast turn and a fast drift need different ones.
            for last_share in (share, 0.0, 0.5, 1.0):
                mix = np.full(len(drift), share)
                mix[-1] = last_share
                improve(drift + mix * (stop - drift))
        reach = 0.25 * input_scale(problem)[:n]
        for _ in range(ROUNDS):
            moved = False
            for axis in range(len(drift)):
                for sign in (1.0, -1.0):
                    step = np.zeros(len(drift))
                    step[axis] = sign * reach[axis]
                    moved = improve(best + step) or moved
            if not moved:
                reach = 0.5 * reach
        return whole(best)
