"""The generated pilot in single and in double precision, each in a closed loop of its own.

python benchmarks/pilot_precision.py [--first-seed 0] [--seeds 10] [--only case2 case5 sea2d]

The C of ``gbt-ocp codegen --pilot`` is compiled twice and called by a world in double precision. The vehicle is
integrated under the thrust of the commands at 50 Hz; bearings come ten times a second with the errors of the
configuration, the same in both precisions. The error is that of the forecast at its times, averaged over the decisions
after the settling time; the share of the range is its first one, now. The last loop is 10 km from where the coordinates
begin, with poses given in double precision (``gbt_pilot_navigate_far``).
"""

from __future__ import annotations

import argparse
import ctypes
import math
import os
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
import numpy as np
from pilot_foreign_loop import runge_kutta

import gbt_ocp as gbt
from gbt_ocp.experiments.build.loop import Streams, build_start, build_target, build_vehicle
from gbt_ocp.experiments.build.pilot import build_pilot
from gbt_ocp.guidance.startup import planner_of
from gbt_ocp.ocp.codegen.library import kernel_files, load_library
from gbt_ocp.ocp.codegen.options import CompiledOptions
from gbt_ocp.ocp.codegen.problem_source import generate_problem
from gbt_ocp.pilot.pilot_source import pilot_files

PROBLEMS = {"case2": (15.0, 2.0), "case5": (15.0, 2.0), "sea2d": (120.0, 60.0)}
"""By name: seconds of a run, and those after which errors count."""

FAR_M = 10_000.0
"""How far off in each horizontal coordinate the last loop is, in m."""

PERIOD, BEARINGS = 0.02, 5
"""Seconds between two commands, and how many of them go to a bearing."""

LOOP = """#include "gbt_pilot.h"
/* A step of a closed loop: a navigation, a bearing or none, a command. Everything is double here. */
static gbt_pilot pilot;
static gbt_command command;
void loop_begin(void) { gbt_pilot_init(&pilot); }
int loop_step(double time, const double *pose, const double *velocity, const double *angles, double *thrust,
              double *mean)
{
    const double decided = pilot.decided ? pilot.decided_at : -1;
    gbt_real value[GBT_DIMENSION], rates[GBT_POSE];
    for (int k = 0; k < GBT_POSE; k++) rates[k] = (gbt_real)velocity[k];
    gbt_pilot_navigate_far(&pilot, time, pose, rates, 0);
    if (angles) {
        for (int k = 0; k < GBT_DIMENSION - 1; k++) value[k] = (gbt_real)angles[k];
        gbt_pilot_measure(&pilot, GBT_DIMENSION == 2 ? GBT_AZIMUTH : GBT_AZIMUTH_ELEVATION, value, 0, 0, time);
    }
    gbt_pilot_command(&pilot, time, &command);
    for (int k = 0; k < GBT_INPUTS; k++) thrust[k] = command.thrust[k];
    for (int t = 0; t <= GBT_AHEAD; t++)
        for (int k = 0; k < GBT_DIMENSION; k++)
            mean[t * GBT_DIMENSION + k] = pilot.origin[k] + (double)pilot.forecast.mean[t][k];
    return pilot.decided_at > decided;
}
"""
SINGLE = "\n#ifndef GBT_SINGLE\n#define GBT_SINGLE\n#endif\n"


def library(configuration: gbt.Configuration, single: bool) -> ctypes.CDLL:
    """The pilot of a configuration with the step of a loop, compiled."""
    parts = build_pilot(configuration)
    planner: Any = planner_of(parts.guidance)
    options = CompiledOptions.checked(planner.solver.options, planner.problem.pieces)
    files = kernel_files() | generate_problem(planner.problem, options).files | pilot_files(parts)
    files |= {"gbt_loop.c": LOOP}
    if single:
        files["gbt_identity.h"] += SINGLE
    return load_library(files)


def direction(line: Any) -> Any:
    """Azimuth, and in space elevation, of a vector."""
    azimuth = math.atan2(line[1], line[0])
    return np.array([azimuth] if len(line) == 2 else [azimuth, math.atan2(line[2], math.hypot(line[0], line[1]))])


