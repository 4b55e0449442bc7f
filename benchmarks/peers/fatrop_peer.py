"""fatrop through CasADi: multiple shooting, stages in order, one Runge-Kutta step a period, compiled functions."""

from __future__ import annotations

from contextlib import chdir
from tempfile import TemporaryDirectory
from typing import Any

import casadi as ca
import numpy as np

from peers.statement import CASADI, Answer, Statement

COMPILED = {"jit": True, "compiler": "shell", "jit_options": {"flags": ["-O3"]}}
"""Options of CasADi that compile the functions of the program."""


class FatropPeer:
    """The problem in CasADi's interface to fatrop, which finds the stages itself."""

    def __init__(self, statement: Statement) -> None:
        p, n, size = statement.pieces, statement.inputs, statement.states
        rates, cost = statement.functions()
        start, given = ca.SX.sym("s", size), ca.SX.sym("p", statement.parameters, p)
        # unknowns and constraints stage by stage: x_k, u_k, then the gap to x_k+1, then what is bounded in the stage
        unknowns, gaps, equal = [], [], []
        states = [ca.SX.sym(f"x{k}", size) for k in range(p + 1)]
        total = 0.0
        for k in range(p):
            u = ca.SX.sym(f"u{k}", n)
            unknowns += [states[k], u]
            gaps.append(states[k + 1] - statement.after_a_period(rates, states[k], u))
            equal += [True] * size
            if k == 0:
                gaps.append(states[0] - start)
                equal += [True] * size
            total += cost(states[k + 1], given[:, k])
        unknowns.append(states[p])
        program = {"x": ca.vertcat(*unknowns), "f": total, "g": ca.vertcat(*gaps)}
        program["p"] = ca.vertcat(start, ca.vec(given))
        options = {**CASADI, **COMPILED, "structure_detection": "auto", "equality": equal, "fatrop.print_level": 0}
        with TemporaryDirectory() as folder, chdir(folder):  # where CasADi leaves what it compiles
            self._solver = ca.nlpsol("fatrop", "fatrop", program, options)
        self._pieces, self._inputs, self._states = p, n, size
        free, box = np.full(size, np.inf), np.full(n, statement.limit)
        self._bound = np.concatenate([*([free, box] * p), free])

    def solve(self, start: Any, parameters: Any, states: Any, held: Any) -> Answer:
        """See :class:`peers.statement.Peer`."""
        p, first = self._pieces, np.column_stack([start, states])
        stages = [np.concatenate([first[:, k], held[:, k]]) for k in range(p)]
        found = self._solver(
            x0=np.concatenate([*stages, first[:, p]]),
            p=np.concatenate([start, parameters.ravel(order="F")]),
            lbx=-self._bound,
            ubx=self._bound,
            lbg=0.0,
            ubg=0.0,
        )
        values = np.asarray(found["x"]).ravel()
        inputs = values[: p * (self._states + self._inputs)].reshape(p, -1)[:, self._states :]
        return Answer.of(inputs, self._solver.stats())


build = FatropPeer
