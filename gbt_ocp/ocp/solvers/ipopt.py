"""IPOPT through CasADi: the reference solver of both formulations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.problem_data import PosedProblem, ProblemData, ShootingData
from gbt_ocp.ocp.shooting_transcription import transcribe_shooting
from gbt_ocp.ocp.solvers.base import Solution
from gbt_ocp.ocp.transcription import Transcription, transcribe
from gbt_ocp.typing import Array

DEFAULT_OPTIONS: dict[str, Any] = {
    "print_level": 0,
    "sb": "yes",
    "tol": 1e-6,
    "acceptable_tol": 1e-4,
    "max_iter": 300,
    # most solves start near the solution; from 0.1 a few in a thousand end in the restoration phase at close range
    "mu_init": 1e-2,
}

PENALTY_FORMS = ("elastic", "printed")
"""How IPOPT is given a penalty: with its kinks as constraints (the same minimisers), or as the paper prints it."""

FILES = ("output_file", "option_file_name", "hsllib", "pardisolib")
"""Options of IPOPT that name a file to be written, read or loaded as code: none of them is a number of the problem."""


def ipopt_options(options: Mapping[str, Any]) -> dict[str, Any]:
    """:data:`DEFAULT_OPTIONS` with those of the user over them.

    Raises
    ------
    ValueError
        If an option names a file.
    """
    for name in FILES:
        if name in options:
            raise ValueError(f"solver_options.{name}: found {options[name]!r}; allowed: no option that names a file")
    return DEFAULT_OPTIONS | dict(options)


def ipopt_function(nlp: Mapping[str, ca.MX], options: Mapping[str, Any]) -> ca.Function:
    """IPOPT for a program in CasADi's form, with :data:`DEFAULT_OPTIONS` unless ``options`` say otherwise.

    Raises
    ------
    ValueError
        If an option is unknown to IPOPT, or names a file.
    """
    settings: dict[str, Any] = {
        "expand": True,
        "print_time": False,
        "error_on_fail": False,
        "ipopt": ipopt_options(options),
    }
    try:
        return ca.nlpsol("planner", "ipopt", dict(nlp), settings)
    except RuntimeError as fault:
        # CasADi's message is a trail of source lines; the last one says what was wrong
        reason = str(fault).strip().splitlines()[-1].split(": ", 1)[-1]
        raise ValueError(f"solver_options: {reason}") from fault


def solution_of(function: ca.Function, found: Mapping[str, Any], shape: tuple[int, ...]) -> Solution:
    """What the last call of :func:`ipopt_function` gave; its first unknowns are u of that shape."""
    stats = function.stats()
    size = int(np.prod(shape))
    variables = np.asarray(found["x"]).ravel()[:size].reshape(shape)
    solved = bool(stats["success"]) and bool(np.all(np.isfinite(variables)))
    status = "solved" if solved else str(stats["return_status"])
    return Solution(variables, solved, status, int(stats["iter_count"]))


class IpoptSolver:
    """The nonlinear program solved by IPOPT with exact derivatives.

    Newton's method stalls on the narrow kinks of the penalty. By default IPOPT therefore gets them as
    constraints (:attr:`~gbt_ocp.ocp.transcription.Transcription.elastic_nlp`): the same minimisers in a few dozen
    iterations. Whatever the form, a cold or failed solve of a penalty goes through the stages of
    :func:`gbt_ocp.ocp.transcription.continuation` if the direct one fails, each from the solution of the one before;
    the printed form takes them at once when cold.

    Parameters
    ----------
    problem
        What to solve.
    options
        ``penalty``: one of :data:`PENALTY_FORMS`. All others are IPOPT's and replace or join
        :data:`DEFAULT_OPTIONS`.

    Attributes
    ----------
    prints_penalty
        Whether IPOPT is given a penalty as the paper prints it.

    Raises
    ------
    ValueError
        If the form of the penalty or an option of IPOPT is unknown.
    """

    name = "ipopt"

    def __init__(self, problem: PosedProblem, options: Mapping[str, Any]) -> None:
        own = dict(options)
        form = own.pop("penalty", PENALTY_FORMS[0])
        if form not in PENALTY_FORMS:
            raise ValueError(f"solver_options.penalty: found {form!r}; allowed: {', '.join(PENALTY_FORMS)}")
        self._problem = problem
        self._program = program = _program_of(problem)
        self._binding = Binding(problem)
        self.prints_penalty = form == "printed" and bool(problem.penalties)
        self._elastic = form == "elastic" and bool(problem.penalties)
        self._slacks = program.excess.numel() if self._elastic else 0
        if self._elastic:
            self._excess = ca.Function("excess", self._arguments(), [program.excess, program.width])
        nlp = program.elastic_nlp if self._elastic else program.nlp
        self._solver = ipopt_function(nlp, own)
        self._giving = program.giving
        self._values = ca.Function("limits", self._arguments(), [program.limits])
        free = np.full(program.variables.numel() + program.inner.numel(), np.inf)
        self._defects = np.zeros(program.defects.numel())
        none = np.full(self._slacks, np.inf)
        self._least = np.concatenate([-free, np.zeros(self._slacks), -none, np.zeros(len(self._giving))])
        self._unbounded = none

    def _arguments(self) -> list[ca.MX]:
        """What the limits are functions of."""
        return [ca.vertcat(self._program.variables, self._program.inner), self._program.parameters]

    def _solve_once(
        self,
        start: Array,
        objectives: Sequence[Array],
        guess: Array,
        stage: Sequence[tuple[float, float]],
        tightening: ArrayLike,
        limits: Sequence[Array],
    ) -> Solution:
        program = self._program
        inside = program.inward(tightening)
        if np.any(program.lower + inside > program.upper - inside):
            return Solution(guess, False, "limits tightened away", 0)
        parameters = self._binding.vector(start, objectives, stage, tightening, limits)
        first = begin = guess.ravel()
        if program.led_to is not None:
            # the states start where the guess leads, or where that is no number as they are
            states = np.asarray(program.led_to(start, begin)).ravel()
            kept = np.tile(start.ravel(), len(guess))
            first = begin = np.concatenate([begin, np.where(np.isfinite(states), states, kept)])
        if self._elastic:
            excess, width = (np.asarray(part).ravel() for part in self._excess(begin, parameters))
            square = np.clip(excess + width, 0.0, 2.0 * width)
            first = np.concatenate([first, np.maximum(excess + width - square, 0.0), square])
        lower, upper = program.lower + inside, program.upper - inside
        least, most = lower.copy(), np.full(len(self._giving), np.inf)
        if self._giving:
            values = np.asarray(self._values(begin, parameters)).ravel()
            slack = np.maximum(np.maximum(values - upper, lower - values) / program.scale, 0.0)
            first = np.concatenate([first, slack[self._giving]])
            least[self._giving] = -np.inf
        found = self._solver(
            x0=first,
            p=parameters,
            lbx=self._least,
            lbg=np.concatenate([least, self._defects, np.zeros(self._slacks), lower[self._giving]]),
            ubg=np.concatenate([upper, self._defects, self._unbounded, most]),
        )
        return solution_of(self._solver, found, guess.shape)

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
        penalties = self._problem.penalties
        final = [(soft.width, soft.weight) for soft in penalties]
        iterations = 0
        if self._elastic or not penalties or not cold:
            solution = self._solve_once(start, objectives, guess, final, tightening, limits)
            if solution.solved or not penalties:
                return solution
            iterations = solution.iterations
        stages = [list(stage) for stage in zip(*(continuation(*pair) for pair in final), strict=True)]
        solution = self.solve_stages(start, objectives, guess, stages, tightening=tightening, limits=limits)
        return replace(solution, iterations=iterations + solution.iterations)

    def solve_stages(
        self,
        start: Array,
        objectives: Sequence[Array],
        guess: Array,
        stages: Sequence[Sequence[tuple[float, float]]],
        *,
        tightening: ArrayLike = 0.0,
        limits: Sequence[Array] = (),
    ) -> Solution:
        """Solve with the penalties' (ϖ, w_p) of each stage in turn, from the solution of the one before.

        A single stage is a plain solve with these (ϖ, w_p), which need not be the problem's.
        """
        iterations = 0
        for stage in stages:
            solution = self._solve_once(start, objectives, guess, stage, tightening, limits)
            iterations += solution.iterations
            # A stage that stopped early is still a better start for the next one than the guess before it.
            if np.all(np.isfinite(solution.variables)):
                guess = solution.variables
        return replace(solution, iterations=iterations)


def _program_of(problem: PosedProblem) -> Transcription:
    if isinstance(problem, ShootingData):
        return transcribe_shooting(problem)
    assert isinstance(problem, ProblemData), "there are no others"
    return transcribe(problem)


def continuation(width: float, weight: float) -> list[tuple[float, float]]:
    """Stages (ϖ, w_p) that lead from an easy penalty to the one asked for, each solved from the last one's solution.

    At ϖ = 0.01 and w_p = 1000 they are (0.5, 10), (0.1, 100), (0.01, 1000).
    """
    return [(50.0 * width, weight / 100.0), (10.0 * width, weight / 10.0), (width, weight)]
