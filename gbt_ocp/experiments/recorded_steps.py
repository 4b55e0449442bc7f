"""What a planner is given in the closed loop of a configuration: steps to record for its C."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.guidance.startup import planned_of
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.ocp.planner import AnyPlanner
from gbt_ocp.simulation.loop import simulate


class _EnoughError(Exception):
    """So many steps are recorded as were asked for."""


class _Recorder(AnyPlanner):
    """A planner that keeps the arguments of its solves, and ends the loop after so many."""

    def __init__(self, planner: AnyPlanner, count: int) -> None:
        super().__init__(planner.problem, planner.solver)
        self.steps: list[dict[str, Any]] = []
        self._count = count

    def solve(
        self, state: ArrayLike, forecast: Any = None, desired: ArrayLike | None = None, **data: Any
    ) -> Plan | ShootingPlan:
        if len(self.steps) == self._count:
            raise _EnoughError
        self.steps.append({"state": np.array(state), "forecast": forecast, "desired": desired, **data})
        return super().solve(state, forecast, desired, **data)


def recorded_steps(configuration: Configuration, planner: AnyPlanner, count: int) -> list[dict[str, Any]]:
    """Run the closed loop of a configuration with this planner until it has solved so often.

    Parameters
    ----------
    configuration
        The experiment; its duration bounds that of the loop.
    planner
        Of the configuration's problem. Its memory stays as it is.
    count
        Solves, at most.

    Returns
    -------
    The arguments of each solve, as :func:`gbt_ocp.ocp.write_c` takes them.

    Raises
    ------
    ConfigurationError
        If nothing was solved: the guidance does not plan, or not within the duration.
    """
    loop, start = build_loop(configuration)
    planned = planned_of(loop.guidance)
    if planned is None:
        found = configuration.guidance.kind
        raise ConfigurationError(
            [f"guidance.kind: found {found}; allowed: planner, whose steps are recorded for the generated code"]
        )
    recorder = _Recorder(planner, count)
    planned.planner = recorder
    with suppress(_EnoughError):
        simulate(loop, start, configuration.duration_s)
    if not recorder.steps:
        raise ConfigurationError(
            [
                f"duration_s: found {configuration.duration_s:g}, in which nothing is planned; allowed: a longer one, "
                "since steps of the closed loop are recorded for the generated code"
            ]
        )
    return recorder.steps
