"""From the data of a solve to the numbers of the nonlinear program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.ocp.problem_data import PosedProblem
from gbt_ocp.ocp.term_checks import bound_numbers
from gbt_ocp.ocp.terms import AnyObjective, MovingConstraint
from gbt_ocp.ocp.transcription import limit_size
from gbt_ocp.typing import Array


def stack_parameters(shapes: Mapping[str, tuple[int, int]], bound: Mapping[str, Array], count: int) -> Array:
    """Numbers for parameters of these shapes at ``count`` times, one time a column ``(size, count)``."""
    columns = [np.asarray(bound[name], dtype=float).transpose(0, 2, 1).reshape(count, -1) for name in shapes]
    return np.hstack([np.zeros((count, 0)), *columns]).T


class Binding:
    """Turns the start and the data of a solve into the parameter vector of a :class:`Transcription`."""

    def __init__(self, problem: PosedProblem) -> None:
        self.problem = problem
        # isinstance with a protocol takes as long as a short plan, so it is asked once
        self._moving = [c if isinstance(c, MovingConstraint) else None for c in problem.constraints]
        self._moves = any(limit_size(constraint) for constraint in problem.constraints)

    def objective_parameters(self, data: Mapping[str, Any]) -> list[Array]:
        """Parameters of each objective, one endpoint a column ``(size, p)``.

        Raises
        ------
        ValueError
            If something is missing, of a wrong shape, or not finite; one line that names the class.
        """
        return [self._bound(term, self.problem.pieces, data) for term in self.problem.objectives]

    def limit_parameters(self, data: Mapping[str, Any]) -> list[Array]:
        """Parameters of each constraint, one knot a column ``(size, p+1)``; an empty list if none has any.

        Raises
        ------
        ValueError
            As :meth:`objective_parameters`.
        """
        if not self._moves:
            return []
        knots = self.problem.pieces + 1
        return [np.zeros((0, knots)) if one is None else self._bound(one, knots, data) for one in self._moving]

    def _bound(self, term: AnyObjective | MovingConstraint, count: int, data: Mapping[str, Any]) -> Array:
        numbers = bound_numbers(term, self.problem.pieces, count, data)
        return stack_parameters(term.shapes, numbers, count)

    def vector(
        self,
        start: Array,
        objectives: Sequence[Array],
        penalties: Sequence[tuple[float, float]],
        tightening: ArrayLike,
        limits: Sequence[Array] = (),
    ) -> Array:
        """The parameter vector, for these (ϖ, w_p) of each penalty and a tightening of each constraint, or of all."""
        inside = np.broadcast_to(tightening, len(self.problem.constraints))[len(self.problem.hard) :]
        parts = [start.ravel(), *(values.T.ravel() for values in (*objectives, *limits))]
        parts += [np.array([*pair, one]) for pair, one in zip(penalties, inside, strict=True)]
        return np.concatenate(parts)
