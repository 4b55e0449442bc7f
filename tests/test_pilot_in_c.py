"""The pilot in C: the same answers as in Python, the trackers by themselves, what is refused, inputs that are wrong."""

import math
import shutil
import subprocess

import numpy as np
import pytest
from pilots_in_c import closed_loop, files_of
from test_breaks import circled, square, travelled

import gbt_ocp as gbt
from gbt_ocp.cli.main import main
from gbt_ocp.experiments.build.pilot import build_pilot
from gbt_ocp.models import Mounting, case_target
from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.models.measurements import Measurement
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.ocp.export.verification import verify_folder
from gbt_ocp.pilot.compiled_ekf import CompiledExtendedKalmanFilter
from gbt_ocp.pilot.compiled_gp import CompiledGaussianProcessTracker
from gbt_ocp.tracking.filters.ekf import ExtendedKalmanFilter, FirstGuess
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker
from gbt_ocp.tracking.gp.kernels import KERNELS
from gbt_ocp.tracking.gp.likelihood import LogLikelihood
from gbt_ocp.tracking.intake import take_in
from gbt_ocp.tracking.priors import LogNormal, PositionPrior, RangedPrior

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

NOISE = math.radians(0.5)


def angles(rng, time, target, pose, std=None, frame=None, sensor="sensor", mounting=None):
    """A noisy bearing in the plane or in space."""
    line = target - pose[:-1]
    turned = pose[-1] if frame == "bow" else 0.0
    found = [math.atan2(line[1], line[0]) - turned + NOISE * rng.normal()]
    if len(line) == 3:
        found.append(math.atan2(line[2], math.hypot(line[0], line[1])) + NOISE * rng.normal())
    kind = "azimuth" if len(line) == 2 else "azimuth_elevation"
    value = found[0] if len(line) == 2 else found
    return Measurement(time, kind, value, std, sensor, frame, mounting)


def only_bearings(rng, time, target, pose):
    return [angles(rng, time, target, pose)] if rng.random() > 0.05 else []


def all_sensors(rng, time, target, pose):
    """Now and then a bearing of either of two sensors, a range, a position; some twice, some from long ago."""
    distance = float(np.linalg.norm(target - pose[:-1]))
    bow = Mounting((0.3, 0.1) + (0.0,) * (len(target) - 2), 0.1)
    offered = [
        (0.5, angles(rng, time, target, pose)),
        (0.3, angles(rng, time, target, pose, 0.01, "bow", "bow", bow)),
        (0.1, Measurement(time, "range", distance, 0.1 * distance, "sonar")),
        (0.05, Measurement(time, "position", target + rng.normal(size=len(target)), 1.0, "radio")),
        (0.05, Measurement(time, "size", 0.1, 0.01, "eye")),
        (0.03, Measurement(time - 5.0, "azimuth", 1.0, 0.1, "clock")),
        (0.03, Measurement(time + 9.0, "azimuth", 1.0, 0.1, "clock")),
    ]
    some = [one for share, one in offered if rng.random() < share]
    return [*some, *some[:1]] if rng.random() < 0.1 else some


# ---- the pilot ------------------------------------------------------------------------------------------------------


def test_commands_of_an_untidy_loop_are_those_of_python():
    """Commands at any rate, a third of the measurements late, kinds that are refused, clocks that are wrong."""
    config = gbt.load_config("case2", ["tracker.kind=ekf", "tracker.engine=compiled", "sensor.noise_deg=0.5"])
    pilot = closed_loop(config, 4.0, all_sensors, interval=(0.01, 0.12), late=1.0)
    assert pilot.commands > 50
    assert pilot.followed == pilot.commands
    assert pilot.worst < 1e-8
    assert pilot.worst_setpoint < 1e-8
    assert pilot.answers >= {"taken", "late", "duplicate", "too old", "ahead"}


SMALL_TORPEDO = ("tracker.kind=ekf", "tracker.engine=compiled", "planner.pieces=8", "vehicle.start.range_m=45")


@pytest.mark.long
def test_commands_of_a_torpedo_are_those_of_python():
    """Helm, plans by integration, and the regulator between them, at any rate of commands."""
    config = gbt.load_config("torpedo2d", [*SMALL_TORPEDO, "guidance.startup_deviation=0.35"])
    pilot = closed_loop(config, 25.0, all_sensors, interval=(0.05, 0.2), late=1.0)
    kinds = {type(decided.decision).__name__ for decided in pilot.decided}
    assert kinds == {"ndarray", "ShootingPlan"}, "it crosses, and it plans"
    assert pilot.commands > 150
    # Newton's method within bounds stops where the gradient is small: the last bits of a start decide how small
    assert pilot.worst < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("name", ["torpedo2d", "torpedo3d"])
