"""The pilot on a Cortex-M7: a recorded closed loop in an emulator, against Python, in both precisions."""

import functools
import re
import subprocess

import numpy as np
import pytest
from arm_board import ARM, COMPILER, FLAGS, MACHINE, NEEDED, UNITS, program_of, said_by
from pilots_in_c import files_of

import gbt_ocp as gbt
from gbt_ocp.experiments.build.pilot import build_pilot
from gbt_ocp.experiments.recorded_pilot import RecordedPilot

pytestmark = NEEDED

CASES = [
    pytest.param("case2", "seed=0", 30, marks=pytest.mark.long),
    pytest.param("case5", "seed=0", 60, marks=pytest.mark.slow),
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


def steps_on_the_board(place, name, change, commands, precision):
    """The recording, an array by name of what was printed a step, and sizes by name."""
    recording, files = recorded(name, change, commands)
    for file, text in files.items():
        (place / file).write_text(text, encoding="utf-8")
    sources = [*sorted(place.glob("gbt_*.c")), ARM / "pilot_bench.c"]
    said = said_by(program_of(place, sources, [place], precision))
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
