"""The section ``sensor``: what is measured, when, and how well. One bearing sensor, or a list of sensors."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Discriminator, Tag

from gbt_ocp.experiments.config.keys import PositionNumbers, Section, as_tuples, key

SensorKind = Literal["azimuth", "azimuth_elevation", "elevation", "range", "size", "position"]

NOISE_KEYS: dict[str, tuple[str, ...]] = {
    "azimuth": ("noise_deg",),
    "azimuth_elevation": ("noise_deg",),
    "elevation": ("noise_deg",),
    "range": ("noise_m", "noise_share"),
    "size": ("noise_deg", "noise_share"),
    "position": ("noise_m",),
}
"""Keys of which a sensor of a kind has one."""


class SensorSection(Section):
    """The bearing sensor (section 5.6)."""

    period_s: float = key(0.1, "T, sampling period in s.", gt=0.0)
    noise_deg: float = key(0.0, "Standard deviation of the bearing noise in degrees.", ge=0.0)
    missed_probability: float = key(0.0, "Probability that a bearing is missed.", ge=0.0, lt=1.0)
    outlier_deg: float = key(0.0, "Size of a sporadic outlier in degrees.", ge=0.0)
    outlier_every_s: float = key(10.0, "Time between outliers in s.", gt=0.0)
    latency_s: float = key(0.0, "Time in s from a measurement to its arrival at the tracker, which knows both.", ge=0.0)


class ListedSensorSection(Section):
    """One of several sensors."""

    name: str = key(..., "Name of a listed sensor.", "a text of its own", min_length=1)
    kind: SensorKind = key(..., "What a listed sensor measures.")
    period_s: float = key(1.0, "Time between its measurements in s.", "a whole multiple of the shortest", gt=0.0)
    noise_deg: float | None = key(None, "Standard deviation of its angle in degrees.", gt=0.0)
    noise_m: float | None = key(
        None, "Standard deviation of a listed sensor's range, or of each axis of a position, in m.", gt=0.0
    )
    noise_share: float | None = key(
        None, "Standard deviation of a listed sensor's range or angular size, as a share of the value.", gt=0.0, lt=1.0
    )
    missed_probability: float = key(0.0, "Probability that a measurement is missed.", ge=0.0, lt=1.0)
    latency_s: float = key(0.0, "Time in s from a measurement to its arrival at the tracker, which knows both.", ge=0.0)
    frame: Literal["earth", "bow"] = key("earth", "Whether a listed sensor's angles count from +x or from the bow.")
    heading_std_deg: float = key(
        0.0, "Standard deviation of the own heading in degrees; angles from the bow have it too.", ge=0.0
    )
    mounting: PositionNumbers | None = key(
        None, "Place of a listed sensor on the vehicle in m, forward, to port(, up); null is the vehicle's origin."
    )
    mounting_yaw_deg: float = key(0.0, "Angle from the bow to the sensor's zero direction in degrees, frame: bow.")
    size_m: float = key(1.0, "True size of the target in m that a sensor of kind size sees.", gt=0.0)

    @property
    def gives_bearings(self) -> bool:
        """Whether it measures a direction, or part of one."""
        return self.kind in ("azimuth", "azimuth_elevation", "elevation")


def _one_or_several(value: Any) -> str:
    return "several" if isinstance(value, list | tuple) else "one"


def _some(value: tuple[ListedSensorSection, ...]) -> tuple[ListedSensorSection, ...]:
    if not value:
        raise ValueError("none")
    return value


AnySensor = Annotated[
    Annotated[SensorSection, Tag("one")]
    | Annotated[tuple[ListedSensorSection, ...], BeforeValidator(as_tuples), AfterValidator(_some), Tag("several")],
    Discriminator(_one_or_several),
]
"""One bearing sensor, or a list of sensors."""

SENSOR_ALLOWED = (
    f"a mapping with the keys {', '.join(SensorSection.model_fields)}, or a list of mappings with name and kind"
)
"""What the section may be, in words."""