def test_a_pilot_of_a_torpedo_with_the_default_tracker_compiles_without_a_warning(tmp_path, name):
    """Sizes of its plans and of the tracker have names of their own, in each precision."""
    files = files_of(build_pilot(gbt.load_config(name, ["tracker.engine=compiled"])))
    for file, text in files.items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    units = sorted(str(path) for path in tmp_path.glob("gbt_*.c"))
    for flags in ([], ["-DGBT_SINGLE"]):
        command = ["gcc", "-fsyntax-only", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", *flags, *units]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[:2000]


KNOWN_BY_INTEGRATION = ("torpedo2d", "torpedo3d", "vessel")

SWEEPS = (("sea2d", 2.7), ("sea2d", "sensor"), ("sea3d", 2.7), ("sea3d", "sensor"))
"""Desired bearings for a speed of the vehicle, and by the clock."""

LOOPS = [
    ("case2", 30.0, ("tracker.kind=ekf", "sensor.noise_deg=0.5")),
    ("case5", 30.0, ("tracker.kind=ekf", "sensor.noise_deg=0.5")),
    ("sea2d", 300.0, ("tracker.kind=ekf",)),
    ("sea3d", 300.0, ("tracker.kind=ekf",)),
    ("sea2d", 300.0, ()),
    ("sea3d", 300.0, ()),
    *((name, 60.0, ("tracker.kind=ekf", f"desired_bearing.speed_mps={speed}")) for name, speed in SWEEPS),
    ("torpedo2d", 120.0, ("tracker.kind=ekf",)),
    ("torpedo3d", 60.0, ("tracker.kind=ekf",)),
    # solved closely: where the shipped tolerance stops Newton's method, the last bits of a start decide
    ("torpedo2d", 120.0, ("planner.solver_options.compiled.tolerance=1e-6",)),
    ("vessel", 120.0, ("tracker.kind=ekf",)),
]

EXACT = [(f"case{number}", 30.0, (f"preset={preset}",)) for number in range(1, 7) for preset in ("paper", "default")]
"""Loops of the process, whose bearings are exact: with the paper's nugget, and with one that is tuned."""


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("name", "seconds", "changes"), [*LOOPS, *EXACT])
def test_commands_of_closed_loops_are_those_of_python(name, seconds, changes, seed, monkeypatch):
    if changes and changes[0].startswith("preset="):
        monkeypatch.setitem(globals(), "NOISE", 0.0)
    changes = [*changes, "tracker.engine=compiled", f"seed={seed}"]
    pilot = closed_loop(gbt.load_config(name, changes), seconds, only_bearings)
    assert pilot.commands > 9.0 * seconds
    # plans by integration have no setpoints
    assert pilot.followed > 0.5 * pilot.commands or name in KNOWN_BY_INTEGRATION
    assert pilot.worst < 1e-8
    assert pilot.worst_setpoint < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "seconds", "changes"), [loop for loop in LOOPS if loop[0] not in KNOWN_BY_INTEGRATION]
)
def test_commands_of_untidy_loops_are_those_of_python(name, seconds, changes):
    changes = [*changes, "tracker.engine=compiled"]
    pilot = closed_loop(gbt.load_config(name, changes), 0.2 * seconds, all_sensors, interval=(0.01, 0.12), late=1.0)
    assert pilot.followed > 0.2 * pilot.commands
    assert pilot.worst < 1e-8


# ---- the filter -----------------------------------------------------------------------------------------------------


def filters(d, size, prior):
    """The filter in numpy, and the one in C."""
    known = {} if prior is None else {"mean": prior, "covariance": 4.0 * np.eye(d)}
    guess = FirstGuess(RangedPrior(np.zeros(d), **known, range=30.0), 20.0, 2.0)
    made = {"process_noise": 0.05, "bearing_std": 0.02, "size": LogNormal(5.0, 0.5) if size else None}
    return ExtendedKalmanFilter(guess, **made), CompiledExtendedKalmanFilter(guess, **made)


