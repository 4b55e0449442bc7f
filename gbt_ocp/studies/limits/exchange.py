"""Hard limits at nodes, with nodes added where the finished trajectory breaks a limit between them.

Nodes are added until the fine grid (:data:`~gbt_ocp.ocp.check.FINE_POINTS` points a piece) shows no violation
of the true limits any more, each solve starting from the last solution: an exchange method for what is a
semi-infinite program. At the added nodes the limits are a little tighter (:data:`MARGIN`), so that a solution that
touches them there keeps them beside, whatever the margin of the limits themselves (γ, which may be 1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.check import FINE_POINTS, LimitCheck
from gbt_ocp.ocp.problem import TrajectoryProblem
from gbt_ocp.ocp.problem_data import HardLimit
from gbt_ocp.ocp.solvers.base import Solution
from gbt_ocp.ocp.solvers.compiled import CompiledSolver
from gbt_ocp.ocp.solvers.ipopt import IpoptSolver, ipopt_function, solution_of
from gbt_ocp.ocp.trajectory import FlatTrajectory, propagate
from gbt_ocp.ocp.transcription import constraint_function, input_scale, limit_size, transcribe
from gbt_ocp.studies.limits.soft import only_hard
from gbt_ocp.typing import Array

EXCHANGES = 5
"""How often nodes may be added in one solve."""

MARGIN = 1.0e-4
"""How far inside, in units of the limit, an added node keeps a solution."""

DOUBLINGS = 3
"""How often the compiled solver's nodes may be doubled."""

BETWEEN_NODES = "limits broken between nodes"
"""Status of a solve that ran out of rounds."""


class ExchangeIpoptSolver:
    """IPOPT with nodes at the worst points of the fine grid, beside those of the problem.

    The flat output at any time is linear in the start and the unknowns. The coefficients of a fixed number of added
    nodes are parameters of one nonlinear program, so nothing is built while solving.

    Parameters
    ----------
    problem
        With hard limits only.
    nodes
        Most nodes that may be added in one solve, at least one, by default three a piece.

    Raises
    ------
    ValueError
        If the problem has a penalty, or no hard limit, or no node may be added.
    """

    name = "ipopt"

    def __init__(self, problem: TrajectoryProblem, nodes: int | None = None) -> None:
        only_hard(problem)
        if nodes is not None and nodes < 1:
            raise ValueError(f"nodes: found {nodes}; allowed: a whole number >= 1")
        self._problem = problem
        self._nodes = 3 * problem.pieces if nodes is None else nodes
        self._scale = input_scale(problem)
        self._binding = Binding(problem)
        self._check = LimitCheck(problem)
        self._plain = IpoptSolver(problem, {})
        self._program = program = transcribe(problem)
        size = problem.vehicle.flat_dimension
        orders = problem.joined + problem.pieces * problem.freedoms // size
        self._orders = orders
        weights = ca.MX.sym("weights", orders, 3 * self._nodes)
        shares = ca.MX.sym("shares", problem.pieces + 1, self._nodes)
        start = ca.reshape(program.parameters[: size * problem.joined], size, problem.joined)
        top = ca.reshape(program.variables * ca.repmat(ca.DM(self._scale), problem.pieces, 1), size, -1)
        points = ca.horzsplit(ca.mtimes(ca.horzcat(start, top), weights), self._nodes)
        limits, self._lower, self._upper, self._unit = [program.limits], [], [], []
        offset = program.parameters.numel() - sum(map(limit_size, problem.constraints)) * (problem.pieces + 1)
        for limit in problem.hard:
            c = limit.constraint
            end = offset + limit_size(c) * (problem.pieces + 1)
            moving = ca.reshape(program.parameters[offset:end], limit_size(c), problem.pieces + 1)
            offset = end
            columns = [*points, *([ca.mtimes(moving, shares)] if limit_size(c) else [])]
            limits.append(ca.vec(constraint_function(problem, c).map(self._nodes)(*columns)))
            self._lower.append(c.lower + c.backoff)
            self._upper.append(c.upper - c.backoff)
            self._unit.append(c.scale)
        self._solver = ipopt_function(
            {
                "x": program.variables,
                "p": ca.vertcat(program.parameters, ca.vec(weights), ca.vec(shares)),
                "f": -program.objective,
                "g": ca.vertcat(*limits),
            },
            {},
        )

    def solve(
        self,
        start: Array,
        objectives: Sequence[Array],
        guess: Array,
        *,
        cold: bool,
        tightening: ArrayLike = 0.0,
        limits: Sequence[Array] = (),
    ) -> Solution:
        """Solve from a guess; see :meth:`gbt_ocp.ocp.solvers.base.Solver.solve`."""
        solution = self._plain.solve(start, objectives, guess, cold=cold, tightening=tightening, limits=limits)
        iterations, times = solution.iterations, np.zeros(0)
        for _ in range(EXCHANGES):
            broken = self._broken(start, solution, limits)
            if not broken.size or len(np.union1d(times, broken)) > self._nodes:
                break
            times = np.union1d(times, broken)
            solution = self._solve_with(times, start, objectives, solution.variables, tightening, limits)
            iterations += solution.iterations
        if self._broken(start, solution, limits).size:
            solution = replace(solution, solved=False, status=BETWEEN_NODES)
        return replace(solution, iterations=iterations)

    def _broken(self, start: Array, solution: Solution, limits: Sequence[Array]) -> Array:
        """Times at which the violation of a true limit is largest nearby, on the fine grid; none without solution."""
        if not solution.solved:
            return np.zeros(0)
        trajectory = FlatTrajectory(self._problem.period, start, solution.variables * self._scale)
        profile = self._check.profile(trajectory, limits)
        beside = np.pad(profile, ((0, 0), (1, 1)), constant_values=-np.inf)
        worst = (profile > 0.0) & (profile >= beside[:, :-2]) & (profile > beside[:, 2:])
        piece, point = np.nonzero(worst)
        return np.asarray(self._problem.period * (piece + point / (FINE_POINTS - 1)))

    def _solve_with(
        self,
        times: Array,
        start: Array,
        objectives: Sequence[Array],
        guess: Array,
        tightening: ArrayLike,
        limits: Sequence[Array],
    ) -> Solution:
        program = self._program
        inside = program.inward(tightening)
        added, lower, upper = self._added(times, tightening)
        found = self._solver(
            x0=guess.ravel(),
            p=np.concatenate([self._binding.vector(start, objectives, [], tightening, limits), added]),
            lbg=np.concatenate([program.lower + inside, lower]),
            ubg=np.concatenate([program.upper - inside, upper]),
        )
        return solution_of(self._solver, found, guess.shape)

    def _added(self, times: Array, tightening: ArrayLike) -> tuple[Array, Array, Array]:
        """Parameters that place the added nodes, and the bounds there; unused nodes have none."""
        pieces, period = self._problem.pieces, self._problem.period
        weights = np.zeros((self._orders, 3 * self._nodes))
        shares = np.zeros((pieces + 1, self._nodes))
        used = np.arange(self._nodes) < len(times)
        executed = np.zeros(self._nodes, dtype=bool)
        for number, time in enumerate(times):
            piece = min(int(time / period + 1e-9), pieces - 1)
            share = time / period - piece
            shares[piece : piece + 2, number] = 1.0 - share, share
            executed[number] = piece == 0
            weights[:, number :: self._nodes] = self._coefficients(piece, share * period)
        lower, upper = [], []
        tightened = np.broadcast_to(tightening, len(self._unit))
        for low, high, unit, own in zip(self._lower, self._upper, self._unit, tightened, strict=True):
            inside = (np.where(executed, own, 0.0) + MARGIN)[:, None] * unit
            lower.append(np.where(used[:, None], low + inside, -np.inf).ravel())
            upper.append(np.where(used[:, None], high - inside, np.inf).ravel())
        added = np.concatenate([weights.ravel(order="F"), shares.ravel(order="F")])
        return added, np.concatenate(lower), np.concatenate(upper)

    def _coefficients(self, piece: int, time: float) -> Array:
        """How z, ż and z̈ at a time of a piece depend on the start and on what is free ``(k+1 + (L-k) p, 3)``."""
        joined, free = self._problem.joined, self._problem.degree + 1 - self._problem.joined
        # the trajectory of every unit vector at once
        units = np.eye(self._orders)
        own = [list(units[begin : begin + free]) for begin in range(joined, self._orders, free)]
        derivatives: list[Array] = list(units[:joined])
        for number in range(piece):
            derivatives = propagate(derivatives, own[number], self._problem.period)[:joined]
        return np.stack(propagate(derivatives, own[piece], time)[:3], axis=1)


