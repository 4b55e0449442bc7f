"""A foreign loop through the pilot (its own integrator and clock, late bearings, two sensors) against the built-in one.

python benchmarks/pilot_foreign_loop.py [--first-seed 0] [--seeds 20] [--seconds 180] [--unstated] [--own-errors]

The target, the vehicle's start and the number of bearings are those of the built-in loop. Navigations and commands come
at random intervals, a third of the bearings late by up to a second. One of the two sensors counts its angles from the
bow, where it is mounted. The vehicle is integrated by a Runge-Kutta method of its own under the thrust of the commands.

The bearings have the errors of the built-in loop's, in their order, or with `--own-errors` such as are drawn again: two
runs of one seed differ by a quarter with them. The ratio of the means is printed with its interval, by drawing the
seeds again. The built-in loop's bearings do not state their deviation, and the tracker counts `tracker.noise.std_deg`,
which is larger; those of this loop state it, but for `--unstated`.
"""

from __future__ import annotations

import argparse
import heapq
import math
import os
import warnings
from collections.abc import Callable, Iterator
from itertools import chain
from time import perf_counter, thread_time
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
import numpy as np
from scipy.stats import bootstrap

import gbt_ocp as gbt
from gbt_ocp.experiments.build.loop import Streams, build_start, build_target, build_vehicle
from gbt_ocp.models import Mounting

SETTLING_S = 60.0
"""Time in s from which errors count."""

INTERVALS = {"navigate": (0.01, 0.03), "command": (0.01, 0.03), "mast": (0.1, 0.3), "bow": (0.1, 0.3)}
"""Shortest and longest time in s between two events of a kind; two sensors at 5 Hz make the 10 Hz of one, and thrust is
asked for at the least rate of a follower, 50 Hz."""

LATE_SHARE, LATE_S = 0.3, 1.0
"""Share of bearings that come late, and by how much at most, in s."""

NOISE_RAD, MISSED = math.radians(1.0), 0.05
"""Of both sensors, as in sea2d."""

BOW = Mounting((1.5, 0.0))
"""Where the sensor at the bow sits, forward and to port in m."""


