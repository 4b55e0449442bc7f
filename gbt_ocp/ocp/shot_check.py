"""The true limits of a finished trajectory by integration, on a fine grid or where they are worst."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gbt_ocp.ocp.check import FINE_POINTS
from gbt_ocp.ocp.problem_data import HardLimit, PenaltyLimit, ShootingData
from gbt_ocp.ocp.shot import Shots, ShotTrajectory
from gbt_ocp.typing import Array


class ShotCheck:
    """The :class:`~gbt_ocp.ocp.check.LimitCheck` of trajectories by integration.

    A limit on the inputs is looked at where it is worst, at the ends of the periods.

    Parameters
    ----------
    shots
        Integrates the trajectories.
    points
        Grid points a piece, both ends included.
    """

    def __init__(self, shots: Shots, points: int = FINE_POINTS) -> None:
        problem: ShootingData = shots.problem
        imposed: list[HardLimit | PenaltyLimit] = [*problem.hard, *problem.penalties]
        self.points, self._shots, self._judged = points, shots, problem.judged
        self._constraints = problem.constraints
        self._grids = [shots.form.grid(limit) for limit in imposed]

    def __call__(self, trajectory: ShotTrajectory, limits: Sequence[Array] = ()) -> Array:
        """Largest violation of the judged limits in each piece ``(p,)`` in their units, ``-inf`` without any."""
        rows = [row for row, judged in zip(self.survey(trajectory, limits), self._judged, strict=True) if judged]
        return np.asarray(np.max(np.array(rows).reshape(len(rows), trajectory.pieces), axis=0, initial=-np.inf))

    def survey(self, trajectory: ShotTrajectory, limits: Sequence[Array] = (), *, nodes: bool = False) -> Array:
        """Largest violation of every constraint in each piece ``(count, p)``, judged or not; infinite for NaN.

        ``nodes``: at the constraint's own nodes instead of the grid.
        """
        rows = []
        for number, grid in enumerate(self._grids):
            shares = np.linspace(0.0, 1.0, self.points)
            if nodes or grid.steady:
                shares = np.arange(grid.first if grid.steady else 0, grid.intervals + 1) / grid.intervals
            excess = self._excess(number, trajectory.numbers, shares, limits)
            if grid.given:
                excess[0, shares == 0.0] = -np.inf
            rows.append(excess.max(axis=1))
        found = np.array(rows).reshape(len(rows), trajectory.pieces)
        return np.where(np.isnan(found), np.inf, found)

    def at_start(self, start: Array, limits: Sequence[Array] = ()) -> Array:
        """How far each constraint is broken at the start, where no plan can change it, at least 0 ``(count,)``."""
        found = np.zeros(len(self._constraints))
        piece = np.concatenate([start, np.zeros(self._shots.form.held)])[None]
        for number, grid in enumerate(self._grids):
            if grid.given:
                found[number] = max(0.0, float(self._excess(number, piece, np.zeros(1), limits).max()))
        return found

    def _excess(self, number: int, pieces: Array, shares: Array, limits: Sequence[Array]) -> Array:
        """Violation of one constraint after these shares of every piece ``(p, shares)``."""
        constraint, count = self._constraints[number], len(pieces)
        moving = limits[number][:, : count + 1] if limits else np.zeros((0, count + 1))
        values = self._shots.limit(number, pieces, shares, moving)
        over = np.maximum(values - constraint.upper, constraint.lower - values) / constraint.scale
        return np.asarray(over.max(axis=-1))
