"""Faults put into a closed loop: solver, sensor, tracker, target or vehicle misbehave at chosen steps."""

import copy
from dataclasses import replace

import numpy as np

from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.ocp import Planner
from gbt_ocp.ocp.solvers.base import Solution
from gbt_ocp.simulation.loop import simulate
from gbt_ocp.tracking.protocol import Forecast


class FaultySolver:
    """Answers as a broken solver would, while ``steps`` says so; counts the steps by the calls of the planner."""

    name = "faulty"

    def __init__(self, solver, kind, steps):
        self._solver, self._kind, self._steps = solver, kind, steps
        self.step = -1

    def solve(self, start, objectives, guess, **how):
        if self.step not in self._steps:
            return self._solver.solve(start, objectives, guess, **how)
        if self._kind == "raises":
            raise RuntimeError("the solver is broken")
        if self._kind == "nothing":
            return None
        if self._kind == "shapeless":
            return Solution(np.zeros(3), True, "solved", 1)
        if self._kind == "limit":
            return Solution(np.zeros_like(guess), False, "iteration limit", 60)
        if self._kind == "wild":  # says that it is solved, and is nowhere near the limits
            return Solution(np.full_like(guess, 1e3), True, "solved", 1)
        assert self._kind == "nan"
        return Solution(np.full_like(guess, np.nan), True, "solved", 1)


SOLVER_FAULTS = ("nan", "limit", "raises", "nothing", "shapeless", "wild")


class FaultySensor:
    """Measures what no sensor should."""

    def __init__(self, sensor, kind, steps):
        self._sensor, self._kind, self._steps = sensor, kind, steps
        self.period, self.latency = sensor.period, sensor.latency
        self._last = None

    def measure(self, step, target, own, rng):
        bearing = self._sensor.measure(step, target, own, rng)
        if step in self._steps and bearing is not None:
            if self._kind == "repeated":
                return bearing if self._last is None else self._last
            return {
                "nan": np.full_like(bearing, np.nan),
                "infinite": np.full_like(bearing, np.inf),
                "zero": np.zeros_like(bearing),
                "long": 3.0 * bearing,
                "opposite": -bearing,
                "missing": None,
            }[self._kind]
        self._last = bearing
        return bearing


SENSOR_FAULTS = ("nan", "infinite", "zero", "long", "opposite", "missing", "repeated")


class FaultyTracker:
    """Gets its samples late, twice or from the past, or loses its numbers; a GP's own attributes shine through."""

    def __init__(self, tracker, kind, steps, period):
        self._tracker, self._kind, self._steps, self._period = tracker, kind, steps, period
        self._step = -1

    def __getattr__(self, name):
        return getattr(self._tracker, name)

    def update(self, time, bearing, own):
        faulty = round(time / self._period) in self._steps
        if faulty and self._kind == "reversed":
            time -= 5.0
        self._tracker.update(time, bearing, own)
        if faulty and self._kind == "twice":
            self._tracker.update(time, bearing, own)

    def predict(self, times):
        found = self._tracker.predict(times)
        if round(times[0] / self._period) in self._steps:
            if self._kind == "not_finite":
                return Forecast(np.full_like(found.mean, np.nan), found.covariance)
            if self._kind == "infinite":
                return Forecast(found.mean, np.full_like(found.covariance, np.inf))
            if self._kind == "singular":
                return Forecast(found.mean, np.zeros_like(found.covariance))
            if self._kind == "far":
                return Forecast(found.mean + 1e12, found.covariance)
        return found


TRACKER_FAULTS = ("reversed", "twice", "not_finite", "infinite", "singular", "far")


class ThroughTheVehicle:
    """A target that runs through the places where the vehicle is, whenever it is told where that is."""

    def __init__(self, target, steps, period):
        self._target, self._steps, self._period = target, steps, period
        self.dimension = target.dimension
        self.vehicle = np.zeros(target.dimension)

    def position(self, times):
        t = np.asarray(times, dtype=float)
        found = np.array(self._target.position(t))
        inside = np.isin(np.round(t / self._period).astype(int), list(self._steps))
        found[inside] = self.vehicle
        return found


class WeakerVehicle:
    """A vehicle whose thrust limits shrink when it is told to."""

    def __init__(self, vehicle, share):
        self._vehicle, self._share = vehicle, share
        self.weak = False

    def __getattr__(self, name):
        if name.startswith("__"):  # asked for while it is copied
            raise AttributeError(name)
        return getattr(self._vehicle, name)

    @property
    def thrust_max(self):
        return self._vehicle.thrust_max * (self._share if self.weak else 1.0)


class WatchedGuidance:
    """Tells the faults which step it is, and plans for the weaker vehicle from the step on at which limits shrink."""

    def __init__(self, guidance, faults, period, weaker=None, vehicle=None, shrinks=None, target=None):
        self._guidance, self._faults, self._period = guidance, faults, period
        self._weaker, self._vehicle, self._shrinks, self._target = weaker, vehicle, shrinks, target

    def decide(self, time, flat, forecast):
        step = round(time / self._period)
        for fault in self._faults:
            fault.step = step
        if self._shrinks is not None and step == self._shrinks:
            previous = self._guidance.planner.previous
            self._guidance.planner = self._weaker
            self._weaker.previous = previous
            self._vehicle.weak = True
        if self._target is not None:
            self._target.vehicle = np.array(flat[0][: self._target.dimension])
        return self._guidance.decide(time, flat, forecast)


def faulty_run(
    case="case2",
    *,
    solver=None,
    sensor=None,
    tracker=None,
    through=(),
    shrinks=None,
    share=0.6,
    overrides=(),
    seconds=3.0,
    seed=0,
):
    """A run with faults.

    Parameters
    ----------
    solver, sensor, tracker
        A kind and the steps at which it strikes.
    through
        Steps at which the target is where the vehicle was a step ago.
    shrinks, share
        Step at which the thrust limits shrink to this share of what they were.

    """
    configuration = load_config(case, overrides=[f"duration_s={seconds}", *overrides], seed=seed)
    loop, start = build_loop(configuration)
    loop = copy.copy(loop)
    period = loop.sensor.period
    planner = loop.guidance.planner
    faults = []
    if solver is not None:
        faults.append(FaultySolver(planner.solver, *solver))
        loop.guidance.planner = Planner(planner.problem, faults[0])
    if sensor is not None:
        loop = replace(loop, sensor=FaultySensor(loop.sensor, *sensor))
    if tracker is not None:
        loop = replace(loop, tracker=FaultyTracker(loop.tracker, *tracker, period))
    target = ThroughTheVehicle(loop.target, through, period) if through else None
    if target is not None:
        loop = replace(loop, target=target)
    vehicle = weaker = None
    if shrinks is not None:
        vehicle = WeakerVehicle(loop.vehicle, share)
        limits = (share * loop.vehicle.thrust_max).tolist()
        small, _ = build_loop(
            load_config(
                case,
                overrides=[f"duration_s={seconds}", *overrides, f"vehicle.thrust_max={limits}"],
                seed=seed,
            )
        )
        weaker = small.guidance.planner
        if solver is not None:
            faults.append(FaultySolver(weaker.solver, *solver))
            weaker = Planner(weaker.problem, faults[-1])
        loop = replace(loop, vehicle=vehicle)
    guidance = WatchedGuidance(loop.guidance, faults, period, weaker, vehicle, shrinks, target)
    return simulate(replace(loop, guidance=guidance), start, seconds)
