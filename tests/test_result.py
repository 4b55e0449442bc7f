import dataclasses
import json
import zipfile

import numpy as np
import pytest
import synthetic_run

from gbt_ocp.experiments.result import Result
from gbt_ocp.simulation.history import WALL_CLOCK, History
from gbt_ocp.simulation.summary import FALLBACKS, summarise

# The contract of the run folder, written out a second time on purpose. Arrays that came later may follow it.
# fmt: off
CONTRACT = [
    "t", "vehicle_pose", "vehicle_velocity", "thrust", "target",
    "bearing", "detected", "forecast_mean", "forecast_cov", "error",
    "length_scale", "amplitude", "condition_number", "bound", "objective",
    "violation", "solver_status", "solver_iterations", "solver_time", "plan",
    "tracker_time", "nugget", "fallback", "desired_bearing", "piece_thrust_peak",
    "prior_cov", "off_plan",
]
# fmt: on


def five_steps(**changes) -> History:
    """Five samples, one second apart, whose summary can be worked out on paper."""
    distance = np.array([5.0, 3.0, 2.0, 1.0, 4.0])
    cosine = np.array([-1.0, -1.0, 1.0, 0.5, -0.2])
    pose = np.column_stack([10.0 - distance, np.zeros(5), np.zeros(5)])
    arrays = {
        "t": np.arange(5.0),
        "vehicle_pose": pose,
        "vehicle_velocity": np.zeros((5, 3)),
        "thrust": np.zeros((5, 3)),
        "target": np.tile([10.0, 0.0], (5, 1)),
        "bearing": np.tile([1.0, 0.0], (5, 1)),
        "detected": np.ones(5, dtype=bool),
        "forecast_mean": np.zeros((5, 2, 2)),
        "forecast_cov": np.zeros((5, 2, 2, 2)),
        "error": [[4.0, 2.0], [1.0, 1.0], [0.5, 0.5], [0.1, 0.3], [0.2, 0.2]],
        "length_scale": np.ones(5),
        "amplitude": np.ones(5),
        "nugget": np.ones(5),
        "prior_cov": np.ones((5, 2, 2)),
        "condition_number": [np.inf, 3.0, 2.0, 1.0, 1.0],
        "bound": np.ones((5, 2)),
        "objective": [1.0, 2.0, 3.0, np.nan, 6.0],
        "violation": np.zeros(5),
        "solver_status": ["solved", "Infeasible_Problem_Detected", "solved", "", "solved"],
        "solver_iterations": [10, 30, 10, 0, 10],
        "solver_time": [0.010, 0.990, 0.030, np.nan, 0.020],
        "tracker_time": [0.001, 0.020, 0.003, 0.004, 0.005],
        "fallback": ["", "shifted", "", "", ""],
        "desired_bearing": np.column_stack([cosine, np.sqrt(1.0 - cosine**2)]),
        "piece_thrust_peak": [[0.5, 0.2, 0.1], [0.9, 1.03, 0.1], [1.0, 0.2, 0.1], [0.5, 0.2, 0.1], [np.nan] * 3],
        "off_plan": [np.nan, 0.3, 0.1, 0.2, np.nan],
        "plan": np.zeros((5, 4, 3)),
    }
    return History.of({**arrays, **changes})


def summary_of(history: History, **changes) -> dict:
    given = {
        "period": 1.0,
        "seed": 11,
        "wall_s": 2.5,
        "solver_first_try": np.array([True, False, True, False, True]),
        "retries": {"nugget": 3},
        "versions": {"python": "3"},
    }
    return summarise(history, **{**given, **changes})


