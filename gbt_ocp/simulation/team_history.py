"""What is recorded of a vehicle that is one of several, beside what is recorded of any."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.simulation.columns import column, recorded
from gbt_ocp.simulation.history import History


@recorded
class TeamHistory(History):
    """A :class:`~gbt_ocp.simulation.history.History` with what the vehicle heard of the others.

    Raises
    ------
    ValueError
        As :class:`~gbt_ocp.simulation.history.History`.
    """

    packets_heard: NDArray[np.int64] = column(
        "t", lambda step: step.heard[0], kind=int, optional=True, meaning="Packets that arrived since the last step"
    )
    bearings_heard: NDArray[np.int64] = column(
        "t",
        lambda step: step.heard[1],
        kind=int,
        optional=True,
        meaning="Bearings of others that the tracker was given since the last step",
    )
