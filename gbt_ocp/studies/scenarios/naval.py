"""Scenarios of Ristic, Arulampalam and Gordon (2004), and of Leong et al. (2013): a bearing a minute, half an hour.

x is east and y north; courses count from north, clockwise, as in the sources. Own ships turn with a constant rate in
the minutes that the sources name. Knots are metres per second here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from gbt_ocp.studies.scenarios.motion_laws import SteadyLaw
from gbt_ocp.studies.scenarios.scenario import (
    GUESS,
    MOTION,
    NOISE,
    Knowledge,
    PublicScenario,
    RecordedRun,
    measured,
    stream,
)
from gbt_ocp.typing import Array

RISTIC = "Ristic, Arulampalam, Gordon: Beyond the Kalman Filter, 2004, chapter 6"
LEONG = "Leong, Arulampalam, Lamahewa, Abhayapala: A Gaussian-sum based cubature Kalman filter, IEEE TAES 2013"

KNOT, MINUTE = 1852.0 / 3600.0, 60.0
MINUTES_AHEAD = 5 * MINUTE
COURSE_STD = np.pi / np.sqrt(12.0)
"""Deviation of the target's course from that towards the vehicle, which the sources' filters begin with."""

DENSITY = 9.0e-6
"""Spectral density of the target's acceleration in Leong's scenarios, in m²/s³."""

Turn = tuple[float, float, float]
"""Minutes in which a course changes, and the new course in degrees."""


def track(start: Array, knots: float, course: float, turns: Sequence[Turn], times: Array) -> Array:
    """Positions ``(K, 2)`` in m of a ship of constant speed that changes its course at a constant rate.

    Parameters
    ----------
    start
        ``(2,)`` in m.
    knots, course
        Speed in knots and first course in degrees.
    turns
        Its changes.
    times
        ``(K,)`` in s.
    """
    at, courses = [0.0], [course]
    for first, last, new in turns:
        at += [first * MINUTE, last * MINUTE]
        courses += [courses[-1], new]
    fine = np.arange(0.0, times[-1] + 0.5)
    heading = np.deg2rad(np.interp(fine, at, courses))
    heading = 0.5 * (heading[1:] + heading[:-1])
    steps = knots * KNOT * np.stack([np.sin(heading), np.cos(heading)], axis=-1)
    moved = np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    return np.asarray(start + np.stack([np.interp(times, fine, column) for column in moved.T], axis=-1))


def _from(bearing: float, range: float) -> Array:
    """A place at a bearing in degrees from north and a range in m."""
    angle = np.deg2rad(bearing)
    return np.asarray(range * np.array([np.sin(angle), np.cos(angle)]))


def _guess(run: int, true_range: float, range_std: float, knots: float) -> tuple[float, float]:
    """The guessed range in m and speed in m/s: the sources draw both about the true ones, 2 knots the speed's."""
    rng = stream(run, GUESS)
    while True:
        far, speed = true_range + range_std * rng.standard_normal(), knots + 2.0 * rng.standard_normal()
        if far > 600.0 and speed > 0.6:
            return far, speed * KNOT


def disturbed(path: Array, density: float, rng: np.random.Generator) -> Array:
    """A path ``(K, 2)`` a minute apart with white noise of this density in m²/s³ on its acceleration."""
    states, found = np.zeros((1, 4)), []
    law = SteadyLaw(0.0, 0.0, density=density)
    for place in path:
        found.append(place + states[0, :2])
        states = law.moved(states, MINUTE, rng)
    return np.array(found)


def _recorded(
    run: int,
    own: Callable[[Array], Array],
    target: Callable[[Array], Array],
    minutes: int,
    std: float,
    guess: tuple[float, float],
    density: float,
    turn_rate: float,
    turns: bool,
) -> RecordedRun:
    ahead = round(MINUTES_AHEAD / MINUTE)
    times = MINUTE * np.arange(minutes + ahead + 1, dtype=float)
    path = target(times)
    if density > 0.0:
        path = disturbed(path, density, stream(run, MOTION))
    ours = own(times[: minutes + 1])
    far, speed = _guess(run, float(np.linalg.norm(path[0] - ours[0])), *guess)
    knowledge = Knowledge(
        far,
        guess[0],
        speed,
        bearing_std=np.deg2rad(std),
        pace=30.0,
        acceleration_density=max(density, 1e-3 * turn_rate),
        turn_rate=turn_rate,
        turns=turns,
    )
    kept = minutes + 1
    seen = measured(times[:kept], ours, path[:kept], knowledge, stream(run, NOISE))
    return RecordedRun(times[:kept], ours, path[:kept], path[ahead:], seen, knowledge)


