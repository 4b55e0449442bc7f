"""The pilot on a Cortex-M7: a recorded closed loop in an emulator, against Python, in both precisions."""

import functools
import re
import subprocess

import numpy as np
import pytest
from arm_board import ARM, COMPILER, FLAGS, MACHINE, NEEDED, SMALL, UNITS, program_of, said_by
from pilots_in_c import files_of

import gbt_ocp as gbt
from gbt_ocp.experiments.build.pilot import build_pilot
from gbt_ocp.experiments.recorded_pilot import RecordedPilot

pytestmark = NEEDED

CASES = [
    pytest.param("case2", "seed=0", 30, marks=pytest.mark.long),
    pytest.param("case5", "seed=0", 50, marks=pytest.mark.slow),
    pytest.param("sea2d", "seed=0", 100, marks=pytest.mark.slow),
    pytest.param("sea2d", "tracker.kind=ekf", 100, marks=pytest.mark.slow),
    pytest.param("sea2d", "tracker.kind=motion_gp", 100, marks=pytest.mark.slow),
]


@functools.cache
def recorded(name, change, commands):
    """The recording, and all files of its C by name."""
    config = gbt.load_config(name, [change])
    recording = RecordedPilot(config, commands)
    return recording, files_of(build_pilot(config)) | recording.files


def steps_on_the_board(place, name, change, commands, precision, flags=()):
    """The recording, an array by name of what was printed a step, and sizes by name."""
    recording, files = recorded(name, change, commands)
    for file, text in files.items():
        (place / file).write_text(text, encoding="utf-8")
    sources = [*sorted(place.glob("gbt_*.c")), ARM / "pilot_bench.c"]
    said = said_by(program_of(place, sources, [place], precision, flags))
    steps = [dict(re.findall(r"(\w+) (\S+)", line)) for line in said.splitlines() if line.startswith("time")]
    arrays = {key: np.array([float(step[key]) for step in steps]) for key in steps[0]}
    sizes = {key: int(number) for key, number in re.findall(r"(\w+) (\d+)", said.splitlines()[-1])}
    return recording, arrays, sizes


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize(("name", "change", "commands"), CASES)
def test_commands_on_a_microcontroller_are_those_of_python(tmp_path, name, change, commands, precision):
    recording, steps, sizes = steps_on_the_board(tmp_path, name, change, commands, precision)
    assert len(steps["time"]) == recording.commands >= commands
    assert recording.compared > 0.5 * commands
    compared = steps["within"] > 0.0
    off = np.sort((steps["difference"] / np.maximum(steps["within"], 1e-99))[compared])
    if precision == "double":
        # another C library rounds otherwise; a plan that it moves further is one that ended at its tolerance
        assert off[int(0.9 * len(off))] < 1.0
        assert off[-1] < 100.0
        assert np.all(steps["same"][compared & (steps["steady"] == 1)])
    else:
        assert np.median(steps["difference"][compared]) < 0.03
    assert sizes["stack"] < 32768
    took = steps["instructions"]
    assert took[steps["planned"] == 1].min() > 1e5, "planning takes time"
    print(name, precision, f"mean {took.mean():.4g} most {took.max():.4g}", sizes)


CALLER = """
#include "gbt_pilot.h"
static gbt_pilot pilot;
static gbt_command command;
static volatile double time;
static volatile gbt_real number;
int main(void)
{
    gbt_real numbers[2 * GBT_POSE];
    gbt_sensor_pose sensor = {0};
    for (int k = 0; k < 2 * GBT_POSE; k++) numbers[k] = number;
    sensor.frame = GBT_AS_CONFIGURED;
    gbt_pilot_init(&pilot);
    gbt_pilot_navigate(&pilot, time, numbers, numbers + GBT_POSE, 0);
    gbt_pilot_measure(&pilot, (gbt_kind)(int)time, numbers, numbers, &sensor, time);
    gbt_pilot_command(&pilot, time, &command);
    return command.thrust[0] > number;
}
"""
"""A program of the pilot and little else."""


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
def test_the_pilot_at_sea_fits_into_64_kb_of_flash(tmp_path, precision):
    """Code and constants of everything but the C library, which is not compiled for the link."""
    for file, text in files_of(build_pilot(gbt.load_config("sea2d"))).items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    (tmp_path / "caller.c").write_text(CALLER)
    program_of(tmp_path, [*sorted(tmp_path.glob("gbt_*.c")), tmp_path / "caller.c"], [tmp_path], precision, SMALL)
    placed = (tmp_path / "map").read_text().split("Linker script and memory map")[1]
    parts = re.findall(r"^ \.(?:text|rodata|data)\S*\s+0x[0-9a-f]+\s+(0x[0-9a-f]+) \S*ltrans", placed, re.MULTILINE)
    flash = sum(int(size, 16) for size in parts)
    assert 50000 < flash < 64000


OF_TIMES = {
    *("decide", "desired", "gaps", "guidance", "intake", "origin", "own_track", "pilot", "trajectory", "watch"),
    *("bins", "motion_gp", "motions", "polar", "shape_rows", "singles", "track_memory", "ekf", "gp"),
    *("moments", "places", "plan", "problem", "wide"),
    *("binned", "held_turn", "imm_ekf", "mixture", "nodes", "noise", "polar_update", "waiting"),
}
"""Files that handle times, and coordinates of zones or of a moving origin, which are double in both precisions: a few
operations a measurement, a command or a plan."""


@pytest.mark.parametrize(
    ("name", "change"),
    [
        pytest.param("case2", "seed=0", marks=pytest.mark.long),
        pytest.param("sea2d", "tracker.kind=motion_gp", marks=pytest.mark.slow),
        pytest.param("sea2d", "seed=0", marks=pytest.mark.long),
    ],
)
def test_the_arithmetic_of_a_float_pilot_calls_no_library_for_doubles(tmp_path, name, change):
    """On a floating-point unit for single precision: solver, factorisations, likelihood, rows and fits."""
    parts = build_pilot(gbt.load_config(name, [change, "tracker.engine=compiled"]))
    free, calling = set(), set()
    for file, text in files_of(parts).items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    for source in sorted(tmp_path.glob("gbt_*.c")):
        made = source.with_suffix(".o")
        command = [COMPILER, *FLAGS, *MACHINE, *UNITS["single"], f"-I{tmp_path}", "-c", str(source), "-o", str(made)]
        subprocess.run(command, check=True)
        needs = subprocess.run(["arm-none-eabi-nm", "-u", str(made)], capture_output=True, text=True, check=True).stdout
        (calling if re.search(r"__aeabi_(d|f2d|i2d|ui2d|cd)", needs) else free).add(source.stem.removeprefix("gbt_"))
    assert calling <= OF_TIMES, calling - OF_TIMES
    assert free >= {"solver", "interior", "riccati", "pieces", "slacks", "check", "linalg"}
    of_tracker = (
        {"shape_fit", "shape_hypotheses"} if "motion_gp" in change else {"held_bank", "held_ahead", "imm", "mixed"}
    )
    assert free >= ({"gp_likelihood"} if name == "case2" else of_tracker)
