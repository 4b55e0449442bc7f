"""The problem as every peer gets it, and what every peer has to do.

States x = (z, ż) ``(2n,)``, inputs u = τ / τ_max ``(n,)`` held over each of p periods, |u| <= γ. Maximised is the sum
over the ends of the periods of the terms of our own problem (similarity of the bearings by the unscented transform,
pull towards the target). Parameters of an end are the sigma points and the desired bearing, stacked ``(K,)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol

import casadi as ca
import numpy as np

from gbt_ocp.models.vehicles import acceleration
from gbt_ocp.ocp import ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.objective_total import objective_function

NAMES = {
    "alpaqa": "alpaqa PANOC", "fatrop": "fatrop", "opti": "CasADi Opti", "rockit": "rockit", "do_mpc": "do-mpc",
}  # fmt: skip
"""Modules here, and what the tables call them."""

PACKAGES = {"alpaqa": "alpaqa", "fatrop": "casadi", "opti": "casadi", "rockit": "rockit-meco", "do_mpc": "do-mpc"}
"""Where they come from."""


@dataclass(frozen=True)
class Answer:
    """What a peer returns: inputs over their limits ``(p, n)``, and IPOPT's own account of how they came about.

    ``solver_seconds`` is the processor time that IPOPT counts itself; the rest of a call is the package's own.
    """

    held: Any
    solved: bool
    status: str
    iterations: int
    solver_seconds: float

    @classmethod
    def of(cls, held: Any, stats: dict[str, Any]) -> Answer:
        """From CasADi's statistics."""
        seconds = stats.get("t_proc_total", np.nan)
        return cls(held, bool(stats["success"]), str(stats["return_status"]), int(stats["iter_count"]), float(seconds))


class Peer(Protocol):
    """Another package with the problem built."""

    def solve(self, start: Any, parameters: Any, states: Any, held: Any) -> Answer:
        """Solve from x ``(2n,)`` with parameters ``(K, p)`` and a guess: x at the ends ``(2n, p)``, u ``(n, p)``."""


class Statement:
    """One trajectory problem in the words above."""

    def __init__(self, problem: TrajectoryProblem) -> None:
        self.pieces, self.period = problem.pieces, problem.period
        self.inputs, self.states = problem.vehicle.flat_dimension, 2 * problem.vehicle.flat_dimension
        self.limit = min(limit.gamma for limit in problem.constraints if isinstance(limit, ThrustLimit))
        self._vehicle = problem.vehicle
        self._terms = [objective_function(problem, term) for term in problem.objectives]
        self.parameters = sum(term.size1_in(3) for term in self._terms)

    def rates(self, x: Any, u: Any) -> Any:
        """ẋ ``(2n,)``, a CasADi expression."""
        n = self.inputs
        return ca.vertcat(x[n:], acceleration(self._vehicle, x[:n], x[n:], u * ca.DM(self._vehicle.thrust_max)))

    def cost(self, x: Any, parameters: Any) -> Any:
        """What the end of a period adds to the cost, a CasADi expression."""
        n, total, first = self.inputs, 0.0, 0
        for term in self._terms:
            size = term.size1_in(3)
            # none of these terms reads the acceleration
            total -= term(x[:n], x[n:], ca.DM.zeros(n), parameters[first : first + size])
            first += size
        return total

    def functions(self) -> tuple[ca.Function, ca.Function]:
        """:meth:`rates` and :meth:`cost` as functions of x and u, and of x and the parameters."""
        x, u, p = (ca.SX.sym(name, size) for name, size in zip("xup", self.sizes, strict=True))
        return ca.Function("rates", [x, u], [self.rates(x, u)]), ca.Function("cost", [x, p], [self.cost(x, p)])

    def after_a_period(self, rates: ca.Function, x: Any, u: Any) -> Any:
        """x a period later under held u: one classical Runge-Kutta step."""
        h = self.period
        k1 = rates(x, u)
        k2 = rates(x + h / 2 * k1, u)
        k3 = rates(x + h / 2 * k2, u)
        k4 = rates(x + h * k3, u)
        return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    @property
    def sizes(self) -> Sequence[int]:
        """Numbers of states, inputs and parameters."""
        return self.states, self.inputs, self.parameters


IPOPT = {"print_level": 0, "sb": "yes"}
"""IPOPT's options: nothing but silence. Tolerance and linear solver (MUMPS) are its defaults."""

CASADI = {"expand": True, "print_time": False, "record_time": True}
"""Options of CasADi's interface to it: functions expanded to scalars, time counted but not printed."""

FLAT_OPTIONS = {**CASADI, **{f"ipopt.{name}": value for name, value in IPOPT.items()}}
"""Both in one dictionary."""


def make(name: str, statement: Statement) -> Peer:
    """Build the problem with a peer; ``ImportError`` where it is not installed."""
    peer: Peer = import_module(f"peers.{name}_peer").build(statement)
    return peer
