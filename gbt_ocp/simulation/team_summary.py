"""Numbers of a run with several vehicles: those of each side by side, and those of all together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gbt_ocp.simulation.channel import Channel
from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.run_folder import strict
from gbt_ocp.typing import Array

OF_EACH = (
    "error_mean", "error_settled", "error_start", "relative_error", "relative_error_10s", "nees_mean", "coverage_95",
    "range_observable_from_s", "distance_min", "distance_median", "steps_below_standoff", "lost", "violation_max",
    "solver_success_rate",
)  # fmt: skip
"""Keys of the summary of each vehicle that the one of a run with several repeats, where they are defined."""


def separations(histories: Mapping[str, History]) -> Array:
    """Distance in metres of the two vehicles that are nearest to each other, at each step ``(K,)``."""
    places = [one.vehicle_pose[:, : one.dimension] for one in histories.values()]
    pairs = [(a, b) for number, a in enumerate(places) for b in places[number + 1 :]]
    return np.asarray(np.min([np.linalg.norm(a - b, axis=1) for a, b in pairs], axis=0))


def team_numbers(
    histories: Mapping[str, History],
    summaries: Mapping[str, Mapping[str, Any]],
    channel: Channel,
    separation: float | None,
) -> dict[str, Any]:
    """What the summary of a run with several vehicles has beside that of its first.

    Parameters
    ----------
    histories, summaries
        Of each vehicle by its name.
    channel
        Between them.
    separation
        Distance in metres that they are to keep, if there is one.

    Returns
    -------
    ``vehicles``, the numbers :data:`OF_EACH` of each; ``team``, numbers of all: ``error_start`` and ``error_mean``,
    means over the vehicles; ``separation_min`` and ``separation_median``, distances of the two nearest vehicles;
    ``steps_below_separation``, steps at which these were nearer than they are to be; ``packets_sent`` and
    ``packets_lost``, one for each hearer, and ``packet_bytes``, the size of the largest.
    """
    apart = separations(histories)
    team: dict[str, Any] = {
        name: float(np.mean([one[name] for one in summaries.values()])) for name in ("error_start", "error_mean")
    }
    team |= {"separation_min": apart.min(), "separation_median": np.median(apart)}
    if separation is not None:
        team["steps_below_separation"] = int(np.sum(apart < separation))
    team |= {"packets_sent": channel.sent, "packets_lost": channel.lost, "packet_bytes": channel.largest}
    each = {name: {key: one[key] for key in OF_EACH if key in one} for name, one in summaries.items()}
    found: dict[str, Any] = strict({"vehicles": each, "team": team})
    return found
