"""The section ``vehicle``: which vehicle, where it starts and how it follows a plan."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag, ValidationInfo

from gbt_ocp.experiments.config.keys import (
    InputNumbers,
    NegativeInputNumbers,
    NotNegativeInputNumbers,
    NotPositiveInputNumbers,
    PositionNumbers,
    Positive,
    PositiveInputNumbers,
    Section,
    key,
)


def _inertia_positive(added_mass: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
    # A missing coefficient is a fault of its own key.
    mass, inertia = info.data.get("mass", math.inf), info.data.get("inertia", math.inf)
    if any(mass - added <= 0.0 for added in added_mass[:-1]) or inertia - added_mass[-1] <= 0.0:
        raise ValueError("M is not positive")
    return added_mass


class VehicleParametersSection(Section):
    """Coefficients of a Fossen model; sequences over surge, sway, (heave,) yaw."""

    mass: float = key(..., "m in kg.", gt=0.0)
    inertia: float = key(..., "I about the vertical in kg m^2.", gt=0.0)
    added_mass: Annotated[InputNumbers, AfterValidator(_inertia_positive)] = key(
        ...,
        "Added mass with Fossen's (negative) sign in kg, kg m^2 in yaw.",
        "{n} numbers, with mass (inertia in yaw) minus each of them > 0",
    )
    linear_drag: NotNegativeInputNumbers = key(..., "Linear drag in N s/m, N m s in yaw.")
    quadratic_drag: NotNegativeInputNumbers = key(..., "Quadratic drag in N s^2/m^2, N m s^2 in yaw.")


def _own_or_named(value: Any) -> str:
    return "own" if isinstance(value, Mapping | VehicleParametersSection) else "named"


def _word_or_given(value: Any) -> str:
    return "word" if isinstance(value, str) else "given"


class StartSection(Section):
    """Where the vehicle starts; at rest, unless it is one that has to move."""

    position_m: PositionNumbers | None = key(None, "Position in m; null draws it uniformly from the box.")
    range_m: Positive | None = key(None, "Distance in m from where the target starts, in a random direction, instead.")
    box_m: float = key(5.0, "Half side of the box around the origin in m.", ge=0.0)
    yaw_deg: float = key(0.0, "Yaw in degrees, counter-clockwise from +x.")
    speed: float | None = key(
        None, "Speed ahead through the water in m/s; null is at rest, with vehicle.kind: driven the model's.", ge=0.0
    )


Follow = Literal["exact", "dynamics", "feedback"]
KnownName = Literal["falcon", "bluerov2_heavy"]
KNOWN_BY_NAME = {
    "falcon": "Falcon, 116 kg, with the paper's limits of the thrust (Shen, Shi and Buckham 2016)",
    "bluerov2_heavy": "BlueROV2 Heavy, 13.5 kg, eight T200 thrusters at 16 V (von Benzon et al. 2022)",
}
"""What the vehicles of :data:`gbt_ocp.models.KNOWN_VEHICLES` are; here, so that a list of them loads no model."""

DrivenName = Literal["torpedo2d", "torpedo3d", "vessel"]
DRIVEN_BY_NAME = {
    "torpedo2d": "LAUV torpedo in the plane, 18 kg, thrust and rudder, 2 m/s (da Silva et al. 2007)",
    "torpedo3d": "LAUV torpedo in space, with an elevator too (da Silva et al. 2007)",
    "vessel": "Otter surface vessel, 55 kg, two thrusters, 3 m/s (Fossen's Marine Systems Simulator)",
}
"""What the vehicles of :data:`gbt_ocp.models.KNOWN_DRIVEN` are, which are not flat."""
DRIVEN_INPUTS = {"torpedo2d": 2, "torpedo3d": 3, "vessel": 2}
"""Numbers of their inputs."""
DRIVEN_DIMENSIONS = {"torpedo2d": 2, "torpedo3d": 3, "vessel": 2}
"""Dimensions of the space in which they move."""

# what vehicles of both kinds have in common, declared once
_START = Field(default_factory=StartSection, description="Initial state.")
_FOLLOW = key(
    "exact",
    "Follow the flat output exactly, integrate the dynamics under the planned thrust, or do that with feedback.",
)
_BANDWIDTH = key(
    None,
    "Bandwidth of the feedback in rad/s; null is the follower's own, 2 rad/s.",
    "null, or a number in (0, 50] with vehicle.follow = feedback",
    gt=0.0,
    le=50.0,
)
_THRUST_LAG = key(
    None,
    "Time constant in s of the thrusters, 0 for none: the follower makes up for it, and estimates what else the "
    "vehicle needs beyond its model; null where it is not known.",
    "null, or a number in [0, 10] with vehicle.follow = feedback and planner.form = flat",
    ge=0.0,
    le=10.0,
)
_HOTEL = key(0.0, "Power in W that the vehicle takes besides its thrusters; counted in energy_j.", ge=0.0)


KnownOfCurrent = Annotated[
    Annotated[Literal["none", "unknown"], Tag("word")] | Annotated[PositionNumbers, Tag("given")],
    Discriminator(_word_or_given),
]
_CURRENT = key(
    "none",
    "What the planner knows of the current: that there is none, nothing (it is estimated), or its velocity in m/s.",
    "none, unknown, or {d} numbers",
)


class FossenVehicleSection(Section):
    """A Fossen model, 3-DOF in the plane and 4-DOF in space."""

    kind: Literal["fossen"] = key(..., "Fossen's equations.")
    parameters: Annotated[
        Annotated[KnownName, Tag("named")] | Annotated[VehicleParametersSection, Tag("own")],
        Discriminator(_own_or_named),
    ] = key(
        "falcon",
        "Coefficients: a vehicle by its name, as gbt-ocp list vehicles shows them, or its own.",
    )
    thrust_max: PositiveInputNumbers = key(
        (5000.0, 5000.0, 1500.0),
        "τ_max: N on each axis, then the yaw moment in N m. By default the named vehicle's (the Falcon's 5000 N and "
        "1500 N m).",
    )
    thrust_min: NegativeInputNumbers | None = key(
        None, "τ_min where the limits differ by sign, in the same units; null is the named vehicle's, or -τ_max."
    )
    start: StartSection = _START
    follow: Follow = _FOLLOW
    follow_bandwidth: float | None = _BANDWIDTH
    thrust_lag_s: float | None = _THRUST_LAG
    hotel_w: float = _HOTEL
    current: KnownOfCurrent = _CURRENT


class DrivenVehicleSection(Section):
    """A vehicle with fewer inputs than ways to move; needs planner.form: shooting."""

    kind: Literal["driven"] = key(..., "A vehicle that is not flat; vehicle.model alone chooses it.")
    model: DrivenName = key(
        ...,
        "The vehicle by its name, as gbt-ocp list vehicles shows them; of a flat one it is vehicle.parameters.",
        ", ".join([*KNOWN_BY_NAME, *DRIVEN_BY_NAME]),
    )
    thrust_max: PositiveInputNumbers | None = key(
        None, "Upper limits of the inputs in their units (N, rad); null is the model's."
    )
    thrust_min: NotPositiveInputNumbers | None = key(None, "Lower limits, likewise; null is the model's.")
    start: StartSection = _START
    follow: Follow = _FOLLOW
    follow_bandwidth: float | None = _BANDWIDTH
    hotel_w: float = _HOTEL
    current: KnownOfCurrent = _CURRENT


class ProblemVehicleSection(Section):
    """The vehicle that the problem module makes."""

    kind: Literal["problem"] = key(..., "The problem module's own vehicle.")
    start: StartSection = _START
    follow: Follow = _FOLLOW
    follow_bandwidth: float | None = _BANDWIDTH
    hotel_w: float = _HOTEL


AnyVehicle = Annotated[FossenVehicleSection | DrivenVehicleSection | ProblemVehicleSection, Field(discriminator="kind")]
"""The section; ``kind`` chooses between its classes."""
