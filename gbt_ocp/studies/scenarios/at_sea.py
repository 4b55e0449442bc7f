"""Scenarios at sea, with own paths and targets recorded in closed loop, and logs of real bearings.

``sea_paths.npz`` holds the paths (``scripts/record_sea_paths.py``), each second, in whole millimetres. A run takes one
of them in turn, with noise and misses of its own.
"""

from __future__ import annotations

from functools import cache, partial
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline

from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.logs.read import read_log
from gbt_ocp.models.turning import SPEED_TIME
from gbt_ocp.simulation.track_summary import AHEAD_S, TRACK_SETTLING_S
from gbt_ocp.studies.scenarios.motion_laws import HeldTurnLaw
from gbt_ocp.studies.scenarios.scenario import NOISE, Knowledge, PublicScenario, RecordedRun, measured, stream
from gbt_ocp.typing import Array

if TYPE_CHECKING:
    from gbt_ocp.simulation.replayed_track import BearingLog

PATHS = "sea_paths.npz"
PERIOD, MISSED = 0.1, 0.05

SPEED_CHANGE = 0.2
"""Standard deviation of the logarithm of the speed, where it varies."""


@cache
def sea_paths(name: str) -> tuple[Array, Array]:
    """Own paths and targets of a configuration, ``(R, K, d)`` each in m, a second apart."""
    with resources.files(__package__).joinpath(PATHS).open("rb") as file, np.load(file) as found:
        return 1e-3 * found[f"{name}_own"], 1e-3 * found[f"{name}_target"]


def _recorded(run: int, name: str, knowledge: Knowledge) -> RecordedRun:
    owns, targets = sea_paths(name)
    own, target = owns[run % len(owns)], targets[run % len(owns)]
    seconds = np.arange(len(own), dtype=float)
    last = seconds[-1] - AHEAD_S
    times = PERIOD * np.arange(round(last / PERIOD) + 1)
    ours, path = CubicSpline(seconds, own), CubicSpline(seconds, target)
    truth = path(times)
    seen = measured(times, ours(times), truth, knowledge, stream(run, NOISE), missed=MISSED)
    return RecordedRun(times, ours(times), truth, path(times + AHEAD_S), seen, knowledge)


def _scenario(name: str, dimension: int, varies: bool) -> PublicScenario:
    knowledge = Knowledge(50.0, 50.0, 1.0, np.deg2rad(1.0), speed_varies=varies)
    space, speed = "in space" if dimension == 3 else "in the plane", "varies by 20 %" if varies else "is constant"
    return PublicScenario(
        name,
        f"a boat that turns at random, {space}, whose speed {speed}, seen by a vehicle that keeps 30 m away; 1°, 10 Hz",
        f"configuration {name} of this package, own paths recorded in closed loop",
        dimension,
        runs=4,
        record=partial(_recorded, name=name, knowledge=knowledge),
        ahead=AHEAD_S,
        scored_from=TRACK_SETTLING_S,
        scored_every=2.0,
        law=HeldTurnLaw(
            1.0, 0.0, 0.05, (20.0, 40.0), speed_change=SPEED_CHANGE if varies else 0.0, speed_time=SPEED_TIME
        ),
    )


SEA = tuple(_scenario(name, d, v) for name, d, v in (
    ("sea2d", 2, False), ("sea2d_speed", 2, True), ("sea3d", 3, False), ("sea3d_speed", 3, True),
))  # fmt: skip
"""The scenarios at sea."""


def log_scenarios(folder: Path) -> tuple[PublicScenario, ...]:
    """A scenario for each CSV file of a folder with bearings and the truth beside them; see ``docs/howto/replay.md``.

    Bearings count from +x, counter-clockwise.

    Raises
    ------
    ConfigurationError
        If the folder has no such file, or a file is no log with the truth.
    """
    files = sorted(folder.glob("*.csv"))
    if not files:
        raise ConfigurationError([f"--logs: found no CSV file in {folder}; allowed: a folder with logs of bearings"])
    return tuple(_of_log(path) for path in files)


def _of_log(path: Path) -> PublicScenario:
    log = read_log(path, "x")
    if log.truth is None:
        raise ConfigurationError([f"--logs: {path}: found no true positions; allowed: a log with true_x and true_y"])
    knowledge = Knowledge(80.0, 80.0, 2.5, np.deg2rad(2.5), acceleration_density=0.1)
    return PublicScenario(
        f"log_{path.stem}",
        f"recorded bearings of a boat, {log.times[-1] - log.times[0]:.0f} s",
        f"recorded log {path.name}",
        log.dimension,
        runs=1,
        record=partial(_of_run, log=log, knowledge=knowledge),
        ahead=AHEAD_S,
        scored_from=30.0,
        scored_every=1.0,
    )


def _of_run(run: int, log: BearingLog, knowledge: Knowledge) -> RecordedRun:
    """A log is the same in each run."""
    assert log.truth is not None
    ahead = np.stack(
        [np.interp(log.times + AHEAD_S, log.times, column, right=np.nan) for column in log.truth.T], axis=-1
    )
    return RecordedRun(log.times, log.own, log.truth, ahead, tuple((one,) for one in log.sightings), knowledge)
