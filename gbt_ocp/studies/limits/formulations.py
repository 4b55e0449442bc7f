"""Formulations of the same limits: what each of them minimises, who can solve it, and why others cannot.

A formulation is of all limits of a configuration: those on thrust, and those of its section ``limits``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import ArrayLike

from gbt_ocp.experiments.build.loop import build_vehicle
from gbt_ocp.experiments.config.limits import LIMIT_KINDS
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.ocp.limit_classes import LimitClass, limit_class
from gbt_ocp.ocp.planner import Planner, ShotPlanner
from gbt_ocp.ocp.problem import TrajectoryProblem
from gbt_ocp.ocp.shooting_problem import ShootingProblem
from gbt_ocp.ocp.solvers.base import Solution, Solver
from gbt_ocp.ocp.solvers.compiled import CompiledSolver
from gbt_ocp.ocp.solvers.ipopt import IpoptSolver, continuation
from gbt_ocp.studies.limits.exchange import DoublingCompiledSolver, ExchangeIpoptSolver
from gbt_ocp.studies.limits.integrated import by_integration
from gbt_ocp.studies.limits.soft import SoftCompiledSolver, SoftIpoptSolver
from gbt_ocp.studies.limits.unyielding import UnyieldingSolver, may_give
from gbt_ocp.typing import Array

IPOPT, COMPILED = "ipopt", "compiled"
COMPARED_SOLVERS = (IPOPT, COMPILED)

Options = Mapping[str, Any]


class StagedPenalty:
    """The penalty of the paper handed to IPOPT at these (ϖ, w_p) one after the other, and nothing tried if one fails.

    ``stages`` may be replaced between solves; ``form`` is one of :data:`gbt_ocp.ocp.solvers.ipopt.PENALTY_FORMS`.
    """

    name = IPOPT

    def __init__(
        self,
        problem: TrajectoryProblem,
        stages: Sequence[Sequence[tuple[float, float]]],
        options: Options | None = None,
        form: str = "printed",
    ) -> None:
        self._solver = IpoptSolver(problem, {**(options or {}), "penalty": form})
        self.stages = stages

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
        return self._solver.solve_stages(start, objectives, guess, self.stages, tightening=tightening, limits=limits)


Make = Callable[[TrajectoryProblem, Options], Any]
"""From the problem and the solver's options to a planner."""


def _planner(make: Callable[[TrajectoryProblem, Options], Any]) -> Make:
    return lambda problem, options: Planner(problem, make(problem, options))


def _printed(problem: TrajectoryProblem, options: Options) -> StagedPenalty:
    return StagedPenalty(problem, [[(soft.width, soft.weight) for soft in problem.penalties]], options)


def _continued(problem: TrajectoryProblem, options: Options) -> StagedPenalty:
    stages = zip(*(continuation(soft.width, soft.weight) for soft in problem.penalties), strict=True)
    return StagedPenalty(problem, list(stages), options)


def _hard(make: Callable[[TrajectoryProblem, Options], Solver]) -> Make:
    def solver(problem: TrajectoryProblem, options: Options) -> Solver:
        solved = make(problem, options)
        return UnyieldingSolver(problem, solved) if may_give(problem) else solved

    return _planner(solver)


def _soft(
    by_class: Callable[[TrajectoryProblem, Options], Solver], thrust: Callable[[TrajectoryProblem, Options], Any]
) -> Make:
    """What the solvers do with hard limits that may give; where there are only limits on thrust, slacks of these."""
    return _planner(lambda problem, options: (by_class if may_give(problem) else thrust)(problem, options))


def _shot(make: Callable[[ShootingProblem, Options], Solver]) -> Make:
    """A planner by integration; where limits cannot all be kept they give by class, as in the flat form."""

    def planner(problem: TrajectoryProblem, options: Options) -> ShotPlanner:
        shot = by_integration(problem)
        return ShotPlanner(shot, make(shot, options))

    return planner


@dataclass(frozen=True)
class Share:
    """How much of the work a slow solver gets, so that a comparison takes minutes.

    Attributes
    ----------
    problems
        Share of the problems in open loop, drawn from all of them.
    seeds
        Share of the seeds in closed loop, at least one seed unless it is zero.
    everywhere
        Whether closed loops are run for every configuration or for the first one alone.
    """

    problems: float = 1.0
    seeds: float = 1.0
    everywhere: bool = True


