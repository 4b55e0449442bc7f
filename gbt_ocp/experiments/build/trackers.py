"""From the section ``tracker`` to an estimator."""

from __future__ import annotations

import numpy as np

from gbt_ocp.experiments.build.tracker_kinds import TRACKERS
from gbt_ocp.experiments.config import tracker as sections
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.tracking.priors import PositionPrior
from gbt_ocp.tracking.protocol import PositionTracker, Tracker
from gbt_ocp.typing import Array


def build_tracker(section: sections.TrackerSection, start: Array, sensor: BearingSensor) -> Tracker | PositionTracker:
    """The tracker of a section.

    Parameters
    ----------
    section
        Of a kind in :data:`~gbt_ocp.experiments.build.tracker_kinds.TRACKERS`.
    start
        The vehicle's first position ``(d,)`` in metres.
    sensor
        Its period and noise count.
    """
    return TRACKERS[section.kind].build(section, position_prior(section, start), sensor)


def position_prior(section: sections.TrackerSection, start: Array) -> PositionPrior:
    """What the key ``prior`` says of the target, and the vehicle's first position ``(d,)``."""
    prior = section.prior
    if prior is None:
        return PositionPrior(start)
    covariance = prior.covariance if prior.std is None else prior.std**2 * np.eye(len(start))
    return PositionPrior(start, np.array(prior.position), np.array(covariance))
