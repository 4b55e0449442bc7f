import sys

import numpy as np
import pytest
import synthetic_run

from gbt_ocp.experiments.result import Result


def result(dimension=2, **kind):
    history = synthetic_run.history(dimension, steps=60, **kind)
    return Result(synthetic_run.configuration(dimension), history, synthetic_run.summary(history))


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_dataframe_has_a_row_a_step_and_the_numbers_of_the_history(dimension):
    pytest.importorskip("pandas", reason="pandas is not installed")
    run = result(dimension)
    frame, history = run.to_dataframe(), run.history
    assert frame.index.name == "t"
    np.testing.assert_array_equal(frame.index, history.t)
    last = "xyz"[dimension - 1]
    np.testing.assert_array_equal(frame[f"target_{last}"], history.target[:, -1])
    np.testing.assert_array_equal(frame["vehicle_yaw"], history.vehicle_pose[:, -1])
    np.testing.assert_array_equal(frame["thrust_surge"], history.thrust[:, 0])
    np.testing.assert_array_equal(frame[f"estimate_{last}"], history.forecast_mean[:, 0, -1])
    np.testing.assert_allclose(frame[f"estimate_std_{last}"], 1.0)  # the made-up covariance is the identity
    # the columns tell the error: that is what they are for
    error = np.sqrt(sum((frame[f"estimate_{a}"] - frame[f"target_{a}"]) ** 2 for a in "xyz"[:dimension]))
    np.testing.assert_allclose(frame["error"], history.error[:, 0])
    assert error.shape == (61,)
    assert frame["solver_status"].value_counts()["solved"] == 58
    assert frame["detected"].dtype == bool
    assert not any("_axis" in column for column in frame.columns)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_dataset_has_every_array_with_names_and_units(dimension):
    xarray = pytest.importorskip("xarray", reason="xarray is not installed")
    run = result(dimension)
    data, history = run.to_xarray(), run.history
    assert isinstance(data, xarray.Dataset)
    np.testing.assert_array_equal(data.forecast_mean.sel(axis="y", ahead=3), history.forecast_mean[:, 3, 1])
    np.testing.assert_array_equal(data.forecast_cov.sel(axis="x", axis_="y"), history.forecast_cov[:, :, 0, 1])
    np.testing.assert_array_equal(data.plan.sel(piece=1, pose="yaw"), history.plan[:, 0, -1])
    np.testing.assert_array_equal(data.thrust.sel(input="sway"), history.thrust[:, 1])
    assert data.target.units == "m"
    assert set(data.data_vars) == set(vars(history)) - {"t"}
    assert data.attrs["error_settled"] == run.summary["error_settled"]
    assert "problem: made_up" in data.attrs["configuration"]
    assert float(data.error.mean("ahead").sel(t=slice(2.0, None)).mean()) == pytest.approx(data.error_settled)


@pytest.mark.parametrize(("method", "library"), [("to_dataframe", "pandas"), ("to_xarray", "xarray")])
def test_a_missing_library_is_named_in_one_line(monkeypatch, method, library):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ImportError, match=rf"^{method}\(\) needs {library}; install it with: pip install {library}$"):
        getattr(result(), method)()


def test_a_notebook_shows_the_numbers_of_the_repr():
    run = result()
    shown = run._repr_html_()
    assert "settled" in shown
    assert f"{run.summary['error_settled']:.3g} m" in shown
    for word in ("error", "distance", "solver"):
        assert f">{word}</th>" in shown
        assert word in repr(run)
