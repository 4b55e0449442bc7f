"""How the treatments depend on their settings: ϖ, w_p and units of the penalty, γ and n_c of them all."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from gbt_ocp.experiments.build.loop import build_flat_problem, build_vehicle
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.ocp.planner import Planner
from gbt_ocp.ocp.stiffness import kink_widths, stiffness
from gbt_ocp.studies.limits.comparison_tables import Row
from gbt_ocp.studies.limits.formulations import COMPILED, IPOPT, StagedPenalty, limits_in
from gbt_ocp.studies.limits.problems import RANDOM, RECORDED, Check, Problems, unasked
from gbt_ocp.studies.limits.solves import COLD_AND_WARM, solve_chunk
from gbt_ocp.studies.limits.treatments import Pair, treated

WIDTHS = (0.3, 0.1, 0.03, 0.01, 0.003, 0.001)
WEIGHTS = (10.0, 100.0, 1000.0, 10000.0)
GAMMAS = (0.9, 0.95, 0.98, 0.99, 0.999)
NODES = (1, 2, 4, 8, 20)
"""Values of the settings; each is varied alone, with the configuration's other settings. ϖ in units of the limit."""

FORMS = {"penalty": "printed", "elastic": "elastic"}
"""Formulations that are swept over ϖ, w_p and units with IPOPT, and the form of the penalty that IPOPT gets in each."""

PROBLEMS = {IPOPT: 4, COMPILED: 40}
"""Problems of a configuration on which a solver is swept, half recorded and half random."""


@dataclass(frozen=True)
class VariedSetting:
    """One setting varied: ``points`` gives the name of each value and the keys of ``planner`` that it changes."""

    swept: str
    pair: Pair
    points: tuple[tuple[str, tuple[tuple[str, Any], ...]], ...]


def varied_settings(configuration: Configuration, pairs: list[Pair]) -> Iterator[VariedSetting]:
    """The settings that are varied for the chosen pairs.

    ϖ is swept in units of the limit. In newtons the same penalty has ``ϖ τ_max`` and ``w_p/τ_max`` (the first limit
    stands for all); the paper's w_p = 1000 without a ϖ is tried with 10 N and with the same ϖ as in units of the limit.
    All of these settings are of the thrust limits: a configuration that has others takes no part.
    """
    if limits_in(configuration):
        return
    planner, unit = configuration.planner, float(build_vehicle(configuration).thrust_max[0])
    factor = 1.0 if planner.thrust_units == "normalised" else unit
    width, weight = planner.width / factor, planner.weight * factor
    points: dict[str, list[tuple[str, dict[str, Any]]]] = {
        "width": [(f"{w:g}", {"width": w, "weight": weight}) for w in WIDTHS],
        "weight": [(f"{w:g}", {"width": width, "weight": w}) for w in WEIGHTS],
        "units": [
            (f"newton, width {w:g} N, weight {p:g}", {"width": w, "weight": p, "thrust_units": "newton"})
            for w, p in ((width * unit, weight / unit), (width * unit, 1000.0), (10.0, 1000.0))
        ],
    }
    for formulation in FORMS:
        if Pair(formulation, IPOPT) in pairs:
            for swept, found in points.items():
                settings = tuple(
                    (name, tuple(({"thrust_units": "normalised"} | changes).items())) for name, changes in found
                )
                yield VariedSetting(swept, Pair(formulation, IPOPT), settings)
    for formulation in ("elastic", "hard", "exchange"):
        # exchange, compiled, would have a ladder of solvers generated for every value
        solvers = (IPOPT, COMPILED) if formulation == "exchange" else (COMPILED, IPOPT)
        pair = next((Pair(formulation, one) for one in solvers if Pair(formulation, one) in pairs), None)
        if pair is not None:
            yield VariedSetting("gamma", pair, tuple((f"{g:g}", (("gamma", g),)) for g in GAMMAS))
            yield VariedSetting("nodes", pair, tuple((f"{n}", (("nodes", n),)) for n in NODES))


def solve_varied(
    configuration: Configuration, problems: Problems, setting: VariedSetting, check: Check = unasked
) -> list[Row]:
    """Solve a sample with every value of a setting, cold and warm; one row a solve."""
    some = sample(problems, setting.pair)
    rows, planner, units = [], None, None
    for value, changes in setting.points:
        changed = treated(configuration, setting.pair.formulation, **dict(changes))
        problem = build_flat_problem(changed, build_vehicle(changed))
        kink: Row = {"kink_mm": None, "stiffness": None}
        if problem.penalties:
            limit = problem.penalties[0]
            narrowest = float(kink_widths(problem, limit)[: configuration.dimension].min())
            kink = {"kink_mm": 1e3 * narrowest, "stiffness": stiffness(problem, limit)}
        if setting.swept in ("width", "weight", "units"):
            # ϖ and w_p are parameters of the program: it is built again only for other units
            if planner is None or changed.planner.thrust_units != units:
                solver = StagedPenalty(problem, [], form=FORMS[setting.pair.formulation])
                planner, units = Planner(problem, solver), changed.planner.thrust_units
            solver.stages = [[(soft.width, soft.weight) for soft in problem.penalties]]
        for mode in COLD_AND_WARM:
            chunk = range(len(some))
            found = solve_chunk(
                configuration, some, chunk, setting.pair, mode, planner=planner, check=check, **dict(changes)
            )
            rows += [{"swept": setting.swept, "value": value, **kink, **row} for row in found]
    return rows


def sample(problems: Problems, pair: Pair) -> Problems:
    """The problems that a pair is swept on."""
    numbers: list[int] = []
    for origin in (RECORDED, RANDOM):
        there = np.flatnonzero(problems.origin == origin)
        count = min(PROBLEMS[pair.solver] // 2, len(there))
        # inside: the very first one is the first step of a run, which has no plan before it
        inside = np.linspace(0, len(there) - 1, count + 2)[1:-1]
        numbers += there[inside.round().astype(int)].tolist()
    return problems.subset(np.array(sorted(set(numbers))))
