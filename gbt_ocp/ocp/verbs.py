"""The verbs that build a problem up: each says how a constraint is treated."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from gbt_ocp.models.sizes import at_least, positive
from gbt_ocp.ocp.problem_data import HardLimit, PenaltyLimit, PosedProblem
from gbt_ocp.ocp.term_checks import check_constraint, check_objective
from gbt_ocp.ocp.terms import AnyObjective, Constraint
from gbt_ocp.ocp.thrust_limits import OfChanges, OfInputs

if TYPE_CHECKING:
    from typing import Self


class PosingVerbs(PosedProblem):
    """What a problem of either form is built up with; each verb gives a new problem."""

    def maximize(self, objective: AnyObjective) -> Self:
        """Add a term to the objective.

        Raises
        ------
        gbt_ocp.models.contracts.ContractError
            If the term lacks something or gives something of a wrong size; it is evaluated once.
        """
        check_objective(objective, self.vehicle, self.pieces)
        return replace(self, objectives=(*self.objectives, objective))

    def subject_to(self, constraint: Constraint, *, nodes: int = 4) -> Self:
        """Impose a constraint exactly, at ``nodes`` intervals a piece.

        Raises
        ------
        gbt_ocp.models.contracts.ContractError
            If the constraint lacks something, or its bounds do not fit what it gives; it is evaluated once.
        ValueError
            If ``nodes`` is not a whole number from 1 on.
        """
        at_least("nodes", nodes, 1)
        self._check(constraint)
        return replace(self, hard=(*self.hard, HardLimit(constraint, nodes)))

    def subject_to_penalty(
        self, constraint: Constraint, *, weight: float = 1000.0, width: float = 0.01, nodes: int = 20
    ) -> Self:
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
        self._check(constraint)
        return replace(self, penalties=(*self.penalties, PenaltyLimit(constraint, nodes, weight, width)))

    def _check(self, constraint: Constraint) -> None:
        """Evaluate a constraint once; of thrust, a vehicle that is not flat knows no more than the limits."""
        if isinstance(constraint, OfChanges):
            self.check_changes(constraint)
        elif not isinstance(constraint, OfInputs) or hasattr(self.vehicle, "inputs"):
            check_constraint(constraint, self.vehicle)