def pointer(array: Any) -> ctypes.c_void_p:
    """Its first number."""
    return ctypes.c_void_p(array.ctypes.data)


def run(
    configuration: gbt.Configuration, loop: ctypes.CDLL, settling: float, off: float = 0.0
) -> tuple[float, float, float]:
    """Mean error of the forecast in m and of its first position over the range, and the least distance in m.

    The pilot's coordinates begin ``off`` metres away, in the horizontal plane.
    """
    streams, rng = Streams.of(configuration.seed), np.random.default_rng([configuration.seed, 29])
    vehicle, target = build_vehicle(configuration), build_target(configuration, streams.target)
    start = build_start(configuration, vehicle, streams.start, target.position(0.0))
    state, d = vehicle.state(start[0], start[1]), configuration.dimension
    ahead = configuration.forecast_period * np.arange(configuration.tracker.forecast + 1)
    thrust, mean = np.zeros(len(vehicle.thrust_max)), np.zeros((len(ahead), d))
    noise, missed = math.radians(configuration.sensor.noise_deg), configuration.sensor.missed_probability
    found = []
    loop.loop_begin()
    for step in range(round(configuration.duration_s / PERIOD)):
        time = step * PERIOD
        pose, velocity = np.array(vehicle.pose(state)), np.array(vehicle.velocity(state))
        line, angles = target.position(time) - pose[:d], None
        if step % BEARINGS == 0:
            errors = noise * rng.standard_normal(d - 1)
            angles = None if rng.random() < missed else direction(line) + errors
        given = None if angles is None else pointer(angles)
        pose[:2] += off
        now = ctypes.c_double(time)
        decided = loop.loop_step(now, pointer(pose), pointer(velocity), given, pointer(thrust), pointer(mean))
        if decided and time >= settling:
            truth = np.array([target.position(time + one) for one in ahead])
            truth[:, :2] += off
            error = np.linalg.norm(mean - truth, axis=1)
            found.append((error.mean(), error[0] / np.linalg.norm(line), np.linalg.norm(line)))
        held = thrust.copy()
        state = runge_kutta(lambda x, held=held: vehicle.rates(x, held), state, PERIOD)
    errors = np.array(found)
    return float(errors[:, 0].mean()), float(errors[:, 1].mean()), float(errors[:, 2].min())


LOOPS = {"double": (False, 0.0), "single": (True, 0.0), "single, 10 km": (True, FAR_M)}
"""Whether a loop is in single precision, and how far off."""


def main() -> None:
    """Print a line a run, then a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--only", nargs="+", choices=list(PROBLEMS), default=list(PROBLEMS))
    arguments = parser.parse_args()
    rows = []
    for name in arguments.only:
        seconds, settling = PROBLEMS[name]
        found = []
        for seed in range(arguments.first_seed, arguments.first_seed + arguments.seeds):
            configuration = gbt.load_config(name, [f"duration_s={seconds}"], seed=seed)
            all_loops = [
                run(configuration, library(configuration, single), settling, off) for single, off in LOOPS.values()
            ]
            print(f"{name}, seed {seed}: {dict(zip(LOOPS, all_loops, strict=True))}", flush=True)
            found.append(all_loops)
        means, least = np.mean(found, axis=0), np.min(found, axis=0)
        for loop, mean, closest in zip(LOOPS, means, least, strict=True):
            cells = [f"{mean[0]:.4f}", f"{mean[0] / means[0][0]:.2f}", f"{100.0 * mean[1]:.3f}"]
            rows.append(
                [f"{name}, {loop}", f"{seconds:g}", *cells, f"{mean[1] / means[0][1]:.2f}", f"{closest[2]:.2f}"]
            )
    heads = ["loop", "s", "forecast, m", "over that of double", "now, % of range", "over that of double"]
    heads += ["least distance, m"]
    print("\nEach precision in its own loop\n")
    print("| " + " | ".join(heads) + " |\n|" + "---|" * len(heads))
    for row in rows:
        print("| " + " | ".join(row) + " |")


if __name__ == "__main__":
    main()
