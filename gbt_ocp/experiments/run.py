"""One experiment: a configuration in, a result out."""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

from tqdm import tqdm

from gbt_ocp.experiments.build.desired import unreachable_bearings
from gbt_ocp.experiments.build.far_priors import far_priors
from gbt_ocp.experiments.build.team import TeamMember, build_team
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.experiments.interrupts import interrupted_between_steps
from gbt_ocp.experiments.noise_check import run_noise_warnings
from gbt_ocp.experiments.result import Result
from gbt_ocp.guidance.startup import planner_of
from gbt_ocp.guidance.strategy import Guidance
from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.ocp.codegen.library import CompilerError
from gbt_ocp.ocp.planner import AnyPlanner, Planner
from gbt_ocp.ocp.stiffness import STALLING, kink_widths, stiffness
from gbt_ocp.simulation.channel import Channel
from gbt_ocp.simulation.closed_loop import Recording
from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.loop import simulate_together, step_count
from gbt_ocp.simulation.summary import installed_versions, summarise
from gbt_ocp.simulation.team_history import TeamHistory
from gbt_ocp.simulation.team_summary import team_numbers
from gbt_ocp.tracking.gaps import gap_warning


def stalling_penalties(guidance: Guidance) -> list[str]:
    """Warnings, one a penalty whose kink is so stiff that Newton's method stalls on it.

    Only IPOPT with the penalty as printed follows the kink itself; the elastic form and the compiled solver get it as
    inequalities and do not stall, however narrow it is (``gbt-ocp compare`` measures both).
    """
    planner = planner_of(guidance)
    if not isinstance(planner, Planner) or not getattr(planner.solver, "prints_penalty", False):
        return []
    problem, found = planner.problem, []
    for penalty in problem.penalties:
        hardness = stiffness(problem, penalty)
        if hardness > STALLING:
            metres = float(kink_widths(problem, penalty)[: problem.vehicle.position_dimension].min())
            found.append(
                f"planner: width {penalty.width:g} and weight {penalty.weight:g} make a kink {1e3 * metres:.3g} mm "
                f"wide in the endpoints, with a stiffness of {hardness:.3g} (above {STALLING:g}): Newton steps on the "
                "penalty as printed will stall; solver_options.penalty elastic, solver compiled and formulation hard "
                "do not"
            )
    return found


def run(
    configuration: Configuration | str | Path | Mapping[str, Any],
    *,
    overrides: Iterable[str] = (),
    seed: int | None = None,
    progress: bool = False,
) -> Result:
    """Run one experiment.

    Parameters
    ----------
    configuration
        A configuration, the name of a shipped one, a path to a YAML file, or a mapping with its keys.
    overrides
        ``key.path=value`` strings that replace single keys; only for a configuration that is not loaded yet.
    seed
        Replaces the seed, likewise.
    progress
        Show a progress bar on standard error.

    Warns
    -----
    RuntimeWarning
        If a prior is centred on the origin and the vehicle starts far from it, the vehicle cannot follow the desired
        bearing at its standoff, or the penalty is so stiff that Newton steps will stall; the summary has the same under
        ``warnings``.

    Raises
    ------
    ConfigurationError
        If the configuration is wrong; one line a fault.
    KeyboardInterrupt
        If the run was interrupted (Ctrl-C), after the step it was in.
    """
    if not isinstance(configuration, Configuration):
        configuration = load_config(configuration, overrides=list(overrides), seed=seed)
    elif seed is not None or list(overrides):
        raise ValueError("overrides and seed belong to load_config; this configuration is loaded already")
    began = perf_counter()
    try:
        members, channel = build_team(configuration)
    except (ValueError, CompilerError) as fault:
        # What only shows when the parts are put together is still a fault of the input.
        raise ConfigurationError([f"{configuration.name}: {fault}"]) from fault

    doubts = [_doubts(member) for member in members]
    for member, lines in zip(members, doubts, strict=True):
        _warn(member, lines)
    steps = step_count(configuration.duration_s, configuration.period_s)
    with (
        interrupted_between_steps() as check,
        tqdm(total=steps, disable=not progress, file=sys.stderr, unit="step", desc=configuration.name) as bar,
    ):

        def after_step(step: int, error: float, solver_time: float) -> None:
            check()
            if not progress:  # the bar would have the line made and throw it away
                return
            solver = f", solver {1e3 * solver_time:.1f} ms" if math.isfinite(solver_time) else ""
            bar.set_postfix_str(f"error {error:.4f} m{solver}", refresh=False)
            bar.update()

        recordings = simulate_together(
            [(member.loop, member.start) for member in members],
            configuration.duration_s,
            channel,
            after_step,
            History if channel is None else TeamHistory,
        )
    wall = perf_counter() - began
    results = [_result(*one, wall) for one in zip(members, recordings, doubts, strict=True)]
    return results[0] if channel is None else _together(configuration, members, results, channel)