def test_summary_is_what_comes_out_on_paper():
    expected = {
        "error_mean": (3.0 + 1.0 + 0.5 + 0.2 + 0.2) / 5,
        "error_settled": (0.5 + 0.2 + 0.2) / 3,
        "error_final": 0.2,
        "error_rms": ((9.0 + 1.0 + 0.25 + 0.04 + 0.04) / 5) ** 0.5,
        "error_median": 0.5,
        "error_settled_max": 0.5,
        "settling_s": 2.0,
        "distance_min": 1.0,
        "distance_median": 3.0,
        "distance_max_after_10s": None,
        "similarity_second_half": -0.2,
        "similarity_mean_second_half": (1.0 + 0.5 - 0.2) / 3,
        # the covariance is zero
        "range_std_over_range_final": 0.0,
        "range_observable_from_s": 0.0,
        "violation_max": 0.03,
        "off_plan_median": 0.2,
        "off_plan_max": 0.3,
        "objective_mean": (1.0 + 2.0 + 3.0 + 6.0) / 4,
        "solver_success_rate": 0.75,
        "solver_iterations_mean": 15.0,
        "solver_time_median_ms": 25.0,
        "solver_time_max_ms": 990.0,
        "tracker_time_median_ms": 4.0,
        "step_time_median_ms": 25.0,  # of 11, 1010, 33, 4, 25
        "steps_over_period": 1,
        "steps": 4,
        "wall_s": 2.5,
        "seed": 11,
    }
    summary = summary_of(five_steps())
    nested = {key: summary.pop(key) for key in ("fallbacks", "retries", "versions")}
    assert {key: summary[key] for key in expected} == pytest.approx(expected)
    assert nested == {
        "fallbacks": {"shifted": 1, "cold": 0, "unfinished": 0, "braking": 0},
        "retries": {"nugget": 3},
        "versions": {"python": "3"},
    }


def test_settling_time_and_ten_seconds_include_their_own_sample_despite_rounding():
    rounded = five_steps(t=np.array([0.0, 1.0, 2.0 - 1e-12, 10.0 - 1e-12, 11.0]))
    summary = summary_of(rounded)
    assert summary["error_settled"] == pytest.approx(0.3)
    assert summary["distance_max_after_10s"] == 4.0
    assert summary_of(five_steps(), settling=9.0)["error_settled"] is None


def test_without_a_solver_its_numbers_are_null():
    nothing = {"solver_status": [""] * 5, "solver_time": [np.nan] * 5, "solver_iterations": [0] * 5}
    summary = summary_of(five_steps(**nothing, fallback=[""] * 5, plan=np.zeros((5, 0, 3))))
    for key in ("solver_success_rate", "solver_iterations_mean", "solver_time_median_ms", "solver_time_max_ms"):
        assert summary[key] is None
    assert summary["objective_mean"] is None
    assert summary["step_time_median_ms"] == pytest.approx(4.0)
    assert dict.fromkeys(FALLBACKS, 0) == summary["fallbacks"]


def test_thrust_of_an_executed_piece_that_is_unknown_is_not_reported_as_within_its_limits():
    peak = five_steps().piece_thrust_peak.copy()
    peak[2, 1] = np.nan
    assert summary_of(five_steps(piece_thrust_peak=peak))["violation_max"] is None
    peak[2, 1] = 0.0
    peak[1, 1] = 0.9
    assert summary_of(five_steps(piece_thrust_peak=peak))["violation_max"] == 0.0
    peak[-1] = 1.5  # a piece was executed from the last sample after all
    assert summary_of(five_steps(piece_thrust_peak=peak))["violation_max"] == pytest.approx(0.5)


def test_a_tracker_that_broke_is_not_averaged_away():
    error = five_steps().error.copy()
    error[3, 1] = np.nan
    summary = summary_of(five_steps(error=error))
    assert summary["error_mean"] is None
    assert summary["error_settled"] is None


def test_first_try_of_another_length_is_refused():
    with pytest.raises(ValueError, match=r"solver_first_try has shape \(3,\); allowed: \(5,\)"):
        summary_of(five_steps(), solver_first_try=np.ones(3, dtype=bool))


def test_history_has_the_arrays_of_the_contract(tmp_path):
    five_steps().save_npz(tmp_path / "history.npz")
    with np.load(tmp_path / "history.npz", allow_pickle=False) as archive:
        assert archive.files[: len(CONTRACT)] == CONTRACT
        assert archive["solver_status"].tolist()[1] == "Infeasible_Problem_Detected"
        assert archive["plan"].shape == (5, 4, 3)
    assert set(WALL_CLOCK) <= set(CONTRACT)


