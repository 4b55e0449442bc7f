"""Random sequences of calls of the pilot in C, under the sanitizers: no fault, named answers, bounded iterations."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from pilots_in_c import files_of

import gbt_ocp as gbt
from gbt_ocp.experiments.build.pilot import build_pilot

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")

PROGRAM = Path(__file__).parent / "fuzz" / "pilot_fuzz.c"
CHECKED = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]

SMALL = "{bin_s: 1.0, window_s: 12.0, turn_rate_std: [0.03], turn_time_s: [10.0], speed_change_std: [0.1]}"
"""A grid of one point and a short window: many sequences count for more here than good tracks."""

PILOTS = {
    "ekf": ("case2", ["tracker.kind=ekf", "sensor.noise_deg=0.5"], 30_000),
    "gp": ("case5", ["tracker.window=6"], 30_000),
    "motion_gp in the plane": ("sea2d", ["tracker.kind=motion_gp", f"tracker={SMALL}"], 25_000),
    "mixture in the plane": ("sea2d", [], 10_000),
    "motion_gp in space": ("sea3d", ["tracker.kind=motion_gp", f"tracker={SMALL}"], 5_000),
}
"""Configuration of each, and the sequences that it is given."""


def program_of(place, name, flags):
    """The program for a pilot, built in a folder."""
    problem, changes, _ = PILOTS[name]
    config = gbt.load_config(problem, ["tracker.engine=compiled", *changes])
    for file, text in files_of(build_pilot(config)).items():
        (place / file).write_text(text, encoding="utf-8")
    units = sorted(str(path) for path in place.glob("gbt_*.c"))
    command = [
        "gcc",
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-Wpedantic",
        "-Werror",
        *flags,
        f"-I{place}",
        str(PROGRAM),
        *units,
    ]
    built = subprocess.run([*command, "-lm", "-o", str(place / "fuzz")], capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return place / "fuzz"


def sound(program, sequences, seed=0):
    """Runs so many sequences; how often each status, answer and note was given."""
    done = subprocess.run([program, str(sequences), str(seed)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, (done.stdout + done.stderr)[-4000:]
    assert done.stdout.startswith(f"0 faults, {sequences} sequences"), done.stdout
    found = re.search(r"statuses ([\d ]+); answers ([\d ]+); notes ([\d ]+)", done.stdout)
    return [[int(number) for number in group.split()] for group in found.groups()]


NO_PLAN = 3
"""The status for numbers so large that no plan is finite; a navigation of such numbers is refused before."""


def given(statuses):
    """Whether every status was given that can be."""
    return min(count for place, count in enumerate(statuses) if place != NO_PLAN) > 0


@pytest.mark.long
def test_a_few_sequences_are_answered(tmp_path):
    statuses, answers, notes = sound(program_of(tmp_path, "motion_gp in the plane", ["-O0"]), 150)
    assert given(statuses)
    assert min(answers[:8]) > 0
    assert sum(count > 0 for count in notes) >= 5


@pytest.mark.slow
@pytest.mark.parametrize("name", PILOTS)
def test_a_hundred_thousand_sequences_are_answered(tmp_path, name):
    """Over the five pilots together."""
    statuses, answers, notes = sound(program_of(tmp_path, name, ["-O1", *CHECKED]), PILOTS[name][2], 1)
    assert given(statuses)
    # what the tracker refuses is counted at the next command
    assert [place for place, count in enumerate(answers) if count == 0] == [8]
    assert sum(count > 0 for count in notes) >= 6
