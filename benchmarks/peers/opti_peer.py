"""CasADi's Opti: multiple shooting as in its example ``race_car.py``, one Runge-Kutta step a period."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import casadi as ca
import numpy as np

from peers.statement import CASADI, IPOPT, Answer, Statement


class OptiPeer:
    """The problem in Opti."""

    def __init__(self, statement: Statement) -> None:
        p = statement.pieces
        rates, cost = statement.functions()
        self._opti = opti = ca.Opti()
        self._x, self._u = opti.variable(statement.states, p + 1), opti.variable(statement.inputs, p)
        self._start, self._given = opti.parameter(statement.states), opti.parameter(statement.parameters, p)
        total = 0
        for k in range(p):
            x, u = self._x[:, k], self._u[:, k]
            opti.subject_to(self._x[:, k + 1] == statement.after_a_period(rates, x, u))
            total += cost(self._x[:, k + 1], self._given[:, k])
        opti.minimize(total)
        opti.subject_to(opti.bounded(-statement.limit, ca.vec(self._u), statement.limit))
        opti.subject_to(self._x[:, 0] == self._start)
        opti.solver("ipopt", CASADI, IPOPT)

    def solve(self, start: Any, parameters: Any, states: Any, held: Any) -> Answer:
        """See :class:`peers.statement.Peer`."""
        opti = self._opti
        opti.set_value(self._start, start)
        opti.set_value(self._given, parameters)
        opti.set_initial(self._x, np.column_stack([start, states]))
        opti.set_initial(self._u, held)
        with suppress(RuntimeError):  # not solved; the last iterate is in debug
            opti.solve()
        return Answer.of(np.asarray(opti.debug.value(self._u)).T, opti.stats())


build = OptiPeer
