"""Scenarios of Ning et al. (2024): bearings and angular sizes of a target at 3 to 10 m, fifty a second.

Numbers are those of the authors' programs (github.com/WindyLab/Bearing-angle, folders Fig4a to Fig5b). Their filters
are given the first guesses of the position (0, 13) or (0, 8) with a deviation of 0.3 m, which is a tenth of its error;
here the guessed range comes with a deviation as large as its error. The angle is the one that the size fills, of which
theirs is the first order.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from gbt_ocp.studies.scenarios.motion_laws import SteadyLaw
from gbt_ocp.studies.scenarios.scenario import NOISE, Knowledge, PublicScenario, RecordedRun, measured, stream
from gbt_ocp.typing import Array

SOURCE = "Ning, Zhang, Li, Chen, Zhao: A bearing-angle approach for unknown target motion analysis, IJRR 2024, figure "
STEP = 0.02
"""Time between measurements in s."""

STILL = SteadyLaw(0.0, 0.05)
"""A target that may move by a few centimetres a second."""

DIFFERS = "the guessed range has a deviation as large as its error, not a tenth of it"


def round_the_target(steps: int) -> tuple[Array, Array]:
    """Figures 4a and 5a: the observer goes round the still target at 5 m with 3 m/s. Own and target ``(K, 2)``."""
    turned = -0.5 * np.pi - 3.0 / 5.0 * STEP * np.arange(steps)
    target = np.tile([0.0, 10.0], (steps, 1))
    return target + 5.0 * np.stack([np.cos(turned), np.sin(turned)], axis=-1), target


def to_and_fro(steps: int, distance: float) -> tuple[Array, Array]:
    """Figures 4b and 5b: on the line to the still target, about a point that 2 m/s² pull towards, from 4 m/s on."""
    places, place, speed = [], 5.0, 4.0
    for _ in range(steps):
        places.append(place)
        place, speed = place + STEP * speed, speed + STEP * (-2.0 if place >= 5.0 else 2.0)
    own = np.stack([np.zeros(steps), places], axis=-1)
    return own, np.tile([0.0, distance], (steps, 1))


def in_pursuit(steps: int) -> tuple[Array, Array]:
    """Figure 4c: 5 m/s towards a target of (3, 1) m/s, the course turned as fast as the line of sight."""
    target = np.array([0.0, 10.0]) + STEP * np.arange(steps)[:, None] * np.array([3.0, 1.0])
    own = np.zeros((steps, 2))
    course = sight = 0.5 * np.pi
    for k in range(steps - 1):
        line = target[k] - own[k]
        now = float(np.arctan2(line[1], line[0]))
        course, sight = course + now - sight, now
        own[k + 1] = own[k] + STEP * 5.0 * np.array([np.cos(course), np.sin(course)])
    return own, target


def turning_square(own: Array, target: Array, rate: float) -> Array:
    """Figures 5a and 5b: sizes ``(K,)`` in m of a square that turns, 0.71 to 1 m seen from ``own``."""
    line = target - own
    seen = np.arctan2(line[:, 1], line[:, 0]) - rate * STEP * np.arange(len(own))
    return np.asarray(np.cos(np.mod(seen, 0.5 * np.pi) - 0.25 * np.pi))


def _recorded(
    run: int, paths: Callable[[], tuple[Array, Array]], knowledge: Knowledge, true_std: float, rate: float | None
) -> RecordedRun:
    own, target = paths()
    sizes = np.ones(len(own)) if rate is None else turning_square(own, target, rate)
    times = STEP * np.arange(len(own), dtype=float)
    seen = measured(times, own, target, knowledge, stream(run, NOISE), sizes=sizes, true_std=true_std)
    velocity = (target[1] - target[0]) / STEP
    return RecordedRun(times, own, target, target + NEAR_AHEAD * velocity, seen, knowledge)


NEAR_AHEAD = 1.0
"""How far ahead forecasts are scored, in s."""


def _scenario(
    figure: str,
    title: str,
    paths: Callable[[], tuple[Array, Array]],
    *,
    guess: tuple[float, float],
    size: float,
    true_std: float,
    law: SteadyLaw | None,
    speed: float = 0.3,
    rate: float | None = None,
) -> PublicScenario:
    share = {1.6: 0.6, 1.3: 0.4, 0.8: 0.25}[size]
    knowledge = Knowledge(
        *guess,
        speed=speed,
        bearing_std=0.01,
        pace=0.1,
        acceleration_density=1e-4,
        turn_rate=0.3,
        turns=False,
        size=(size, share),
    )
    return PublicScenario(
        name=f"ning_{figure}",
        title=title,
        source=SOURCE + figure,
        dimension=2,
        runs=6,
        record=partial(_recorded, paths=paths, knowledge=knowledge, true_std=true_std, rate=rate),
        ahead=NEAR_AHEAD,
        scored_from=0.4 * STEP * len(paths()[0]),
        scored_every=0.2,
        law=law,
        differs=DIFFERS,
    )


NING = (
    _scenario(
        "4a",
        "a still target of 1 m, the observer goes round it at 5 m",
        partial(round_the_target, 500),
        guess=(8.0, 3.0),
        size=1.6,
        true_std=0.01163,
        law=STILL,
    ),
    _scenario(
        "4b",
        "a still target of 1 m, the observer runs to and fro on the line to it",
        partial(to_and_fro, 600, 10.0),
        guess=(3.0, 2.0),
        size=0.8,
        true_std=0.008,
        law=STILL,
    ),
    _scenario(
        "4c",
        "a target of constant velocity, pursued by proportional navigation",
        partial(in_pursuit, 175),
        guess=(13.0, 3.0),
        size=1.6,
        true_std=0.011,
        law=SteadyLaw(3.0, 1.0),
        speed=3.0,
    ),
    _scenario(
        "5a",
        "as 4a, a square that turns fast: its size is not constant",
        partial(round_the_target, 500),
        guess=(8.0, 3.0),
        size=1.3,
        true_std=0.01,
        law=None,
        rate=1.5 * np.pi,
    ),
    _scenario(
        "5b",
        "as 4b at 10.5 m, a square that turns slowly: its size is not constant",
        partial(to_and_fro, 600, 10.5),
        guess=(3.0, 2.5),
        size=0.8,
        true_std=0.01,
        law=None,
        rate=np.pi / 8.0,
    ),
)
"""Figures 4a to 5b."""
