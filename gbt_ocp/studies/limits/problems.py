"""The problems that every treatment solves: recorded in closed loop, and drawn at random."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.experiments.build import loop as build
from gbt_ocp.experiments.build.desired import build_desired_bearing
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.files import read_arrays
from gbt_ocp.guidance.information import FisherInformation
from gbt_ocp.guidance.path_information import MotionInformation, PosteriorVariance, stage_ends
from gbt_ocp.guidance.startup import planned_of
from gbt_ocp.ocp.plan import Plan
from gbt_ocp.ocp.planner import Planner
from gbt_ocp.ocp.problem_data import ProblemData
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.simulation.loop import simulate
from gbt_ocp.tracking.path_belief import path_covariance
from gbt_ocp.tracking.protocol import Forecast, JointForecast
from gbt_ocp.typing import Array

Check = Callable[[], None]
"""Called between two solves; raises ``KeyboardInterrupt`` if Ctrl-C was pressed."""


def unasked() -> None:
    """The check where there is nothing to interrupt."""


RECORDED, RANDOM = "recorded", "random"
"""Where a problem comes from."""

START_UP = 4
"""Steps at the beginning of a recorded run that are always among its problems: range is not observable there."""


@dataclass(frozen=True)
class Instance:
    """What a planner is asked.

    Attributes
    ----------
    start
        Derivatives 0 … L-1 of the flat output ``(L, n)``.
    moments
        Predicted position of the target now and at the endpoints, p+1 times.
    desired
        Desired bearings at the endpoints ``(p, d)``.
    previous
        The plan of the step before; ``None`` where there is none.
    more
        What an objective is given beside these, by name.
    """

    start: Array
    moments: Forecast
    desired: Array
    previous: FlatTrajectory | None
    more: Mapping[str, Any] = field(default_factory=dict)

    @property
    def data(self) -> dict[str, Any]:
        """Keywords of a planner's ``solve``."""
        mean, covariance = self.moments.mean, self.moments.covariance
        return {
            "forecast": Forecast(mean[1:], covariance[1:]),
            "desired": self.desired,
            "present": Forecast(mean[0], covariance[0]),
            **self.more,
        }


# N problems, L derivatives of n flat outputs, p pieces with m = p + 1 moments, d coordinates, k times of a path, w = 2.
_LAYOUT = {
    "origin": "N",
    "run": "N",
    "time": "N",
    "start": "NLn",
    "mean": "Nmd",
    "covariance": "Nmdd",
    "desired": "Npd",
    "previous_start": "NLn",
    "previous_top": "Npn",
    "past": "Ndd",
    "path": "Nkdkd",
    "noise": "Nw",
    "period": "",
}
_KINDS = {"origin": "U", "run": "i"}


