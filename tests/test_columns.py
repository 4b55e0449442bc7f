"""A recorded array is declared in one place, also from outside the package; what is recorded grows with the run."""

from dataclasses import replace
from inspect import getdoc
from pathlib import Path

import numpy as np
import pytest
import synthetic_run

from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.result import Result
from gbt_ocp.simulation.columns import column, columns, recorded
from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.loop import simulate
from gbt_ocp.typing import Array

ROOT = Path(__file__).resolve().parents[1]


@recorded
class Watched(History):
    """A history with two arrays of a user's own."""

    line_of_sight: Array = column(
        "t axis", lambda step: step.target[0] - step.vehicle.pose(step.state)[:2], "m", meaning="From vehicle to target"
    )
    mood: np.ndarray = column(
        "t", lambda step: "calm" if step.plan is None else "planning", kind=str, meaning="A word", optional=True
    )


def looped(**overrides):
    settings = {"duration_s": 1.0, "planner.solver": "ipopt", "planner.formulation": "hard", **overrides}
    return build_loop(load_config("case2", [f"{key}={value}" for key, value in settings.items()]))


@pytest.fixture(scope="module")
def watched():
    return simulate(*looped(), 1.0, history=Watched).history


def test_an_array_declared_outside_the_package_is_recorded_saved_and_read_back(tmp_path, watched):
    assert isinstance(watched, Watched)
    np.testing.assert_array_equal(watched.line_of_sight, watched.target - watched.vehicle_pose[:, :2])
    assert set(watched.mood) == {"planning"}
    watched.save_npz(tmp_path / "history.npz")
    back = Watched.load_npz(tmp_path / "history.npz")
    np.testing.assert_array_equal(back.line_of_sight, watched.line_of_sight)
    np.testing.assert_array_equal(back.mood, watched.mood)
    # the arrays of every run are what they are without it
    plain = History.load_npz(tmp_path / "history.npz")
    for one in columns(History):
        np.testing.assert_array_equal(getattr(plain, one.name), getattr(watched, one.name))


def test_it_is_in_the_tables_the_dataset_and_the_reference(watched):
    pytest.importorskip("pandas", reason="pandas is not installed")
    pytest.importorskip("xarray", reason="xarray is not installed")
    run = Result(synthetic_run.configuration(2), watched, {})
    frame, data = run.to_dataframe(), run.to_xarray()
    np.testing.assert_array_equal(frame["line_of_sight_y"], watched.line_of_sight[:, 1])
    assert list(frame["mood"]) == list(watched.mood)
    assert data.line_of_sight.dims == ("t", "axis")
    assert data.line_of_sight.units == "m"
    assert "line_of_sight\n    From vehicle to target, ``(K, d)``, m" in getdoc(Watched)
    assert "line_of_sight" not in getdoc(History)


def test_a_file_that_is_older_than_an_optional_array_is_read_and_one_without_another_is_not(tmp_path, watched):
    path = tmp_path / "history.npz"
    kept = {one.name: getattr(watched, one.name) for one in columns(watched) if one.name != "mood"}
    np.savez(path, **kept)
    assert list(Watched.load_npz(path).mood) == [""] * len(watched.t)
    del kept["line_of_sight"]
    np.savez(path, **kept)
    with pytest.raises(ValueError, match=r"history\.npz: not a history: missing arrays: line_of_sight"):
        Watched.load_npz(path)


def test_its_shape_is_checked_like_that_of_all_others(watched):
    with pytest.raises(ValueError, match=r"line_of_sight has shape \(11, 3\), but target has shape \(11, 2\)"):
        replace(watched, line_of_sight=np.zeros((11, 3)))


@pytest.mark.parametrize(
    ("read", "says"),
    [
        (lambda step: np.zeros(2 if step.time < 0.35 else 3), r"row of shape \(3,\) at step 4; allowed: \(2,\)"),
        (lambda step: 0.0, r"row of shape \(\) at step 0; allowed: 1 axes"),
    ],
)
def test_a_row_that_does_not_fit_is_named_with_its_step(read, says):
    @recorded
    class Odd(History):
        odd: Array = column("t axis", read, meaning="Odd")

    with pytest.raises(ValueError, match=f"history: odd: found a {says}"):
        simulate(*looped(**{"guidance.kind": "static"}), 1.0, history=Odd)


def test_longer_words_and_more_pieces_than_before_keep_what_was_recorded():
    words = ["", "solved", "", "Infeasible_Problem_Detected", "x"]

    @recorded
    class Growing(History):
        word: np.ndarray = column("t", lambda step: words[round(10 * step.time) % 5], kind=str, meaning="A word")
        plan: Array = column(
            "t piece pose", lambda step: np.full((round(10 * step.time) % 5, 3), step.time), meaning=""
        )

    history = simulate(*looped(**{"guidance.kind": "random"}), 1.0, history=Growing).history
    assert list(history.word) == [*words, *words, ""]
    assert history.plan.shape == (11, 4, 3)
    for k in range(11):
        np.testing.assert_array_equal(history.plan[k, : k % 5], 0.1 * k)
        assert np.isnan(history.plan[k, k % 5 :]).all()


def test_the_reference_lists_every_array():
    page = (ROOT / "docs" / "api" / "simulation.md").read_text(encoding="utf-8")
    for one in columns(History):
        assert f"| `{one.name}` | `{one.shape}` | {one.units} |" in page
