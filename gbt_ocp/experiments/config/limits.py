"""The section ``limits``: what the vehicle must keep to besides its thrust."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from gbt_ocp.experiments.config.keys import PositionNumbers, Positive, Section, as_tuples, key

LimitName = Literal["range", "keep_out", "depth", "speed", "yaw_rate", "bow_angle"]
"""Names of the limits, as :attr:`Limits.hard` lists them."""

Corner = tuple[float, float]


class RangeLimit(Section):
    """Distance from the target, as far as the forecast tells it."""

    nearest_m: Positive | None = key(None, "Least range in m.", "a number > 0, or null for none")
    farthest_m: Positive | None = key(None, "Largest range in m.", "a number > nearest_m, or null for none")
    confidence: float = key(
        0.95, "Probability with which each of the two is kept.", "a number in [0.5, 1)", ge=0.5, lt=1.0
    )
    margin_m: float = key(
        0.0, "By how much plans keep more than what is asked, in m; a run is judged by what is asked.",
        "a number >= 0, and below half of what lies between nearest_m and farthest_m", ge=0.0,
    )  # fmt: skip
    spread: Literal["forecast", "present"] = key(
        "forecast",
        "Spread of the posterior ahead: that of the forecast, or the present one, which further bearings will keep.",
        "forecast, present",
    )


class DepthLimit(Section):
    """The water, in space."""

    lowest_m: float = Field(description="Seabed: least z in m.", json_schema_extra={"allowed": "a number"})
    highest_m: float = Field(
        description="Surface: largest z in m.", json_schema_extra={"allowed": "a number > lowest_m"}
    )


class KeepOutZone(Section):
    """A circle (a sphere in space) or a convex polygon (an upright prism in space)."""

    centre_m: PositionNumbers | None = key(None, "Centre of a circle in m.", "{d} numbers, beside radius_m")
    radius_m: Positive | None = key(None, "Its radius in m.", "a number > 0, beside centre_m")
    corners_m: Annotated[tuple[Corner, ...], BeforeValidator(as_tuples)] | None = key(
        None, "Corners of a convex polygon in m, instead.", "at least 3 pairs of numbers round a convex polygon"
    )


class Limits(Section):
    """Limits besides thrust; what is null is not limited."""

    range: RangeLimit | None = key(None, "Distance from the target.", "null, or a mapping with nearest_m, farthest_m")
    keep_out: Annotated[tuple[KeepOutZone, ...], BeforeValidator(as_tuples)] = key(
        (),
        "Zones to stay out of.",
        "a list of mappings, each with centre_m and radius_m, or with corners_m",
    )
    depth: DepthLimit | None = key(None, "Seabed and surface, in space.", "null, or a mapping with lowest_m, highest_m")
    speed: Positive | None = key(None, "Largest speed in m/s.", "null, or a number > 0")
    yaw_rate_deg: Positive | None = key(None, "Largest yaw rate in degrees a second.", "null, or a number > 0")
    bow_angle_deg: float | None = key(
        None,
        "Largest angle between bow and expected target in degrees.",
        "null, or a number in (0, 180)",
        gt=0.0,
        lt=180,
    )
    hard: Annotated[tuple[LimitName, ...], BeforeValidator(as_tuples)] = key(
        (),
        "Which of them are imposed exactly; the others are penalised.",
        "a list of range, keep_out, depth, speed, yaw_rate, bow_angle",
    )
    weight: Positive = key(100.0, "w_p of those that are penalised.", "a number > 0")
    width: Positive = key(0.01, "ϖ of those that are penalised, in units of the limit.", "a number > 0")
    nodes: int = key(4, "n_c, intervals a piece at which they are imposed.", "a whole number >= 1", ge=1)