RISTIC_OWN = partial(track, np.zeros(2), 5.0, 140.0, ((13.0, 17.0, 20.0),))
RISTIC_TARGET = partial(track, _from(80.0, 5000.0), 4.0, -140.0, ())
MANOEUVRING_OWN = partial(track, np.zeros(2), 5.0, 140.0, ((13.0, 17.0, 20.0), (32.0, 37.0, 155.0)))
MANOEUVRING_TARGET = partial(track, _from(80.0, 5000.0), 4.0, -140.0, ((20.0, 25.0, -260.0),))
DIFFICULT_OWN = partial(track, np.zeros(2), 5.0, -80.0, ((15.0, 15.01, 146.0),))
DIFFICULT_TARGET = partial(track, np.array([7090.9, 7052.6]), 15.0, -135.4, ())


def _scenario(
    name: str,
    title: str,
    source: str,
    own: Callable[[Array], Array],
    target: Callable[[Array], Array],
    minutes: int,
    *,
    std: float,
    range_std: float,
    knots: float,
    density: float,
    scored_from: float,
    law: SteadyLaw | None,
    turn_rate: float = 1.0e-3,
    differs: str = "",
) -> PublicScenario:
    record = partial(
        _recorded,
        own=own,
        target=target,
        minutes=minutes,
        std=std,
        guess=(range_std, knots),
        density=density,
        turn_rate=turn_rate,
        turns=law is None,
    )
    return PublicScenario(
        name,
        title,
        source,
        dimension=2,
        runs=20,
        record=record,
        ahead=MINUTES_AHEAD,
        scored_from=scored_from * MINUTE,
        scored_every=MINUTE,
        law=law,
        differs=differs,
    )


NAVAL = (
    _scenario(
        "ristic_moderate",
        "a target of 4 knots from 5 km, own ship of 5 knots turns once; 1.5°",
        f"{RISTIC}: nonmanoeuvring case",
        RISTIC_OWN,
        RISTIC_TARGET,
        30,
        std=1.5,
        range_std=2000.0,
        knots=4.0,
        density=0.0,
        scored_from=20.0,
        law=SteadyLaw(4.0 * KNOT, 2.0 * KNOT, COURSE_STD),
    ),
    _scenario(
        "ristic_manoeuvring",
        "the same target turns by 120° in the minutes 20 to 25, own ship turns twice; 1.5°",
        f"{RISTIC}: manoeuvring case",
        MANOEUVRING_OWN,
        MANOEUVRING_TARGET,
        40,
        std=1.5,
        range_std=2000.0,
        knots=4.0,
        density=0.0,
        scored_from=26.0,
        law=None,
        turn_rate=np.deg2rad(120.0) / (5.0 * MINUTE),
        differs="own ship's second turn, from minute 32 to 37, is a choice: the last range is then 2.91 km",
    ),
    _scenario(
        "leong_moderate",
        "as Ristic's, the target disturbed by white noise of its acceleration; 1.5°",
        f"{LEONG}: moderately nonlinear",
        RISTIC_OWN,
        partial(track, np.array([4920.0, 850.0]), 4.0, -140.0, ()),
        32,
        std=1.5,
        range_std=2000.0,
        knots=4.0,
        density=DENSITY,
        scored_from=20.0,
        law=SteadyLaw(4.0 * KNOT, 2.0 * KNOT, COURSE_STD, DENSITY),
    ),
    _scenario(
        "leong_difficult",
        "a target of 15 knots from 10 km, own ship of 5 knots turns once; 2°",
        f"{LEONG}: highly nonlinear",
        DIFFICULT_OWN,
        DIFFICULT_TARGET,
        30,
        std=2.0,
        range_std=4000.0,
        knots=15.0,
        density=DENSITY,
        scored_from=20.0,
        law=SteadyLaw(15.0 * KNOT, 2.0 * KNOT, COURSE_STD, DENSITY),
    ),
)
"""The naval scenarios."""
