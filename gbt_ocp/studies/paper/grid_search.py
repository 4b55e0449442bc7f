"""Grid search of the methods that are compared: on seeds of its own, every score kept."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from gbt_ocp.experiments.config import yaml_dialect as dialect
from gbt_ocp.experiments.sweep.carry_out import Sweep
from gbt_ocp.experiments.sweep.sweep_plan import Variant, variant
from gbt_ocp.files import packaged_text
from gbt_ocp.studies.paper.methods import PLANE, Method
from gbt_ocp.studies.paper.workbench import Workbench

SEEDS = {2: (1000, 1001), 3: (1000,)}
"""Seeds by dimension, none of them used for a table. Without noise, runs differ in nothing but the start; the grids in
space are four times as large."""

DURATION_S = 15.0
"""Length of a run of the search: half of those of the tables."""

PRIOR_STD = 3.0
"""Every method knows where the target starts to this many metres on each axis, around the origin."""

TUNED_FILE = "tuned.yaml"

Parameters = dict[str, Any]
Chosen = dict[tuple[str, str], Parameters]
"""Parameters by method and case."""

Score = tuple[str, str, Parameters, float, float, int]
"""Method, case, point of the grid, mean of the whole-run and of the settled error, runs that did not succeed."""


def _dimension(case: str) -> int:
    return 2 if case in PLANE else 3


def method_variant(method: Method, case: str, point: Mapping[str, Any]) -> Variant:
    """The configuration of a method on a case, with the prior position that all methods are given."""
    prior = {"position": [0.0] * _dimension(case), "std": PRIOR_STD}
    labels = {"case": case, "method": method.name, **point}
    return variant(case, {**method.keys, **point, "tracker.prior": prior}, labels=labels)


def _tried(method: Method, case: str, point: Mapping[str, Any]) -> Variant:
    """A point of a grid: shorter, and labelled by its estimator, since two methods may ask for the same runs."""
    made = method_variant(method, case, point)
    shorter = made.configuration.model_copy(update={"duration_s": DURATION_S})
    return Variant({**made.overrides, "method": _estimator(method)}, shorter)


@cache
def shipped() -> Chosen:
    """The parameters that were found with ``--tune``, as they are shipped."""
    text = packaged_text("gbt_ocp.studies.paper", TUNED_FILE)
    found, _ = dialect.parse(text, TUNED_FILE)
    return {(name, case): dict(point or {}) for name, cases in found.items() for case, point in cases.items()}


def as_yaml(chosen: Chosen) -> str:
    """The file of :func:`shipped`."""
    nested: dict[str, dict[str, Parameters]] = {}
    for (name, case), point in chosen.items():
        nested.setdefault(name, {})[case] = point
    return dialect.dump(nested)


def searched_on(cases: Sequence[str]) -> str:
    """Seeds and length of the runs of the search, in words."""
    seeds = SEEDS[_dimension(cases[0])]
    return f"{len(seeds)} run{'s' * (len(seeds) > 1)} of {DURATION_S:g} s a point (from seed {seeds[0]})"


def search(
    workbench: Workbench, name: str, methods: Sequence[Method], cases: Sequence[str]
) -> tuple[Chosen, list[Score]]:
    """Search the grids of all methods, each case by itself.

    A method with several grids is searched along one after the other. A point scores the mean of the method's column
    over the :data:`SEEDS`; one with a failed or diverged run is not chosen while there is another.

    Returns
    -------
    chosen, scores
        The best parameters, and the score of every point that was tried.
    """
    chosen: Chosen = {(method.name, case): {} for method in methods for case in cases}
    scores: list[Score] = []
    seeds = SEEDS[_dimension(cases[0])]
    for stage in range(max(len(method.grids) for method in methods)):
        variants: list[Variant] = []
        for method in methods:
            for case in cases if stage < len(method.grids) else ():
                for point in _points(method.grids[stage]):
                    made = _tried(method, case, {**chosen[method.name, case], **point})
                    if made not in variants:
                        variants.append(made)
        done = workbench.sweep(f"{name}-tuning-{stage + 1}", variants, seeds=seeds)
        for method in methods:
            if stage < len(method.grids):
                for case in cases:
                    tried = _scores(done, method, case, chosen[method.name, case])
                    scores += tried
                    column = 3 if method.score == "error_mean" else 4
                    chosen[method.name, case] = min(tried, key=lambda score: (score[5] > 0, score[column]))[2]
    return chosen, scores


def _points(grid: Mapping[str, Sequence[Any]]) -> list[Parameters]:
    return [dict(zip(grid, values, strict=True)) for values in product(*grid.values())]


def _estimator(method: Method) -> str:
    return str(method.keys["tracker.kind"])


def _scores(done: Sweep, method: Method, case: str, fixed: Parameters) -> list[Score]:
    """Scores of the points of one method and case that agree with what is fixed already, in the order of the grid."""
    found = []
    for entry in done.plan.variants:
        agrees = all(entry.overrides.get(key) == value for key, value in fixed.items())
        if (entry.overrides["case"], entry.overrides["method"]) != (case, _estimator(method)) or not agrees:
            continue
        rows = [row for row in done.rows if all(row.get(key) == value for key, value in entry.overrides.items())]
        means = []
        good = np.ones(len(rows), dtype=bool)
        for key in ("error_mean", "error_settled"):
            values = Workbench.column(rows, key)
            good &= np.isfinite(values)
            means.append(float(values[good].mean()) if good.any() else math.inf)
        point = {key: value for key, value in entry.overrides.items() if key not in ("case", "method")}
        found.append((method.name, case, point, means[0], means[1], int((~good).sum())))
    return found