class Clock:
    """Processor time of the thread in the parts of a loop, and in the pilot around them.

    Parameters
    ----------
    pilot
        Its parts are wrapped.
    """

    def __init__(self, pilot: gbt.Pilot) -> None:
        self.inside = self.outside = 0.0
        self.calls = 0
        piloting = pilot._piloting
        for owner, name in ((piloting._online, "take"), (piloting._online, "decide"), (piloting._follower, "thrust")):
            setattr(owner, name, self._inner(getattr(owner, name)))

    def _inner(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*arguments: Any) -> Any:
            began = thread_time()
            try:
                return function(*arguments)
            finally:
                self.inside += thread_time() - began

        return timed

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call the pilot."""
        began = thread_time()
        found = function(*arguments)
        self.outside += thread_time() - began
        self.calls += 1
        return found

    @property
    def overhead(self) -> float:
        """Seconds a call that the pilot takes beside the parts."""
        return (self.outside - self.inside) / self.calls


def runge_kutta(rates: Callable[[Any], Any], state: Any, duration: float, step: float = 0.02) -> Any:
    """The state after ``duration`` seconds: the classical method of fourth order."""
    count = max(1, math.ceil(duration / step))
    h = duration / count
    for _ in range(count):
        a = rates(state)
        b = rates(state + 0.5 * h * a)
        c = rates(state + 0.5 * h * b)
        d = rates(state + h * c)
        state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return state


def foreign(
    configuration: gbt.Configuration, seed: int, seconds: float, std: float | None, bearing_errors: Iterator[float]
) -> tuple[float, float, gbt.Pilot]:
    """Mean error over the range from the settling time on, seconds of overhead a call, and the pilot at the end.

    ``std`` in radians is what bearings state; ``None`` for nothing. ``bearing_errors`` in radians are those of the
    bearings in their order, NaN for one that is missed.
    """
    rng, streams = np.random.default_rng([seed, 19]), Streams.of(configuration.seed)
    vehicle, target = build_vehicle(configuration), build_target(configuration, streams.target)
    start = build_start(configuration, vehicle, streams.start, target.position(0.0))
    state, thrust, time = vehicle.state(start[0], start[1]), np.zeros(len(vehicle.thrust_max)), 0.0
    pilot = gbt.Pilot(configuration)
    clock = Clock(pilot)
    events: list[tuple[float, int, str, Any]] = [(0.0, 0, "navigate", None), (0.001, 1, "command", None)]
    events += [(0.002, 2, "mast", None), (0.05, 3, "bow", None)]
    errors, number = [], len(events)
    while events[0][0] <= seconds:
        event, _, kind, measurement = heapq.heappop(events)
        state = runge_kutta(lambda x, held=thrust: vehicle.rates(x, held), state, event - time)
        time = event
        pose, truth = vehicle.pose(state), target.position(time)
        if kind == "arrival":
            clock.call(pilot.measure, measurement)
            continue
        if kind == "navigate":
            clock.call(pilot.navigate, time, pose, vehicle.velocity(state))
        elif kind == "command":
            command = clock.call(pilot.command, time)
            thrust = command.thrust
            if command.forecast is not None and time >= SETTLING_S:
                place = (time - command.times[0]) / (command.times[1] - command.times[0])
                mean = (1.0 - place) * command.forecast.mean[0] + place * command.forecast.mean[1]
                errors.append(np.linalg.norm(mean - truth) / np.linalg.norm(truth - pose[:2]))
        elif not math.isnan(angle := next(bearing_errors)):
            late = rng.uniform(0.0, LATE_S) if rng.random() < LATE_SHARE else 0.0
            if kind == "mast":
                line = truth - pose[:2]
                found = gbt.Measurement(time, "azimuth", math.atan2(line[1], line[0]) + angle, std, "mast")
            else:
                c, s = math.cos(pose[2]), math.sin(pose[2])
                line = truth - pose[:2] - BOW.position[0] * np.array([c, s])
                azimuth = math.atan2(line[1], line[0]) - pose[2] + angle
                found = gbt.Measurement(time, "azimuth", azimuth, std, "bow", "bow", BOW)
            number += 1
            heapq.heappush(events, (time + late, number, "arrival", found))
        number += 1
        heapq.heappush(events, (time + rng.uniform(*INTERVALS[kind]), number, kind, None))
    return float(np.mean(errors)), clock.overhead, pilot


def built_in(configuration: gbt.Configuration) -> tuple[float, Any]:
    """The same error of the built-in loop, and the errors of its bearings in radians, NaN where one was missed."""
    history = gbt.run(configuration).history
    line = history.target - history.vehicle_pose[:, :2]
    error = float(np.mean((history.error[:, 0] / np.linalg.norm(line, axis=1))[history.t >= SETTLING_S]))
    measured, across = history.bearing, np.stack([-line[:, 1], line[:, 0]], axis=1)
    angles = np.arctan2(np.sum(across * measured, axis=1), np.sum(line * measured, axis=1))
    return error, np.where(history.detected, angles, np.nan)


def drawn(rng: np.random.Generator) -> Iterator[float]:
    """Errors of bearings in radians, NaN for those that are missed."""
    while True:
        yield NOISE_RAD * rng.standard_normal() if rng.random() >= MISSED else math.nan


def interval(inside: Any, outside: Any) -> Any:
    """95 % interval ``(2,)`` of the ratio of the means of errors ``(K,)``, by drawing the seeds again."""
    return bootstrap((inside, outside), ratio_of_means, paired=True, method="percentile", rng=0).confidence_interval


def ratio_of_means(inside: Any, outside: Any, axis: int = -1) -> Any:
    """That of the second over the first."""
    return np.mean(outside, axis=axis) / np.mean(inside, axis=axis)


def pace() -> float:
    """Seconds that this machine takes for three million additions in Python, beside which an overhead can be read."""
    began, total = thread_time(), 0
    for number in range(3_000_000):
        total += number
    return thread_time() - began


def main() -> None:
    """Print a line a seed, then a table with the ratio of the mean errors and the overhead."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=180.0)
    parser.add_argument("--problem", default="sea2d")
    parser.add_argument("--unstated", action="store_true")
    parser.add_argument("--own-errors", action="store_true")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    rows = []
    for seed in range(arguments.first_seed, arguments.first_seed + arguments.seeds):
        configuration = gbt.load_config(arguments.problem, [f"duration_s={arguments.seconds}"], seed=seed)
        began = perf_counter()
        inside, angles = built_in(configuration)
        between = perf_counter()
        # the random intervals may ask for a few more than the built-in loop had
        again = drawn(np.random.default_rng([seed, 23]))
        std = None if arguments.unstated else NOISE_RAD
        outside, overhead, pilot = foreign(
            configuration, seed, arguments.seconds, std, again if arguments.own_errors else chain(angles, again)
        )
        rows.append((inside, outside, overhead))
        received = pilot._piloting._state(arguments.seconds).received
        print(
            f"seed {seed}: built-in {inside:.4f}, foreign {outside:.4f} of the range; overhead {1e6 * overhead:.1f} us "
            f"a call; {between - began:.0f} and {perf_counter() - between:.0f} s; {dict(received)}",
            flush=True,
        )
    means = np.mean(rows, axis=0)
    low, high = interval(*np.transpose(rows)[:2]) if len(rows) > 1 else (math.nan, math.nan)
    seeds = f"{arguments.first_seed} to {arguments.first_seed + len(rows) - 1}"
    ratio = f"{means[1] / means[0]:.3f} ({low:.2f} to {high:.2f})"
    print("\nAll seeds\n")
    print("| seeds | built-in loop, % of range | foreign loop | ratio (95 %) | overhead, µs a call | Python, s |")
    print("|---|---|---|---|---|---|")
    cells = (f"{100.0 * means[0]:.2f}", f"{100.0 * means[1]:.2f}", ratio, f"{1e6 * means[2]:.0f}", f"{pace():.2f}")
    print(f"| {seeds} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