def _doubts(member: TeamMember) -> list[str]:
    """What is to be said of a vehicle before it runs."""
    configuration, loop = member.configuration, member.loop
    return [
        *far_priors(configuration.tracker, member.start[0, : configuration.dimension], loop.sensor),
        *unreachable_bearings(configuration, loop.vehicle),
        *stalling_penalties(loop.guidance),
    ]


def _warn(member: TeamMember, lines: Iterable[str]) -> None:
    name = ", ".join(filter(None, [member.configuration.name, member.name]))
    for line in lines:
        warnings.warn(f"{name}: {line}", RuntimeWarning, stacklevel=3)


def _result(member: TeamMember, recording: Recording, doubts: list[str], wall: float) -> Result:
    """The result of one vehicle."""
    configuration, loop, history = member.configuration, member.loop, recording.history
    summary = summarise(
        history,
        period=configuration.period_s,
        seed=configuration.seed,
        wall_s=wall,
        solver_first_try=history.answered_first,
        retries={
            "tightened": recording.tightened,
            "nugget": recording.nugget_retries,
            "refused_bearings": recording.refused_bearings,
            "held_forecasts": recording.held_forecasts,
            "clipped": recording.clipped,
            "new_tracks": len(recording.new_tracks),
        },
        versions=installed_versions(),
        forecast_period=configuration.forecast_period,
        standoff=configuration.standoff,
        hotel_w=configuration.vehicle.hotel_w,
    )
    # the configuration has `auto`, which does not name the solver that was chosen
    planner = planner_of(loop.guidance)
    summary["solver"] = planner.solver.name if isinstance(planner, AnyPlanner) else None
    afterwards = run_noise_warnings(
        history, configuration.tracker, loop.sensor, configuration.forecast_period, loop.sensors is not None
    )
    if recording.new_tracks:
        afterwards.append(gap_warning(configuration.tracker.kind, recording.new_tracks))
    _warn(member, afterwards)
    summary["warnings"] = [*doubts, *afterwards]
    # the configuration has no limits of a problem's own vehicle
    limits = ThrustRange.of(loop.vehicle)
    summary["thrust_max"], summary["thrust_min"] = limits.upper.tolist(), limits.lower.tolist()
    driven = loop.vehicle if isinstance(loop.vehicle, DrivenBody) else None
    summary["inputs"] = None if driven is None else list(driven.input_names[driven.position_dimension])
    return Result(configuration, history, summary)


def _together(
    configuration: Configuration, members: list[TeamMember], results: list[Result], channel: Channel
) -> Result:
    """The result of the first of several vehicles, with those of the others."""
    by_name = {member.name: result for member, result in zip(members, results, strict=True)}
    numbers = team_numbers(
        {name: result.history for name, result in by_name.items()},
        {name: result.summary for name, result in by_name.items()},
        channel,
        configuration.limits.separation_m,
    )
    first, *others = by_name
    rest = {name: replace(by_name[name], configuration=configuration) for name in others}
    return Result(configuration, results[0].history, by_name[first].summary | numbers, rest)