class DoublingCompiledSolver:
    """The compiled solver with twice the nodes on every piece as long as the fine grid shows a violation.

    The nodes of the compiled solver are fixed when its code is generated, so single ones cannot be added: a ladder of
    solvers with n_c, 2 n_c, 4 n_c, ... nodes stands ready.

    Parameters
    ----------
    problem
        With hard limits only.

    Raises
    ------
    ValueError
        If the problem has a penalty, or no hard limit.
    """

    name = "compiled"

    def __init__(self, problem: TrajectoryProblem) -> None:
        only_hard(problem)
        self._period, self._scale = problem.period, input_scale(problem)
        self._ladder = [
            CompiledSolver(
                replace(problem, hard=tuple(HardLimit(h.constraint, h.nodes * 2**k) for h in problem.hard)), {}
            )
            for k in range(DOUBLINGS + 1)
        ]

    def solve(
        self,
        start: Array,
        objectives: Sequence[Array],
        guess: Array,
        *,
        cold: bool,
        tightening: ArrayLike = 0.0,
        limits: Sequence[Array] = (),
    ) -> Solution:
        """Solve from a guess; see :meth:`gbt_ocp.ocp.solvers.base.Solver.solve`."""
        iterations = 0
        for solver in self._ladder:
            solution: Solution = solver.solve(start, objectives, guess, cold=cold, tightening=tightening, limits=limits)
            iterations += solution.iterations
            trajectory = FlatTrajectory(self._period, start, solution.variables * self._scale)
            if not solution.solved or self.check(trajectory, limits).max() <= 0.0:
                return replace(solution, iterations=iterations)
            guess, cold = solution.variables, False
        return replace(solution, solved=False, status=BETWEEN_NODES, iterations=iterations)

    def check(self, trajectory: FlatTrajectory, limits: Sequence[Array] = ()) -> Array:
        """Largest violation of each piece ``(p,)``; see :class:`gbt_ocp.ocp.check.LimitCheck`."""
        return self._ladder[0].check(trajectory, limits)
