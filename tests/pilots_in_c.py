"""A pilot in C through ctypes, beside the pilot in Python: both are given the same inputs."""

import ctypes
import math

import numpy as np

import gbt_ocp as gbt
from gbt_ocp.experiments.build.loop import Streams, build_start, build_target
from gbt_ocp.experiments.build.pilot import build_pilot
from gbt_ocp.guidance.startup import planner_of
from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.ocp.codegen.library import kernel_files, load_library
from gbt_ocp.ocp.codegen.options import CompiledOptions
from gbt_ocp.ocp.codegen.problem_source import generate_problem
from gbt_ocp.ocp.problem_data import ShootingData
from gbt_ocp.pilot.pilot_source import pilot_files

KINDS = ("azimuth", "azimuth_elevation", "elevation", "range", "size", "position")

ANSWERS = (
    *("taken", "late", "waiting", "duplicate", "too old", "ahead", "not finite", "no navigation", "refused", "full"),
    "wrong",
)

NOTES = (
    *("no navigation", "navigation old", "time stepped back", "no bearing", "track lost", "forecast held", "fallback"),
    "given up",
)

FRAMES = (None, "earth", "bow")


def files_of(parts):
    """All C files of a pilot and its planner."""
    planner = planner_of(parts.guidance)
    shooting = isinstance(planner.problem, ShootingData)
    options = CompiledOptions.checked(planner.solver.options, planner.problem.pieces, shooting=shooting)
    return kernel_files(shooting=shooting) | generate_problem(planner.problem, options).files | pilot_files(parts)


def own(vehicle, state):
    """Pose and velocity as a pilot is given them: with the pitch of a vehicle that has one."""
    n = vehicle.flat_dimension
    if isinstance(vehicle, DrivenBody) and n > vehicle.position_dimension + 1:
        return state[:n], state[n:]
    return vehicle.pose(state), vehicle.velocity(state)


