"""The true limits of a finished trajectory on a fine grid."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from gbt_ocp.ocp.problem_data import HardLimit, PenaltyLimit, ProblemData
from gbt_ocp.ocp.thrust_limits import ThrustChange
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.ocp.transcription import between_knots, constraint_function, first_free_node, limit_size
from gbt_ocp.typing import Array

FINE_POINTS = 101
"""Grid points a piece at which a finished trajectory is held against its limits, both ends included."""


class LimitCheck:
    """Evaluates the true limits of a trajectory on a fine grid.

    What is given at the start, and no plan can change, is left out, and so is from :meth:`__call__` and
    :meth:`profile` what is not judged (:attr:`~gbt_ocp.ocp.problem_data.ProblemData.judged`).

    Parameters
    ----------
    points
        Grid points a piece, both ends included.
    """

    def __init__(self, problem: ProblemData, points: int = FINE_POINTS) -> None:
        self.points = points
        self._constraints, self._joined = problem.constraints, problem.joined
        self._judged = [number for number, counts in enumerate(problem.judged) if counts]
        imposed: list[HardLimit | PenaltyLimit] = [*problem.hard, *problem.penalties]
        self._nodes = [limit.nodes for limit in imposed]
        self._given = [first_free_node(problem, c) == 1 for c in self._constraints]
        self._functions = [constraint_function(problem, c) for c in self._constraints]
        self._mapped: dict[tuple[int, int], ca.Function] = {}

    def __call__(self, trajectory: FlatTrajectory, limits: Sequence[Array] = ()) -> Array:
        """Largest violation of each piece ``(p,)`` in units of the limits.

        Negative inside them, ``-inf`` without any; the trajectory may have any number of pieces.

        Parameters
        ----------
        trajectory
            What to check.
        limits
            Parameters of the constraints from the first knot of the trajectory on; see
            :meth:`Binding.limit_parameters`. Needed where constraints have any.
        """
        return np.asarray(self.profile(trajectory, limits).max(axis=1))

    def profile(self, trajectory: FlatTrajectory, limits: Sequence[Array] = ()) -> Array:
        """Largest violation at each point of the grid ``(p, points)``, likewise."""
        worst = np.full((trajectory.pieces, self.points), -np.inf)
        for number in self._judged:
            worst = np.maximum(worst, self._excess(number, trajectory, limits, self.points))
        return worst

    def survey(self, trajectory: FlatTrajectory, limits: Sequence[Array] = (), *, nodes: bool = False) -> Array:
        """Largest violation of every constraint in each piece ``(count, p)``, judged or not; infinite for NaN.

        ``nodes``: at the constraint's own nodes instead of the grid.
        """
        rows = [
            self._excess(number, trajectory, limits, self._nodes[number] + 1 if nodes else self.points).max(axis=1)
            for number in range(len(self._constraints))
        ]
        found = np.array(rows).reshape(len(rows), trajectory.pieces)
        return np.where(np.isnan(found), np.inf, found)

    def at_start(self, start: Array, limits: Sequence[Array] = ()) -> Array:
        """How far each constraint is broken at the start, where no plan can change it, at least 0 ``(count,)``."""
        found = np.zeros(len(self._constraints))
        start = start[: self._joined]
        point = [start[order] if order < len(start) else np.zeros(start.shape[1]) for order in range(3)]
        for number, (constraint, function) in enumerate(zip(self._constraints, self._functions, strict=True)):
            if self._given[number]:
                moving = [limits[number][:, 0]] if limit_size(constraint) else []
                value = np.asarray(function(*point, *moving)).ravel()
                over = np.maximum(value - constraint.upper, constraint.lower - value) / constraint.scale
                found[number] = max(0.0, float(over.max()))
        return found

    def _excess(self, number: int, trajectory: FlatTrajectory, limits: Sequence[Array], points: int) -> Array:
        """Violation of one constraint on an even grid of every piece ``(p, points)``."""
        constraint, pieces = self._constraints[number], trajectory.pieces
        if isinstance(constraint, ThrustChange):  # weighed, not limited
            return np.full((pieces, points), -np.inf)
        key = number, pieces * points
        if key not in self._mapped:
            self._mapped[key] = self._functions[number].map(pieces * points)
        columns = [values.reshape(-1, values.shape[-1]).T for values in trajectory.sample(points)]
        shares = np.linspace(0.0, 1.0, points)
        moving = between_knots(limits[number][:, : pieces + 1], shares) if limits else []
        values = np.asarray(self._mapped[key](*columns, *moving))
        over = np.maximum(values - constraint.upper[:, None], constraint.lower[:, None] - values)
        excess = np.asarray((over / constraint.scale[:, None]).max(axis=0).reshape(pieces, points))
        if self._given[number]:
            excess[0, 0] = -np.inf
        return excess
