"""Priors centred on the origin, for a vehicle that starts far from it."""

from __future__ import annotations

import numpy as np

from gbt_ocp.experiments.build.noise import noise_of
from gbt_ocp.experiments.config.tracker import GaussianProcessSection, ProcessSection, TrackerSection
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.typing import Array

FAR = 5.0e3
"""Distance in metres from the origin: to 10 km the tracker of exact bearings loses nothing, at 100 km a metre."""

NEAR_ORIGIN = 0.1
"""Share of the vehicle's distance from the origin below which a prior position counts as centred there."""


def far_priors(section: TrackerSection, start: Array, sensor: BearingSensor) -> list[str]:
    """Warnings, one a prior that is centred on the origin while the vehicle starts far from it.

    Parameters
    ----------
    section
        Of the tracker.
    start
        The vehicle's first position ``(d,)`` in metres.
    sensor
        Its noise decides whether ``centre`` is used.
    """
    distance = float(np.linalg.norm(start))
    if distance < FAR:
        return []
    found = []
    where = f"the vehicle starts {distance:.4g} m from the origin"
    exact = not isinstance(section, GaussianProcessSection) or noise_of(section, sensor) is None
    if isinstance(section, ProcessSection) and section.centre == "origin" and exact and section.prior is None:
        found.append(
            f"tracker.centre: origin, but {where}: the position may be wrong by far; allowed here: "
            "tracker.centre=vehicle (preset=paper sets origin), or positions relative to a nearby point"
        )
    if section.prior is not None:
        expected = float(np.linalg.norm(section.prior.position))
        if expected < NEAR_ORIGIN * distance:
            found.append(
                f"tracker.prior.position: {expected:.4g} m from the origin, but {where}: allowed here: a position near "
                "the vehicle, or tracker.prior=null"
            )
    return found
