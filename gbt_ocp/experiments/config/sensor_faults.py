"""The section ``sensor`` before it is checked: its period and noise, and the faults of a list of sensors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from gbt_ocp.experiments.build.tracker_kinds import ALL, BEARINGS_ALONE, TRACKERS
from gbt_ocp.experiments.config.faults import NOTHING, Fault, shown, value_at
from gbt_ocp.experiments.config.sensor import NOISE_KEYS, SensorSection

_PLANAR = ("azimuth", "range", "size", "position")


def sampling_period(merged: Mapping[str, Any]) -> Any:
    """T as it is written, or its default: of a list of sensors the shortest period."""
    written = merged.get("sensor")
    if isinstance(written, list):
        return min(_numbers(written, "period_s", 1.0), default=1.0)
    found = value_at(merged, ("sensor", "period_s"))
    return SensorSection.model_fields["period_s"].default if found is NOTHING else found


def bearing_noise(merged: Mapping[str, Any]) -> Any:
    """Noise of bearings in degrees as it is written, or its default: of a list of sensors the largest."""
    written = merged.get("sensor")
    if isinstance(written, list):
        return max(_numbers(written, "noise_deg", 0.0), default=0.0)
    found = value_at(merged, ("sensor", "noise_deg"))
    return SensorSection.model_fields["noise_deg"].default if found is NOTHING else found


def taken_by(merged: Mapping[str, Any]) -> tuple[str, ...] | None:
    """Kinds of measurements that the tracker takes, as far as its kind is known; sizes need ``tracker.size``."""
    kind = TRACKERS.get(str(value_at(merged, ("tracker", "kind"))))
    if kind is None:
        return None
    takes, noise = kind.takes, value_at(merged, ("tracker", "noise"))
    if kind.name == "gp" and (noise is None or (not isinstance(noise, Mapping) and not bearing_noise(merged))):
        takes = BEARINGS_ALONE  # for exact bearings
    sized = value_at(merged, ("tracker", "size")) not in (NOTHING, None)
    return takes if takes != ALL or sized else tuple(one for one in ALL if one != "size")


def _numbers(sensors: list[Any], name: str, default: float) -> list[float]:
    values = [one.get(name, default) for one in sensors if isinstance(one, Mapping)]
    return [value for value in values if isinstance(value, int | float) and not isinstance(value, bool) and value > 0.0]


def sensor_faults(merged: Mapping[str, Any], dimension: int | None, takes: tuple[str, ...] | None) -> Iterator[Fault]:
    """Faults of a list of sensors.

    Parameters
    ----------
    merged
        All layers of the configuration.
    dimension
        d, ``None`` if it is not known.
    takes
        Kinds of measurements that the tracker takes, ``None`` if it is not known.
    """
    written = merged.get("sensor")
    if not isinstance(written, list):
        return
    shortest, names = sampling_period(merged), []
    for k, one in enumerate(written):
        if not isinstance(one, Mapping):
            continue
        path, kind = ("sensor", str(k)), one.get("kind")
        if one.get("name") in names:
            yield Fault((*path, "name"), shown(one.get("name")), "a name that no other sensor has")
        names.append(one.get("name"))
        period = one.get("period_s", 1.0)
        if isinstance(period, int | float) and not isinstance(period, bool) and period > 0.0:
            times = period / shortest
            if abs(times - round(times)) > 1e-6:
                yield Fault((*path, "period_s"), shown(period), f"a whole multiple of the shortest, {shortest:.6g} s")
        if not isinstance(kind, str) or kind not in NOISE_KEYS:
            continue
        allowed = NOISE_KEYS[kind]
        given = [name for name in ("noise_deg", "noise_m", "noise_share") if one.get(name) is not None]
        if len(given) != 1 or given[0] not in allowed:
            found = " and ".join(given) if given else "no noise"
            yield Fault(path, found, f"one of {', '.join(allowed)} for a sensor of kind {kind}")
        if dimension == 2 and kind not in _PLANAR:
            yield Fault((*path, "kind"), shown(kind), f"{', '.join(_PLANAR)} in 2 dimensions")
        elif takes is not None and kind not in takes:
            tracker = value_at(merged, ("tracker", "kind"))
            size = ", for kind size with tracker.size" if kind == "size" and "range" in takes else ""
            yield Fault((*path, "kind"), shown(kind), f"{', '.join(takes)}, which tracker.kind: {tracker} takes{size}")
