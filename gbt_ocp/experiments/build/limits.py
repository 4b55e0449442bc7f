"""From the section ``limits`` to constraints of the trajectory problem."""

from __future__ import annotations

import math
from collections.abc import Iterator

from gbt_ocp.experiments.config.limits import LimitName
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.guidance.target_limits import FieldOfView, RangeLimits
from gbt_ocp.ocp import Constraint, DepthLimits, KeepOut, KeepOutPolygon, SpeedLimit, TrajectoryProblem, YawRateLimit


def with_limits(problem: TrajectoryProblem, configuration: Configuration) -> TrajectoryProblem:
    """The problem subject to the limits of the configuration.

    Raises
    ------
    ValueError
        If a limit makes no sense, or the vehicle's flat output carries no yaw for one that needs it.
    """
    section = configuration.limits
    for name, constraint in _constraints(problem, configuration):
        if name in section.hard:
            problem = problem.subject_to(constraint, nodes=section.nodes)
        else:
            problem = problem.subject_to_penalty(
                constraint, weight=section.weight, width=section.width, nodes=section.nodes
            )
    return problem


def _constraints(problem: TrajectoryProblem, configuration: Configuration) -> Iterator[tuple[LimitName, Constraint]]:
    section, d = configuration.limits, configuration.dimension
    if section.range is not None:
        limit = section.range
        near = None if limit.nearest_m is None else limit.nearest_m + limit.margin_m
        far = None if limit.farthest_m is None else limit.farthest_m - limit.margin_m
        yield "range", RangeLimits(d, near, far, limit.confidence, limit.spread == "forecast")
    for zone in section.keep_out:
        if zone.corners_m is not None:
            yield "keep_out", KeepOutPolygon(zone.corners_m)
        elif zone.centre_m is not None and zone.radius_m is not None:
            yield "keep_out", KeepOut(zone.centre_m, zone.radius_m)
    if section.depth is not None:
        yield "depth", DepthLimits(section.depth.lowest_m, section.depth.highest_m)
    if section.speed is not None:
        yield "speed", SpeedLimit(d, section.speed)
    turns: tuple[tuple[LimitName, float | None], ...] = (
        ("yaw_rate", section.yaw_rate_deg),
        ("bow_angle", section.bow_angle_deg),
    )
    for name, degrees in turns:
        if degrees is None:
            continue
        if problem.vehicle.flat_dimension <= d:
            raise ValueError(f"limits.{name}_deg: found {degrees}; allowed: null, the vehicle's flat output has no yaw")
        angle = math.radians(degrees)
        yield name, YawRateLimit(d, angle) if name == "yaw_rate" else FieldOfView(d, angle)
