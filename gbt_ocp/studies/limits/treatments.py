"""Treatments of the thrust limits: what each of them minimises, who can solve it, and why others cannot."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from numpy.typing import ArrayLike

from gbt_ocp.experiments.build.loop import build_problem, build_vehicle
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.ocp.codegen.expressions import NotGenerableError
from gbt_ocp.ocp.codegen.library import CompilerError
from gbt_ocp.ocp.planner import Planner
from gbt_ocp.ocp.problem import TrajectoryProblem
from gbt_ocp.ocp.shooting import ShootingPlanner
from gbt_ocp.ocp.solvers.base import Solution
from gbt_ocp.ocp.solvers.compiled import CompiledSolver
from gbt_ocp.ocp.solvers.ipopt import IpoptSolver
from gbt_ocp.ocp.transcription import continuation
from gbt_ocp.studies.limits.exchange import DoublingCompiledSolver, ExchangeIpoptSolver
from gbt_ocp.studies.limits.soft import SoftCompiledSolver, SoftIpoptSolver
from gbt_ocp.typing import Array

IPOPT, COMPILED = "ipopt", "compiled"
SOLVERS = (IPOPT, COMPILED)


class StagedPenalty:
    """The penalty of the paper handed to IPOPT at these (ϖ, w_p) one after the other, and nothing tried if one fails.

    ``stages`` may be replaced between solves; ``form`` is one of :data:`gbt_ocp.ocp.solvers.ipopt.PENALTY_FORMS`.
    """

    name = IPOPT

    def __init__(
        self, problem: TrajectoryProblem, stages: Sequence[Sequence[tuple[float, float]]], form: str = "printed"
    ) -> None:
        self._solver = IpoptSolver(problem, {"penalty": form})
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


Make = Callable[[TrajectoryProblem], Any]
"""From the problem to a planner."""


def _planner(make: Callable[[TrajectoryProblem], Any]) -> Make:
    return lambda problem: Planner(problem, make(problem))


def _printed(problem: TrajectoryProblem) -> StagedPenalty:
    return StagedPenalty(problem, [[(soft.width, soft.weight) for soft in problem.penalties]])


def _continued(problem: TrajectoryProblem) -> StagedPenalty:
    stages = zip(*(continuation(soft.width, soft.weight) for soft in problem.penalties), strict=True)
    return StagedPenalty(problem, list(stages))


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
        Whether it starts from the problem with the paper's penalty, or from that with hard limits.
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
    shares: dict[str, Share] = field(default_factory=dict)


_SLOW = {IPOPT: Share(problems=0.5, seeds=0.0)}  # its solutions are those of the compiled solver, which steers
_SLOWEST = {IPOPT: Share(problems=0.3, seeds=0.1)}
_LONG_WAY = {IPOPT: Share(problems=0.3, seeds=0.1, everywhere=False)}  # beside another one that steers likewise

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
        {
            IPOPT: _planner(lambda problem: IpoptSolver(problem, {})),
            COMPILED: _planner(lambda problem: CompiledSolver(problem, {})),
        },
        shares=_SLOW,
    ),
    "hard": Formulation(
        "hard limits at n_c + 1 nodes a piece",
        False,
        {
            IPOPT: _planner(lambda problem: IpoptSolver(problem, {})),
            COMPILED: _planner(lambda problem: CompiledSolver(problem, {})),
        },
        shares=_SLOW,
    ),
    "exchange": Formulation(
        "hard limits, with nodes added until the fine grid shows no violation (compiled: n_c doubled)",
        False,
        {IPOPT: _planner(ExchangeIpoptSolver), COMPILED: _planner(DoublingCompiledSolver)},
        shares=_SLOW,
    ),
    "soft": Formulation(
        "limits at the nodes with exact l1 slacks",
        False,
        {IPOPT: _planner(SoftIpoptSolver), COMPILED: _planner(SoftCompiledSolver)},
        shares=_SLOW,
    ),
    "shooting": Formulation(
        "multiple shooting with body thrust held over each period (another trajectory class, a yardstick)",
        False,
        {IPOPT: ShootingPlanner},
        {COMPILED: "the kernel's recursion is that of flat pieces, not of an integrator"},
        shares=_LONG_WAY,
    ),
}
"""All treatments by name, the paper's own first."""