def sightings(d, rng, count=120):
    """Of all kinds, some at one time, some out of order, with gaps, from a vehicle that moves."""
    time = 0.0
    for number in range(count):
        time += rng.choice([0.0, 0.1, 0.5, 0.7])
        if number in (60, 61):
            time += 4e3
        own = np.array([3.0 * math.sin(0.2 * time), 3.0 * math.cos(0.2 * time), -1.0])[:d]
        target = own + np.array([25.0, 10.0, 6.0])[:d] + rng.normal(size=d)
        pose = np.append(own, 0.3 * time)
        line = target - own
        far, std = float(np.linalg.norm(line)), [None, 0.03][rng.integers(2)]
        elevation = math.asin(line[2] / far) if d == 3 else 0.0
        choices = [
            angles(rng, time, target, pose, std),
            angles(rng, time, target, pose, 0.05, "bow", "bow"),
            Measurement(time, "azimuth", math.atan2(line[1], line[0]), std, "azimuth"),
            Measurement(time, "elevation", elevation, std, "elevation"),
            Measurement(time, "range", far, 1.0, "range"),
            Measurement(time, "range", far, None, "range"),
            Measurement(time, "size", 2.0 * math.atan(2.5 / far), 0.01, "size"),
            Measurement(time, "position", target, 2.0, "position"),
            Measurement(time - 0.3, "azimuth_elevation", [0.3, 0.1], 0.1, "late"),
        ]
        yield choices[rng.integers(len(choices))].placed(pose, 0.01)


@pytest.mark.parametrize("prior", [False, True])
@pytest.mark.parametrize("size", [False, True])
@pytest.mark.parametrize("d", [2, 3])
def test_the_filter_in_c_takes_refuses_and_predicts_as_the_one_in_numpy(d, size, prior):
    rng = np.random.default_rng([d, size, prior])
    both = filters(d, size, np.array([20.0, 5.0, 1.0])[:d] if prior else None)
    refused = 0
    for sighting in sightings(d, rng):
        taken = []
        for tracker in both:
            try:
                take_in(tracker, sighting)
            except ValueError:
                taken.append(False)
            else:
                taken.append(True)
        assert taken[0] == taken[1], sighting
        refused += not taken[0]
        ahead = sighting.time + np.array([0.0, 0.5, 5.0])
        forecasts = [tracker.predict(ahead) for tracker in both]
        for python, c in zip(*forecasts, strict=True):
            assert c == pytest.approx(python, rel=1e-8, abs=1e-8, nan_ok=True)
        assert both[0].new_tracks == both[1].new_tracks
        if size:
            assert both[1].size.median == pytest.approx(both[0].size.median, rel=1e-9)
    assert 5 < refused < 100
    assert both[0].new_tracks > 0


PROCESSES = [
    (2, False, {"nugget": 1e-8, "amplitude": 1.0, "centre": "origin"}),
    (3, False, {"nugget": 1e-8, "amplitude": 1.0, "centre": "origin"}),
    (2, True, {"nugget": 1e-6}),
    (3, True, {"nugget": 1e-6, "kernel": "matern52"}),
    (2, False, {"nugget": 1e-5, "kernel": "rq", "window": 8}),
    (2, False, {"nugget": 1e-4, "kernel": "matern32", "length_scale": 2.0}),
    (2, False, {"breaks": True}),
    (3, True, {"breaks": True}),
    (2, True, {"breaks": True, "kernel": "matern52", "window": 8}),
]
"""Dimension, whether there is a prior, and settings; the first two are the paper's."""


def likelihood_of(tracker, window_of):
    """The log likelihood of the hyperparameters of one tracker, on the window of another."""
    theta, seen = tracker.hyperparameters, window_of.window.measurements()
    kernel = KERNELS[window_of.settings[0]]
    likelihood = LogLikelihood(kernel, seen, window_of.window.own_positions[-1], None)
    return likelihood(np.array([*theta.log_kernel, theta.log_amplitude, np.log(theta.nugget)]))[0]


