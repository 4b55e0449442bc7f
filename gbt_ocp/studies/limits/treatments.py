"""Treatments of the limits: formulations with solvers, and the planners of a configuration under them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from gbt_ocp.experiments.build.loop import build_flat_problem, build_vehicle
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.ocp.codegen.expressions import NotGenerableError
from gbt_ocp.ocp.codegen.library import CompilerError
from gbt_ocp.ocp.limit_classes import LimitClass
from gbt_ocp.ocp.solvers.base import options_beside
from gbt_ocp.studies.limits.formulations import COMPARED_SOLVERS, FORMULATIONS, limits_in


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
        for option, names, known in (
            ("formulations", formulations, FORMULATIONS),
            ("solvers", solvers, COMPARED_SOLVERS),
        )
        for name in names
        if name not in known
    ]
    if faults:
        raise ConfigurationError(faults)
    pairs = [
        Pair(name, solver)
        for name, formulation in FORMULATIONS.items()
        for solver in COMPARED_SOLVERS
        if name in formulations and solver in solvers and solver in formulation.solvers
    ]
    if not pairs:
        raise ConfigurationError(
            [f"--formulations, --solvers: found no pair of {', '.join(formulations)} with {', '.join(solvers)}"]
        )
    left_out = [name for name in formulations if name not in {pair.formulation for pair in pairs}]
    if left_out and set(formulations) != set(FORMULATIONS):
        fitting = [name for name, formulation in FORMULATIONS.items() if set(solvers) & set(formulation.solvers)]
        raise ConfigurationError(
            [
                f"--formulations: found {name!r}, which no solver of {', '.join(solvers)} solves; "
                f"allowed: {', '.join(fitting)}"
                for name in left_out
            ]
        )
    return pairs


def unfit(configuration: Configuration, pair: Pair) -> str | None:
    """Why a pair is not compared for a configuration, if it is not."""
    return FORMULATIONS[pair.formulation].unfit(configuration)


def described(pairs: Sequence[Pair], configurations: Sequence[Configuration]) -> list[dict[str, str]]:
    """Table ``formulations``: what each pair is, and why the others of these formulations do not exist."""
    rows = []
    for name in dict.fromkeys(pair.formulation for pair in pairs):
        formulation = FORMULATIONS[name]
        rows += [{"formulation": name, "solver": one, "meaning": formulation.meaning} for one in formulation.solvers]
        rows += [
            {"formulation": name, "solver": one, "meaning": f"none: {why}"} for one, why in formulation.absent.items()
        ]
        for configuration in configurations:
            why = formulation.unfit(configuration)
            if why:
                rows.append({"formulation": name, "solver": "", "meaning": f"not for {configuration.name}: {why}"})
    return rows


def treated(configuration: Configuration, formulation: str, **changes: Any) -> Configuration:
    """The configuration with the problem that a formulation starts from, and other keys of ``planner`` replaced."""
    treatment = FORMULATIONS[formulation]
    update = {"formulation": "penalty" if treatment.penalty else "hard", "solver": "auto", **changes}
    planner = configuration.planner.model_copy(update=update)
    last = treatment.exact or (LimitClass.THRUST if treatment.penalty else LimitClass.BELIEVED)
    hard = tuple(name for name, found in limits_in(configuration).items() if found <= last)
    limits = configuration.limits.model_copy(update={"hard": hard})
    return configuration.model_copy(update={"planner": planner, "limits": limits})


def make_planner(configuration: Configuration, pair: Pair, **changes: Any) -> Any:
    """A fresh planner of a pair, with the configuration's options for its solver.

    Raises
    ------
    ConfigurationError
        If the pair cannot be made for this configuration.
    """
    treatment, section = treated(configuration, pair.formulation, **changes), configuration.planner
    options = options_beside(section.solver, pair.solver, section.solver_options)
    options.pop("penalty", None)  # a formulation says this itself
    try:
        problem = build_flat_problem(treatment, build_vehicle(treatment))
        return FORMULATIONS[pair.formulation].solvers[pair.solver](problem, options)
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
