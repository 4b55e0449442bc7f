"""rockit: multiple shooting as in its model predictive control example, one Runge-Kutta step a period."""

from __future__ import annotations

from typing import Any

import numpy as np
from rockit import MultipleShooting, Ocp

from peers.statement import FLAT_OPTIONS, Answer, Statement


class RockitPeer:
    """The problem in rockit."""

    def __init__(self, statement: Statement) -> None:
        p = statement.pieces
        rates, cost = statement.functions()
        self._ocp = ocp = Ocp(T=p * statement.period)
        self._x, self._u = ocp.state(statement.states), ocp.control(statement.inputs)
        self._start = ocp.parameter(statement.states)
        self._given = ocp.parameter(statement.parameters, grid="control", include_last=True)
        ocp.set_der(self._x, rates(self._x, self._u))
        # the cost of the start is a constant
        ocp.add_objective(ocp.sum(cost(self._x, self._given), include_last=True))
        ocp.subject_to(-statement.limit <= (self._u <= statement.limit), include_last=False)
        ocp.subject_to(ocp.at_t0(self._x) == self._start)
        ocp.solver(
            "ipopt",
            FLAT_OPTIONS,
        )
        ocp.method(MultipleShooting(N=p, M=1, intg="rk"))

    def solve(self, start: Any, parameters: Any, states: Any, held: Any) -> Answer:
        """See :class:`peers.statement.Peer`."""
        ocp = self._ocp
        ocp.set_value(self._start, start)
        ocp.set_value(self._given, np.column_stack([parameters[:, 0], parameters]))
        ocp.set_initial(self._x, np.column_stack([start, states]))
        ocp.set_initial(self._u, held)
        try:
            found = ocp.solve()
        except RuntimeError:  # not solved
            found = ocp.non_converged_solution
        inputs = found.sample(self._u, grid="control")[1][:-1]  # the last is shown twice
        return Answer.of(inputs, found.stats)


build = RockitPeer