class PilotInC:
    """The same calls as a :class:`gbt_ocp.Pilot`; sensors are numbers by the order in which they are first used."""

    def __init__(self, configuration):
        parts = build_pilot(configuration)
        self.sensors = {name: number for number, name in enumerate(parts.sensors)}
        self.d, n, m = parts.vehicle.position_dimension, parts.vehicle.flat_dimension, len(parts.vehicle.thrust_max)
        self.library = load_library(files_of(parts))
        number, whole, d = ctypes.c_double, ctypes.c_int, self.d

        class Setpoint(ctypes.Structure):
            _fields_ = [
                ("status", whole),
                *((name, number * n) for name in ("z", "dz")),
                *((name, number) for name in ("course", "speed", "heading", "depth")),
            ]

        class Command(ctypes.Structure):
            _fields_ = [
                ("status", whole),
                ("time", number),
                ("thrust", number * m),
                *((name, whole) for name in ("range_known", "notes", "following")),
                ("setpoint", Setpoint),
                *((name, whole) for name in ("planned", "planner", "origin")),
                *((name, number) for name in ("bearing_age", "navigation_age")),
                *((name, whole) for name in ("track_lost", "waiting", "new_tracks")),
                ("received", ctypes.c_uint * len(ANSWERS)),
            ]

        class SensorPose(ctypes.Structure):
            _fields_ = [(name, whole) for name in ("sensor", "frame", "mounted")]
            _fields_ += [("position", number * d), ("yaw", number)]

        self.Command, self.SensorPose, self.Setpoint = Command, SensorPose, Setpoint
        self.library.gbt_pilot_waypoint.restype = number
        self.library.gbt_pilot_bytes.restype = ctypes.c_size_t
        self.memory = np.zeros(self.library.gbt_pilot_bytes() // 8 + 1)
        self.pilot = ctypes.c_void_p(self.memory.ctypes.data)
        self.library.gbt_pilot_init(self.pilot)

    def navigate(self, time, pose, velocity, covariance=None):
        arrays = [None if one is None else np.array(one, dtype=float) for one in (pose, velocity, covariance)]
        pointers = [None if one is None else ctypes.c_void_p(one.ctypes.data) for one in arrays]
        return ANSWERS[self.library.gbt_pilot_navigate(self.pilot, ctypes.c_double(time), *pointers)]

    def measure(self, measurement):
        pose = self.SensorPose(self.sensors.setdefault(measurement.sensor, len(self.sensors)))
        pose.frame = FRAMES.index(measurement.frame)
        if measurement.mounting is not None:
            pose.mounted, pose.yaw = 1, measurement.mounting.yaw
            pose.position[: len(measurement.mounting.position)] = measurement.mounting.position
        value = np.array(measurement.components)
        std = None
        if measurement.std is not None:
            std = np.broadcast_to(np.asarray(measurement.std, dtype=float), value.shape).copy()
        answer = self.library.gbt_pilot_measure(
            self.pilot,
            KINDS.index(measurement.kind),
            ctypes.c_void_p(value.ctypes.data),
            None if std is None else ctypes.c_void_p(std.ctypes.data),
            ctypes.byref(pose),
            ctypes.c_double(measurement.time),
        )
        return ANSWERS[answer]

    def waypoints(self):
        """Those of the last command, each with its time."""
        found = []
        while True:
            setpoint = self.Setpoint()
            time = self.library.gbt_pilot_waypoint(self.pilot, len(found), ctypes.byref(setpoint))
            assert math.isnan(time) == (setpoint.status != 0)
            if math.isnan(time):
                return found
            found.append((setpoint, time))

    def command(self, time):
        command = self.Command()
        self.library.gbt_pilot_command(self.pilot, ctypes.c_double(time), ctypes.byref(command))
        return command


def noted(command):
    """The notes of a command in C, by name."""
    return {name for bit, name in enumerate(NOTES) if command.notes & 2**bit}


def answers_of(command):
    """How often each answer was given, by name."""
    return {name: count for name, count in zip(ANSWERS, command.received, strict=True) if count}


class Compared:
    """Both pilots behind the same calls, which compare what they answer.

    ``worst`` is the largest difference of a thrust over its limit; ``commands`` counts them.
    """

    def __init__(self, configuration):
        self.python, self.c = gbt.Pilot(configuration), PilotInC(configuration)
        self.limit = self.python._piloting.parts.vehicle.thrust_max
        self.worst = self.worst_setpoint = 0.0
        self.commands = self.followed = 0
        self.answers, self.decided = set(), []

    def navigate(self, *arguments):
        self._same(self.python.navigate(*arguments), self.c.navigate(*arguments))

    def measure(self, measurement):
        self._same(self.python.measure(measurement), self.c.measure(measurement))

    def _same(self, python, c):
        assert python == c
        self.answers.add(c)

    def command(self, time):
        python, c = self.python.command(time), self.c.command(time)
        health = python.health
        assert set(health.notes) == noted(c), (time, health.notes, noted(c))
        assert dict(health.received) == answers_of(c), (time, health.received, answers_of(c))
        assert (python.range_known, health.track_lost) == (bool(c.range_known), bool(c.track_lost))
        assert (health.waiting, health.new_tracks) == (c.waiting, c.new_tracks)
        for mine, its in ((health.bearing_age, c.bearing_age), (health.navigation_age, c.navigation_age)):
            assert mine == its or abs(mine - its) < 1e-9
        difference = float(np.max(np.abs(python.thrust - np.array(c.thrust)) / self.limit))
        self.worst = max(self.worst, difference)
        self.commands += 1
        self.decided.append(python.decided)
        setpoint = python.setpoint
        assert (setpoint is None) == (c.setpoint.status != 0)
        if setpoint is not None:
            self.followed += 1
            off = np.abs(np.append(setpoint.pose - np.array(c.setpoint.z), setpoint.speed - c.setpoint.speed))
            self.worst_setpoint = max(self.worst_setpoint, float(off.max()))
        if self.commands % 10 == 1:
            ahead = self.c.waypoints()
            assert len(ahead) == len(python.waypoints)
            for mine, (its, time_of) in zip(python.waypoints, ahead, strict=True):
                assert abs(mine.time - time_of) < 1e-9
                off = np.abs(np.append(mine.pose - np.array(its.z), mine.speed - its.speed))
                self.worst_setpoint = max(self.worst_setpoint, float(off.max()))
        return python


def runge_kutta(rates, state, duration, step=0.02):
    """The state after ``duration`` seconds."""
    count = max(1, math.ceil(duration / step))
    h = duration / count
    for _ in range(count):
        a = rates(state)
        b = rates(state + 0.5 * h * a)
        c = rates(state + 0.5 * h * b)
        d = rates(state + h * c)
        state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return state


def closed_loop(configuration, seconds, see, *, interval=None, late=0.0, pilot=None):
    """A closed loop of both pilots under the thrust of the one in Python.

    Parameters
    ----------
    see
        Measurements of a time, from (rng, time, target, pose).
    interval
        Shortest and longest time between two steps; the configuration's period without.
    late
        Longest time by which every third measurement is late.
    """
    rng, streams = np.random.default_rng([configuration.seed, 7]), Streams.of(configuration.seed)
    pilot = Compared(configuration) if pilot is None else pilot
    vehicle, target = pilot.python._piloting.parts.vehicle, build_target(configuration, streams.target)
    start = build_start(configuration, vehicle, streams.start, target.position(0.0))
    state, time, number, waiting = vehicle.state(start[0], start[1]), 0.0, 0, []
    while time <= seconds:
        pose, velocity = own(vehicle, state)
        pilot.navigate(time, pose, velocity, 1e-4 * np.eye(len(pose)))
        for measurement in see(rng, time, target.position(time), pose[: target.dimension + 1]):
            due = time + (rng.uniform(0.0, late) if late and rng.random() < 0.3 else 0.0)
            waiting.append((due, measurement))
        for one in [one for one in waiting if one[0] <= time]:
            pilot.measure(one[1])
            waiting.remove(one)
        thrust = pilot.command(time).thrust
        number += 1
        later = number * configuration.period_s if interval is None else time + rng.uniform(*interval)
        state = runge_kutta(lambda x, held=thrust: vehicle.rates(x, held), state, later - time)
        time = later
    return pilot
