"""Keys that are written where something else that is written leaves them without effect: they are refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from gbt_ocp.experiments.build.tracker_kinds import TRACKERS
from gbt_ocp.experiments.config.consistency import as_number
from gbt_ocp.experiments.config.desired_bearing import DesiredBearingSection
from gbt_ocp.experiments.config.faults import NOTHING, Fault, shown, value_at
from gbt_ocp.experiments.config.guidance import PlannerGuidanceSection
from gbt_ocp.experiments.config.keys import Section, as_tuples
from gbt_ocp.experiments.config.limits import LimitsSection
from gbt_ocp.experiments.config.planner import PlannerSection
from gbt_ocp.experiments.config.plant import PlantSection
from gbt_ocp.experiments.config.sensor_faults import bearing_noise
from gbt_ocp.experiments.config.team import LinkSection
from gbt_ocp.experiments.config.tracker import GaussianProcessSection

Path = tuple[str, str]

SECTIONS: dict[str, type[Section]] = {
    "planner": PlannerSection,
    "guidance": PlannerGuidanceSection,
    "limits": LimitsSection,
    "link": LinkSection,
    "plant": PlantSection,
    "desired_bearing": DesiredBearingSection,
}
"""Sections whose keys have conditions."""


class Condition(NamedTuple):
    """What keys need beside them.

    Attributes
    ----------
    keys
        Paths of the keys that have no effect without it.
    words
        The condition, as a user would write it.
    holds
        Whether it holds, from a function that gives the value at a path.
    """

    keys: tuple[Path, ...]
    words: str
    holds: Callable[[Callable[[str, str], Any]], bool]


def _all(section: str, *names: str) -> tuple[Path, ...]:
    return tuple((section, name) for name in names)


def _imposed() -> list[str]:
    """Keys of ``limits`` that are limits, those added from outside too; the others say how they are imposed."""
    return [name for name in LimitsSection.model_fields if name not in ("hard", "weight", "width", "nodes")]


MOTION = ("motion_logdet", "motion_trace")

CONDITIONS = (
    Condition(
        _all("planner", "degree", "continuity"), "planner.form: flat", lambda at: at("planner", "form") == "flat"
    ),
    Condition(
        _all("planner", "thrust", "steps"), "planner.form: shooting", lambda at: at("planner", "form") == "shooting"
    ),
    Condition(
        _all("planner", "kappa", "similarity"),
        "planner.objective: similarity",
        lambda at: at("planner", "objective") == "similarity",
    ),
    Condition(
        _all("planner", "stages", "ahead_s"),
        f"planner.objective: {' or '.join(MOTION)}",
        lambda at: at("planner", "objective") in MOTION,
    ),
    Condition(
        _all("planner", "width", "weight"),
        "planner.formulation: penalty",
        lambda at: at("planner", "formulation") == "penalty",
    ),
    Condition(
        _all("limits", "hard", "weight", "width", "nodes"),
        "one of the limits",
        lambda at: any(at("limits", name) for name in _imposed()),
    ),
    Condition(
        _all("guidance", "startup_speed", "startup_leg_s", "startup_opening"),
        "guidance.startup_deviation above 0",
        lambda at: at("guidance", "startup_deviation") != 0.0,
    ),
    Condition(
        _all("desired_bearing", "m", "period_s", "target_speed"),
        "desired_bearing.speed_mps: sensor or null, or desired_bearing.phase: fixed",
        lambda at: at("desired_bearing", "phase") == "fixed" or at("desired_bearing", "speed_mps") in (None, "sensor"),
    ),
    Condition(
        _all("plant", "current_time_s"), "plant.current_std above 0", lambda at: at("plant", "current_std") != 0.0
    ),
)
"""Those that belong to a choice of the same section or another one."""

TOGETHER = (("limits", "separation_m"), *_all("link", *LinkSection.model_fields))
"""Keys for which there must be several vehicles."""


def without_effect(merged: Mapping[str, Any], beneath: Mapping[str, Any]) -> Iterator[Fault]:
    """Faults of such keys.

    Parameters
    ----------
    merged
        All layers of the configuration.
    beneath
        The layers below what is written. What they say is no fault, nor is writing it or a default out again.
    """

    def at(section: str, name: str) -> Any:
        found = value_at(merged, (section, name))
        return SECTIONS[section].model_fields[name].default if found is NOTHING else found

    several = isinstance(value_at(merged, ("vehicles",)), list | tuple)
    for keys, words, holds in (*CONDITIONS, Condition(TOGETHER, "vehicles", lambda _: several)):
        for path in keys:
            if _is_own(path, SECTIONS[path[0]], merged, beneath) and not holds(at):
                yield Fault(path, shown(value_at(merged, path)), f"only with {words}, without effect here")
    yield from _beside_noise(merged, beneath)


def _is_own(path: Path, section: type[Section], merged: Mapping[str, Any], beneath: Mapping[str, Any]) -> bool:
    """Whether a key is written with another value than its default and than that of the layers below."""
    value, below = (as_tuples(value_at(layer, path)) for layer in (merged, beneath))
    return value not in (NOTHING, section.model_fields[path[1]].default, below)


def _beside_noise(merged: Mapping[str, Any], beneath: Mapping[str, Any]) -> Iterator[Fault]:
    """Keys of the tracker for exact bearings where the one for noisy bearings takes its place."""
    kind, noise = TRACKERS.get(str(value_at(merged, ("tracker", "kind")))), value_at(merged, ("tracker", "noise"))
    if kind is None or not issubclass(kind.section, GaussianProcessSection):
        return
    by_sensor = noise in (NOTHING, "sensor") and as_number(bearing_noise(merged))
    if not (isinstance(noise, Mapping) or by_sensor):
        return
    for path in _all("tracker", "kernel", "centre", "amplitude", "length_scale", "nugget", "bound_delta"):
        if _is_own(path, GaussianProcessSection, merged, beneath):
            why = "tracker.noise has keys of its own" if isinstance(noise, Mapping) else "sensor.noise_deg is above 0"
            allowed = f"only with tracker.noise: null, without effect here ({why})"
            yield Fault(path, shown(value_at(merged, path)), allowed)
    if value_at(merged, ("tracker", "engine")) == "compiled" != value_at(beneath, ("tracker", "engine")):
        yield Fault(("tracker", "engine"), "'compiled'", "auto or numpy where the bearings are noisy")