@pytest.mark.parametrize(("d", "known", "settings"), PROCESSES)
def test_the_process_in_c_is_tuned_and_predicts_as_the_one_in_numpy(d, known, settings):
    target = case_target(2 if d == 2 else 5)
    there = {"mean": target.position(0.0) + 0.1, "covariance": 0.09 * np.eye(d) + 0.01} if known else {}
    prior = PositionPrior(np.zeros(d), **there)
    both = [made(d, prior=prior, **settings) for made in (GaussianProcessTracker, CompiledGaussianProcessTracker)]
    worst = 0.0
    for number in range(56):
        time = 0.1 * number + (9e3 if number > 40 else 0.0)  # a long gap, after which the track begins again
        own = np.array([2.0 * math.sin(1.3 * time), 2.0 * math.cos(1.3 * time), 0.3 * math.sin(time)])[:d]
        line = target.position(time) - own
        ahead = time + 0.1 * np.arange(12)
        for tracker in both:
            tracker.update(time, line / np.linalg.norm(line), own)
        python, c = (tracker.predict(ahead) for tracker in both)
        scale = both[0].hyperparameters.amplitude
        worst = max(worst, float(np.abs(python.mean - c.mean).max()) / scale)
        worst = max(worst, float(np.abs(python.covariance - c.covariance).max()) / scale**2)
        if "breaks" in settings:
            # with a nugget of 1e-14 many θ are equally likely to rounding, which is then large
            python, c = (likelihood_of(tracker, both[0]) for tracker in both)
            assert c > python - 1.0
        else:
            assert both[1].hyperparameters.length_scale == pytest.approx(both[0].hyperparameters.length_scale, rel=1e-6)
    assert both[0].new_tracks == both[1].new_tracks == 1
    assert 0.0 < worst < (0.1 if "breaks" in settings else 1e-6)


@pytest.mark.parametrize("d", [2, 3])
def test_the_process_in_c_cuts_its_window_and_leaves_strays_out_where_the_one_in_numpy_does(d):
    times = 0.1 * np.arange(110)
    target = travelled(square, times)
    own = circled(target, times)
    if d == 3:
        target = np.column_stack([target, 0.3 * np.sin(times)])
        own = np.column_stack([own, 1.0 + 0.2 * np.cos(3.0 * times)])
    bearings = unit_bearing(target, own)
    bearings[25] = rotate_bearing(bearings[25], np.full(d - 1, 0.3))
    both = [made(d, breaks=True) for made in (GaussianProcessTracker, CompiledGaussianProcessTracker)]
    off, sizes = [], []
    for k, time in enumerate(times):
        for tracker in both:
            tracker.update(float(time), bearings[k], own[k])
        python, c = (tracker.predict(time + 0.1 * np.arange(12)) for tracker in both)
        off.append(np.abs(python.mean - c.mean).max() / both[0].hyperparameters.amplitude)
        sizes.append([len(tracker.window) for tracker in both])
    sizes = np.array(sizes)
    np.testing.assert_array_equal(sizes[:, 0], sizes[:, 1])
    assert np.sum(np.diff(sizes[:, 1]) < 0) == 2, "one cut at each corner, and none at the stray"
    # the nugget is tuned to 1e-11 or so: rounding is a hundred thousand times larger than elsewhere
    assert np.median(off) < 1e-4
    assert max(off) < 5e-3


@pytest.mark.parametrize("case", [2, 5])
def test_the_process_in_c_is_off_the_one_in_numpy_by_what_rounding_does(case):
    """With exact bearings rounding is amplified a million times: own positions off in their last bit show how much."""
    target, rng = case_target(case), np.random.default_rng(0)
    d = 2 if case == 2 else 3
    prior = PositionPrior(np.zeros(d), mean=target.position(0.0) + 0.1, covariance=0.01 * np.eye(d))
    numpy, bit, c = (
        made(d, prior=prior, breaks=True)
        for made in (GaussianProcessTracker, GaussianProcessTracker, CompiledGaussianProcessTracker)
    )
    by_rounding, by_c = [], []
    for time in 0.1 * np.arange(40):
        own = np.array([2.0 * math.sin(1.3 * time), 2.0 * math.cos(1.3 * time), 0.3 * math.sin(time)])[:d]
        line = target.position(time) - own
        for tracker, place in ((numpy, own), (bit, own * (1.0 + 2.2e-16 * rng.uniform(-1.0, 1.0, d))), (c, own)):
            tracker.update(time, line / np.linalg.norm(line), place)
        found = [tracker.predict(time + 0.1 * np.arange(12)).mean for tracker in (numpy, bit, c)]
        by_rounding.append(np.abs(found[1] - found[0]).max())
        by_c.append(np.abs(found[2] - found[0]).max())
        assert len(c.window) == len(numpy.window)
    assert 0.0 < np.median(by_c) < 10.0 * np.median(by_rounding)
    assert max(by_c) < 10.0 * max(by_rounding)


