"""Faults of several vehicles: names that are not their own, packets without room, trackers that cannot listen."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

from gbt_ocp.experiments.build.tracker_kinds import TRACKERS
from gbt_ocp.experiments.config.faults import NOTHING, Fault, shown, value_at
from gbt_ocp.experiments.config.team import LinkSection
from gbt_ocp.experiments.config.tracking_problem import TrackingProblem

MOST_VEHICLES = 8
"""Vehicles in one run: each plan keeps its distance from every other one."""

SEEN_FROM_ONE = ("imm_kf_f",)
"""Kinds of trackers that take no bearings."""


def team_faults(merged: Mapping[str, Any], problem: TrackingProblem | None) -> Iterator[Fault]:
    """Faults of the sections ``vehicles`` and ``link``.

    Parameters
    ----------
    merged
        All layers of the configuration.
    problem
        The problem, ``None`` if it could not be loaded.
    """
    team = value_at(merged, ("vehicles",))
    if not isinstance(team, list | tuple) or not team:
        return
    if not 2 <= len(team) <= MOST_VEHICLES:
        yield Fault(("vehicles",), f"{len(team)} of them", f"2 to {MOST_VEHICLES} vehicles, or none for one alone")
    names = [one.get("name") for one in team if isinstance(one, Mapping)]
    for name, count in Counter(name for name in names if isinstance(name, str)).items():
        if count > 1:
            yield Fault(("vehicles",), f"{count} with the name {shown(name)}", "a name of its own for each")
    if value_at(merged, ("vehicle", "kind")) not in (NOTHING, "fossen"):
        for place, one in enumerate(team):
            if isinstance(one, Mapping) and one.get("model") is not None:
                path = ("vehicles", str(place), "model")
                yield Fault(path, shown(one["model"]), "null beside a vehicle.kind other than fossen")
    kind = str(value_at(merged, ("tracker", "kind")))
    if kind in SEEN_FROM_ONE:
        others = ", ".join(name for name in TRACKERS if name not in SEEN_FROM_ONE)
        yield Fault(("tracker", "kind"), shown(kind), f"beside vehicles, {others}")
    if value_at(merged, ("tracker", "engine")) == "compiled":
        yield Fault(("tracker", "engine"), "'compiled'", "beside vehicles, numpy: the C hears one vehicle alone")
    if problem is not None:
        from gbt_ocp.pilot.packets import packet_size  # which loads CasADi

        size, least = value_at(merged, ("link", "packet_bytes")), packet_size(problem.dimension, 1)
        size = LinkSection.model_fields["packet_bytes"].default if size is NOTHING else size
        if isinstance(size, int) and 0 < size < least:
            yield Fault(("link", "packet_bytes"), shown(size), f"at least {least}, the size of a packet with a bearing")
