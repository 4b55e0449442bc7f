"""The section ``limits``: what the vehicle must keep to besides its thrust.

A limit is defined in one place: its name, its key with what the key allows, and the constraints that it makes. The
functions below :class:`LimitsSection` define those that exist. A further limit is a further function, here or in a
problem's own file; see :func:`limit`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from gbt_ocp.experiments.config.keys import (
    PositionNumbers,
    Positive,
    PositiveInputNumbers,
    Section,
    as_tuples,
    key,
    redeclare,
)

if TYPE_CHECKING:  # CasADi takes a second to import, which a check of a configuration does not need
    from gbt_ocp.ocp import Constraint
    from gbt_ocp.ocp.problem_data import PosedProblem

Corner = tuple[float, float]


class RangeLimitSection(Section):
    """Distance from the target, as far as the forecast tells it."""

    nearest_m: Positive | None = key(None, "Least range in m.")
    farthest_m: Positive | None = key(None, "Largest range in m.", "null, or a number > nearest_m")
    confidence: float = key(0.95, "Probability with which each of the two is kept.", ge=0.5, lt=1.0)
    margin_m: float = key(
        0.0, "By how much plans keep more than what is asked, in m; a run is judged by what is asked.",
        "a number >= 0, and below half of what lies between nearest_m and farthest_m", ge=0.0,
    )  # fmt: skip
    spread: Literal["forecast", "present"] = key(
        "forecast",
        "Spread of the posterior ahead: that of the forecast, or the present one, which further bearings will keep.",
    )
    target_speed_max: Positive | None = key(
        None,
        "Largest speed of the target through the water in m/s: plans keep the range to wherever it can be until the "
        "next plan, a piece later; null trusts the forecast.",
    )
    hypothesis_probability: Annotated[float, Field(gt=0.0, lt=1.0)] | None = key(
        None,
        "Probability from which on plans keep the range to a hypothesis of the tracker's by itself; null for the "
        "moments of all together.",
    )

    @property
    def nearest_kept(self) -> float | None:
        """What plans keep in metres, the margin with it; ``None`` for no limit."""
        return None if self.nearest_m is None else self.nearest_m + self.margin_m


class DepthLimitSection(Section):
    """The water, in space."""

    lowest_m: float = key(..., "Seabed: least z in m.")
    highest_m: float = key(..., "Surface: largest z in m.", "a number > lowest_m")


class KeepOutZoneSection(Section):
    """A circle (a sphere in space) or a convex polygon (an upright prism in space)."""

    centre_m: PositionNumbers | None = key(None, "Centre of a circle in m.", "{d} numbers, beside radius_m")
    radius_m: Positive | None = key(None, "Its radius in m.", "a number > 0, beside centre_m")
    corners_m: Annotated[tuple[Corner, ...], BeforeValidator(as_tuples)] | None = key(
        None, "Corners of a convex polygon in m, instead.", "at least 3 pairs of numbers round a convex polygon"
    )


class LimitsSection(Section):
    """Limits besides thrust; what is null is not limited."""

    # Its keys are declared by :func:`limit`: those of LIMITS, then those that all limits share.
    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...


@dataclass(frozen=True)
class Limit:
    """A limit: its key in the section, and the constraints that it makes.

    Attributes
    ----------
    key
        Name of the key in the section ``limits``.
    annotation
        Type of its value, ``None`` among the values.
    declared
        Default, meaning and what is allowed, from :func:`~gbt_ocp.experiments.config.keys.key`.
    constraints
        Makes constraints from a value other than ``None`` and the problem that they are added to.
    """

    key: str
    annotation: Any
    declared: Any
    constraints: Callable[[Any, PosedProblem], Iterator[Constraint]]


LIMIT_KINDS: dict[str, Limit] = {}
"""The limits that exist, by the names that ``limits.hard`` lists."""


def limit(name: str, key: str, annotation: Any, declared: Any) -> Callable[[Any], Any]:
    """Define a limit: a decorator of the function that makes its constraints.

    In a problem's file it adds the limit for that problem::

        @limit("north", "north_m", float | None, key(None, "Largest y in m."))
        def _north(value, problem):
            yield NorthLimit(value)

    Parameters
    ----------
    name
        As ``limits.hard`` lists it. A file that is executed again replaces its own limit of that name.
    key, annotation, declared
        See :class:`Limit`.

    Raises
    ------
    ValueError
        If another file has defined a limit of that name or key.
    """

    def define(constraints: Callable[[Any, PosedProblem], Iterator[Constraint]]) -> Any:
        for other, found in LIMIT_KINDS.items():
            if (other == name or found.key == key) and found.constraints.__module__ != constraints.__module__:
                raise ValueError(f"limit {name}: found a name or key ({key}) of a limit that exists; allowed: another")
        LIMIT_KINDS[name] = Limit(key, annotation, declared, constraints)
        redeclare(
            LimitsSection, {**{one.key: (one.annotation, one.declared) for one in LIMIT_KINDS.values()}, **_shared()}
        )
        return constraints

    return define


def _shared() -> dict[str, tuple[Any, Any]]:
    names: Any = Literal.__getitem__(tuple(LIMIT_KINDS))
    return {
        "hard": (
            Annotated[tuple[names, ...], BeforeValidator(as_tuples)],
            key((), "Which of them are imposed exactly; the others are penalised."),
        ),
        "weight": (Positive, key(100.0, "w_p of those that are penalised.")),
        "width": (Positive, key(0.01, "ϖ of those that are penalised, in units of the limit.")),
        "nodes": (int, key(4, "n_c, intervals a piece at which they are imposed.", ge=1)),
    }


@limit(
    "range",
    "range",
    RangeLimitSection | None,
    key(None, "Distance from the target."),
)
def _range(value: RangeLimitSection, problem: PosedProblem) -> Iterator[Constraint]:
    from gbt_ocp.guidance.standoff import RangeOfHypotheses, ReachableRange
    from gbt_ocp.guidance.target_limits import RangeLimits

    far = None if value.farthest_m is None else value.farthest_m - value.margin_m
    foresee, reach = value.spread == "forecast", (value.target_speed_max or 0.0) * problem.period
    limits = RangeLimits(problem.vehicle.position_dimension, value.nearest_kept, far, value.confidence, foresee=foresee)
    if value.hypothesis_probability is not None:
        yield RangeOfHypotheses(limits, value.hypothesis_probability, reach)
    else:
        yield ReachableRange(limits, reach) if reach > 0.0 else limits


@limit(
    "keep_out",
    "keep_out",
    Annotated[tuple[KeepOutZoneSection, ...], BeforeValidator(as_tuples)],
    key((), "Zones to stay out of.", "a list of mappings, each with centre_m and radius_m, or with corners_m"),
)
def _keep_out(value: tuple[KeepOutZoneSection, ...], problem: PosedProblem) -> Iterator[Constraint]:
    from gbt_ocp.ocp import KeepOut, KeepOutPolygon

    for zone in value:
        if zone.corners_m is not None:
            yield KeepOutPolygon(zone.corners_m)
        elif zone.centre_m is not None and zone.radius_m is not None:
            yield KeepOut(zone.centre_m, zone.radius_m)


@limit(
    "separation",
    "separation_m",
    Positive | None,
    key(
        None,
        "Least distance in m from other vehicles, beside vehicles: each stays on its side of the target, or clear of "
        "wherever the others can be.",
    ),
)
def _separation(value: float, problem: PosedProblem) -> Iterator[Constraint]:
    from gbt_ocp.guidance.apart import KeepApart

    yield KeepApart(problem.vehicle.position_dimension, value)


@limit(
    "depth",
    "depth",
    DepthLimitSection | None,
    key(None, "Seabed and surface, in space."),
)
def _depth(value: DepthLimitSection, problem: PosedProblem) -> Iterator[Constraint]:
    from gbt_ocp.ocp import DepthLimits

    yield DepthLimits(value.lowest_m, value.highest_m)


@limit("speed", "speed", Positive | None, key(None, "Largest speed in m/s."))
def _speed(value: float, problem: PosedProblem) -> Iterator[Constraint]:
    from gbt_ocp.ocp import SpeedLimit

    yield SpeedLimit(problem.vehicle.position_dimension, value)


@limit(
    "speed_min",
    "speed_min",
    Positive | None,
    key(None, "Least speed ahead through the water in m/s, for a vehicle that is steered by fins."),
)
def _speed_min(value: float, problem: PosedProblem) -> Iterator[Constraint]:
    from gbt_ocp.guidance.steering_limits import LeastSpeed

    _refuse_without_yaw("speed_min", value, problem)
    yield LeastSpeed(problem.vehicle.position_dimension, value)


@limit(
    "turn_radius",
    "turn_radius_m",
    Positive | None,
    key(None, "Least radius of turns in m."),
)
def _turn_radius(value: float, problem: PosedProblem) -> Iterator[Constraint]:
    from gbt_ocp.guidance.steering_limits import LeastTurnRadius

    _refuse_without_yaw("turn_radius_m", value, problem)
    yield LeastTurnRadius(problem.vehicle.position_dimension, value)


@limit(
    "pitch",
    "pitch_deg",
    Annotated[float, Field(gt=0.0, lt=90.0)] | None,
    key(None, "Largest pitch in degrees, of a vehicle that has one."),
)
def _pitch(value: float, problem: PosedProblem) -> Iterator[Constraint]:
    from gbt_ocp.guidance.steering_limits import PitchLimit

    if problem.vehicle.flat_dimension <= problem.vehicle.position_dimension + 1:
        raise ValueError(f"limits.pitch_deg: found {value}; allowed: null, the vehicle has no pitch")
    yield PitchLimit(math.radians(value))


@limit(
    "input_rate",
    "input_rate",
    PositiveInputNumbers | None,
    key(None, "Largest rates of the inputs in their units a second, with planner.form: shooting."),
)
def _input_rate(value: tuple[float, ...], problem: PosedProblem) -> Iterator[Constraint]:
    from gbt_ocp.ocp import InputRateLimit

    yield InputRateLimit(problem.vehicle, value)


@limit(
    "yaw_rate",
    "yaw_rate_deg",
    Positive | None,
    key(None, "Largest yaw rate in degrees a second."),
)
def _yaw_rate(value: float, problem: PosedProblem) -> Iterator[Constraint]:
    from gbt_ocp.ocp import YawRateLimit

    _refuse_without_yaw("yaw_rate_deg", value, problem)
    yield YawRateLimit(problem.vehicle.position_dimension, math.radians(value))


@limit(
    "bow_angle",
    "bow_angle_deg",
    Annotated[float, Field(gt=0.0, lt=180.0)] | None,
    key(None, "Largest angle between bow and expected target in degrees."),
)
def _bow_angle(value: float, problem: PosedProblem) -> Iterator[Constraint]:
    from gbt_ocp.guidance.target_limits import FieldOfView

    _refuse_without_yaw("bow_angle_deg", value, problem)
    yield FieldOfView(problem.vehicle.position_dimension, math.radians(value))


def _refuse_without_yaw(key: str, value: float, problem: PosedProblem) -> None:
    if problem.vehicle.flat_dimension <= problem.vehicle.position_dimension:
        raise ValueError(f"limits.{key}: found {value}; allowed: null, the vehicle's flat output has no yaw")
