import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import synthetic_run
import yaml
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.image import imread

from gbt_ocp.experiments.result import Result
from gbt_ocp.reporting.figures import draw_figures, write_figures

SIX = {"trajectories", "error", "condition_number", "hyperparameters", "thrust", "solver_time"}


def draw(history):
    configuration = yaml.safe_load(synthetic_run.configuration(history.dimension).to_yaml())
    return draw_figures(history, configuration, synthetic_run.summary(history))


def line(axes, label):
    (found,) = [line for line in axes.get_lines() if line.get_label() == label]
    return found


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.long
def test_a_run_folder_gets_its_six_figures_with_nothing_overlapping(tmp_path, dimension, capfd):
    history = synthetic_run.history(dimension)
    result = Result(synthetic_run.configuration(dimension), history, synthetic_run.summary(history))
    folder = result.save(tmp_path / "run")
    assert {path.stem for path in (folder / "figures").glob("*.png")} == SIX
    for path in (folder / "figures").iterdir():
        image = imread(path)
        assert image.shape[1] == 1260  # 6.3 in at 200 dpi
        assert image.min() < 0.2 < image.max()
    assert capfd.readouterr().err == ""  # matplotlib logs what it could not do


@pytest.mark.parametrize(("dimension", "drift"), [(2, 0.0), (2, 4.0), (3, 0.0), (3, 1.0), (3, -1.0)])
@pytest.mark.long
def test_labels_carry_units_and_stay_inside_and_apart(dimension, drift):
    history = synthetic_run.history(dimension)
    along = drift * history.t[:, None] * np.eye(dimension)[-1]  # along y in the plane, up or down in space
    pose = history.vehicle_pose.copy()
    pose[:, :dimension] += along
    figures = draw(dataclasses.replace(history, target=history.target + along, vehicle_pose=pose))
    for name, figure in figures.items():
        renderer = FigureCanvasAgg(figure).get_renderer()
        figure.draw(renderer)
        boxes = [legend.get_window_extent(renderer) for legend in figure.legends]
        for axes in figure.axes:
            if axes.get_xlabel():
                assert "[" in axes.get_xlabel()
            assert "[" in axes.get_ylabel() or name == "condition_number"
            texts = [axes.xaxis.label, axes.yaxis.label, axes.title]
            texts += [axes.zaxis.label] if hasattr(axes, "zaxis") else []
            boxes += [text.get_window_extent(renderer) for text in texts if text.get_text()]
        for index, box in enumerate(boxes):
            assert 0.0 <= box.x0 < box.x1 <= figure.bbox.width, name
            assert 0.0 <= box.y0 < box.y1 <= figure.bbox.height, name
            assert not any(box.overlaps(other) for other in boxes[:index]), name


def test_figures_show_the_numbers_of_the_history():
    history = synthetic_run.history()
    figures = draw(history)
    (axes,) = figures["error"].axes
    np.testing.assert_allclose(line(axes, "mean error over the forecast").get_ydata(), history.error.mean(axis=1))
    np.testing.assert_allclose(line(axes, "its bound").get_ydata()[3:], history.bound.mean(axis=1)[3:])
    assert axes.get_yscale() == "log"
    assert list(line(axes, "settling time, 2 s").get_xdata()) == [2.0, 2.0]

    (axes,) = figures["condition_number"].axes
    np.testing.assert_allclose(
        line(axes, "cumulative bearing matrix").get_ydata()[3:], np.log10(history.condition_number[3:])
    )
    assert line(axes, "singular: position not observable").get_xdata().tolist() == history.t[:3].tolist()

    surge, sway, yaw = figures["thrust"].axes
    np.testing.assert_allclose(line(yaw, "at the start of the piece").get_ydata(), history.thrust[:, 2] / 1500.0)
    assert line(surge, "above the limit").get_xdata().tolist() == [history.t[40]]
    assert "above the limit" not in [line.get_label() for line in sway.get_lines()]
    assert [line.get_ydata()[0] for line in sway.get_lines() if line.get_label() == "limit"] == [-1.0, 1.0]

    (axes,) = figures["solver_time"].axes
    assert line(axes, "fallback: shifted").get_xdata().tolist() == history.t[30:32].tolist()
    assert line(axes, "not solved").get_xdata().tolist() == [history.t[120]]
    assert line(axes, "sampling period").get_ydata()[0] == pytest.approx(100.0)
    median = np.median(1e3 * history.solver_time)
    assert line(axes, f"solver median, {median:.3g} ms").get_ydata()[0] == pytest.approx(median)


def test_without_a_solver_only_the_tracker_time_is_shown():
    figures = draw(synthetic_run.history(planner=False, tuned=False, steps=30))
    assert set(figures) == {"trajectories", "error", "condition_number", "thrust", "tracker_time"}
    assert [line.get_label() for line in figures["tracker_time"].axes[0].get_lines()] == ["tracker", "sampling period"]


@pytest.mark.long
def test_extreme_values_are_drawn_without_a_warning(tmp_path):
    # Zero errors, a bound that is never finite, a vehicle that stands still, one far estimate, a run of two samples.
    history = synthetic_run.history(steps=1)
    extreme = dataclasses.replace(
        history,
        error=np.zeros_like(history.error),
        bound=np.full_like(history.bound, np.inf),
        condition_number=np.full_like(history.condition_number, np.inf),
        vehicle_pose=np.zeros_like(history.vehicle_pose),
        target=np.full_like(history.target, 1e-9),
        forecast_mean=np.full_like(history.forecast_mean, 1e12),
        piece_thrust_peak=np.full_like(history.piece_thrust_peak, np.nan),
        tracker_time=np.zeros_like(history.tracker_time),
    )
    for name, figure in draw(extreme).items():
        figure.savefig(tmp_path / f"{name}.png")
    assert {path.stem for path in tmp_path.iterdir()} == SIX


def test_a_far_first_estimate_does_not_stretch_the_view():
    history = synthetic_run.history()
    far = history.forecast_mean.copy()
    far[0] = 1e6
    (axes,) = draw(dataclasses.replace(history, forecast_mean=far))["trajectories"].axes
    assert axes.get_aspect() == 1.0
    assert np.ptp(axes.get_xlim()) < 30.0


def test_a_missing_value_is_named(tmp_path):
    history = synthetic_run.history(steps=3)
    with pytest.raises(ValueError, match=r"config\.yaml: vehicle\.thrust_max: found nothing"):
        draw_figures(history, {"sensor": {"period_s": 0.1}}, {})
    with pytest.raises(ValueError, match=r"vehicle\.thrust_max: found \[1, 2\]; allowed: 3 numbers"):
        draw_figures(history, {"sensor": {"period_s": 0.1}, "vehicle": {"thrust_max": [1, 2]}}, {})
    (tmp_path / "config.yaml").write_text("- a list")
    with pytest.raises(ValueError, match=r"config\.yaml: found list; allowed: a mapping"):
        write_figures(tmp_path)


@pytest.mark.long
def test_pyplot_is_never_loaded():
    here = Path(__file__).parent
    code = (
        "import sys; sys.path[:0] = sys.argv[1:]\n"
        "import synthetic_run as run\n"
        "from gbt_ocp.experiments.result import Result\n"
        "history = run.history(steps=5)\n"
        "assert 'matplotlib' not in sys.modules\n"  # a sweep without figures does not pay for it
        "Result(run.configuration(2), history, run.summary(history)).plot()\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code, str(here), str(here.parent)], check=True)