def test_history_comes_back_as_it_was(tmp_path):
    history = synthetic_run.history(3, steps=40)
    history.save_npz(tmp_path / "history.npz")
    back = History.load_npz(tmp_path / "history.npz")
    for field in dataclasses.fields(History):
        before, after = getattr(history, field.name), getattr(back, field.name)
        np.testing.assert_array_equal(after, before)
        assert after.dtype == before.dtype


def test_equal_histories_are_equal_bytes_however_they_were_made(tmp_path):
    history = five_steps()
    otherwise = five_steps(
        forecast_cov=np.asfortranarray(history.forecast_cov),
        solver_status=np.array(history.solver_status.tolist(), dtype="U90"),
        solver_iterations=history.solver_iterations.astype(np.int32),
        thrust=np.zeros((5, 6))[:, ::2],
    )
    history.save_npz(tmp_path / "a.npz")
    otherwise.save_npz(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    with zipfile.ZipFile(tmp_path / "a.npz") as archive:  # no trace of when or on what it was written
        assert {(entry.date_time, entry.create_system) for entry in archive.infolist()} == {((1980, 1, 1, 0, 0, 0), 3)}
    five_steps(thrust=np.full((5, 3), 1e-300)).save_npz(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() != (tmp_path / "b.npz").read_bytes()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"target": np.zeros((4, 2))}, r"target has shape \(4, 2\), but t has shape \(5,\)"),
        ({"target": np.zeros((5, 3))}, r"has shape .*, but target has shape \(5, 3\)"),
        ({"bound": np.zeros((5, 3))}, r"bound has shape \(5, 3\), but forecast_mean has shape \(5, 2, 2\)"),
        ({"error": np.zeros(5)}, r"error has shape \(5,\); allowed: 2 axes"),
        ({"plan": np.zeros((5, 4, 2))}, r"plan has shape \(5, 4, 2\), but vehicle_pose has shape \(5, 3\)"),
    ],
)
def test_arrays_that_disagree_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        five_steps(**change)


def test_a_damaged_history_says_what_is_wrong(tmp_path):
    path = tmp_path / "history.npz"
    np.savez(path, t=np.zeros(3))
    with pytest.raises(ValueError, match=r"history\.npz: not a history: missing arrays: vehicle_pose, "):
        History.load_npz(path)
    five_steps().save_npz(path)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(ValueError, match=r"history\.npz: not a history"):
        History.load_npz(path)
    path.write_text("nothing of the kind")
    with pytest.raises(ValueError, match=r"history\.npz: not a history"):
        History.load_npz(path)


def test_result_comes_back_from_its_folder(tmp_path):
    history = synthetic_run.history(steps=30)
    result = Result(synthetic_run.configuration(2), history, synthetic_run.summary(history))
    folder = result.save(tmp_path / "deep" / "run", figures=False)
    assert sorted(entry.name for entry in folder.iterdir()) == ["config.yaml", "history.npz", "summary.json"]

    def refuse(word):
        raise AssertionError(f"{word} is not JSON")

    written = json.loads((folder / "summary.json").read_text(encoding="utf-8"), parse_constant=refuse)
    assert written == result.summary
    assert written["distance_max_after_10s"] is None  # the run lasts 3 s

    back = Result.load(folder)
    assert back.summary == result.summary
    assert back.configuration.to_yaml() == result.configuration.to_yaml()
    assert back.configuration.sensor.period_s == 0.1
    assert back.configuration.vehicle.thrust_max == [5000.0, 5000.0, 1500.0]
    np.testing.assert_array_equal(back.history.error, history.error)
    (again,) = {
        path.read_bytes() for path in (folder / "config.yaml", back.save(tmp_path / "b", False) / "config.yaml")
    }
    assert again


def test_repr_says_the_essentials_in_four_lines():
    history = five_steps()
    text = repr(Result(synthetic_run.configuration(2), history, summary_of(history)))
    assert len(text.splitlines()) == 4
    for part in ("2D", "seed 11", "settled 0.3 m", "min 1 m", "0.03", "first try 0.75", "1 fallbacks"):
        assert part in text
    short = repr(Result(synthetic_run.configuration(2), history, summary_of(history, settling=9.0)))
    assert "settled none" in short
