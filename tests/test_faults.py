"""Faults in the closed loop: each has a stated outcome (docs/reliability.md), and none ends a run."""

import warnings
from collections import Counter

import numpy as np
import pytest
from faults import SENSOR_FAULTS, SOLVER_FAULTS, TRACKER_FAULTS, faulty_run

from gbt_ocp.ocp.codegen.library import find_compiler

SOLVER = "compiled" if find_compiler() else "ipopt"
HARD = ("planner.formulation=hard", f"planner.solver={SOLVER}")

WORDS = {
    "nan": "not finite",
    "limit": "iteration limit",
    "raises": "raised RuntimeError",
    "nothing": "no answer",
    "shapeless": "answer of a wrong shape",
    "wild": "limits broken between nodes",
}
"""What the history calls each failure of a solver."""


def run(*arguments, **faults):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of the solver that raises
        return faulty_run(*arguments, overrides=HARD, **faults)


def is_sound(recording):
    """Whether the vehicle stayed finite and within its thrust limits at every step."""
    arrays = recording.arrays
    finite = all(np.all(np.isfinite(arrays[name])) for name in ("vehicle_pose", "vehicle_velocity", "thrust"))
    return finite and float(arrays["piece_thrust_peak"].max()) <= 1.0


@pytest.mark.parametrize("kind", SOLVER_FAULTS)
@pytest.mark.long
def test_a_solver_that_fails_for_twenty_steps_is_answered_and_named(kind):
    recording = run(solver=(kind, set(range(8, 28))), seconds=4.0)
    assert is_sound(recording)
    arrays = recording.arrays
    failed = arrays["solver_status"] != "solved"
    assert np.flatnonzero(failed).tolist() == list(range(8, 28))
    assert set(arrays["solver_status"][failed]) == {WORDS[kind]}
    assert np.all(arrays["fallback"][failed] != "")
    assert np.all(arrays["fallback"][~failed] == "")
    # an iterate or the rest of the last plan first, and the target is not lost by it
    assert arrays["fallback"][8] == ("unfinished" if kind == "limit" else "shifted")
    assert arrays["error"][-1].mean() < 0.1


def test_a_solver_that_never_answers_leaves_a_vehicle_that_brakes():
    recording = run("case5", solver=("raises", set(range(31))), seconds=1.0)
    assert is_sound(recording)
    assert set(recording.arrays["fallback"]) <= {"braking", "shifted", "unfinished"}
    speed = np.linalg.norm(recording.arrays["vehicle_velocity"][:, :3], axis=1)
    assert speed.max() < 1e-9  # it starts at rest and has no reason to move


def test_a_solver_that_raises_is_said_in_a_warning():
    with pytest.warns(RuntimeWarning, match=r"solver 'faulty' raised RuntimeError\('the solver is broken'\)"):
        faulty_run(solver=("raises", {3}), seconds=0.5, overrides=HARD)


@pytest.mark.parametrize("kind", SENSOR_FAULTS)
def test_bearings_that_are_none_are_refused_and_counted(kind):
    recording = run(sensor=(kind, set(range(5, 15))))
    assert is_sound(recording)
    refused = kind in ("nan", "infinite", "zero", "long")
    assert recording.refused_bearings == (10 if refused else 0)
    detected = recording.arrays["detected"][5:15]
    assert detected.any() != (refused or kind == "missing")
    if kind != "repeated":
        # whoever sees nothing for a second, or the mirrored bearing, finds the target again
        assert recording.arrays["error"][-1].mean() < 0.1


def test_a_gap_of_five_seconds_is_survived():
    recording = run(sensor=("missing", set(range(20, 70))), seconds=10.0)
    assert is_sound(recording)
    assert np.count_nonzero(recording.arrays["detected"]) == 51
    assert recording.arrays["error"][-1].mean() < 0.1


@pytest.mark.parametrize("kind", TRACKER_FAULTS)
def test_a_tracker_that_loses_its_numbers_or_its_clock_does_not_stop_the_vehicle(kind):
    recording = run(tracker=(kind, set(range(5, 15))))
    assert is_sound(recording)
    assert recording.held_forecasts == (10 if kind in ("not_finite", "infinite") else 0)
    assert recording.refused_bearings == (10 if kind in ("reversed", "twice") else 0)
    assert recording.arrays["error"][-1].mean() < 0.1


def test_a_forecast_that_is_never_finite_is_replaced_by_the_place_of_the_vehicle():
    recording = run(tracker=("not_finite", set(range(31))), seconds=1.0)
    assert is_sound(recording)
    assert recording.held_forecasts == 11
    assert np.all(np.isnan(recording.arrays["forecast_mean"]))  # what the tracker said is what is recorded


def test_a_target_that_passes_through_the_vehicle_is_survived():
    assert is_sound(run(through=set(range(10, 14))))


@pytest.mark.parametrize(("case", "share"), [("case2", 0.6), ("case5", 0.3)])
def test_thrust_limits_that_shrink_in_mid_run_are_kept_from_then_on(case, share):
    recording = run(case, shrinks=15, share=share)
    assert is_sound(recording)  # peaks are relative to the limits of their step
    thrust = np.abs(recording.arrays["thrust"][15:])
    assert thrust.max() <= share * 5000.0 * (1.0 + 1e-9)


def any_faults(rng):
    """Faults drawn at random: each kind with probability one half, in a stretch of 1 to 25 steps."""

    def stretch():
        begin = int(rng.integers(0, 30))
        return set(range(begin, begin + int(rng.choice([1, 2, 5, 10, 25]))))

    faults = {}
    for name, kinds in (("solver", SOLVER_FAULTS), ("sensor", SENSOR_FAULTS), ("tracker", TRACKER_FAULTS)):
        if rng.random() < 0.5:
            faults[name] = (str(rng.choice(kinds)), stretch())
    if rng.random() < 0.3:
        faults["through"] = stretch()
    if rng.random() < 0.3:
        faults |= {"shrinks": int(rng.integers(1, 28)), "share": float(rng.choice([0.25, 0.5, 0.9]))}
    return faults


def combinations(seeds):
    """Runs with random faults that are not sound, and how often each answer was given."""
    unsound, answers = [], Counter()
    for seed in seeds:
        rng = np.random.default_rng([2026, seed])
        case = str(rng.choice(["case1", "case2", "case3", "case4", "case5", "case6"]))
        formulation = str(rng.choice(["hard", "penalty"]))
        faults = any_faults(rng)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            recording = faulty_run(case, overrides=(f"planner.formulation={formulation}", HARD[1]), seed=seed, **faults)
        answers.update(str(word) for word in recording.arrays["fallback"])
        if not is_sound(recording):
            unsound.append((seed, case, formulation, faults, float(recording.arrays["piece_thrust_peak"].max())))
    return unsound, answers


@pytest.mark.long
def test_random_combinations_of_faults():
    assert combinations(range(6))[0] == []


@pytest.mark.slow
def test_five_hundred_random_combinations_of_faults():
    unsound, answers = combinations(range(500))
    print(dict(answers))
    assert unsound == []
