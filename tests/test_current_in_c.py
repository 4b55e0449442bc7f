"""The current in the pilot in C: given or estimated, the same as in Python."""

import ctypes
import math

import numpy as np
import pytest
from pilots_in_c import Compared

from gbt_ocp.cli.main import main
from gbt_ocp.experiments.build.loop import Streams, build_start, build_target
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.models.measurements import Measurement
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.simulation.flow import Flow
from gbt_ocp.simulation.plant import Motion, Plant

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

NOISE = math.radians(1.0)


class InWater(Compared):
    """Both pilots, whose estimates of the current are compared at every command."""

    def command(self, time):
        command = super().command(time)
        current = self.python._piloting.parts.guidance.current
        velocity, covariance = np.zeros(self.c.d), np.zeros((self.c.d, self.c.d))
        places = [ctypes.c_void_p(array.ctypes.data) for array in (velocity, covariance)]
        self.c.library.gbt_pilot_current(self.c.pilot, *places)
        np.testing.assert_allclose(velocity, current.velocity, atol=1e-8)
        np.testing.assert_allclose(covariance, current.covariance, atol=1e-8)
        self.estimate = velocity
        return command


def drifting(name, water, seconds, *changes):
    """A closed loop in moving water under the thrust of the pilot in Python."""
    common = ["tracker.kind=ekf", "tracker.engine=compiled", "vehicle.follow=feedback", "seed=3"]
    config = load_config(name, [*common, *changes])
    pilot, rng, streams = InWater(config), np.random.default_rng(5), Streams.of(config.seed)
    vehicle, target = pilot.python._piloting.parts.vehicle, build_target(config, streams.target)
    start = build_start(config, vehicle, streams.start, target.position(0.0))
    motion, state = Motion(Plant(vehicle, flow=Flow(water))), vehicle.state(start[0], start[1])
    for step in range(round(seconds / config.period_s)):
        time = step * config.period_s
        pose = vehicle.pose(state)
        pilot.navigate(time, pose, vehicle.velocity(state))
        line = target.position(time) - pose[:-1]
        angles = [math.atan2(line[1], line[0]), math.atan2(line[-1], math.hypot(line[0], line[1]))][: len(line) - 1]
        value = np.array(angles) + NOISE * rng.normal(size=len(angles))
        kind = "azimuth" if len(line) == 2 else "azimuth_elevation"
        pilot.measure(Measurement(time, kind, value[0] if len(line) == 2 else value, sensor="sensor"))
        thrust = pilot.command(time).thrust
        state = motion.advance(state, lambda s, held=thrust: held, config.period_s)
    return pilot


@pytest.mark.long
@pytest.mark.parametrize(("name", "water"), [("sea2d", (0.3, -0.4)), ("sea3d", (0.3, -0.35, 0.2))])
def test_the_current_is_estimated_as_in_python(name, water):
    """While the range is not known: a plan makes thousandths of the last bit, and thrusts would part from there."""
    pilot = drifting(name, water, 3.0, "vehicle.current=unknown", "guidance.startup_deviation=0.01")
    assert pilot.followed == 0
    assert pilot.worst < 1e-8
    assert np.linalg.norm(pilot.estimate - water) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        ("vehicle.current=[0.4,-0.3]",),
        ("vehicle.current=[0.1,0.1]", "planner.degree=3", "planner.effort_rate=0.1"),
        ("vehicle.current=[0.1,0.1]", "planner.effort_rate=0.1"),
    ],
)
def test_plans_and_setpoints_in_a_given_current_are_those_of_python(changes):
    pilot = drifting("case2", (0.4, -0.3), 4.0, "sensor.noise_deg=0.5", *changes)
    assert pilot.followed == pilot.commands
    assert pilot.worst < 1e-8
    assert pilot.worst_setpoint < 1e-8
    np.testing.assert_array_equal(
        pilot.estimate, load_config("case2", ["vehicle.follow=feedback", *changes]).vehicle.current
    )


@pytest.mark.slow
def test_a_recorded_loop_in_a_current_is_replayed_by_the_generated_folder(tmp_path, capsys):
    keys = ("tracker.kind=ekf", "sensor.noise_deg=0.3", "vehicle.follow=feedback", "vehicle.current=unknown")
    given = [*keys, "plant.current=[0.3,-0.4]", "duration_s=8"]
    changes = [word for key in given for word in ("--set", key)]
    assert main(["codegen", "case2", "--out", str(tmp_path / "c"), "--pilot", "--verify", *changes]) == 0
    assert "81 commands" in capsys.readouterr().out


def test_a_zone_in_a_current_is_refused_in_c_in_one_line(tmp_path, capsys):
    given = ["tracker.kind=ekf", "vehicle.follow=feedback", "vehicle.current=[0.1,0.1]"]
    given.append("limits.keep_out=[{centre_m: [9.0, 9.0], radius_m: 0.8}]")
    changes = [word for key in given for word in ("--set", key)]
    assert main(["codegen", "case2", "--out", str(tmp_path / "c"), "--pilot", *changes]) == 2
    said = capsys.readouterr().err
    assert "--pilot: planner: found an objective or a limit with data of its own" in said
