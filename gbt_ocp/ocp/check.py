"""The true limits of a finished trajectory on a fine grid."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from gbt_ocp.ocp.problem_data import ProblemData
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.ocp.transcription import between_knots, constraint_function, first_free_node
from gbt_ocp.typing import Array

FINE_POINTS = 101
"""Grid points a piece at which a finished trajectory is held against its limits, both ends included."""


class LimitCheck:
    """Evaluates the true limits of a trajectory on a fine grid.

    What is given at the start, and no plan can change, is left out, and so is what is not judged
    (:attr:`~gbt_ocp.ocp.problem_data.ProblemData.judged`).

    Parameters
    ----------
    points
        Grid points a piece, both ends included.
    """

    def __init__(self, problem: ProblemData, points: int = FINE_POINTS) -> None:
        self.points = points
        judged = [number for number, counts in enumerate(problem.judged) if counts]
        self._numbers = judged
        self._constraints = [problem.constraints[number] for number in judged]
        self._given = [first_free_node(problem, c) == 1 for c in self._constraints]
        self._functions = [constraint_function(problem, c) for c in self._constraints]
        self._mapped: dict[int, list[ca.Function]] = {}

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
        pieces = trajectory.pieces
        if pieces not in self._mapped:
            self._mapped[pieces] = [function.map(pieces * self.points) for function in self._functions]
        worst = np.full((pieces, self.points), -np.inf)
        point = trajectory.sample(self.points)
        columns = [values.reshape(-1, values.shape[-1]).T for values in point]
        shares = np.linspace(0.0, 1.0, self.points)
        for number, constraint, given, function in zip(
            self._numbers, self._constraints, self._given, self._mapped[pieces], strict=True
        ):
            moving = between_knots(limits[number][:, : pieces + 1], shares) if limits else []
            values = np.asarray(function(*columns, *moving))
            over = np.maximum(values - constraint.upper[:, None], constraint.lower[:, None] - values)
            over = (over / constraint.scale[:, None]).max(axis=0).reshape(pieces, self.points)
            if given:
                over[0, 0] = -np.inf
            worst = np.maximum(worst, over)
        return worst
