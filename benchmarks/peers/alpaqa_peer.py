"""alpaqa: PANOC on single shooting of held inputs, one Runge-Kutta step a period, compiled by its own loader."""

from __future__ import annotations

from time import thread_time
from typing import Any

import alpaqa as pa
import casadi as ca
import numpy as np

from peers.statement import Answer, Statement

TOLERANCE = 1e-4
"""Of the projected gradient step with the method's own step size (``ProjGradNorm``). Its default, an estimate of the
residual of the optimality conditions, leaves one step in ten unsolved after 2000 iterations and takes twice the time in
the median, for an objective that is larger by 0.03 in case 2 and 0.11 in case 5."""

ITERATIONS = 2000
"""At most; its default is 100."""


class AlpaqaPeer:
    """The problem in alpaqa: the inputs are the only unknowns."""

    def __init__(self, statement: Statement) -> None:
        p, n = statement.pieces, statement.inputs
        rates, cost = statement.functions()
        held, start = ca.SX.sym("u", n * p), ca.SX.sym("x", statement.states)
        given = ca.SX.sym("p", statement.parameters, p)
        x, total = start, 0.0
        for k in range(p):
            x = statement.after_a_period(rates, x, held[n * k : n * (k + 1)])
            total += cost(x, given[:, k])
        box = np.full(n * p, statement.limit)
        values = ca.vertcat(start, ca.vec(given))
        posed = pa.minimize(total, held).subject_to_box((-box, box)).with_param(values, np.zeros(values.numel()))
        self._problem = posed.compile(sym=ca.SX.sym)
        self._solver = pa.PANOCSolver(
            {"max_iter": ITERATIONS, "stop_crit": pa.PANOCStopCrit.ProjGradNorm}, {"memory": n * p}
        )
        self._shape = (p, n)

    def solve(self, start: Any, parameters: Any, states: Any, held: Any) -> Answer:
        """See :class:`peers.statement.Peer`."""
        self._problem.param = np.concatenate([start, parameters.ravel(order="F")])
        began = thread_time()
        options = {"tolerance": TOLERANCE}
        found, stats = self._solver(self._problem, options, held.ravel(order="F"), asynchronous=False)
        seconds = thread_time() - began
        solved = stats["status"] == pa.SolverStatus.Converged
        inputs = np.asarray(found).reshape(self._shape)
        return Answer(inputs, solved, str(stats["status"]), int(stats["iterations"]), seconds)


build = AlpaqaPeer