@dataclass(frozen=True)
class Formulation:
    """One treatment.

    Attributes
    ----------
    meaning
        In one line.
    penalty
        Whether it starts from the problem with the paper's penalty on the thrust, or from that with hard limits.
    exact
        The last class of the other limits that are hard as well, those after it being penalised; ``None``: all are
        treated like the thrust.
    unfit
        Why a configuration cannot be treated so, if it cannot.
    solvers
        How each solver that can do it is made.
    absent
        Why another one cannot.
    shares
        Which share of the work a solver gets, by default all of it: a problem takes IPOPT thirty times as long as the
        compiled solver, and with the printed penalty hundreds of times.
    """

    meaning: str
    penalty: bool
    solvers: dict[str, Make]
    absent: dict[str, str] = field(default_factory=dict)
    exact: LimitClass | None = None
    unfit: Callable[[Configuration], str | None] = lambda _: None
    shares: dict[str, Share] = field(default_factory=dict)


_SLOW = {IPOPT: Share(problems=0.5, seeds=0.0)}  # its solutions are those of the compiled solver, which steers
_SLOWEST = {IPOPT: Share(problems=0.3, seeds=0.1)}
_LONG_WAY = {IPOPT: Share(problems=0.3, seeds=0.1, everywhere=False)}  # beside another one that steers likewise


def limits_in(configuration: Configuration) -> dict[str, LimitClass]:
    """The limits besides thrust that a configuration has, by their names in ``limits.hard``, with their classes."""
    section, found = configuration.limits, {}
    problem = TrajectoryProblem(build_vehicle(configuration), 1, configuration.planner.period_s or 1.0)
    for name, one in LIMIT_KINDS.items():
        value = getattr(section, one.key)
        classes = [] if value is None else [limit_class(problem, c) for c in one.constraints(value, problem)]
        if classes:
            found[name] = max(classes)
    return found


def _not_thrust_alone(configuration: Configuration) -> str | None:
    return "it takes limits on thrust only" if limits_in(configuration) else None


def _none_believed(configuration: Configuration) -> str | None:
    if LimitClass.BELIEVED in limits_in(configuration).values():
        return None
    return "no limit depends on what is only believed, so it is hard"


_NO_KINKS = "the kernel takes the kinks as inequalities, which is the formulation elastic; it has no other way"

FORMULATIONS: dict[str, Formulation] = {
    "penalty": Formulation(
        "the paper's penalty as printed: one smooth function for Newton's method",
        True,
        {IPOPT: _planner(_printed)},
        {COMPILED: _NO_KINKS},
        shares=_SLOWEST,
    ),
    "continuation": Formulation(
        "the same penalty in three stages of falling ϖ and rising w_p, each from the last one's solution",
        True,
        {IPOPT: _planner(_continued)},
        {COMPILED: "ϖ and w_p are fixed when the code is generated, and the kernel needs no stages: see elastic"},
        shares=_LONG_WAY,
    ),
    "elastic": Formulation(
        "the same penalty with its kinks as inequalities: the same minimisers",
        True,
        {IPOPT: _planner(IpoptSolver), COMPILED: _planner(CompiledSolver)},
        shares=_SLOW,
    ),
    "mixed": Formulation(
        "hard limits on what is known (thrust, speed, yaw rate, zones), the penalty on what is only believed",
        False,
        {IPOPT: _hard(IpoptSolver), COMPILED: _soft(CompiledSolver, CompiledSolver)},
        exact=LimitClass.CERTAIN,
        unfit=_none_believed,
        shares=_SLOW,
    ),
    "hard": Formulation(
        "hard limits at n_c + 1 nodes a piece",
        False,
        {IPOPT: _hard(IpoptSolver), COMPILED: _hard(CompiledSolver)},
        shares=_SLOW,
    ),
    "exchange": Formulation(
        "hard limits, with nodes added until the fine grid shows no violation (compiled: n_c doubled)",
        False,
        {
            IPOPT: _planner(lambda problem, _: ExchangeIpoptSolver(problem)),
            COMPILED: _planner(lambda problem, _: DoublingCompiledSolver(problem)),
        },
        unfit=_not_thrust_alone,
        shares=_SLOW,
    ),
    "soft": Formulation(
        "limits at the nodes with exact l1 slacks, by class where some may give: thrust never, what is believed first",
        False,
        {
            IPOPT: _soft(IpoptSolver, lambda problem, _: SoftIpoptSolver(problem)),
            COMPILED: _soft(CompiledSolver, lambda problem, _: SoftCompiledSolver(problem)),
        },
        shares=_SLOW,
    ),
    "shooting": Formulation(
        "trajectories by integration, body thrust held over each piece; limits as in soft (another trajectory class)",
        False,
        {IPOPT: _shot(IpoptSolver), COMPILED: _shot(CompiledSolver)},
        shares=_LONG_WAY,
    ),
}
"""All treatments by name, the paper's own first."""
