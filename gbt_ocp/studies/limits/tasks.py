"""What a comparison consists of, settled before anything runs, and the tasks it is carried out in."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.studies.limits.formulations import COMPILED, FORMULATIONS, IPOPT, Share
from gbt_ocp.studies.limits.sensitivity import varied_settings
from gbt_ocp.studies.limits.solves import COLD_AND_WARM
from gbt_ocp.studies.limits.treatments import Pair, unfit

FORMAT = 1
"""Version of ``comparison.json``."""

CHUNK = 25
"""Problems a task: small enough to lose little in an interruption, large enough to build a solver for. They are drawn
from all problems, so that some of the chunks stand for all of them."""

RANDOM_SHARE = 0.25
"""Random problems beside each recorded one."""


@dataclass(frozen=True)
class ComparisonPlan:
    """A comparison.

    Attributes
    ----------
    configurations
        The experiments, by distinct names.
    pairs
        Formulations with solvers.
    runs
        Seeds in closed loop, and runs that problems are recorded in.
    problems
        Recorded problems of each experiment, at least.
    full
        Whether slow pairs get all of the work too, which takes hours instead of minutes.
    """

    configurations: tuple[Configuration, ...]
    pairs: tuple[Pair, ...]
    runs: int
    problems: int
    full: bool = False

    def to_json(self) -> str:
        """The plan as it stands in the folder; equal plans are equal texts."""
        return (
            json.dumps(
                {
                    "format": FORMAT,
                    "runs": self.runs,
                    "problems": self.problems,
                    "full": self.full,
                    "pairs": [[pair.formulation, pair.solver] for pair in self.pairs],
                    "configurations": [configuration.to_mapping() for configuration in self.configurations],
                },
                indent=1,
                ensure_ascii=False,
            )
            + "\n"
        )

    @property
    def recorded_a_run(self) -> int:
        """Problems recorded in each run."""
        return math.ceil(self.problems / self.runs)

    @property
    def random(self) -> int:
        """Random problems of each experiment."""
        return max(1, round(RANDOM_SHARE * self.problems))

    def seeds(self, pair: Pair, case: int) -> int:
        """Seeds that a pair gets in closed loop of an experiment."""
        share = self.share(pair)
        first = next((k for k in range(len(self.configurations)) if pair in self.pairs_of(k)), None)
        if share.seeds == 0.0 or (case != first and not share.everywhere):
            return 0
        return max(1, round(self.runs * share.seeds))

    def pairs_of(self, case: int) -> tuple[Pair, ...]:
        """The pairs that an experiment can be treated with."""
        return tuple(pair for pair in self.pairs if unfit(self.configurations[case], pair) is None)

    def share(self, pair: Pair) -> Share:
        """Which share of the work a pair gets."""
        return Share() if self.full else FORMULATIONS[pair.formulation].shares.get(pair.solver, Share())


def chunks(size: int, share: float = 1.0) -> Iterator[tuple[int, list[int]]]:
    """Numbered chunks of so many problems, or of a share of them; each chunk is a random sample of all problems.

    The smaller share is part of the larger one, and the chunks are the same for all pairs.
    """
    shuffled = np.random.default_rng(0).permutation(size)
    parts = np.array_split(shuffled, math.ceil(size / CHUNK))
    for number in range(max(1, round(share * len(parts)))):
        yield number, sorted(parts[number].tolist())


@dataclass(frozen=True)
class Task:
    """A piece of work that leaves one file, ``parts/NAME``.

    Attributes
    ----------
    kind
        ``record``, ``solve``, ``best``, ``loop`` or ``sweep``.
    name
        Of the file.
    case
        Number of the experiment.
    pair
        Whom it concerns, if one alone.
    argument
        What else there is to know: a seed, a range of problems with the mode, a sweep.
    """

    kind: str
    name: str
    case: int
    pair: Pair | None = None
    argument: Any = None


def recordings(plan: ComparisonPlan) -> list[Task]:
    """The tasks that make the problems."""
    return [
        Task("record", f"record-{configuration.name}-{run}.npz", case, argument=run)
        for case, configuration in enumerate(plan.configurations)
        for run in range(plan.runs)
    ]


def measurements(plan: ComparisonPlan, sizes: Sequence[int]) -> list[Task]:
    """All other tasks, for so many problems of each experiment; long ones first, so that no core waits at the end."""
    slow = list(_loops(plan, IPOPT))
    return [*slow, *_sweeps(plan), *_solves(plan, sizes), *_bests(plan, sizes), *_loops(plan, COMPILED)]


def _loops(plan: ComparisonPlan, solver: str) -> Iterator[Task]:
    for case, configuration in enumerate(plan.configurations):
        for pair in plan.pairs_of(case):
            if pair.solver == solver:
                for seed in range(plan.seeds(pair, case)):
                    name = f"loop-{configuration.name}-{pair.formulation}-{pair.solver}-{seed}.csv"
                    yield Task("loop", name, case, pair, seed)


def _sweeps(plan: ComparisonPlan) -> Iterator[Task]:
    for case, configuration in enumerate(plan.configurations):
        for setting in varied_settings(configuration, list(plan.pairs_of(case))):
            name = f"sweep-{configuration.name}-{setting.swept}-{setting.pair.formulation}-{setting.pair.solver}.csv"
            yield Task("sweep", name, case, setting.pair, setting)


def _solves(plan: ComparisonPlan, sizes: Sequence[int]) -> Iterator[Task]:
    for case, configuration in enumerate(plan.configurations):
        for pair in plan.pairs_of(case):
            for mode in COLD_AND_WARM:
                for number, chunk in chunks(sizes[case], plan.share(pair).problems):
                    name = f"solve-{configuration.name}-{pair.formulation}-{pair.solver}-{mode}-{number}.csv"
                    yield Task("solve", name, case, pair, (mode, chunk))


def _bests(plan: ComparisonPlan, sizes: Sequence[int]) -> Iterator[Task]:
    for case, configuration in enumerate(plan.configurations):
        for number, chunk in chunks(sizes[case]):
            yield Task("best", f"best-{configuration.name}-{number}.csv", case, argument=chunk)
