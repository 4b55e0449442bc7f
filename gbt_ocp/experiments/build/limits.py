"""From the section ``limits``, and what effort costs, to constraints of the trajectory problem."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar, cast

from gbt_ocp.experiments.config.limits import LIMIT_KINDS, LimitsSection
from gbt_ocp.experiments.config.planner import PlannerSection
from gbt_ocp.guidance.apart import KeepApart
from gbt_ocp.guidance.current import Current
from gbt_ocp.guidance.water import OverGround
from gbt_ocp.ocp import PathConstraint, ThrustChange, ThrustEffort
from gbt_ocp.ocp.verbs import PosingVerbs

Posed = TypeVar("Posed", bound=PosingVerbs)

EFFORT_NODES = 2
"""Intervals a piece over which the effort is summed: it is a parabola in the thrust, which varies little in one."""


def with_effort(problem: Posed, section: PlannerSection, vehicle: Any) -> Posed:
    """The problem with what thrust and its changes cost, as far as the section weighs them.

    Raises
    ------
    ValueError
        If changes are to count where the thrust jumps.
    """
    if section.effort > 0.0:
        effort, width = ThrustEffort(vehicle), ThrustEffort.WIDTH
        problem = problem.subject_to_penalty(effort, weight=4.0 * section.effort, width=width, nodes=EFFORT_NODES)
    if section.effort_rate > 0.0:
        # the parabola holds up to a change from one limit to the other within a piece
        change = ThrustChange(vehicle, reach=2.0 / problem.period)
        weight, width = change.weight(section.effort_rate), change.width
        problem = problem.subject_to_penalty(change, weight=weight, width=width, nodes=EFFORT_NODES)
    return problem


def with_limits(problem: Posed, section: LimitsSection, current: Current | None = None, others: int = 0) -> Posed:
    """The problem subject to the limits of the section: those of ``hard`` at the nodes, the others as penalties.

    With a current, what stands still over ground moves in the problem. So many ``others`` are vehicles to keep apart
    from.

    Raises
    ------
    ValueError
        If a limit makes no sense, or the vehicle's flat output has no yaw for one that needs it.
    """
    for name, limit in LIMIT_KINDS.items():
        value = getattr(section, limit.key)
        for constraint in () if value is None else limit.constraints(value, problem):
            if isinstance(constraint, KeepApart):
                if others == 0:
                    continue
                constraint = replace(constraint, count=others)
                if section.range is not None:
                    kept = {"nearest": section.range.nearest_m, "confidence": section.range.confidence}
                    constraint = replace(constraint, **kept)
            if current is not None and getattr(constraint, "over_ground", False):
                constraint = OverGround(cast(PathConstraint, constraint), current, problem.period)
            if name in section.hard:
                problem = problem.subject_to(constraint, nodes=section.nodes)
            else:
                problem = problem.subject_to_penalty(
                    constraint, weight=section.weight, width=section.width, nodes=section.nodes
                )
    return problem