@dataclass(frozen=True)
class Problems:
    """A set of problems of one configuration, as ``problems/NAME.npz`` holds them.

    Attributes
    ----------
    origin
        ``recorded`` or ``random`` ``(N,)``.
    run
        Seed of the run that a problem was recorded in; random ones count on from 0 ``(N,)``.
    time
        t_k in s ``(N,)``; NaN of a random one.
    start
        Derivatives 0 … L-1 of the flat output ``(N, L, n)``.
    mean, covariance
        Predicted position of the target now and at the endpoints ``(N, p+1, d)`` m, ``(N, p+1, d, d)`` m².
    desired
        Desired bearings at the endpoints ``(N, p, d)``.
    previous_start, previous_top
        The plan of the step before: ``start`` ``(N, L, n)`` and ``top`` ``(N, p, freedoms)`` of its
        :class:`~gbt_ocp.ocp.trajectory.FlatTrajectory`, NaN where there is none.
    past
        Information of earlier bearings ``(N, d, d)``; NaN where the objective takes none.
    path, noise
        Covariance of the positions at several times together ``(N, k, d, k, d)`` m², and the two parts of the variance
        of a bearing to come ``(N, 2)`` (see :class:`~gbt_ocp.tracking.protocol.JointForecast`); NaN in the same way.
    period
        T in s.
    """

    origin: NDArray[np.str_]
    run: NDArray[np.int64]
    time: Array
    start: Array
    mean: Array
    covariance: Array
    desired: Array
    previous_start: Array
    previous_top: Array
    past: Array
    path: Array
    noise: Array
    period: Array

    def __len__(self) -> int:
        return len(self.origin)

    def __getitem__(self, number: int) -> Instance:
        known = bool(np.all(np.isfinite(self.previous_top[number])))
        previous = FlatTrajectory(float(self.period), self.previous_start[number], self.previous_top[number])
        return Instance(
            self.start[number],
            Forecast(self.mean[number], self.covariance[number]),
            self.desired[number],
            previous if known else None,
            self._more(number),
        )

    def _more(self, number: int) -> dict[str, Any]:
        """What an objective is given beside the moments; a path goes by the name of each objective that takes one."""
        found: dict[str, Any] = {}
        if np.all(np.isfinite(self.past[number])):
            found["past"] = self.past[number]
        if np.all(np.isfinite(self.path[number])):
            found["path"] = found["joint"] = JointForecast(self.path[number], *self.noise[number])
        return found

    def subset(self, numbers: Any) -> Problems:
        """Some of them."""
        chosen = {one.name: getattr(self, one.name)[numbers] for one in fields(self) if one.name != "period"}
        return Problems(**chosen, period=self.period)

    def save(self, path: Path) -> None:
        """Write them."""
        np.savez_compressed(path, **{one.name: getattr(self, one.name) for one in fields(self)})

    @classmethod
    def load(cls, path: Path) -> Problems:
        """Read them back.

        Raises
        ------
        ValueError
            If the file is damaged, or its arrays do not fit each other.
        """
        arrays = read_arrays(path, _LAYOUT, "a set of problems")
        sizes: dict[str, int] = {}
        for name, layout in _LAYOUT.items():
            array, kind = arrays[name], _KINDS.get(name, "f")
            if array.ndim != len(layout) or array.dtype.kind != kind:
                raise ValueError(
                    f"{path}: {name}: found {array.dtype} of shape {array.shape}; allowed: {layout or 'one'}"
                )
            for letter, size in zip(layout, array.shape, strict=True):
                if sizes.setdefault(letter, size) != size:
                    raise ValueError(f"{path}: {name}: found shape {array.shape}; allowed: {letter} = {sizes[letter]}")
        if not sizes["N"] or sizes["m"] != sizes["p"] + 1:
            raise ValueError(f"{path}: found {sizes['N']} problems of {sizes['p']} pieces and {sizes['m']} moments")
        return cls(**arrays)


def joined(parts: list[Problems]) -> Problems:
    """All of several sets of the same configuration."""
    names = [one.name for one in fields(Problems) if one.name != "period"]
    return Problems(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names}, period=parts[0].period
    )


class _Witness:
    """A planner that remembers what it was asked."""

    def __init__(self, planner: Planner) -> None:
        self._planner = planner
        self.problem = planner.problem
        self.asked: list[Instance] = []
        self.reset = planner.reset

    def solve(self, state: Array, forecast: Forecast, desired: Array, *, present: Forecast, **data: Any) -> Plan:
        p = self.problem.pieces
        moments = Forecast(
            np.concatenate([present.mean[None], forecast.mean[:p]]),
            np.concatenate([present.covariance[None], forecast.covariance[:p]]),
        )
        self.asked.append(Instance(np.array(state), moments, desired[:p], self._planner.previous, data))
        return self._planner.solve(state, forecast, desired, present=present, **data)


