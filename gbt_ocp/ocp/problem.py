"""The trajectory problem: an immutable description, built up by verbs that name how a constraint is treated.

problem = TrajectoryProblem(vehicle, pieces=5, period=0.1)
problem = problem.maximize(BearingSimilarity(2))
problem = problem.subject_to_penalty(ThrustLimit(vehicle, gamma=0.98), weight=1000.0, width=0.01, nodes=20)
planner = problem.compile()
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from gbt_ocp.models.model_checks import check_flatness
from gbt_ocp.models.sizes import at_least, positive
from gbt_ocp.ocp.planner import Planner
from gbt_ocp.ocp.problem_data import HardLimit, PenaltyLimit, ProblemData
from gbt_ocp.ocp.term_checks import check_constraint, check_objective
from gbt_ocp.ocp.terms import Constraint, JointObjective, Objective


@dataclass(frozen=True)
class TrajectoryProblem(ProblemData):
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

    def maximize(self, objective: Objective | JointObjective) -> TrajectoryProblem:
        """Add a term to the objective.

        Raises
        ------
        gbt_ocp.models.contracts.ContractError
            If the term lacks something or gives something of a wrong size; it is evaluated once.
        """
        check_objective(objective, self.vehicle, self.pieces)
        return replace(self, objectives=(*self.objectives, objective))

    def subject_to(self, constraint: Constraint, *, nodes: int = 4) -> TrajectoryProblem:
        """Impose a constraint exactly, at ``nodes`` intervals a piece.

        Raises
        ------
        gbt_ocp.models.contracts.ContractError
            If the constraint lacks something, or its bounds do not fit what it gives; it is evaluated once.
        ValueError
            If ``nodes`` is not a whole number from 1 on.
        """
        at_least("nodes", nodes, 1)
        check_constraint(constraint, self.vehicle)
        return replace(self, hard=(*self.hard, HardLimit(constraint, nodes)))

    def subject_to_penalty(
        self, constraint: Constraint, *, weight: float = 1000.0, width: float = 0.01, nodes: int = 20
    ) -> TrajectoryProblem:
        """Penalise the violation of a constraint, integrated over ``nodes`` intervals a piece.

        Raises
        ------
        gbt_ocp.models.contracts.ContractError
            As :meth:`subject_to`.
        ValueError
            As :meth:`subject_to`, or if ``weight`` (w_p) or ``width`` (ϖ) is not above 0.
        """
        at_least("nodes", nodes, 1)
        positive("weight", weight)
        positive("width", width)
        check_constraint(constraint, self.vehicle)
        return replace(self, penalties=(*self.penalties, PenaltyLimit(constraint, nodes, weight, width)))

    def compile(self, solver: str = "auto", options: Mapping[str, Any] | None = None) -> Planner:
        """Make the planner of this problem; the same as ``Planner(problem, solver, options)``.

        Raises
        ------
        ValueError
            As :class:`~gbt_ocp.ocp.planner.Planner`.
        """
        return Planner(self, solver, options)
