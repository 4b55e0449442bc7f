"""The section ``guidance``: how the vehicle moves, one class a law."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from gbt_ocp.experiments.config.keys import InputNumbers, Section, key

GUIDANCE_LAWS = {
    "planner": "follows the planned trajectory (paper, section 4)",
    "static": "stays where it is (paper, section 5.3, mode 1)",
    "constant_force": "constant body thrust (paper, section 5.3, mode 2)",
    "random": "random body thrust (paper, section 5.3, mode 3)",
    "circumnavigation": "circles the estimate at a standoff",
    "fim_placement": "is put where the desired bearings are best, without dynamics",
    "helical": "winds around the line of sight (in space)",
}
"""Observer strategies that exist, by ``guidance.kind``."""


class PlannerGuidanceSection(Section):
    """The vehicle follows the planned trajectory."""

    kind: Literal["planner"] = key(..., "Trajectory optimisation.")
    startup_deviation: float = key(
        0.0,
        "Until the range's posterior deviation is below this share of it, the vehicle crosses the line of sight; "
        "0 plans at once.",
        ge=0.0,
    )
    startup_speed: float = key(3.0, "Speed in m/s at which it crosses, where startup_deviation is above 0.", gt=0.0)
    startup_leg_s: float = key(
        8.0, "Time in s after which it crosses the other way, where startup_deviation is above 0.", gt=0.0
    )
    startup_opening: float = key(
        1.2, "Part of startup_speed in m/s that leads away from the target, where startup_deviation is above 0.", ge=0.0
    )


class StaticGuidanceSection(Section):
    """The vehicle stays where it is (section 5.3, mode 1)."""

    kind: Literal["static"] = key(..., "No thrust.")


class ConstantForceGuidanceSection(Section):
    """Constant thrust (section 5.3, mode 2)."""

    kind: Literal["constant_force"] = key(..., "Constant body thrust.")
    force: InputNumbers = key(..., "Thrust in N on each axis, then the yaw moment in N m (default 500 N, no moment).")


class RandomGuidanceSection(Section):
    """Random thrust within the limits (section 5.3, mode 3)."""

    kind: Literal["random"] = key(..., "Random body thrust.")
    hold_s: float = key(1.0, "Time each draw is held in s.", gt=0.0)


class StandoffGuidanceSection(Section):
    """What the laws share that keep a distance."""

    standoff_m: float = key(0.5, "Distance in m to keep from the estimate.", gt=0.0)


class CircumnavigationGuidanceSection(StandoffGuidanceSection):
    """The vehicle circles the estimate."""

    kind: Literal["circumnavigation"] = key(..., "Circles the estimate.")
    speed: float = key(4.0, "Tangential speed in m/s, above the target's.", gt=0.0)
    radial_gain: float = key(10.0, "Gain on the range in 1/s.", gt=0.0)


class FimPlacementGuidanceSection(StandoffGuidanceSection):
    """The vehicle is put where the next desired bearing is taken, without dynamics."""

    kind: Literal["fim_placement"] = key(..., "Placed at the optimal configuration.")


class HelicalGuidanceSection(StandoffGuidanceSection):
    """The vehicle winds around the line of sight."""

    kind: Literal["helical"] = key(..., "Winds around the line of sight.")
    gain: float = key(5.0, "N, gain on the heading error in 1/m.", gt=0.0)
    amplitude_z: float = key(3.5, "c_z, amplitude about z in rad.", ge=0.0)
    amplitude_y: float = key(3.5, "c_y, amplitude about y in rad.", ge=0.0)
    frequency: float = key(0.5, "k, weaving frequency in rad/s.", ge=0.0)
    range_gain: float = key(10.0, "k_r, gain on the range in 1/s^2.", ge=0.0)
    range_damping: float = key(6.0, "k_v, gain on the closing speed in 1/s.", ge=0.0)


AnyGuidance = Annotated[
    PlannerGuidanceSection
    | StaticGuidanceSection
    | ConstantForceGuidanceSection
    | RandomGuidanceSection
    | CircumnavigationGuidanceSection
    | FimPlacementGuidanceSection
    | HelicalGuidanceSection,
    Field(discriminator="kind"),
]
"""The section; ``kind`` chooses between its classes."""
