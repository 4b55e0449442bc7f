"""The pilot in C in single precision, kilometres from where its coordinates begin: the origin moves along with it."""

import ctypes
import math

import numpy as np
import pytest
from pilots_in_c import files_of

import gbt_ocp as gbt
from gbt_ocp.experiments.build.pilot import build_pilot
from gbt_ocp.ocp.codegen.library import find_compiler, load_library

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

LOOK = """#include "gbt_pilot.h"
void look(const gbt_pilot *pilot, const gbt_command *command, double *out)
{
    for (int k = 0; k < GBT_DIMENSION; k++) {
        out[k] = (double)pilot->forecast.mean[0][k] + pilot->origin[k];
        out[GBT_DIMENSION + k] = pilot->origin[k];
        out[2 * GBT_DIMENSION + k] = (double)command->setpoint.z[k];
    }
    out[3 * GBT_DIMENSION] = command->setpoint.status;
}
size_t command_bytes(void) { return sizeof(gbt_command); }
"""

SINGLE = "\n#ifndef GBT_SINGLE\n#define GBT_SINGLE\n#endif\n"


class FarPilot:
    """The calls of a pilot in C, in either precision; positions are given in double."""

    def __init__(self, configuration, single):
        files = files_of(build_pilot(configuration)) | {"gbt_look.c": LOOK}
        if single:
            files["gbt_identity.h"] += SINGLE
        self.library = load_library(files)
        self.real = np.float32 if single else np.float64
        self.d = configuration.dimension
        for name in ("gbt_pilot_bytes", "command_bytes"):
            getattr(self.library, name).restype = ctypes.c_size_t
        sizes = (self.library.gbt_pilot_bytes(), self.library.command_bytes())
        self.memory = [np.zeros(size // 8 + 1) for size in sizes]
        self.pilot, self.given = (ctypes.c_void_p(one.ctypes.data) for one in self.memory)
        getattr(self.library, "gbt_pilot_init_single" if single else "gbt_pilot_init")(self.pilot)

    def step(self, time, pose, velocity, kind, value):
        """Navigation, measurement and command; the forecast now, the origin and the setpoint, each ``(d,)``."""
        pose, velocity = np.array(pose, dtype=float), np.array(velocity, dtype=self.real)
        value, std = np.array(value, dtype=self.real), np.full(len(value), 0.01, dtype=self.real)
        now = ctypes.c_double(time)
        self.library.gbt_pilot_navigate_far(self.pilot, now, *map(_pointer, (pose, velocity)), None)
        self.library.gbt_pilot_measure(self.pilot, kind, *map(_pointer, (value, std)), None, now)
        self.library.gbt_pilot_command(self.pilot, now, self.given)
        out = np.zeros(3 * self.d + 1)
        self.library.look(self.pilot, self.given, _pointer(out))
        return out[:-1].reshape(3, self.d)


def _pointer(array):
    return ctypes.c_void_p(array.ctypes.data)


SMALL = "{window_s: 12.0, bin_s: 1.0, turn_rate_std: [0.03], turn_time_s: [10.0]}"

TRACKERS = {
    "ekf": ("case2", ["tracker.kind=ekf", "sensor.noise_deg=0.5"], 1e-3),
    "gp": ("case2", [], 0.2),
    "motion_gp": ("sea2d", ["tracker.kind=motion_gp", f"tracker={SMALL}"], 0.02),
}
"""Configuration of each, and how far float may be from double, over the range. That of gp takes bearings for exact,
which floats are not, and sees little of the range here."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.long if name == "motion_gp" else pytest.mark.slow) for name in TRACKERS],
)
def test_a_float_far_from_the_origin_knows_what_a_double_knows(name):
    """Past the target at 25 m/s, from 9 km to 10.5 km of the origin: it moves several times."""
    problem, changes, within = TRACKERS[name]
    config = gbt.load_config(problem, ["tracker.engine=compiled", *changes])
    pilots = [FarPilot(config, single) for single in (False, True)]
    origins, off, level = set(), [], []
    for number in range(600):
        time = 0.1 * number
        own = np.array([9e3 + 25.0 * time, -7e3 + 8.0 * math.sin(0.8 * time)])
        target = np.array([9.03e3 + 25.0 * time, -6.99e3])
        pose, velocity = [*own, 0.0], [25.0, 6.4 * math.cos(0.8 * time), 0.0]
        line = target - own
        # now and then the position itself, in the coordinates of the earth
        placed = number % 50 == 7 and name != "gp"
        kind, value = (5, target) if placed else (0, [math.atan2(line[1], line[0]), 0.0])
        double, single = (one.step(time, pose, velocity, kind, value) for one in pilots)
        origins.add(tuple(single[1]))
        assert not np.any(double[1]), "in double precision it stays"
        if number > 100:
            off.append(np.abs(double[0] - single[0]).max() / np.linalg.norm(line))
            level.append(np.abs(double[2] - single[2]).max())
    assert len(origins) >= 3
    assert np.median(off) < within
    assert np.median(level) < 30.0 * within + 1.0
