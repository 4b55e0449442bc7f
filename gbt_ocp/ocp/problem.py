"""The trajectory problem: an immutable description, built up by verbs that name how a constraint is treated.

problem = TrajectoryProblem(vehicle, pieces=5, period=0.1)
problem = problem.maximize(BearingSimilarity(2))
problem = problem.subject_to_penalty(ThrustLimit(vehicle, gamma=0.98), weight=1000.0, width=0.01, nodes=20)
planner = problem.compile()
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gbt_ocp.models.model_checks import check_flatness
from gbt_ocp.ocp.planner import Planner
from gbt_ocp.ocp.problem_data import ProblemData
from gbt_ocp.ocp.verbs import PosingVerbs


@dataclass(frozen=True)
class TrajectoryProblem(PosingVerbs, ProblemData):
    """Maximise a sum over the endpoints of a flat trajectory, under path constraints (``eq33``, ``eq36``).

    Parameters
    ----------
    vehicle
        Gives the flatness map.
    pieces
        p, the number of pieces.
    period
        T in seconds, the length of a piece.
    degree
        L >= 2, the degree of the polynomials.
    continuity
        k, from 1 to L-1: how many derivatives are continuous from piece to piece. By default L-1, as in the paper,
        which leaves one vector of freedom a piece, its endpoint; with less, a piece has L-k of them, and its
        acceleration may turn with the vehicle where k = 1 < L-1.

    Raises
    ------
    ValueError
        If a size is out of range, or the vehicle lacks something.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        check_flatness(self.vehicle)

    def compile(self, solver: str = "auto", options: Mapping[str, Any] | None = None) -> Planner:
        """Make the planner of this problem; the same as ``Planner(problem, solver, options)``.

        Raises
        ------
        ValueError
            As :class:`~gbt_ocp.ocp.planner.Planner`.
        """
        return Planner(self, solver, options)
