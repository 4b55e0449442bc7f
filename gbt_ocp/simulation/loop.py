"""The closed loop: the online loop in a world, and a record of what is needed to repeat or explain it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.simulation.channel import Channel
from gbt_ocp.simulation.closed_loop import ClosedLoop, Recording
from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.vehicle_run import VehicleRun

Progress = Callable[[int, float, float], None]
"""Called after each step with its number, the mean error in metres, and the solver's time in seconds."""


def step_count(duration: float, period: float) -> int:
    """Steps of a run: the first at t = 0, the last at the last full period within the duration (both in seconds)."""
    # a tenth has no exact binary form: 0.3/0.1 is a little less than 3
    return int(duration / period + 1e-6) + 1


def simulate(
    loop: ClosedLoop,
    start: ArrayLike,
    duration: float,
    progress: Progress | None = None,
    history: type[History] = History,
) -> Recording:
    """Run the closed loop.

    A bearing that the tracker refuses counts as missed. A forecast that is not finite is recorded as it is, but the
    guidance is given the last finite one in its place, a period further on.

    Parameters
    ----------
    loop
        The parts.
    start
        Derivatives 0 … L-1 of the flat output at t = 0 ``(L, n)``.
    duration
        In seconds; see :func:`step_count`.
    progress
        Called after each step.
    history
        The class of the history; a subclass may declare further arrays.
    """
    return simulate_together([(loop, start)], duration, None, progress, history)[0]


def simulate_together(
    vehicles: Sequence[tuple[ClosedLoop, ArrayLike]],
    duration: float,
    channel: Channel | None,
    progress: Progress | None = None,
    history: type[History] = History,
) -> list[Recording]:
    """Run the closed loops of several vehicles with the same target and the same period, step by step.

    In each step all measure, then packets are sent and heard, then each decides with the last plans that it has heard
    of the others, and all move.

    Parameters
    ----------
    vehicles
        The parts of each, and where it starts; see :func:`simulate`. One that talks to the others has an
        :attr:`~ClosedLoop.exchange`.
    duration
        In seconds.
    channel
        Carries their packets; ``None`` for vehicles that do not talk.
    progress
        Called after each step with the mean of their errors, and the times of their solvers together.
    history
        The class of their histories.
    """
    period = vehicles[0][0].sensor.period
    steps = step_count(duration, period)
    runs = [VehicleRun(loop, start, steps, history) for loop, start in vehicles]
    for k in range(steps):
        t = k * period
        for run in runs:
            run.measure(k, t)
        if channel is not None:
            _talk(t, runs, channel)
        done = [run.move(t) for run in runs]
        if progress is not None:
            times = [step.plan.solve_time for step in done if step.plan is not None]
            error = sum(float(np.add.reduce(step.error)) / len(step.error) for step in done) / len(done)
            progress(k, error, sum(times) if times else np.nan)
    return [run.recording() for run in runs]


def _talk(time: float, runs: Sequence[VehicleRun], channel: Channel) -> None:
    """Send what is due, and hear what has arrived."""
    if channel.due(time):
        for number, run in enumerate(runs):
            channel.send(time, number, run.packet(time), len(runs))
    for number, run in enumerate(runs):
        run.hear(channel.arrived(time, number))
