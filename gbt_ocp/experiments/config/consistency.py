"""Faults between keys: keys that contradict each other, the problem, or the files that they name.

The checks read the merged mapping and not the checked models, so that their faults come together with those of
single keys and not after them. A value of the wrong type is left to the models.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from gbt_ocp.experiments.build.tracker_kinds import TRACKERS
from gbt_ocp.experiments.config import catalogue
from gbt_ocp.experiments.config.faults import NOTHING, Fault, shown, value_at
from gbt_ocp.experiments.config.keys import Section
from gbt_ocp.experiments.config.noise import NoisyBearingsSection
from gbt_ocp.experiments.config.planner import PlannerSection
from gbt_ocp.experiments.config.schema import Configuration, kinds
from gbt_ocp.experiments.config.sensor_faults import bearing_noise, sampling_period, sensor_faults, taken_by
from gbt_ocp.experiments.config.team_faults import team_faults
from gbt_ocp.experiments.config.tracker import GaussianProcessSection, ShapeSection, TrackerSection
from gbt_ocp.experiments.config.tracking_problem import TrackingProblem
from gbt_ocp.experiments.config.vehicle_faults import vehicle_faults

_BINS = ("bin_s", "window_s")
_CASES = {2: ("case1", "case2", "case3"), 3: ("case4", "case5", "case6")}


def inconsistencies(merged: Mapping[str, Any], problem: TrackingProblem | None) -> Iterator[Fault]:
    """Faults between keys.

    Parameters
    ----------
    merged
        All layers of the configuration, with absolute paths.
    problem
        The problem, ``None`` if it could not be loaded.
    """
    yield from _sizes(merged)
    yield from _limits(merged, problem)
    yield from _noise(merged)
    yield from _engine(merged)
    yield from _one_of(merged, ("desired_bearing",), "m", "period_s")
    if isinstance(value_at(merged, ("tracker", "prior")), Mapping):
        yield from _one_of(merged, ("tracker", "prior"), "std", "covariance")
    yield from vehicle_faults(merged, problem)
    yield from team_faults(merged, problem)
    yield from sensor_faults(merged, None if problem is None else problem.dimension, taken_by(merged))
    if problem is not None:
        yield from _dimension(merged, problem)
        yield from _factories(merged, problem)
        yield from _track(merged, problem.dimension)


def _number(merged: Mapping[str, Any], path: tuple[str, ...], default: Any) -> float | None:
    value = value_at(merged, path)
    return as_number(default if value is NOTHING else value)


def as_number(value: Any) -> float | None:
    """A number of a size that can be computed with, else ``None``: other faults are of these."""
    number = isinstance(value, int | float) and not isinstance(value, bool) and is_moderate(value)
    return value if number else None


def _sizes(merged: Mapping[str, Any]) -> Iterator[Fault]:
    pieces = _number(merged, ("planner", "pieces"), PlannerSection.model_fields["pieces"].default)
    forecast = _number(merged, ("tracker", "forecast"), TrackerSection.model_fields["forecast"].default)
    degree = _number(merged, ("planner", "degree"), PlannerSection.model_fields["degree"].default)
    continuity = _number(merged, ("planner", "continuity"), None)
    if degree is not None and continuity is not None and continuity >= degree >= 2:
        allowed = f"null, or a whole number from 1 to planner.degree - 1 = {degree - 1}"
        yield Fault(("planner", "continuity"), shown(continuity), allowed)
    yield from _changes(merged, degree, continuity)
    duration = _number(merged, ("duration_s",), Configuration.model_fields["duration_s"].default)
    period = as_number(sampling_period(merged))
    steps = 1.0
    piece = _number(merged, ("planner", "period_s"), None)
    ahead = _number(merged, ("tracker", "forecast_period_s"), None)
    if ahead is not None and period is not None and min(ahead, period) > 0.0:
        share = (piece or period) / ahead
        if abs(share - round(share)) > 1e-6 or round(share) < 1:
            allowed = f"null, or a piece divided by a whole number, planner.period_s = {piece or period:.6g}"
            yield Fault(("tracker", "forecast_period_s"), shown(ahead), allowed)
    if piece is not None and period is not None and min(piece, period) > 0.0:
        steps = piece / period
        if abs(steps - round(steps)) > 1e-6 or round(steps) < 1:
            allowed = f"null, or a whole multiple of sensor.period_s = {period:.6g}"
            yield Fault(("planner", "period_s"), shown(piece), allowed)
    if ahead is not None and piece is not None and min(ahead, piece) > 0.0:
        steps = piece / ahead
    if pieces is not None and forecast is not None and pieces * round(steps) > forecast >= 1:
        allowed = f"a whole number from 1 to tracker.forecast = {forecast} (p <= n)"
        if round(steps) > 1:
            allowed = f"pieces of planner.period_s that last at most tracker.forecast = {forecast} "
            allowed += "sampling periods" if ahead is None else "predicted positions"
        yield Fault(("planner", "pieces"), shown(pieces), allowed)
    if duration is not None and period is not None and duration < 2.0 * period:
        allowed = f"at least two sampling periods, {2.0 * period:.6g} s"
        yield Fault(("duration_s",), shown(duration), allowed)
    hold = _number(merged, ("guidance", "hold_s"), None)
    if hold is not None and period is not None and hold > 0.0 and too_many(period, hold, MOST_DRAWS):
        yield Fault(
            ("guidance", "hold_s"), shown(hold), f"at least sensor.period_s / {MOST_DRAWS} = {period / MOST_DRAWS:g} s"
        )
    if duration is not None and period is not None and period > 0.0 and too_many(duration, period, MOST_STEPS):
        allowed = f"at most {MOST_STEPS} sampling periods, {MOST_STEPS * period:.6g} s"
        yield Fault(("duration_s",), shown(duration), allowed)


def _changes(merged: Mapping[str, Any], degree: float | None, continuity: float | None) -> Iterator[Fault]:
    """A weight of changes of the thrust where it both jumps and changes within a piece."""
    rate = _number(merged, ("planner", "effort_rate"), 0.0)
    if value_at(merged, ("planner", "form")) == "shooting" or degree is None or not rate:
        return
    if continuity == 1 and degree > 2:
        allowed = "0 with planner.continuity: 1 and a degree above 2; a number >= 0 with others, or form: shooting"
        yield Fault(("planner", "effort_rate"), shown(rate), allowed)


def _one_of(merged: Mapping[str, Any], path: tuple[str, ...], first: str, second: str) -> Iterator[Fault]:
    section = value_at(merged, path)
    if isinstance(section, Mapping):
        written = [key for key in (first, second) if section.get(key) is not None]
        if len(written) != 1:
            found = f"both {first} and {second}" if written else f"neither {first} nor {second}"
            yield Fault(path, found, f"exactly one of {first}, {second}")


def _noise(merged: Mapping[str, Any]) -> Iterator[Fault]:
    """The noise that the tracker expects, beside that of the sensor."""
    path, kind = ("tracker", "noise"), TRACKERS.get(str(value_at(merged, ("tracker", "kind"))))
    if kind is not None and issubclass(kind.section, ShapeSection):
        yield from _bins(merged, ("tracker",), ShapeSection, 4)
    if kind is None or not issubclass(kind.section, GaussianProcessSection):
        return
    if not isinstance(value_at(merged, path), Mapping):
        return
    if value_at(merged, (*path, "std_deg")) in (NOTHING, None) and not as_number(bearing_noise(merged)):
        yield Fault((*path, "std_deg"), "null", "a number > 0 where sensor.noise_deg is 0")
    yield from _bins(merged, path, NoisyBearingsSection, 2)


def _engine(merged: Mapping[str, Any]) -> Iterator[Fault]:
    """A mixture whose members are not those that there are in C."""
    members = value_at(merged, ("tracker", "members"))
    mixture = value_at(merged, ("tracker", "kind")) == "mixture" and isinstance(members, list | tuple)
    if mixture and value_at(merged, ("tracker", "engine")) == "compiled":
        from gbt_ocp.pilot.mixture_source import MEMBERS_IN_C  # which loads CasADi

        if set(map(str, members)) != {*MEMBERS_IN_C}:
            allowed = f"auto or numpy beside these tracker.members; compiled has {' and '.join(MEMBERS_IN_C)}"
            yield Fault(("tracker", "engine"), "'compiled'", allowed)


def _bins(merged: Mapping[str, Any], path: tuple[str, ...], section: type[Section], least: int) -> Iterator[Fault]:
    """A window that holds too few bins, or more than can be computed with."""
    width, window = (_number(merged, (*path, name), section.model_fields[name].default) for name in _BINS)
    if width is None or window is None or min(width, window) <= 0.0:
        return
    if window < least * width:
        yield Fault((*path, "window_s"), shown(window), f"at least {least} bins, {least * width:.6g} s")
    elif too_many(window, width, MOST_BINS):
        yield Fault((*path, "window_s"), shown(window), f"at most {MOST_BINS} bins, {MOST_BINS * width:.6g} s")


def _limits(merged: Mapping[str, Any], problem: TrackingProblem | None) -> Iterator[Fault]:
    pairs = (("range", "nearest_m", "farthest_m"), ("depth", "lowest_m", "highest_m"))
    for section, low, high in pairs:
        path = ("limits", section)
        least, largest = (_number(merged, (*path, name), None) for name in (low, high))
        if least is not None and largest is not None and not least < largest:
            yield Fault((*path, low), shown(least), f"a number < {high} = {largest:.6g}")
    path = ("limits", "range")
    near, far, margin = (_number(merged, (*path, name), 0.0) for name in ("nearest_m", "farthest_m", "margin_m"))
    between = (far or 0.0) - (near or 0.0)
    if margin is not None and 0.0 < between <= 2.0 * margin:
        allowed = f"a number < {0.5 * between:.6g}, half of what lies between the limits"
        yield Fault((*path, "margin_m"), shown(margin), allowed)
    if isinstance(value_at(merged, ("limits", "range")), Mapping) and all(
        value_at(merged, ("limits", "range", name)) in (NOTHING, None) for name in ("nearest_m", "farthest_m")
    ):
        yield Fault(("limits", "range"), "neither nearest_m nor farthest_m", "at least one of nearest_m, farthest_m")
    if problem is not None and problem.dimension == 2 and isinstance(value_at(merged, ("limits", "depth")), Mapping):
        yield Fault(("limits", "depth"), shown(value_at(merged, ("limits", "depth"))), "null in 2 dimensions")
    zones = value_at(merged, ("limits", "keep_out"))
    for zone in zones if isinstance(zones, list) else []:
        if isinstance(zone, Mapping):
            written = {name for name in ("centre_m", "radius_m", "corners_m") if zone.get(name) is not None}
            if written not in ({"centre_m", "radius_m"}, {"corners_m"}):
                yield Fault(("limits", "keep_out"), shown(zone), "zones with centre_m and radius_m, or with corners_m")


def _dimension(merged: Mapping[str, Any], problem: TrackingProblem) -> Iterator[Fault]:
    kind = value_at(merged, ("target", "kind"))
    if kind in _CASES[5 - problem.dimension]:
        others = [name for name in kinds("target") if not name.startswith("case")]
        allowed = ", ".join([*_CASES[problem.dimension], *others])
        yield Fault(("target", "kind"), shown(kind), f"{allowed} (the problem has {problem.dimension} dimensions)")
    law = value_at(merged, ("guidance", "kind"))
    if problem.dimension == 2 and law == "helical":
        planar = ", ".join(name for name in kinds("guidance") if name != "helical")
        yield Fault(("guidance", "kind"), shown(law), f"{planar} (a helix needs 3 dimensions)")
    axis = value_at(merged, ("desired_bearing", "axis"))
    if problem.dimension == 2 and axis is not NOTHING and axis is not None:
        yield Fault(
            ("desired_bearing", "axis"), shown(axis), "nothing in 2 dimensions, a turn in the plane has no axis"
        )


def _factories(merged: Mapping[str, Any], problem: TrackingProblem) -> Iterator[Fault]:
    for section, factory in (("target", callable(problem.target)), ("vehicle", problem.vehicle is not None)):
        if value_at(merged, (section, "kind")) == "problem" and not factory:
            others = ", ".join(kind for kind in kinds(section) if kind != "problem")
            yield Fault((section, "kind"), '"problem"', f"{others} (problem {problem.name} makes no {section})")


def _track(merged: Mapping[str, Any], dimension: int) -> Iterator[Fault]:
    target = merged.get("target")
    if not isinstance(target, Mapping) or target.get("kind") != "track" or not isinstance(target.get("path"), str):
        return
    path, wanted = catalogue.resolved(target["path"]), f"a CSV file with the columns {'t,x,y,z'[: 2 * dimension + 1]}"
    if path is None or not path.is_file():
        yield Fault(("target", "path"), f"{shown(target['path'])}, which is not a file", wanted)
        return
    from gbt_ocp.models.targets import TrackTarget  # CasADi comes with it, which most commands need not wait for

    try:
        track = TrackTarget.from_csv(path, dimension)
    except (ValueError, OSError) as fault:
        yield Fault(("target", "path"), f"a file that cannot be used ({fault})", wanted)
        return
    values = (
        _number(merged, ("target", "time_scale"), 1.0),
        _number(merged, ("target", "start_time_s"), 0.0),
        _number(merged, ("duration_s",), Configuration.model_fields["duration_s"].default),
        as_number(sampling_period(merged)),
        _number(merged, ("tracker", "forecast"), TrackerSection.model_fields["forecast"].default),
    )
    period = _number(merged, ("tracker", "forecast_period_s"), None) or values[3]  # null may be written out
    values = (*values[:3], period, values[4])
    numbers = [value for value in values if value is not None]
    if len(numbers) < len(values):
        return
    scale, skipped, duration, period, forecast = numbers
    lasts = (track.duration - skipped) * scale
    # The truth is compared with the forecast, which reaches n periods beyond the last step.
    longest = lasts - forecast * period
    if scale > 0.0 and duration > longest + 1e-9:
        yield Fault(
            ("duration_s",),
            shown(duration),
            f"at most {max(longest, 0.0):.6g} s: the track lasts {max(lasts, 0.0):.6g} s after target.start_time_s, "
            f"of which the forecast needs the last {forecast * period:.6g} s",
        )


SMALLEST, LARGEST = 1.0e-30, 1.0e12
"""Sizes between which a number other than 0 must lie: products of a few of them are still ordinary numbers."""

MOST: dict[tuple[str, ...], int] = {
    ("duration_s",): 10_000_000,
    ("tracker", "window"): 10_000,
    ("tracker", "forecast"): 10_000,
    ("tracker", "hypotheses"): 1_000,
    ("tracker", "noise", "window"): 10_000,
    ("planner", "nodes"): 1_000,
    ("limits", "nodes"): 1_000,
}
"""Largest counts, and the longest run in seconds."""

MOST_STEPS = 10_000_000
"""Largest number of sampling periods in a run."""

MOST_BINS = 2_000
"""Largest number of bins in a window; the covariance of the noise is a matrix of that size."""

MOST_DRAWS = 1_000
"""Largest number of random thrusts in a sampling period, of which only the last is applied."""

# A seed is no quantity, and the options are the solver's own.
_FREE = (("seed",), ("planner", "solver_options"))


def is_moderate(value: float) -> bool:
    """Whether a number is 0 or of a size that can be computed with."""
    return value == 0 or SMALLEST <= abs(value) <= LARGEST


def extremes(merged: Mapping[str, Any]) -> Iterator[Fault]:
    """Faults of size, one a number; infinity and NaN are left to the models.

    Parameters
    ----------
    merged
        All layers of the configuration.
    """
    for path, value in _numbers(merged, ()):
        if not is_moderate(value):
            yield Fault(path, shown(value), f"0, or a number of a size from {SMALLEST:g} to {LARGEST:g}")
        elif (most := MOST.get(path)) is not None and value > most:
            yield Fault(path, shown(value), f"at most {most}")


def too_many(value: float, unit: float, most: int) -> bool:
    """Whether a stretch holds more than so many units (both moderate)."""
    return value > most * unit * (1.0 + 1e-9)


def _numbers(node: Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], float]]:
    if path in _FREE:
        return
    if isinstance(node, Mapping):
        for key, value in node.items():
            yield from _numbers(value, (*path, key))
    elif isinstance(node, list):
        # a list of numbers is one key; a list of sections is many
        for k, value in enumerate(node):
            yield from _numbers(value, (*path, str(k)) if isinstance(value, Mapping) else path)
    elif (
        isinstance(node, int | float) and not isinstance(node, bool) and (isinstance(node, int) or math.isfinite(node))
    ):
        yield path, node
