"""The section ``target``: what the target does."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from gbt_ocp.experiments.config.keys import (
    PositionNumbers,
    Section,
    as_tuples,
    key,
)


class CaseTargetSection(Section):
    """One of the paper's motions (section 5.2)."""

    kind: Literal["case1", "case2", "case4", "case5"] = key(..., "Case of the paper.")


class ManoeuvreTargetSection(Section):
    """The circling motions of the paper, with abrupt manoeuvres on request (section 5.6, scenario 5)."""

    kind: Literal["case3", "case6"] = key(..., "Case of the paper.")
    turn_rate_step: float = key(0.0, "Jump of the turn rate in rad/s.", ge=0.0)
    every_s: float = key(10.0, "Time between jumps in s.", gt=0.0)


def _increasing(value: tuple[float, float]) -> tuple[float, float]:
    if not 0.0 < value[0] <= value[1]:
        raise ValueError("not increasing")
    return value


class TurningTargetSection(Section):
    """A boat whose turn rate is drawn again from time to time."""

    kind: Literal["turning"] = key(..., "Random turns at a steady or slowly varying speed.")
    start_m: PositionNumbers | None = key(None, "Where it starts, in m; null is the origin.")
    speed: float = key(1.0, "Horizontal speed in m/s; the median where it varies.", gt=0.0)
    speed_std: float = key(0.0, "Standard deviation of the logarithm of the speed, correlated over 40 s.", ge=0.0)
    turn_rate_max: float = key(0.05, "Turn rates are uniform within plus and minus this, in rad/s.", ge=0.0)
    hold_s: Annotated[tuple[float, float], BeforeValidator(as_tuples), AfterValidator(_increasing)] = key(
        (20.0, 40.0), "Least and largest time in s for which a turn rate is held.", "two increasing numbers > 0"
    )
    climb_rate_max: float = key(0.1, "Vertical speeds are uniform within plus and minus this in m/s, in space.", ge=0.0)


class TrackTargetSection(Section):
    """A recorded track."""

    kind: Literal["track"] = key(..., "A recorded track.")
    path: str = key(
        ...,
        "CSV file with columns t,x,y[,z] (s, m), relative to the YAML file or else to the current folder.",
        "an existing CSV file with the columns t,x,y (z in space)",
        min_length=1,
    )
    length_scale: float = key(1.0, "Factor on lengths.", gt=0.0)
    time_scale: float = key(1.0, "Factor on times; above 1 is slower.", gt=0.0)
    start_m: PositionNumbers | None = key(
        None, "Where the first point used is put, in m; null keeps the scaled coordinates."
    )
    start_time_s: float = key(0.0, "Recorded time skipped, in s.", ge=0.0)


class ProblemTargetSection(Section):
    """The target that the problem module makes."""

    kind: Literal["problem"] = key(..., "The problem module's own target.")


AnyTarget = Annotated[
    CaseTargetSection | ManoeuvreTargetSection | TurningTargetSection | TrackTargetSection | ProblemTargetSection,
    Field(discriminator="kind"),
]
"""The section; ``kind`` chooses between its classes."""
