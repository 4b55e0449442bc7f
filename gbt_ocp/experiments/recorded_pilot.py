"""A closed loop of a pilot, recorded call by call: what its C is given, and what Python answered."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, get_args

import numpy as np

from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.build.pilot import build_pilot
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.experiments.pilot_in_c import with_compiled_tracker
from gbt_ocp.files import packaged_text
from gbt_ocp.guidance.startup import planner_of
from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.measurements import Measurement
from gbt_ocp.ocp.codegen.expressions import c_array
from gbt_ocp.ocp.planner import AnyPlanner
from gbt_ocp.pilot.compiled_ekf import KINDS_IN_C
from gbt_ocp.pilot.own_track import Received
from gbt_ocp.pilot.pilot_health import NOTES
from gbt_ocp.pilot.piloting import Piloting
from gbt_ocp.pilot.skeleton import Skeleton
from gbt_ocp.simulation.closed_loop import ClosedLoop
from gbt_ocp.simulation.loop import step_count
from gbt_ocp.simulation.mover import Mover
from gbt_ocp.typing import Array

COMMANDS = 100
"""Commands that are recorded, at most, where the vehicle plans from the beginning on."""

MOST_AT_START = 5
"""How many times as many are recorded, at most, where the vehicle first moves for its range to be known. Half of
:data:`COMMANDS` then come after the first plan."""

SHAKEN_BY = (1.0e-12, 1.0e-11)
"""Relative changes of what goes in, by which is seen how far rounding may move a command."""

ALLOWED = 100.0
"""How far the C may be from a command, over how far such changes move it."""

LEAST_ALLOWED = 1.0e-6
"""Least difference that is allowed, over the limit of the thrust."""

STEADY = 1.0e-3
"""How far such changes may move a command that is compared, over the limit of the thrust."""

ANSWERS_IN_C: tuple[Received, ...] = get_args(Received)
"""What becomes of an input, by its number in C."""


class RecordedPilot:
    """Calls of a pilot in closed loop, and the plans that it made.

    Where two plans are about equally good, the last bit decides between them, and the two loops part. So the C goes on
    from Python's plan after each command, and how near it has to come to a command follows from two further pilots.
    These are given inputs that rounding might have changed, and go on from the first one's plans with what their own
    trackers remember, as another C library would have it. Commands that these change visibly are not compared.

    Parameters
    ----------
    configuration
        Whose parts exist in C.
    commands
        How many are recorded, at most; the duration of the configuration bounds them too. There are more where nothing
        is planned at first; see :data:`MOST_AT_START`.

    Attributes
    ----------
    commands, compared
        How many commands there are, and how many of them are compared.
    """

    def __init__(self, configuration: Configuration, commands: int = COMMANDS) -> None:
        configuration = with_compiled_tracker(configuration)
        loop, start = build_loop(configuration)
        self._loop = loop
        self._pilots = [Piloting(build_pilot(configuration)) for _ in (0.0, *SHAKEN_BY)]
        self._guidances = [Skeleton() for _ in self._pilots]
        for guidance, pilot in zip(self._guidances, self._pilots, strict=True):
            guidance.explore(pilot.parts.guidance)
        self._rng = np.random.default_rng(0)
        self._sensors = {name: number for number, name in enumerate(self._pilots[0].parts.sensors)}
        self._underway: list[Measurement] = []
        self._calls: list[str] = []
        self._plans: list[Array] = []
        self._width = max(2 * loop.vehicle.flat_dimension, len(loop.vehicle.thrust_max))
        self.commands = self.compared = 0
        period = loop.sensor.period
        mover = Mover(loop.vehicle, period, "dynamics", loop.plant)
        state = loop.vehicle.state(start[0], start[1])
        planned = 0
        for step in range(min(MOST_AT_START * commands, step_count(configuration.duration_s, period))):
            planned += bool(self._plans)
            if step >= commands and 2 * planned >= commands:
                break
            time = step * period
            self._navigated(time, *_own(loop.vehicle, state))
            for measurement in self._seen(loop, step, time, loop.vehicle.pose(state)):
                self._measured(measurement)
            state = mover.hold(state, self._commanded(time)).state

    @property
    def files(self) -> dict[str, str]:
        """The program that replays the loop, and the header with its calls."""
        none = "static const gbt_real pilot_plans[1][GBT_PIECES * GBT_FREE] = {{0}};\n"
        plans = c_array("gbt_real", "pilot_plans", np.array(self._plans)) if self._plans else none
        header = _VECTORS.format(
            calls=len(self._calls),
            width=self._width,
            rows=",\n".join(self._calls),
            plans=plans,
        )
        program = packaged_text("gbt_ocp.pilot", "example", "pilot_example.c")
        return {"pilot_vectors.h": header, "pilot_example.c": program}

    def _seen(self, loop: ClosedLoop, step: int, time: float, pose: Array) -> Iterator[Measurement]:
        """What arrives at a step of what the sensors measure."""
        target = loop.target.position(time)
        if loop.sensors is None:
            bearing = loop.sensor.measure(step, target, pose[:-1], loop.rng)
            if bearing is not None:
                # the angles alone, which is what C is given
                self._underway.append(replace(Measurement.of_direction(time, bearing), direction=None))
            while self._underway and self._underway[0].time <= time - loop.sensor.latency + 1e-9:
                yield self._underway.pop(0)
            return
        loop.sensors.measure(step, time, target, pose)
        for one in loop.sensors.arrived(time, ordered=False):
            yield Measurement(one.time, one.kind, one.value, one.std, one.sensor, "earth")

    def _shaken(self, values: Array) -> Iterator[tuple[Piloting, Array]]:
        """The other pilots, each with values that are changed a little."""
        for pilot, share in zip(self._pilots[1:], SHAKEN_BY, strict=True):
            yield pilot, values + share * (1.0 + np.abs(values)) * self._rng.normal(size=values.shape)

    def _navigated(self, time: float, pose: Array, velocity: Array) -> None:
        answer, both = self._pilots[0].navigate(time, pose, velocity), np.concatenate([pose, velocity])
        for pilot, changed in self._shaken(both):
            pilot.navigate(time, changed[: pose.size], changed[pose.size :])
        self._add("NAVIGATED", time, both, answer=ANSWERS_IN_C.index(answer))

    def _measured(self, one: Measurement) -> None:
        value, d = one.components, self._loop.target.dimension
        answer = self._pilots[0].measure(one)
        for pilot, changed in self._shaken(value):
            pilot.measure(replace(one, value=changed))
        std = np.zeros(0) if one.std is None else np.broadcast_to(np.asarray(one.std, dtype=float), value.shape)
        numbers = np.zeros(2 * d)
        numbers[: value.size], numbers[d : d + std.size] = value, std
        sensor = self._sensors.setdefault(one.sensor, len(self._sensors))
        said = {"answer": ANSWERS_IN_C.index(answer), "kind": KINDS_IN_C.index(one.kind), "sensor": sensor}
        self._add("MEASURED", one.time, numbers, **said, earth=one.frame == "earth", stated=one.std is not None)

    def _commanded(self, time: float) -> Array:
        """The thrust that is asked for at a time ``(m,)``."""
        command, *others = (pilot.command(time) for pilot in self._pilots)
        memory = self._guidances[0].taken()
        for guidance in self._guidances[1:]:
            guidance.put_back(memory)
        thrust, *changed = (np.asarray(one.thrust, dtype=float) for one in (command, *others))
        moved = float((np.abs(changed - thrust).max(axis=0) / self._loop.vehicle.thrust_max).max())
        steady = moved <= STEADY and all(one.health.notes == command.health.notes for one in others)
        decided = command.decided
        plan = None if decided is None or decided.time < time else decided.plan
        made = plan is not None and plan.elapsed == 0.0
        if made:
            planner = planner_of(self._pilots[0].parts.guidance)
            assert isinstance(planner, AnyPlanner), "configurations name no other"
            self._plans.append(planner.previous.top.ravel())
        notes = sum(2**bit for bit, note in enumerate(NOTES) if note in command.health.notes)
        within = max(LEAST_ALLOWED, ALLOWED * moved) if steady else 0.0
        self._add("COMMANDED", time, thrust, within, answer=notes, plan=len(self._plans) if made else 0)
        self.commands += 1
        self.compared += steady
        return thrust

    def _add(self, call: str, time: float, numbers: Array, within: float = 0.0, **said: int) -> None:
        places = ", ".join(
            str(int(said.get(name, 0))) for name in ("answer", "kind", "sensor", "earth", "stated", "plan")
        )
        written = ", ".join(repr(number) for number in numbers.tolist())
        self._calls.append(f"    {{{call}, {places}, {time!r}, {within!r}, {{{written}}}}}")


def _own(vehicle: Any, state: Array) -> tuple[Array, Array]:
    """Pose and velocity as a pilot is given them: those of a vehicle with a pitch have it too."""
    if isinstance(vehicle, DrivenBody) and vehicle.flat_dimension > vehicle.position_dimension + 1:
        return state[: vehicle.flat_dimension], state[vehicle.flat_dimension :]
    return vehicle.pose(state), vehicle.velocity(state)


_VECTORS = """/* Generated: a closed loop of the pilot in Python, call by call. */
#define PILOT_CALLS {calls}

enum {{ NAVIGATED, MEASURED, COMMANDED }};

static const struct {{
    int call;   /* NAVIGATED, MEASURED or COMMANDED */
    int answer; /* what Python answered to an input; the notes of a command */
    int kind, sensor, earth, stated; /* of a measurement: whether in the earth frame, whether with deviations */
    int plan;    /* number in pilot_plans, from 1, of the plan that a command made; 0: it made none */
    double time;
    double within; /* difference of a command that is allowed, over the limit of the thrust; 0: it hangs on rounding */
    gbt_real numbers[{width}]; /* pose and velocity; value and deviations, GBT_DIMENSION each; thrust */
}} pilot_calls[PILOT_CALLS] = {{
{rows}}};

{plans}"""