def test_the_filter_in_c_remembers_what_it_is_saved_with(tmp_path):
    config = gbt.load_config("case2", ["tracker.kind=ekf", "tracker.engine=compiled", "guidance.kind=random"])
    pilot = gbt.Pilot(config)
    rng = np.random.default_rng(0)

    def step(one, time, value):
        one.navigate(time, [0.1 * time, 0.0, 0.0], [0.1, 0.0, 0.0])
        one.measure(Measurement(time, "azimuth", value))
        return one.command(time).forecast.mean

    values = rng.normal(size=20)
    for time in range(10):
        step(pilot, 0.1 * time, values[time])
    other = gbt.Pilot.load(pilot.save(tmp_path / "pilot"))
    for time in range(10, 20):
        assert np.array_equal(step(pilot, 0.1 * time, values[time]), step(other, 0.1 * time, values[time]))


# ---- the folder -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "change", "says"),
    [
        (
            "sea2d",
            "tracker={kind: imm_ekf}",
            "--pilot: tracker.kind: found imm_ekf; allowed: mixture, held_turn, motion_gp, ekf, or gp for exact",
        ),
        (
            "sea2d",
            "tracker.members=[held_turn, ekf]",
            "--pilot: tracker.members: found held_turn, ekf; allowed in C: held_turn and imm_ekf, both of them",
        ),
        (
            "case2",
            "sensor.noise_deg=1.0",
            "--pilot: tracker.kind: found gp for noisy bearings; allowed: mixture, held_turn, motion_gp, ekf, or",
        ),
        ("case2", "guidance.kind=static", "--pilot: guidance.kind: found static; allowed: planner"),
        (
            "case2",
            "planner={objective: fisher_logdet, solver: ipopt}",
            "--pilot: planner: found an objective or a limit with data",
        ),
    ],
)
def test_what_there_is_no_c_for_is_refused_in_one_line(tmp_path, capsys, name, change, says):
    kind = [] if change.startswith(("tracker", "sensor")) else ["--set", "tracker.kind=ekf"]
    assert main(["codegen", name, "--out", str(tmp_path / "c"), "--pilot", *kind, "--set", change]) == 2
    said = capsys.readouterr().err
    assert says in said
    assert len(said.strip().splitlines()) == 1
    assert not (tmp_path / "c").exists()


WRONG_INPUTS = """
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bow_gbt_pilot.h"

static bow_gbt_pilot pilots[2];
static bow_gbt_command commands[2];
static unsigned state = 1;

static double drawn(void)
{
    state = state * 1664525u + 1013904223u;
    return (double)(state >> 8) / 16777216.0;
}

/* a number, or one of those that are none or too many */
static double odd(double usual)
{
    static const double strange[] = {NAN, INFINITY, -INFINITY, 0, 1e300, -1e300, 1e18, 1e-300};
    return drawn() < 0.03 ? strange[(int)(8 * drawn())] : usual;
}

static void step(double time)
{
    double pose[BOW_GBT_POSE], velocity[BOW_GBT_POSE], covariance[BOW_GBT_POSE * BOW_GBT_POSE] = {0};
    const double when = odd(drawn() < 0.05 ? time - 4 * drawn() : drawn() < 0.02 ? time + 1000 * drawn() : time);
    bow_gbt_sensor_pose sensor = {0};
    const int kind = (int)(7 * drawn()) - (drawn() < 0.1);
    double value[3], sigma[3];
    for (int j = 0; j < BOW_GBT_POSE; j++) {
        pose[j] = odd(2 * sin(0.3 * time + j));
        velocity[j] = odd(0.3 * cos(0.3 * time + j));
    }
    covariance[BOW_GBT_POSE * BOW_GBT_POSE - 1] = odd(1e-4);
    for (int j = 0; j < 3; j++) {
        value[j] = odd(3 * drawn());
        sigma[j] = odd(0.01 + drawn());
    }
    sensor.sensor = (int)(12 * drawn()) - 1;
    sensor.frame = (bow_gbt_frame)(int)(3.1 * drawn());
    sensor.mounted = drawn() < 0.5;
    sensor.yaw = odd(0.1);
    for (int p = 0; p < 2; p++) {
        bow_gbt_pilot_navigate(&pilots[p], when, pose, velocity, drawn() < 0 ? 0 : covariance);
        bow_gbt_pilot_measure(&pilots[p], (bow_gbt_kind)kind, value, kind & 1 ? sigma : 0, &sensor, when);
        bow_gbt_pilot_measure(&pilots[p], BOW_GBT_AZIMUTH, value, 0, 0, time);
    }
}

int main(void)
{
    int faults = 0, given = 0;
    for (int p = 0; p < 2; p++) bow_gbt_pilot_init(&pilots[p]);
    bow_gbt_pilot_command(&pilots[0], 0, &commands[0]);
    if (commands[0].status != BOW_GBT_COMMAND_BLIND) faults++;
    for (int k = 0; k < 800; k++) {
        const double time = 0.02 * k, asked = drawn() < 0.02 ? odd(time - 1) : time;
        for (int burst = drawn() < 0.01 ? 100 : 1; burst > 0; burst--)
            step(time - 0.001 * (burst - 1));
        for (int p = 0; p < 2; p++) {
            bow_gbt_pilot_command(&pilots[p], asked, &commands[p]);
            for (int i = 0; i < BOW_GBT_INPUTS; i++)
                if (!isfinite(commands[p].thrust[i])) faults++;
        }
        given += commands[0].status == BOW_GBT_COMMANDED;
        /* two pilots of one program that are given the same answer the same */
        if (memcmp(commands[0].thrust, commands[1].thrust, sizeof commands[0].thrust) != 0) faults++;
    }
    printf("%d faults, %d commands", faults, given);
    for (int k = 0; k < BOW_GBT_ANSWERS; k++) printf(", %u", commands[0].received[k]);
    printf("\\n");
    return faults > 0;
}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The pilot of case 2 with a prefix."""
    place = tmp_path_factory.mktemp("written") / "c"
    given = ["--set", "tracker.kind=ekf", "sensor.noise_deg=0.5", "duration_s=2.0", "--prefix", "bow_"]
    with pytest.MonkeyPatch.context() as patch:
        # sizes are measured in test_codegen.py; here they would only take time
        patch.setattr("gbt_ocp.ocp.export.folder.find_compiler", lambda: None)
        assert main(["codegen", "case2", "--out", str(place), "--pilot", *given]) == 0
    return place


