"""do-mpc: its controller with its default, orthogonal collocation on finite elements, one element a period."""

from __future__ import annotations

from typing import Any

import numpy as np
from do_mpc.controller import MPC
from do_mpc.model import Model

from peers.statement import FLAT_OPTIONS, Answer, Statement


class DoMpcPeer:
    """The problem in do-mpc."""

    def __init__(self, statement: Statement) -> None:
        model = Model("continuous", "SX")
        x = model.set_variable("_x", "x", (statement.states, 1))
        u = model.set_variable("_u", "u", (statement.inputs, 1))
        given = model.set_variable("_tvp", "given", (statement.parameters, 1))
        model.set_rhs("x", statement.rates(x, u))
        model.setup()
        self._pieces = statement.pieces
        self._mpc = mpc = MPC(model)
        mpc.set_param(n_horizon=statement.pieces, t_step=statement.period, n_robust=0, store_full_solution=False)
        mpc.set_param(nlpsol_opts=FLAT_OPTIONS)
        cost = statement.cost(x, given)
        # the cost of the start is a constant
        mpc.set_objective(mterm=cost, lterm=cost)
        mpc.set_rterm(u=0.0)
        mpc.bounds["lower", "_u", "u"] = -statement.limit
        mpc.bounds["upper", "_u", "u"] = statement.limit
        self._template = mpc.get_tvp_template()
        mpc.set_tvp_fun(lambda now: self._template)
        mpc.setup()
        mpc.x0 = np.zeros(statement.states)
        mpc.set_initial_guess()

    def solve(self, start: Any, parameters: Any, states: Any, held: Any) -> Answer:
        """See :class:`peers.statement.Peer`."""
        mpc, p = self._mpc, self._pieces
        for k in range(p + 1):
            self._template["_tvp", k, "given"] = parameters[:, max(k - 1, 0)]
        # states at the collocation points of a period start where it ends
        mpc.opt_x_num["_x", 0, 0, -1] = start
        for k in range(p):
            mpc.opt_x_num["_x", k + 1, 0] = [states[:, k]] * len(mpc.opt_x_num["_x", k + 1, 0])
            mpc.opt_x_num["_u", k, 0] = held[:, k]
        mpc.make_step(np.asarray(start)[:, None])
        inputs = np.array([np.asarray(mpc.opt_x_num["_u", k, 0]).ravel() for k in range(p)])
        return Answer.of(inputs, mpc.solver_stats)


build = DoMpcPeer
