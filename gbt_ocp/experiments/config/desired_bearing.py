"""The section ``desired_bearing``: from where the vehicle is to see the target."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator

from gbt_ocp.experiments.config.allowed import InWords
from gbt_ocp.experiments.config.keys import Positive, Section, as_tuples, key


def _direction(value: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(value):
        raise ValueError("zero")
    return value


Direction = Annotated[
    tuple[float, float, float],
    BeforeValidator(as_tuples),
    AfterValidator(_direction),
    InWords("3 numbers that are not all zero"),
]


class DesiredBearingSection(Section):
    """How the desired bearings turn: one turn in m sampling periods, or in a time."""

    m: int | None = key(
        None,
        "Desired bearings a turn (default 10, 4 in space).",
        "a whole number >= 1, or null beside period_s",
        ge=1,
    )
    period_s: Positive | Literal["auto"] | None = key(
        None,
        "Time of a turn in s, instead of m; auto, the default beside limits.range.nearest_m, is the vehicle's fastest.",
        "a number > 0, auto, or null beside m",
    )
    speed_mps: Literal["sensor"] | Positive | None = key(
        "sensor",
        "Speed in m/s that going round the target may ask for; farther away the bearing turns more slowly. sensor: "
        "with noisy bearings the speed that the vehicle keeps up, else null. null: never slower. With phase: measured, "
        "where nothing needs slowing down: the speed through the water at which it moves across the line of sight, "
        "whatever the target does, instead of a time of a turn; sensor, null: a time of a turn.",
    )
    target_speed: float = key(
        1.0, "Speed of the target in m/s that the vehicle can keep up with while it circles.", ge=0.0
    )
    phase: Literal["fixed", "measured"] = key(
        "fixed",
        "Where the turn is: on from the x axis by the clock, or in each plan on from the present line of sight.",
    )
    reverse_s: Positive | None = key(
        None, "Time in s after which the turn changes its sense, again and again; null for a turn that never does."
    )
    axis: Direction | None = key(None, "Axis of the turn, in space only (default [0, 0, 1]).")