def test_the_folder_has_the_pilot_for_both_ways_to_build_it(folder):
    lists = (folder / "CMakeLists.txt").read_text(encoding="utf-8")
    assert "foreach(program example pilot_example)" in lists
    sources, rest = lists.split("STATIC", 1)[1].split(")", 1)
    headers = rest.split("install(FILES", 1)[1].split("DESTINATION", 1)[0].split()
    assert {f"src/{path.name}" for path in (folder / "src").glob("*.c")} == set(sources.split())
    assert {"src/bow_gbt_pilot.h", "src/bow_gbt_plan.h", "src/bow_gbt_ekf.h"} <= set(headers)
    assert {f"src/{path.name}" for path in (folder / "src").glob("*.h")} >= set(headers)


@pytest.mark.long
def test_the_folder_replays_a_closed_loop_and_says_where_it_differs(folder):
    found = verify_folder(folder)
    assert found.faults == ()
    numbers = found.replayed.replace(",", "").split()
    assert int(numbers[0]) == 21
    assert int(numbers[2]) > 15
    vectors = folder / "pilot_vectors.h"
    text = vectors.read_text(encoding="utf-8")
    row = next(line for line in text.splitlines() if "{COMMANDED, 0, 0, 0, 0, 0, 1, 0.0" in line)
    vectors.write_text(text.replace(row, row.replace(", {", ", {1e3 + "), 1), encoding="utf-8")
    faults = verify_folder(folder, flags="-O0").faults
    vectors.write_text(text, encoding="utf-8")
    assert len(faults) == 1
    assert "pilot_example: exit code 1: command at" in faults[0]


@pytest.mark.slow
def test_wrong_inputs_leave_no_trace_of_undefined_behaviour_and_the_thrust_finite(folder, tmp_path):
    """Late, double, out of order, not finite, too large, of no sensor, in bursts: under the sanitizers."""
    if shutil.which("gcc") is None:
        pytest.skip("no gcc")
    (tmp_path / "wrong.c").write_text(WRONG_INPUTS, encoding="utf-8")
    units = sorted(str(path) for path in (folder / "src").glob("*.c"))
    checks = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    flags = ["-std=c99", "-O0", "-Wall", "-Wextra", "-Wpedantic", "-Werror", *checks, f"-I{folder / 'src'}"]
    program = tmp_path / "program"
    command = ["gcc", *flags, str(tmp_path / "wrong.c"), *units, "-lm", "-o", str(program)]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    done = subprocess.run([str(program)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    numbers = done.stdout.replace(",", "").split()
    assert int(numbers[2]) > 500
    # every answer was given, and those other than GBT_TAKEN are counted
    assert [place for place, count in enumerate(numbers[4:]) if int(count) == 0] == [0], done.stdout