def record(configuration: Configuration, count: int, check: Check = unasked) -> Problems:
    """Problems of one closed-loop run: its first steps, and the rest spread evenly over the run.

    Parameters
    ----------
    configuration
        Of the run; its seed names the run.
    count
        How many, at most as many as the run has steps.
    check
        Called after each step.
    """
    loop, start = build.build_loop(configuration)
    planned = planned_of(loop.guidance)
    assert planned is not None, "checked before anything runs"
    assert isinstance(planned.planner, Planner), "configurations name no other"
    witness = _Witness(planned.planner)
    planned.planner = witness  # type: ignore[assignment]  # it answers like the planner
    simulate(loop, start, configuration.duration_s, lambda *_: check())
    steps = len(witness.asked)
    early = min(START_UP, count // 4)
    spread = np.linspace(early, steps - 1, max(min(count, steps) - early, 1)).round().astype(int)
    numbers = np.union1d(np.arange(early), spread)
    problem = witness.problem
    asked = [witness.asked[k] for k in numbers]
    return _stacked(asked, problem.period * numbers, RECORDED, configuration.seed, problem)


def draw(configuration: Configuration, count: int) -> Problems:
    """Problems drawn at random: a moving vehicle in a box of 10 m, a target that is known to a few decimetres.

    Where a run starts at a distance from the target, so do these: at 0.6 to 1.6 times that, with the target known to a
    fortieth of it. The speed of each axis is normal with 1 m/s (0.5 rad/s of what is not a position), the forecast
    moves straight. Every configuration has problems of its own: its name is part of the seed.
    """
    rng = np.random.default_rng([configuration.seed, crc32(configuration.name.encode())])
    vehicle = build.build_vehicle(configuration)
    desired = build_desired_bearing(configuration, vehicle)
    problem = build.build_flat_problem(configuration, vehicle)
    d, n, p, period = configuration.dimension, vehicle.flat_dimension, problem.pieces, problem.period
    away = configuration.vehicle.start.range_m
    spread = 0.2 if away is None else away / 40.0
    chosen = []
    for number in range(count):
        start = np.zeros((problem.joined, n))
        start[0, :d] = rng.uniform(-5.0, 5.0, d)
        start[1] = rng.normal(size=n) * np.where(np.arange(n) < d, 1.0, 0.5)
        ahead = period * np.arange(p + 1)
        mean = rng.normal(size=d) + ahead[:, None] * rng.normal(size=d)
        if away is not None:
            start[0, :d] *= rng.uniform(0.6, 1.6) * away / np.linalg.norm(start[0, :d])
            start[0, :d] += mean[0]
        root = spread * rng.normal(size=(d, d))
        moments = Forecast(mean, np.tile(root @ root.T, (p + 1, 1, 1)))
        more = _made_up(problem, moments, configuration.planner.ahead_s)
        chosen.append(Instance(start, moments, desired(number + ahead[1:]), None, more))
    return _stacked(chosen, np.full(count, np.nan), RANDOM, np.arange(count), problem)


def _made_up(problem: ProblemData, moments: Forecast, ahead: float) -> dict[str, Any]:
    """No earlier bearings, and a path whose velocity is known to 0.3 m/s on each axis, for an objective that asks."""
    term, d, p = problem.objectives[0], moments.mean.shape[1], problem.pieces
    if isinstance(term, FisherInformation):
        return {"past": np.zeros((d, d))}
    if not isinstance(term, PosteriorVariance | MotionInformation):
        return {}
    times = problem.period * np.arange(1, p + 1)
    if isinstance(term, MotionInformation):
        times = np.append(times, times[stage_ends(p, term.stages)] + ahead)
    place, speed = moments.covariance[0] + 1e-4 * np.eye(d), 0.09 * np.eye(d)
    motion = np.block([[place, np.zeros((d, d))], [np.zeros((d, d)), speed]])
    covariances = place + times[:, None, None] ** 2 * speed
    return {"path": JointForecast(path_covariance(times, place, covariances, motion), 0.0, 1e-4)}


def _stacked(chosen: list[Instance], times: Array, origin: str, runs: Any, problem: ProblemData) -> Problems:
    missing = np.full_like(chosen[0].start, np.nan), np.full((problem.pieces, problem.freedoms), np.nan)
    plans = [missing if one.previous is None else (one.previous.start, one.previous.top) for one in chosen]
    d = chosen[0].desired.shape[1]
    nothing = JointForecast(np.full((1, d, 1, d), np.nan), np.nan, np.nan)
    paths = [one.more.get("path", one.more.get("joint", nothing)) for one in chosen]
    return Problems(
        origin=np.full(len(chosen), origin),
        run=np.broadcast_to(np.asarray(runs, dtype=np.int64), len(chosen)),
        time=np.asarray(times, dtype=float),
        start=np.array([one.start for one in chosen]),
        mean=np.array([one.moments.mean for one in chosen]),
        covariance=np.array([one.moments.covariance for one in chosen]),
        desired=np.array([one.desired for one in chosen]),
        previous_start=np.array([start for start, _ in plans]),
        previous_top=np.array([top for _, top in plans]),
        past=np.array([one.more.get("past", np.full((d, d), np.nan)) for one in chosen]),
        path=np.array([path.covariance for path in paths]),
        noise=np.array([(path.floor, path.angle_variance) for path in paths]),
        period=np.array(problem.period),
    )
