"""Lay what is written over what is beneath: keys replace keys, and another kind brings other keys."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gbt_ocp.experiments.build.tracker_kinds import TRACKERS, kept_keys
from gbt_ocp.experiments.config.faults import are_places
from gbt_ocp.experiments.config.sensor import ListedSensorSection

# Of two keys that say the same thing, the one in the stronger layer replaces the other.
_ALTERNATIVES: dict[tuple[str, ...], tuple[str, str]] = {
    ("desired_bearing",): ("m", "period_s"),
    ("tracker", "prior"): ("std", "covariance"),
}

# Another kind brings other keys; these belong to every kind of their section and stay.
_SHARED: dict[tuple[str, ...], tuple[str, ...]] = {
    ("vehicle",): ("start", "follow", "follow_bandwidth", "hotel_w", "current"),
    ("sensor", "_"): tuple(ListedSensorSection.model_fields),
}


def overlaid(base: Mapping[str, Any], above: Mapping[str, Any], path: tuple[str, ...]) -> dict[str, Any]:
    """A mapping with another one laid over it.

    Parameters
    ----------
    base, above
        The weaker and the stronger one.
    path
        Where they stand in the configuration.
    """
    merged = dict(base)
    if "kind" in above and above["kind"] != base.get("kind", above["kind"]):
        kept = {*_SHARED.get(path, ())}
        if path == ("tracker",):
            kept = kept_keys(*(TRACKERS.get(str(kind)) for kind in (base["kind"], above["kind"])))
        merged = {key: value for key, value in base.items() if key in kept}
    alternatives = _ALTERNATIVES.get(path, ())
    if any(above.get(key) is not None for key in alternatives):
        merged = {key: value for key, value in merged.items() if key not in alternatives}
    for key, value in above.items():
        beneath = merged.get(key)
        if isinstance(value, Mapping) and isinstance(beneath, list) and are_places(value, len(beneath)):
            # sensor.1.noise_deg names a key of one of several
            merged[key] = list(beneath)
            for place, item in value.items():
                merged[key][int(place)] = overlaid({"_": beneath[int(place)]}, {"_": item}, (*path, key))["_"]
        elif isinstance(value, Mapping):
            merged[key] = overlaid(beneath if isinstance(beneath, Mapping) else {}, value, (*path, key))
        else:
            merged[key] = value
    return merged
