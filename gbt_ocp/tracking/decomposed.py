"""A measurement of any kind as a bearing with one deviation and rows of single numbers, for trackers of bearings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from gbt_ocp.models.measurements import Sighting
from gbt_ocp.tracking.polar import LEAST_LEVEL, bearing_of, is_bearing
from gbt_ocp.typing import Array

ALIKE = 1.1
"""Ratio of two deviations below which they count as one."""


@dataclass(frozen=True)
class SightingParts:
    """What a measurement is made of.

    Attributes
    ----------
    bearing
        A unit vector ``(d,)``, if there is one.
    std
        Its deviation in radians in each direction; NaN if the measurement did not say it.
    singles
        What is no bearing: measurements of one number each.
    platform
        Name of the vehicle that measured it; empty for the own one.
    """

    bearing: Array | None
    std: float
    singles: tuple[Sighting, ...]
    platform: str = ""

    def worth(self, std: float) -> float:
        """How many bearings of a deviation in radians the bearing is worth; one if it did not say its own."""
        return 1.0 if np.isnan(self.std) else (std / self.std) ** 2


BY_ITSELF = SightingParts(None, np.nan, ())
"""What comes with a bearing that is given by itself."""


def parts_of(sighting: Sighting, bearing_std: float) -> SightingParts:
    """Take a measurement apart.

    A position is its direction and its range. Azimuth and elevation with the same deviation across the line of sight
    are a bearing; with different ones they are two rows, and the bearing has the larger deviation of the two with the
    rest of the information in the row of the sharper angle.

    Parameters
    ----------
    sighting
        The measurement.
    bearing_std
        Deviation in radians of an angle that did not say it.
    """
    if sighting.kind == "position":
        unit = bearing_of(sighting)
        assert unit is not None, "a position has a direction"
        far = float(np.linalg.norm(sighting.value - sighting.position))
        along, total = float(unit**2 @ sighting.std**2), float(np.sum(sighting.std**2))
        across = np.sqrt((total - along) / (len(unit) - 1))
        distance = replace(sighting, kind="range", value=np.array([far]), std=np.sqrt([along]))
        return SightingParts(unit, float(across / far), (distance,), sighting.platform)
    if not is_bearing(sighting):
        std = np.where(np.isnan(sighting.std), bearing_std, sighting.std)
        return SightingParts(None, np.nan, (replace(sighting, std=std),), sighting.platform)
    if len(sighting.std) == 1 or np.all(np.isnan(sighting.std)):
        return SightingParts(sighting.bearing, float(sighting.std[0]), (), sighting.platform)
    std = np.where(np.isnan(sighting.std), bearing_std, sighting.std)
    level = max(float(np.cos(sighting.value[1])), LEAST_LEVEL)
    sideways, upwards = float(std[0]) * level, float(std[1])
    blunt, sharp = max(sideways, upwards), min(sideways, upwards)
    if blunt <= ALIKE * sharp:
        mean = float(np.sqrt(0.5 * (blunt**2 + sharp**2)))
        return SightingParts(sighting.bearing, mean, (), sighting.platform)
    rest = 1.0 / np.sqrt(1.0 / sharp**2 - 1.0 / blunt**2)
    which = 0 if sideways < upwards else 1
    scale = level if which == 0 else 1.0
    single = replace(
        sighting,
        kind=("azimuth", "elevation")[which],
        value=sighting.value[which : which + 1],
        std=np.array([rest / scale]),
    )
    return SightingParts(sighting.bearing, blunt, (single,), sighting.platform)


class SingleNumbers:
    """Measurements of one number each, oldest first; those of a sensor within a bin are averaged.

    Parameters
    ----------
    width
        Width of a bin in seconds; ``None`` averages none.
    """

    def __init__(self, width: float | None) -> None:
        self._width = width
        self._kept: list[tuple[Sighting, int]] = []

    def __iter__(self) -> Iterator[Sighting]:
        return (one for one, _ in self._kept)

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def latest(self) -> float | None:
        """Time of the latest one in seconds, or of its average."""
        return max((one.time for one in self), default=None)

    def clear(self) -> None:
        """Forget all."""
        self._kept.clear()

    def forget_before(self, time: float) -> None:
        """Forget those from before a time in seconds."""
        self._kept = [(one, count) for one, count in self._kept if one.time >= time]

    def extend(self, singles: Iterable[Sighting]) -> None:
        """Add measurements, no older than the latest."""
        for single in singles:
            if not self._merged(single):
                self._kept.append((single, 1))

    def _merged(self, single: Sighting) -> bool:
        if self._width is None:
            return False
        for k in range(len(self._kept) - 1, -1, -1):
            one, count = self._kept[k]
            if single.time // self._width != one.time // self._width:
                return False
            if (one.kind, one.sensor) == (single.kind, single.sensor):
                self._kept[k] = _averaged(one, count, single), count + 1
                return True
        return False


def _averaged(mean: Sighting, count: int, single: Sighting) -> Sighting:
    """The mean of so many measurements and one more. All count alike: weights by deviations that go with the values
    would favour the small ones.
    """
    share = 1.0 / (count + 1)
    off = single.value - mean.value
    if single.kind == "azimuth":
        off = np.angle(np.exp(1j * off))
    return replace(
        mean,
        time=mean.time + share * (single.time - mean.time),
        value=mean.value + share * off,
        std=share * np.hypot(count * mean.std, single.std),
        position=mean.position + share * (single.position - mean.position),
    )