@dataclass(frozen=True)
class Pair:
    """A formulation with a solver."""

    formulation: str
    solver: str

    @property
    def name(self) -> str:
        """As tables and figures call it."""
        return f"{self.formulation}, {self.solver}"


def chosen_pairs(formulations: Iterable[str], solvers: Iterable[str]) -> list[Pair]:
    """The pairs that exist of what was asked for, in the order of :data:`FORMULATIONS`.

    Raises
    ------
    ConfigurationError
        If a name is unknown or no pair exists.
    """
    formulations, solvers = list(formulations), list(solvers)
    faults = [
        f"--{option}: found {name!r}; allowed: {', '.join(known)}"
        for option, names, known in (("formulations", formulations, FORMULATIONS), ("solvers", solvers, SOLVERS))
        for name in names
        if name not in known
    ]
    if faults:
        raise ConfigurationError(faults)
    pairs = [
        Pair(name, solver)
        for name, formulation in FORMULATIONS.items()
        for solver in SOLVERS
        if name in formulations and solver in solvers and solver in formulation.solvers
    ]
    if not pairs:
        raise ConfigurationError(
            [f"--formulations, --solvers: found no pair of {', '.join(formulations)} with {', '.join(solvers)}"]
        )
    return pairs


def described(pairs: Sequence[Pair]) -> list[dict[str, str]]:
    """Table ``formulations``: what each pair is, and why the others of these formulations do not exist."""
    rows = []
    for name in dict.fromkeys(pair.formulation for pair in pairs):
        formulation = FORMULATIONS[name]
        rows += [{"formulation": name, "solver": one, "meaning": formulation.meaning} for one in formulation.solvers]
        rows += [
            {"formulation": name, "solver": one, "meaning": f"none: {why}"} for one, why in formulation.absent.items()
        ]
    return rows


def treated(configuration: Configuration, formulation: str, **changes: Any) -> Configuration:
    """The configuration with the problem that a formulation starts from, and other keys of ``planner`` replaced."""
    kind = "penalty" if FORMULATIONS[formulation].penalty else "hard"
    planner = configuration.planner.model_copy(
        update={"formulation": kind, "solver": "auto", "solver_options": {}, **changes}
    )
    return configuration.model_copy(update={"planner": planner})


def make_planner(configuration: Configuration, pair: Pair, **changes: Any) -> Any:
    """A fresh planner of a pair.

    Raises
    ------
    ConfigurationError
        If the pair cannot be made for this configuration.
    """
    treatment = treated(configuration, pair.formulation, **changes)
    try:
        problem = build_problem(treatment, build_vehicle(treatment))
        return FORMULATIONS[pair.formulation].solvers[pair.solver](problem)
    except (CompilerError, NotGenerableError, ValueError) as fault:
        raise ConfigurationError([f"{configuration.name}: {pair.name}: {fault}"]) from fault


@lru_cache(maxsize=4)
def _cached(text: str, formulation: str, solver: str, changes: tuple[tuple[str, Any], ...]) -> Any:
    return make_planner(_CONFIGURATIONS[text], Pair(formulation, solver), **dict(changes))


_CONFIGURATIONS: dict[str, Configuration] = {}


def kept_planner(configuration: Configuration, pair: Pair, **changes: Any) -> Any:
    """The same, kept from the last call: chunks of one pair come one after the other. Its memory is cleared."""
    text = configuration.to_yaml()
    _CONFIGURATIONS[text] = configuration
    planner = _cached(text, pair.formulation, pair.solver, tuple(sorted(changes.items())))
    planner.reset()
    return planner
